//! Schedules of several recipes that are drawn together, step by step, and the cutting of steps into windows.

use std::time::{Duration, Instant};

use super::reference::Recheck;
use super::{Batch, Device, Engine, EngineError, cpu, gpu};
use crate::quantity::ArrayFormat;
use crate::random::stream::Draws;
use crate::recipe::Recipe;
use crate::wgsl::Indexing;

/// Largest size of a quantity in one window, in bytes: all windows in flight stay in a cache of 32 MiB.
const WINDOW_BYTES: u64 = 8 << 20;

/// Duration that a window should take: short enough for an interrupt and for any watchdog, long enough to hide the
/// cost of starting one.
const WINDOW_TIME: Duration = Duration::from_millis(60);

impl Engine {
    /// Prepares to draw ranges from several recipes at once. Jobs of one recipe share its shader.
    pub(crate) fn schedule(&self, jobs: &[Job]) -> Result<Schedule<'_>, EngineError> {
        self.schedule_of(jobs, Indexing::Range)
    }

    /// Prepares to make draws whose indices are given in this way. On the CPU that makes no difference.
    pub(super) fn schedule_of(&self, jobs: &[Job], indexing: Indexing) -> Result<Schedule<'_>, EngineError> {
        Ok(Schedule(match &self.device {
            Device::Gpu(gpu) => {
                let recheck = (gpu.recheck > 0.0).then(|| (gpu, recheck(jobs, gpu.recheck)));
                Backend::Gpu(gpu::GpuSchedule::new(gpu, jobs, indexing)?, recheck)
            }
            Device::Cpu(threads) => Backend::Cpu(cpu::CpuSchedule::new(threads, jobs)),
        }))
    }
}

/// Makes the check that makes windows of jobs again.
fn recheck(jobs: &[Job], share: f64) -> Recheck {
    Recheck::new(jobs.iter().map(|job| job.recipe), share)
}

/// A recipe among several that are drawn together, step by step.
#[derive(Clone, Copy)]
pub(crate) struct Job<'a> {
    pub(crate) recipe: &'a Recipe,
    /// Number of draws per step, at least 1.
    pub(crate) per_step: u64,
}

/// An engine with the jobs of a schedule.
pub(crate) struct Schedule<'a>(pub(super) Backend<'a>);

pub(super) enum Backend<'a> {
    /// With what makes some windows again, where that was asked for.
    Gpu(gpu::GpuSchedule<'a>, Option<(&'a gpu::Gpu, Recheck)>),
    Cpu(cpu::CpuSchedule<'a>),
}

impl Schedule<'_> {
    /// Draws the first `steps` steps of each job, and hands them to `sink` window by window, a batch per job. A
    /// window is one submission for all jobs. Draws that failed raise no error.
    pub(crate) fn draw<E: From<EngineError>>(
        &mut self,
        draws: &[Draws],
        steps: u64,
        mut sink: impl FnMut(&[Batch]) -> Result<(), E>,
    ) -> Result<(), E> {
        match &mut self.0 {
            _ if steps == 0 => Ok(()),
            Backend::Gpu(session, None) => session.draw(draws, steps, &mut sink),
            Backend::Gpu(session, Some((gpu, recheck))) => {
                session.draw(draws, steps, &mut |batches: &[Batch]| {
                    let adapter = gpu.adapter().to_string();
                    gpu.note_rechecked(recheck.check(batches, draws, &adapter)?);
                    sink(batches)
                })
            }
            Backend::Cpu(session) => session.draw(draws, steps, &mut sink),
        }
    }
}

/// Number of steps of the next window: grows or shrinks towards [`WINDOW_TIME`].
pub(super) struct Pace {
    next: u64,
    pub(super) most: u64,
    /// Divisor of the number of steps of a window, so that none leaves half a thread idle and planes have no padding.
    grain: u64,
}

impl Pace {
    /// Makes a pace for windows of at most `most` steps of jobs whose arrays have `formats`. The first has about 10^5
    /// candidates.
    pub(super) fn new<'a>(jobs: &[Job], formats: impl Iterator<Item = &'a [ArrayFormat]>, most: u64) -> Pace {
        let four_steps = |(job, formats): (&Job, &'a [ArrayFormat])| {
            formats.iter().map(|format| format.bytes(4 * job.per_step)).max()
        };
        let bytes = jobs.iter().zip(formats).filter_map(four_steps).max().expect("something comes out");
        let candidates = jobs.iter().map(|job| job.per_step as f64 / job.recipe.acceptance()).sum::<f64>();
        let grain = if jobs.iter().all(|job| job.per_step == 1) { 4 } else { 1 };
        let most = most.min(4 * WINDOW_BYTES / bytes).max(grain) / grain * grain;
        Pace { next: ((1e5 / candidates) as u64).clamp(grain, most), most, grain }
    }

    /// Learns from a window of `steps` that took until now from `start`.
    pub(super) fn learn(&mut self, steps: u64, start: Instant) {
        let ratio = WINDOW_TIME.as_secs_f64() / start.elapsed().as_secs_f64().max(1e-6);
        let wanted = steps as f64 * ratio.clamp(0.25, 2.0);
        self.next = (wanted as u64).clamp(self.grain, self.most) / self.grain * self.grain;
    }

    /// The next window of what is left of `steps` from `offset` on; `None` where nothing is.
    pub(super) fn window(&self, steps: u64, offset: u64) -> Option<Window> {
        let left = steps - offset;
        (left > 0).then(|| Window { offset, steps: left.min(self.next) })
    }
}

/// Some steps of a schedule.
#[derive(Clone, Copy)]
pub(super) struct Window {
    pub(super) offset: u64,
    pub(super) steps: u64,
}

impl Window {
    /// The part of a job's draws.
    pub(super) fn of(self, draws: Draws<'_>, per_step: u64) -> Draws<'_> {
        draws.part(self.offset * per_step, self.steps * per_step)
    }
}
