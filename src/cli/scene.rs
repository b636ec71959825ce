//! `spectroll scene`: a data set of scenes, from a file that says what each of them needs.

use std::io::{self, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;
use spectroll::evaluation::plot::PictureFormat;
use spectroll::export::{ArraySelection, Companions, ExportError, Output, SceneExport, Space, Writing};
use spectroll::output::{OutputError, PendingFile, Schema, SetStatus};
use spectroll::plain_file::read_text;
use spectroll::scene::{GroupSummary, MAX_FILE_BYTES, PRESETS, Scene, Workload};
use spectroll::wording::{counted, grouped};
use spectroll::{ArithmeticVerdict, Distribution, Dtype, Engine, Quantity, Recipe};

use super::exit::Usage;
use super::interrupt;
use super::options::{EngineArguments, OutputArguments, Purpose, SummaryArguments};
use super::parse::{seed, size};
use super::picture;
use super::picture::scene::Preview;
use super::run::{self, Waiting, folder_of};

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
    /// Use a built-in scene file; without -o, --preview or --dry-run, print it
    #[arg(long, value_name = "NAME", value_parser = PRESETS.map(|(name, _)| name))]
    example: Option<String>,
    /// Draw with this seed instead of the file's; random takes one from the operating system
    #[arg(long, value_name = "N|random", value_parser = seed, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Draw this group alone
    #[arg(long, value_name = "GROUP")]
    only: Option<String>,
    /// Write these arrays alone, by the names that --dry-run lists
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    arrays: Vec<String>,
    /// Draw these scenes, B excluded [default: all]
    #[arg(long, value_name = "A..B", value_parser = range, allow_hyphen_values = true)]
    scenes: Option<Range<u64>>,
    #[command(flatten)]
    output: OutputArguments,
    /// Draw a picture of some scenes, .png, .svg or .pdf
    #[arg(long, value_name = "OUT.png")]
    preview: Option<PathBuf>,
    #[command(flatten)]
    ground: picture::Ground,
    #[command(flatten)]
    engine: EngineArguments,
    /// Say what would be drawn and what not, and draw nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    summary: SummaryArguments,
}

/// Result of a run, for people and programs.
#[derive(Serialize)]
struct Report {
    scene: String,
    output: Option<String>,
    /// Number of text files, in a folder.
    files: Option<u64>,
    wavelengths: String,
    seed: u64,
    scenes: Range<u64>,
    #[serde(flatten)]
    workload: Workload,
    drawn: Vec<GroupSummary>,
    complete: bool,
    seconds: f64,
    scenes_per_second: f64,
    engine: String,
    /// Arithmetic of an adapter's shaders, and whether its draws are those of the CPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    arithmetic: Option<ArithmeticVerdict>,
    /// Number of draws that were made again on the CPU, and were the same.
    rechecked: u64,
    /// The engine, with its arithmetic.
    #[serde(skip)]
    drawn_by: String,
    version: &'static str,
    /// Room on disk, in a dry run of what would be written.
    #[serde(flatten)]
    room: Option<Room>,
}

/// Room on disk, beside the bytes of the workload.
#[derive(Serialize)]
struct Room {
    /// Number of bytes without which the run cannot end.
    least: u64,
    /// Number of bytes that are free; `None` where that cannot be told, or is of no account.
    free: Option<u64>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let (name, text) = source(arguments)?;
    let output = &arguments.output;
    let to_somewhere = output.is_given();
    let idle = !to_somewhere && arguments.preview.is_none() && !arguments.dry_run;
    if idle && arguments.example.is_some() {
        return Ok(io::stdout().write_all(text.as_bytes())?);
    }
    let folder = arguments.file.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
    let selection = ArraySelection { only: arguments.only.clone(), arrays: arguments.arrays.clone() };
    let waiting = Waiting::begin("preparing the scenes", arguments.summary.quiet);
    let scene = selection.apply(match arguments.seed {
        Some(seed) => Scene::parse_seeded(&name, &text, folder, seed)?,
        None => Scene::parse(&name, &text, folder)?,
    })?;
    drop(waiting);
    let scenes = arguments.scenes.clone().unwrap_or(0..scene.scenes());
    if scenes.end > scene.scenes() {
        let all = scene.scenes();
        let text = format!("--scenes {}..{}: the file has {all} scenes, 0..{all}", scenes.start, scenes.end);
        return Err(Usage(text).into());
    }
    if idle {
        return Err(Usage("say where to with -o, or ask for --dry-run or --preview".to_owned()).into());
    }
    // A folder on this machine is nobody else's business.
    let file = Path::new(&name).file_name().unwrap_or_default().to_string_lossy();
    let export = SceneExport::new(&scene, scenes.clone()).selection(selection.clone()).file(&file, &text);
    let job = Job { arguments, name: &name, scene: &scene, scenes, selection, export };
    // What cannot be written is found out before anything is drawn.
    let planned = if to_somewhere { Some(job.planned()?) } else { None };
    let picture = arguments.preview.as_deref().map(|path| job.picture(path)).transpose()?;
    let engine = arguments.engine.open()?;
    if arguments.dry_run {
        return job.dry_run(&engine, planned.as_ref());
    }
    planned.as_ref().map_or(Ok(()), Planned::check_space)?;
    match (planned, picture) {
        (Some(planned), picture) => job.run(&engine, planned, picture),
        (None, Some(picture)) => {
            picture.make(&job, &engine)?;
            job.tell_seed();
            Ok(())
        }
        (None, None) => Ok(()),
    }
}

/// The name and the text of the scene file.
fn source(arguments: &Arguments) -> anyhow::Result<(String, String)> {
    match (&arguments.file, &arguments.example) {
        (Some(path), _) => {
            let text = read_text(path, MAX_FILE_BYTES)
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
    let number = |text: &str| text.trim().parse::<u64>().ok();
    let parsed = text.split_once("..").and_then(|(a, b)| Some(number(a)?..number(b)?));
    match parsed {
        Some(Range { start, end }) if start == end => Err(format!(
            "there is no scene in it, for the end is left out; did you mean {start}..{}?",
            end.saturating_add(1)
        )),
        Some(range) if range.start < range.end => Ok(range),
        _ => Err("expected A..B, as in 0..100".to_owned()),
    }
}

/// Scenes to be drawn.
struct Job<'a> {
    arguments: &'a Arguments,
    name: &'a str,
    scene: &'a Scene,
    scenes: Range<u64>,
    selection: ArraySelection,
    export: SceneExport<'a>,
}

/// A data set to be written.
struct Planned {
    output: Output,
    schema: Schema,
    companions: Companions,
}

impl Planned {
    /// Number of text files, where they make a folder.
    fn files(&self) -> Option<u64> {
        self.output.text_files(&self.schema, &self.companions)
    }

    /// Type in which an array is written, if it is.
    fn dtype(&self, name: &str) -> Option<Dtype> {
        let shared = self.schema.shared.iter().find(|shared| shared.name == name);
        let field = self.schema.fields.iter().find(|field| field.name == name);
        shared.map(|shared| shared.dtype).or(field.map(|field| field.stored))
    }

    fn check_space(&self) -> Result<(), OutputError> {
        self.output.check_space(&self.schema, &self.companions)
    }
}

/// A picture that can be written.
struct Picture<'a> {
    path: &'a Path,
    format: PictureFormat,
}

impl Picture<'_> {
    fn make(&self, job: &Job<'_>, engine: &Engine) -> anyhow::Result<()> {
        let existing = job.arguments.output.if_exists();
        let theme = job.arguments.ground.theme();
        let drawing = Preview::new(job.name, job.scene, engine, &job.scenes, theme)?.drawing();
        picture::write(&drawing, self.path, self.format, existing)
    }
}

impl Job<'_> {
    fn count(&self) -> u64 {
        self.scenes.end - self.scenes.start
    }

    /// Plans the data set, if it can be written.
    fn planned(&self) -> anyhow::Result<Planned> {
        self.arguments.summary.check(&self.arguments.output)?;
        let output = self.arguments.output.resolve(Purpose::of(self.arguments.dry_run))?;
        let (schema, companions) = (self.export.schema(&output), self.export.companions());
        output.check(&schema, &companions)?;
        Ok(Planned { output, schema, companions })
    }

    /// Says what the seed is where it is not that of the file.
    fn tell_seed(&self) {
        if self.arguments.seed.is_some() && self.arguments.summary.is_in_words() {
            tell!("  seed {}", self.scene.seed());
        }
    }

    /// A picture of these scenes at `path`, if it can be written.
    fn picture<'p>(&self, path: &'p Path) -> anyhow::Result<Picture<'p>> {
        let format = picture::format(path)?;
        let has_spectra = |group: &str| {
            self.scene.arrays().any(|array| array.group == group && array.quantity == Quantity::Spectra)
        };
        if let Some(group) = self.scene.groups().find(|group| !has_spectra(group)) {
            let text = format!("--preview needs the spectra of {group:?}: add \"spectra\" to its quantities");
            return Err(Usage(text).into());
        }
        if !self.arguments.dry_run {
            PendingFile::create(path, self.arguments.output.if_exists())?;
        }
        Ok(Picture { path, format })
    }

    fn run(&self, engine: &Engine, planned: Planned, picture: Option<Picture>) -> anyhow::Result<()> {
        let files = planned.files();
        let Planned { output, schema, companions } = planned;
        let start = Instant::now();
        let mut rows = self.export.rows(engine, &schema)?;
        let writing = interrupt::around(&output, || {
            Writing::open(&output, schema, &companions, engine, &mut rows).map_err(run::failed)
        })?;
        if let Some(error) = picture.and_then(|picture| picture.make(self, engine).err()) {
            return Err(run::failed(writing.stop(ExportError::Host(error.into()))));
        }
        let (quiet, to_stdout) = (self.arguments.summary.quiet, self.arguments.output.to_stdout());
        let outcome = run::make(writing, &mut rows, (quiet, to_stdout))?;
        let seconds = start.elapsed().as_secs_f64();
        self.report(&output, outcome, Report { drawn: rows.drawn, files, seconds, ..self.workload(engine) })
    }

    fn report(&self, output: &Output, outcome: SetStatus, made: Report) -> anyhow::Result<()> {
        let seconds = made.seconds;
        let report = Report {
            output: Some(self.arguments.output.output.display().to_string()),
            complete: outcome == SetStatus::Sealed,
            scenes_per_second: self.count() as f64 / seconds,
            ..made
        };
        self.arguments.summary.tell(&report, || {
            let (scenes, bands) = (counted(self.count(), "scene", "scenes"), self.scene.grid().len());
            let kind = run::kind(output, report.files);
            let name = self.arguments.output.output.display();
            tell!("{name}: {kind}{scenes} of {}", counted(bands as u64, "band", "bands"));
            for GroupSummary { group, summary } in &report.drawn {
                let accepted = summary.acceptance().map_or_else(String::new, |share| {
                    let candidates = counted(summary.attempts, "candidate", "candidates");
                    format!(", {candidates} ({:.2} % accepted)", 100.0 * share)
                });
                let above = run::above_one(summary.above_one, summary.draws, "bounds = \"both\"");
                let above = above.map_or_else(String::new, |above| format!("; {above}"));
                tell!("  {group}: {} drawn{accepted}{above}", counted(summary.draws, "spectrum", "spectra"));
            }
            for (group, model) in self.scene.models() {
                let is_gaussian = *model.distribution() == Distribution::Gaussian;
                let recipe = if is_gaussian { None } else { Recipe::builder(model).build().ok() };
                let left_out = recipe.as_ref().and_then(run::left_out);
                for warning in run::doubts(model).chain(left_out) {
                    tell!("  {group}: {warning}");
                }
            }
            self.tell_seed();
            tell!("  {seconds:.2} s, {}", report.drawn_by);
            if let Some(rechecked) = run::rechecked(report.rechecked) {
                tell!("  {rechecked}");
            }
            if let Some(status) = run::status(output, outcome) {
                tell!("  {status}");
            }
        })
    }

    /// Describes the workload of drawing, before anything is drawn.
    fn workload(&self, engine: &Engine) -> Report {
        let mut workload = self.scene.workload(self.count());
        if engine.adapter().is_none() && workload.shaders > 0 {
            workload.left_out.push("the CPU draws, and nothing is compiled".to_owned());
            workload.shaders = 0;
        }
        for group in &mut workload.groups {
            let all = group.arrays.len();
            group.arrays.retain(|array| self.selection.has(array));
            if group.arrays.len() < all {
                workload.left_out.push(format!("{}: arrays that --arrays does not name", group.name));
            }
        }
        let arrays = workload.groups.iter().flat_map(|group| &group.arrays);
        workload.bytes = arrays.map(|a| a.bytes() as u64 * if a.per_scene { self.count() } else { 1 }).sum();
        Report {
            scene: self.name.to_owned(),
            output: None,
            files: None,
            wavelengths: self.scene.grid().to_string(),
            seed: self.scene.seed(),
            scenes: self.scenes.clone(),
            workload,
            drawn: Vec::new(),
            complete: false,
            seconds: 0.0,
            scenes_per_second: 0.0,
            engine: engine.to_string(),
            arithmetic: engine.verdict(),
            rechecked: engine.rechecked(),
            drawn_by: run::drawn_by(engine),
            version: env!("CARGO_PKG_VERSION"),
            room: None,
        }
    }

    fn dry_run(&self, engine: &Engine, planned: Option<&Planned>) -> anyhow::Result<()> {
        let mut report = Report { files: planned.and_then(Planned::files), ..self.workload(engine) };
        if let Some(Planned { output, schema, companions }) = planned {
            let Space { bytes, least, free } = output.space(schema, companions);
            report.workload.bytes = bytes;
            report.room = Some(Room { least, free });
        }
        if self.arguments.summary.json {
            writeln!(io::stdout(), "{}", serde_json::to_string_pretty(&report)?)?;
        } else {
            self.print(report, planned)?;
        }
        Ok(planned.map_or(Ok(()), Planned::check_space)?)
    }

    fn print(&self, report: Report, planned: Option<&Planned>) -> anyhow::Result<()> {
        let mut out = io::stdout();
        let Report { scene, workload, engine, files, .. } = report;
        let scenes = counted(self.count(), "scene", "scenes");
        writeln!(out, "{scene}: {scenes} on {} nm", self.scene.grid())?;
        for group in &workload.groups {
            let by = match (group.shader, group.draws_per_scene, group.draws_once) {
                (_, 0, 0) => "nothing drawn".to_owned(),
                (_, 0, once) => format!("{} drawn once, on the CPU", grouped(once)),
                (_, each, _) if group.scenes_per_round > 1 => {
                    let (each, round) = (grouped(each), grouped(group.scenes_per_round));
                    format!("{each} for each {round} scenes, on the CPU")
                }
                (Some(shader), each, _) if workload.shaders > 0 => {
                    format!("{} a scene, by shader {shader}", grouped(each))
                }
                (_, each, _) => format!("{} a scene, on the CPU", grouped(each)),
            };
            writeln!(out, "  {}: {by}", group.name)?;
            for array in &group.arrays {
                let scenes = array.per_scene.then_some(self.count() as usize);
                let shape: Vec<_> = scenes.into_iter().chain(array.shape.iter().copied()).collect();
                let dtype = planned.and_then(|planned| planned.dtype(&array.name)).unwrap_or(array.dtype());
                writeln!(out, "    {}: {shape:?} {}", array.name, dtype.name())?;
            }
        }
        writeln!(out, "  left out:")?;
        for line in &workload.left_out {
            writeln!(out, "    {line}")?;
        }
        let shaders = match workload.shaders {
            0 => "no shader compiled".to_owned(),
            1 => "1 shader compiled".to_owned(),
            n => format!("{n} shaders compiled"),
        };
        writeln!(
            out,
            "  {} drawn by {engine}, {shaders}, {}",
            counted(workload.draws, "spectrum", "spectra"),
            size(workload.bytes)
        )?;
        if let Some(files) = files {
            writeln!(out, "  {}: {}", self.arguments.output.output.display(), folder_of(files))?;
        }
        if let Some(Planned { output, schema, companions }) = planned {
            let lines = [run::part(output, schema), run::room(output, output.space(schema, companions))];
            lines.into_iter().flatten().try_for_each(|line| writeln!(out, "  {line}"))?;
        }
        Ok(())
    }
}
