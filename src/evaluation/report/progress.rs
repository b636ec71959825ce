//! Progress of a report: its sections, the time that each may take, the share that is done, and the time that is left.

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::{Effort, ReportError};

/// Section of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Section {
    /// Statistical error against run time, of a model.
    Convergence,
    /// Numerical error against cost, of a model.
    Accuracy,
    /// Cost against difficulty, of a model.
    Difficulty,
    /// Fidelity to the method, of a model.
    Fidelity,
    /// Randomness of the generator and of draws.
    Randomness,
    /// Stiff and extreme cases.
    Stress,
}

/// Sections of each model, in order.
pub(super) const OF_MODEL: [Section; 4] =
    [Section::Convergence, Section::Accuracy, Section::Difficulty, Section::Fidelity];

/// Sections of all models together.
pub(super) const OF_ALL: [Section; 2] = [Section::Randomness, Section::Stress];

/// Additional time for the peers of a model: they take turns with the engines, and Numba compiles first.
const PEERS: [f64; 3] = [8.0, 15.0, 300.0];

impl Section {
    /// Number on the page, from 1.
    pub fn number(self) -> usize {
        self as usize + 1
    }

    /// Title on the page.
    pub fn title(self) -> &'static str {
        match self {
            Section::Convergence => "Statistical error against run time",
            Section::Accuracy => "Numerical error against cost",
            Section::Difficulty => "Cost against difficulty",
            Section::Fidelity => "Fidelity to the method",
            Section::Randomness => "Randomness",
            Section::Stress => "Stiff and extreme cases",
        }
    }

    /// Time that it may take, seconds. A section that has its answer ends before; one that cannot be divided, such as
    /// the extreme cases on the CPU, may take longer.
    fn budget(self, effort: Effort, with_peers: bool) -> f64 {
        let peers = PEERS.map(|seconds| if with_peers { seconds } else { 0.0 });
        match self {
            Section::Convergence => effort.pick(8.0 + peers[0], 35.0 + peers[1], 900.0 + peers[2]),
            Section::Accuracy => effort.pick(3.0, 7.0, 60.0),
            Section::Difficulty => effort.pick(5.0, 14.0, 120.0),
            Section::Fidelity => effort.pick(1.0, 4.0, 30.0),
            Section::Randomness => effort.pick(5.0, 20.0, 120.0),
            Section::Stress => effort.pick(5.0, 25.0, 120.0),
        }
    }
}

/// Section with the time that it may take and the time that it took.
#[derive(Clone, Debug, Serialize)]
pub struct SectionTime {
    /// The section.
    pub section: Section,
    /// Name of the model; `None` for sections of all models together.
    pub model: Option<String>,
    /// Time that it may take, seconds.
    pub budget: f64,
    /// Time that it took, seconds; `None` where it was not measured.
    pub seconds: Option<f64>,
}

impl SectionTime {
    /// Names the section, with its model.
    pub fn name(&self) -> String {
        let title = format!("{}. {}", self.section.number(), self.section.title());
        self.model.as_ref().map_or(title.clone(), |model| format!("{model}: {title}"))
    }
}

/// State of the work, for whoever waits.
#[derive(Clone, Debug)]
pub struct Progress {
    /// Name of the section that is being measured, with its model.
    pub section: String,
    /// Description of the step of it.
    pub step: String,
    /// Share of the whole that is done, between 0 and 1.
    pub done: f64,
    /// Estimated time that is left.
    pub left: Duration,
}

/// Callback that hears from time to time what is being done; `false` from it ends the work. What was measured by then
/// is kept.
pub type Watch<'a> = &'a (dyn Fn(&Progress) -> bool + Sync);

/// Sections in order, with the time that they take.
pub(super) struct Agenda<'a> {
    watch: Watch<'a>,
    sections: RefCell<Vec<SectionTime>>,
    /// The section at work, as an index.
    current: Cell<usize>,
    start: Instant,
    /// Beginning of the section at work.
    began: Cell<Instant>,
    /// Share of the section at work that is done, where the section says.
    share: Cell<Option<f64>>,
    step: RefCell<String>,
}

impl<'a> Agenda<'a> {
    pub(super) fn new(models: &[String], effort: Effort, with_peers: bool, watch: Watch<'a>) -> Agenda<'a> {
        let time = |section: Section, model: Option<&String>| SectionTime {
            section,
            model: model.cloned(),
            budget: section.budget(effort, with_peers),
            seconds: None,
        };
        let of_models = models.iter().flat_map(|model| OF_MODEL.map(|section| time(section, Some(model))));
        let now = Instant::now();
        Agenda {
            watch,
            sections: of_models.chain(OF_ALL.map(|section| time(section, None))).collect::<Vec<_>>().into(),
            current: 0.into(),
            start: now,
            began: now.into(),
            share: None.into(),
            step: String::new().into(),
        }
    }

    /// Measures the next section. `None` where somebody asked for an end.
    pub(super) fn section<T>(
        &self,
        measure: impl FnOnce() -> Result<T, ReportError>,
    ) -> Result<Option<T>, ReportError> {
        self.began.set(Instant::now());
        self.share.set(None);
        let result = match self.say("") {
            Ok(()) => measure(),
            Err(stopped) => Err(stopped),
        };
        match result {
            Ok(measured) => {
                let seconds = self.began.get().elapsed().as_secs_f64();
                self.sections.borrow_mut()[self.current.get()].seconds = Some(seconds);
                self.current.set(self.current.get() + 1);
                Ok(Some(measured))
            }
            Err(ReportError::Stopped) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Names the step that begins. An error where somebody asked for an end.
    pub(super) fn say(&self, step: &str) -> Result<(), ReportError> {
        self.step.replace(step.to_owned());
        self.beat()
    }

    /// Says that the work goes on. An error where somebody asked for an end.
    pub(super) fn beat(&self) -> Result<(), ReportError> {
        if (self.watch)(&self.progress()) { Ok(()) } else { Err(ReportError::Stopped) }
    }

    /// Notes the share of the section at work that is done. A section that notes none fills its time.
    pub(super) fn note(&self, done: usize, all: usize) {
        self.share.set(Some(done as f64 / all.max(1) as f64));
    }

    /// Seconds of the time of the section at work that are left; negative once it is over.
    pub(super) fn left(&self) -> f64 {
        self.sections.borrow()[self.current.get()].budget - self.began.get().elapsed().as_secs_f64()
    }

    fn progress(&self) -> Progress {
        let (sections, current) = (self.sections.borrow(), self.current.get());
        let Some(section) = sections.get(current) else {
            let (section, step) = (String::new(), String::new());
            return Progress { section, step, done: 1.0, left: Duration::ZERO };
        };
        let share = self.share.get().unwrap_or(self.began.get().elapsed().as_secs_f64() / section.budget);
        let budgets: Vec<f64> = sections.iter().map(|section| section.budget).collect();
        let work = budgets[..current].iter().sum::<f64>() + share.clamp(0.0, 0.99) * section.budget;
        let (done, left) = forecast(work, budgets.iter().sum(), self.start.elapsed().as_secs_f64());
        let left = Duration::from_secs_f64(left);
        Progress { section: section.name(), step: self.step.borrow().clone(), done, left }
    }

    /// The sections, and the time that each took.
    pub(super) fn into_sections(self) -> Vec<SectionTime> {
        self.sections.into_inner()
    }
}

/// Share of all work that is done, and the seconds that the rest will take: at the pace so far, which at the beginning
/// is taken to be that of the budgets.
fn forecast(work: f64, all: f64, elapsed: f64) -> (f64, f64) {
    let trust = 0.1 * all;
    let pace = (elapsed + trust) / (work + trust);
    (work / all, (all - work) * pace)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn the_forecast_follows_the_pace() {
        assert_eq!(forecast(0.0, 100.0, 0.0), (0.0, 100.0));
        assert_eq!(forecast(50.0, 100.0, 50.0), (0.5, 50.0));
        let (done, left) = forecast(50.0, 100.0, 150.0);
        assert!(done == 0.5 && (120.0..150.0).contains(&left), "{left}");
        let (_, left) = forecast(50.0, 100.0, 10.0);
        assert!((10.0..25.0).contains(&left), "{left}");
        assert_eq!(forecast(100.0, 100.0, 80.0), (1.0, 0.0));
    }

    #[test]
    fn sections_are_weighed_by_their_time() {
        let heard = Mutex::new(Vec::new());
        let watch = |progress: &Progress| {
            heard.lock().unwrap().push((progress.section.clone(), progress.done));
            progress.step != "stop"
        };
        let agenda = Agenda::new(&["a".to_owned()], Effort::Quick, false, &watch);
        assert_eq!(agenda.section(|| Ok(1)).unwrap(), Some(1));
        let half = agenda.section(|| {
            agenda.note(1, 2);
            agenda.say("half")?;
            agenda.say("stop")
        });
        assert_eq!(half.unwrap(), None);
        let all = 27.0;
        let (name, done) = heard.lock().unwrap().last().cloned().unwrap();
        assert_eq!(name, "a: 2. Numerical error against cost");
        assert!((done - (8.0 + 1.5) / all).abs() < 1e-9, "{done}");
        let sections = agenda.into_sections();
        let measured: Vec<bool> = sections.iter().map(|section| section.seconds.is_some()).collect();
        assert_eq!(measured, [true, false, false, false, false, false]);
        assert_eq!(sections.iter().map(|section| section.budget).sum::<f64>(), all);
    }
}
