//! `spectroll scene`: a data set of scenes, from a file that says what each of them needs.

use std::io::{self, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;
use serde_json::{Map, Value, json};
use spectroll::output::{Constant, Field, Format, Layout, Outcome, Schema, SpdName};
use spectroll::provenance::Sum;
use spectroll::scene::{Array, Content, GroupSummary, Outline, PRESETS, Scene, SceneDrawer, Window};
use spectroll::{Element, Engine, EngineError};

use super::dry_run::{room, size};
use super::picture;
use super::preview::Preview;
use super::progress::Progress;
use super::sink::{OutputArguments, Sink, Target};
use super::{EngineArguments, Usage, check_interrupt, existing, grouped, request, watch_interrupts};

/// Draw scenes of lights, surfaces and targets, as a file says
///
/// An element of a group depends on the seed, the group's name, the scene and the element alone: groups may be added,
/// removed and moved, and any scene drawn alone.
#[derive(clap::Args)]
// A picture or a dry run will do without an output, which is then empty.
#[command(mut_arg("output", |output| output.required(false).default_value("").hide_default_value(true)))]
pub(crate) struct Arguments {
    /// The scene file, in TOML
    #[arg(value_name = "FILE", required_unless_present = "example", conflicts_with = "example")]
    file: Option<PathBuf>,
    /// A built-in scene file instead; without anything to do, print it
    #[arg(long, value_name = "NAME", value_parser = PRESETS.map(|(name, _)| name))]
    example: Option<String>,
    /// Draw this group alone
    #[arg(long, value_name = "GROUP")]
    only: Option<String>,
    /// Draw these scenes, B excluded [default: all]
    #[arg(long, value_name = "A..B", value_parser = range)]
    scenes: Option<Range<u64>>,
    #[command(flatten)]
    output: OutputArguments,
    /// Draw a picture of some scenes, .png or .svg
    #[arg(long, value_name = "OUT.png")]
    preview: Option<PathBuf>,
    #[command(flatten)]
    engine: EngineArguments,
    /// Say what would be drawn and what not, and draw nothing
    #[arg(long)]
    dry_run: bool,
    /// Print the summary as JSON on standard output
    #[arg(long)]
    json: bool,
    /// Print neither progress nor summary
    #[arg(short, long)]
    quiet: bool,
}

/// What a run made and how, for people and programs.
#[derive(Serialize)]
struct Report {
    scene: String,
    output: Option<String>,
    wavelengths: String,
    seed: u64,
    scenes: Range<u64>,
    #[serde(flatten)]
    outline: Outline,
    drawn: Vec<GroupSummary>,
    complete: bool,
    seconds: f64,
    scenes_per_second: f64,
    engine: String,
    version: &'static str,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let (name, text) = source(arguments)?;
    let output = &arguments.output;
    let to_somewhere = !output.output.as_os_str().is_empty();
    let idle = !to_somewhere && arguments.preview.is_none() && !arguments.dry_run;
    if idle && arguments.example.is_some() {
        return Ok(io::stdout().write_all(text.as_bytes())?);
    }
    let folder = arguments.file.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
    let mut scene = Scene::parse(&name, &text, folder)?;
    if let Some(only) = &arguments.only {
        let groups = scene.groups().collect::<Vec<_>>().join(", ");
        scene = scene
            .only(only)
            .ok_or_else(|| Usage(format!("there is no group {only:?}; there are {groups}")))?;
    }
    let scenes = arguments.scenes.clone().unwrap_or(0..scene.scenes());
    if scenes.end > scene.scenes() {
        let all = scene.scenes();
        let text = format!("--scenes {}..{}: the file has {all} scenes, 0..{all}", scenes.start, scenes.end);
        return Err(Usage(text).into());
    }
    if idle {
        return Err(Usage("say where to with -o, or ask for --dry-run or --preview".to_owned()).into());
    }
    let engine =
        Engine::with_threads(&arguments.engine.choice().unwrap_or_default(), arguments.engine.threads)?;
    let job = Job { arguments, name: &name, text: &text, scene: &scene, scenes, engine: &engine };
    if arguments.dry_run {
        return job.dry_run();
    }
    if let Some(path) = &arguments.preview {
        let format = picture::Format::of(path)?;
        Preview::new(&scene, &engine, &job.scenes)?.write(path, format, existing(output.force))?;
    }
    if to_somewhere { job.run() } else { Ok(()) }
}

/// The name and the text of the scene file.
fn source(arguments: &Arguments) -> anyhow::Result<(String, String)> {
    match (&arguments.file, &arguments.example) {
        (Some(path), _) => {
            let text = std::fs::read_to_string(path)
                .map_err(|e| Usage(format!("cannot read the scene file {path:?}: {e}")))?;
            Ok((path.display().to_string(), text))
        }
        (None, example) => {
            let preset = PRESETS.iter().find(|(name, _)| Some(*name) == example.as_deref());
            let (name, text) = preset.expect("the argument parser saw to it");
            Ok(((*name).to_owned(), (*text).to_owned()))
        }
    }
}

/// `A..B`.
fn range(text: &str) -> Result<Range<u64>, String> {
    let parsed =
        text.split_once("..").and_then(|(a, b)| Some(a.trim().parse().ok()?..b.trim().parse().ok()?));
    parsed.filter(|range| range.start <= range.end).ok_or_else(|| "expected A..B, as in 0..100".to_owned())
}

/// Scenes to be drawn.
struct Job<'a> {
    arguments: &'a Arguments,
    name: &'a str,
    text: &'a str,
    scene: &'a Scene,
    scenes: Range<u64>,
    engine: &'a Engine,
}

impl Job<'_> {
    fn count(&self) -> u64 {
        self.scenes.end - self.scenes.start
    }

    fn run(&self) -> anyhow::Result<()> {
        let output = &self.arguments.output;
        if self.arguments.json && output.to_stdout() {
            return Err(Usage("--json and -o - would both write to standard output".to_owned()).into());
        }
        let target = output.target()?;
        let start = Instant::now();
        let mut drawer = self.scene.drawer(self.engine)?;
        let mut writer = Columns::new(self, target, &drawer);
        output.check(target, &writer.schema)?;
        let is_set = matches!(target, Target::Set(_));
        if is_set {
            let rounding = rounding(&mut drawer)?;
            writer.schema.attributes.insert("rounding".to_owned(), rounding.into());
        }
        if !is_set {
            watch_interrupts();
        }
        let companions = [("scene.toml", self.text)];
        let engine = request::engine_name(self.engine);
        let mut sink = output.open(
            target,
            &writer.schema,
            (SpdName::Reflectance, self.scenes.start),
            (&companions, &engine),
        )?;
        if is_set {
            watch_interrupts();
        }
        match self.draw(&mut drawer, &writer, &mut sink).and_then(|drawn| {
            check_interrupt()?;
            Ok(drawn)
        }) {
            Ok(drawn) => {
                let outcome = sink.finish()?;
                self.report(drawn, outcome, start.elapsed().as_secs_f64())
            }
            Err(error) => Err(sink.stop(error)),
        }
    }

    /// Makes the scenes that are missing.
    fn draw(
        &self,
        drawer: &mut SceneDrawer,
        columns: &Columns,
        sink: &mut Sink,
    ) -> anyhow::Result<Vec<GroupSummary>> {
        let missing = sink.missing(self.count());
        let count: u64 = missing.iter().map(|part| part.end - part.start).sum();
        let progress = Progress::new(count, self.arguments.quiet, self.arguments.output.to_stdout());
        let mut drawn = drawer.taken_once();
        let made = missing.into_iter().try_for_each(|part| {
            let scenes = self.scenes.start + part.start..self.scenes.start + part.end;
            let part = drawer.draw(scenes, |window| {
                check_interrupt()?;
                columns.write(&window, sink)?;
                progress.advance(window.scenes.end - window.scenes.start);
                anyhow::Ok(())
            })?;
            for (all, part) in drawn.iter_mut().zip(part) {
                all.summary.draws += part.summary.draws;
                all.summary.attempts += part.summary.attempts;
                all.summary.above_one += part.summary.above_one;
            }
            anyhow::Ok(())
        });
        progress.end();
        made.map(|()| drawn)
    }

    fn report(&self, drawn: Vec<GroupSummary>, outcome: Outcome, seconds: f64) -> anyhow::Result<()> {
        let report = Report {
            output: Some(self.arguments.output.output.display().to_string()),
            drawn,
            complete: outcome == Outcome::Sealed,
            seconds,
            scenes_per_second: self.count() as f64 / seconds,
            ..self.outline()
        };
        if self.arguments.json {
            writeln!(io::stdout(), "{}", serde_json::to_string_pretty(&report)?)?;
        } else if !self.arguments.quiet {
            let (count, bands) = (grouped(self.count()), self.scene.grid().len());
            eprintln!("{}: {count} scenes of {bands} bands", self.arguments.output.output.display());
            for GroupSummary { group, summary } in &report.drawn {
                let accepted = summary.acceptance().map_or_else(String::new, |share| {
                    format!(", {} candidates ({:.2} % accepted)", grouped(summary.attempts), 100.0 * share)
                });
                eprintln!("  {group}: {} spectra drawn{accepted}", grouped(summary.draws));
                if summary.above_one > 0 {
                    eprintln!("    {} of them reach 1 or more after scaling", grouped(summary.above_one));
                }
            }
            eprintln!("  {seconds:.2} s, {}", report.engine);
            if let Outcome::Waiting { done, chunks } = outcome {
                eprintln!("  {} of {} chunks are finished", grouped(done), grouped(chunks));
            }
        }
        Ok(())
    }

    /// What drawing takes, before anything is drawn.
    fn outline(&self) -> Report {
        let mut outline = self.scene.outline(self.count());
        if self.engine.adapter().is_none() && outline.kernels > 0 {
            outline.left_out.push("the CPU draws, and nothing is compiled".to_owned());
            outline.kernels = 0;
        }
        Report {
            scene: self.name.to_owned(),
            output: None,
            wavelengths: self.scene.grid().to_string(),
            seed: self.scene.seed(),
            scenes: self.scenes.clone(),
            outline,
            drawn: Vec::new(),
            complete: false,
            seconds: 0.0,
            scenes_per_second: 0.0,
            engine: self.engine.to_string(),
            version: env!("CARGO_PKG_VERSION"),
        }
    }

    fn dry_run(&self) -> anyhow::Result<()> {
        let report = self.outline();
        let mut out = io::stdout();
        if self.arguments.json {
            return Ok(writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?);
        }
        let Report { scene, outline, engine, .. } = report;
        writeln!(out, "{scene}: {} scenes on {} nm", grouped(self.count()), self.scene.grid())?;
        for group in &outline.groups {
            let by = match (group.kernel, group.draws_per_scene, group.draws_once) {
                (_, 0, 0) => "nothing drawn".to_owned(),
                (_, 0, once) => format!("{} drawn once, on the CPU", grouped(once)),
                (Some(kernel), each, _) if outline.kernels > 0 => {
                    format!("{} a scene, by kernel {kernel}", grouped(each))
                }
                (_, each, _) => format!("{} a scene, on the CPU", grouped(each)),
            };
            writeln!(out, "  {}: {by}", group.name)?;
            for array in &group.arrays {
                let scenes = array.per_scene.then_some(self.count() as usize);
                let shape: Vec<_> = scenes.into_iter().chain(array.shape.iter().copied()).collect();
                writeln!(out, "    {}: {shape:?} {}", array.name, element(array).name())?;
            }
        }
        writeln!(out, "  left out:")?;
        for line in &outline.left_out {
            writeln!(out, "    {line}")?;
        }
        let kernels = match outline.kernels {
            0 => "no kernel compiled".to_owned(),
            1 => "1 kernel compiled".to_owned(),
            n => format!("{n} kernels compiled"),
        };
        writeln!(
            out,
            "  {} spectra drawn by {engine}, {kernels}, {}",
            grouped(outline.draws),
            size(outline.bytes)
        )?;
        let output = &self.arguments.output;
        if !output.to_stdout() && !output.output.as_os_str().is_empty() {
            writeln!(out, "  {}", room(&output.output, outline.bytes)?)?;
        }
        Ok(())
    }
}

/// A sum that engines share exactly where they round alike: of the first scene, whatever is asked for.
fn rounding(drawer: &mut SceneDrawer) -> Result<String, EngineError> {
    let mut sum = Sum::default();
    drawer.draw(0..1, |window| {
        window.arrays().for_each(|(_, bytes)| sum.update(bytes));
        Ok::<_, EngineError>(())
    })?;
    Ok(sum.finish())
}

fn element(array: &Array) -> Element {
    match array.content {
        Content::Attempts => Element::U32,
        _ => Element::F32,
    }
}

/// The arrays of scenes as a data set has them, a row a scene.
struct Columns {
    schema: Schema,
    /// What all scenes share, for formats that hold nothing but rows.
    repeated: Vec<Vec<u8>>,
}

impl Columns {
    fn new(job: &Job, target: Target, drawer: &SceneDrawer) -> Columns {
        let stored = job.arguments.output.element();
        let shares = !matches!(
            target,
            Target::Stdout
                | Target::Spd
                | Target::File(Format::Csv | Format::Parquet | Format::Npy)
                | Target::Set(Layout::Parquet)
        );
        let varying = job.scene.arrays().filter(|array| array.per_scene);
        let mut fields: Vec<_> = varying.map(|array| field(array).stored_as(stored)).collect();
        let (mut constants, mut repeated) = (Vec::new(), Vec::new());
        for (array, bytes) in drawer.constants() {
            if shares {
                let extents = array.shape.iter().map(|&extent| extent as u64);
                let axes = axes(array).into_iter().zip(extents).collect();
                constants.push(Constant { name: array.name.clone(), axes, element: element(array), bytes });
            } else {
                fields.push(field(array).stored_as(stored));
                repeated.push(bytes);
            }
        }
        let schema = Schema {
            fields,
            row: "scene".to_owned(),
            constants,
            count: job.count(),
            wavelengths: job.scene.grid().wavelengths().collect(),
            attributes: attributes(job),
        };
        Columns { schema, repeated }
    }

    fn write(&self, window: &Window, sink: &mut Sink) -> anyhow::Result<()> {
        let count = (window.scenes.end - window.scenes.start) as usize;
        let repeated: Vec<_> = self.repeated.iter().map(|bytes| bytes.repeat(count)).collect();
        let columns: Vec<_> =
            window.arrays().map(|(_, bytes)| bytes).chain(repeated.iter().map(Vec::as_slice)).collect();
        sink.write(&columns)
    }
}

/// The names of the dimensions of an entry of an array.
fn axes(array: &Array) -> Vec<String> {
    // Not that of the group alone: xarray takes a dimension of an array's name for its coordinates.
    let group = array.name.strip_suffix(array.content.suffix()).unwrap_or(&array.name);
    let mut axes = Vec::new();
    let inner = array.content.axis();
    if array.shape.len() > usize::from(inner.is_some()) {
        axes.push(format!("{group}_number"));
    }
    axes.extend(inner.map(str::to_owned));
    axes
}

fn field(array: &Array) -> Field {
    let inner = array.content.axis();
    let last = array.shape.last().copied().unwrap_or(1);
    let field = match inner {
        Some(axis) => Field::vector(&array.name, axis, last, element(array)),
        None => Field::scalar(&array.name, element(array)),
    };
    match axes(array).first() {
        Some(outer) if array.shape.len() > usize::from(inner.is_some()) => {
            field.repeated(outer, array.shape[0])
        }
        _ => field,
    }
}

/// What scenes are made from.
fn attributes(job: &Job) -> Map<String, Value> {
    let attributes = json!({
        // A folder on this machine is nobody else's business.
        "scene_file": Path::new(job.name).file_name().unwrap_or_default().to_string_lossy(),
        "scene": job.text,
        "only": job.arguments.only,
        "seed": job.scene.seed(),
        "start": job.scenes.start,
        "program": concat!("spectroll ", env!("CARGO_PKG_VERSION")),
    });
    let Value::Object(attributes) = attributes else { unreachable!("it is written as one") };
    attributes
}
