//! `spectroll metamers`: random spectra of given colours, into a data set.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;
use spectroll::evaluation::plot::PictureFormat;
use spectroll::export::{ColourShape, Colours, MetamerExport, Output, Rows, Writing};
use spectroll::output::SetStatus;
use spectroll::suggestion::closest;
use spectroll::wording::{counted, grouped};
use spectroll::{
    AnswerCounts, ColourConversion, ColourSpace, Engine, Grid, HardColours, Illuminant, Model, Observer,
    Quantity, Recipe, Sensors, UnreachableColours,
};

use super::exit::Usage;
use super::options::{
    EngineArguments, IlluminantSource, OutputArguments, Purpose, SummaryArguments, illuminant,
    looks_like_a_file, sensors,
};
use super::parse::{attempts, count, seed};
use super::run::{self, Waiting};
use super::wavelengths::grid;
use super::{if_exists, image, interrupt, model_at, picture};

/// Draw spectra that have given colours: of the pixels of an image, or of a table
///
/// Each is a random, physically valid spectrum of the model that has exactly the colour that was asked for: the model's
/// Gaussian conditioned on it. Draw i depends on the model, the options, the seed, the place of its colour and the colour
/// alone, so a part of an image has the spectra that it has in the whole.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A .png image, or text with a colour in each row: numbers between commas, semicolons, tabs or blanks, below a heading
    /// or not
    #[arg(value_name = "IMAGE.png|TABLE")]
    source: String,
    /// A model file, or a name of `spectroll models`
    #[arg(long, default_value = "munsell-vrhel", value_name = "MODEL")]
    model: String,
    /// Number of components of a built-in model, which is fitted anew [default: 8 of built-in models]
    #[arg(short = 'k', long, value_name = "K")]
    components: Option<usize>,
    /// The wavelengths of a built-in model, in nm
    #[arg(long, value_name = "START:STEP:STOP|FILE", value_parser = grid)]
    wavelengths: Option<Grid>,
    /// Number of spectra for each pixel; 0 for the most probable one alone
    #[arg(long, value_name = "N", value_parser = count, conflicts_with = "per_colour", allow_negative_numbers = true)]
    per_pixel: Option<u64>,
    /// Number of spectra for each colour of a table; 0 for the most probable one alone
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    per_colour: Option<u64>,
    /// The part of an image: its first column and row, from 0, and its width and height
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT", value_delimiter = ',', num_args = 1, value_parser = count)]
    crop: Vec<u64>,
    /// Space of a table's colours: xyz (Y of white is 1), srgb and linear-srgb (0 to 1), lab, or the sensors whose responses
    /// they are, 1 for a perfect white: a name or a file, as --sensors of `sample` takes [default: xyz]
    #[arg(long, value_name = "xyz|srgb|linear-srgb|lab|SENSORS")]
    space: Option<String>,
    /// The illuminant that the colours are under, as in `sample`; sRGB is adapted to its white
    #[arg(long, value_name = "NAME|FILE|TEMPERATUREK", default_value = "d65", value_parser = illuminant)]
    illuminant: IlluminantSource,
    /// The observer of the colours
    #[arg(long, value_enum, default_value = "cie1931")]
    observer: Observer,
    /// The seed of the random numbers, or random for one that the summary and the data set tell
    #[arg(long, default_value_t = 0, value_name = "SEED|random", value_parser = seed, allow_negative_numbers = true)]
    seed: u64,
    /// Answer to colours of which no spectrum is found within --max-attempts: the most probable valid spectrum, zeros, or an
    /// error
    #[arg(long, value_enum, default_value = "mode")]
    hard: HardColours,
    /// Answer colours that no spectrum of the model has with the nearest that one has, and write its distance; else they
    /// are zeros, counted and listed
    #[arg(long)]
    nearest: bool,
    /// The most candidates that a draw may take
    #[arg(long, default_value_t = 1000, value_name = "N", value_parser = attempts, allow_negative_numbers = true)]
    max_attempts: u32,
    #[command(flatten)]
    output: OutputArguments,
    /// Also make a picture of up to 512 x 512 pixels under D65, A and F11 (.png), each adapted to its light; or, of a table,
    /// of up to 100 spectra and their chromaticities under these (.png, .svg or .pdf)
    #[arg(long, value_name = "PICTURE")]
    preview: Option<PathBuf>,
    #[command(flatten)]
    ground: picture::Ground,
    #[command(flatten)]
    engine: EngineArguments,
    #[command(flatten)]
    summary: SummaryArguments,
}

/// Result of a run, for people and programs.
#[derive(Serialize)]
struct Report {
    source: String,
    output: String,
    model: String,
    colours: u64,
    per_colour: u64,
    seed: u64,
    #[serde(flatten)]
    answers: AnswerCounts,
    /// Numbers of the first colours without a spectrum of their own, from 0.
    unanswered: Vec<u64>,
    seconds: f64,
    spectra_per_second: f64,
    engine: String,
}

/// The most numbers of colours that a summary lists.
const LISTED: usize = 10;

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let output = arguments.output.resolve(Purpose::Run)?;
    arguments.summary.check(&arguments.output)?;
    let waiting = Waiting::begin("preparing the draws", arguments.summary.quiet);
    let model = model(arguments)?;
    let light = arguments.illuminant.on(model.grid())?;
    let (given, space) = given(arguments, model.grid())?;
    let colours = colours(arguments, &given, space, (&light, model.grid()))?;
    let recipe = recipe(arguments, &model, light, given)?;
    drop(waiting);
    let each = arguments.per_pixel.or(arguments.per_colour).unwrap_or(1);
    check_size(each, &colours)?;
    let (name, source) = (file_name(&arguments.model), file_name(&arguments.source));
    let unreachable = match arguments.nearest {
        true => UnreachableColours::Nearest,
        false => UnreachableColours::Leave,
    };
    let export = MetamerExport::new(&recipe, &colours, each)
        .seed(arguments.seed)
        .answers(arguments.hard, unreachable)
        .names(&name, &source);
    let schema = export.schema(&output);
    let companions = export.companions();
    output.check(&schema, &companions)?;
    let format = arguments.preview.as_deref().map(picture::format).transpose()?;
    let is_image = matches!(colours.shape, ColourShape::Image { .. });
    if is_image && format.is_some_and(|format| format != PictureFormat::Png) {
        return Err(Usage("--preview of an image is a .png".to_owned()).into());
    }
    let engine = arguments.engine.open()?;
    output.check_space(&schema, &companions)?;

    let start = Instant::now();
    let mut rows = export.rows(&engine)?;
    let writing = interrupt::around(&output, || {
        Writing::open(&output, schema, &companions, &engine, &mut rows).map_err(run::failed)
    })?;
    let outcome = run::make(writing, &mut rows, (arguments.summary.quiet, arguments.output.to_stdout()))?;
    let seconds = start.elapsed().as_secs_f64();
    if let (Some(path), Some(format)) = (&arguments.preview, format) {
        preview(arguments, (path, format), &export, (&colours, &model, &engine))?;
    }
    let report = Report {
        source: arguments.source.clone(),
        output: arguments.output.output.display().to_string(),
        model: arguments.model.clone(),
        colours: (colours.responses.len() / recipe.settings().given.as_ref().map_or(1, Sensors::len)) as u64,
        per_colour: each,
        seed: arguments.seed,
        answers: rows.counts,
        unanswered: rows.unanswered.clone(),
        seconds,
        spectra_per_second: rows.counts.all() as f64 / seconds,
        engine: engine.to_string(),
    };
    arguments.summary.tell(&report, || tell_report((&output, outcome), &colours, &report))
}

/// The most rows and columns of an image in a preview, and the most spectra of a table.
const SHOWN: (u64, u64) = (512, 100);

/// Makes the picture: the same draws once more, of what it shows.
fn preview(
    arguments: &Arguments,
    (path, format): (&Path, PictureFormat),
    export: &MetamerExport,
    (colours, model, engine): (&Colours, &Model, &Engine),
) -> anyhow::Result<()> {
    let given = colours.responses.len() as u64 / export.given() as u64;
    let each = arguments.per_pixel.or(arguments.per_colour).unwrap_or(1).max(1);
    let bands = model.bands();
    let mut spectra: Vec<f32> = Vec::new();
    let mut draw = |rows: u64| {
        export.rows(engine)?.draw(0..rows, &mut |columns, _| {
            spectra.extend(bytemuck::pod_collect_to_vec::<u8, f32>(columns[0]));
            Ok(())
        })
    };
    let existing = if_exists(arguments.output.force);
    if let ColourShape::Image { width, .. } = colours.shape {
        let rows = (given / width).min(SHOWN.0);
        draw(rows).map_err(run::failed)?;
        // The first spectrum of each pixel.
        let row = |row: u64| (0..width.min(SHOWN.0)).map(move |column| (row * width + column) * each);
        let pixels = (0..rows).flat_map(row).flat_map(|at| &spectra[at as usize * bands..][..bands]);
        let pixels: Vec<f32> = pixels.copied().collect();
        let bytes = picture::metamers::triptych(&pixels, width.min(SHOWN.0) as usize, model.grid());
        let bytes = bytes.ok_or_else(|| Usage("--preview: the grid has no visible light".to_owned()))?;
        spectroll::output::write_file(path, existing, &bytes)?;
        tell!("wrote {}", path.display());
        return Ok(());
    }
    draw(SHOWN.1.div_ceil(each).min(given)).map_err(run::failed)?;
    let shown = spectra.chunks(bands).take(SHOWN.1 as usize);
    let spectra: Vec<Vec<f64>> = shown.map(|s| s.iter().map(|&v| v.into()).collect()).collect();
    let note = format!("metamers drawn from {}, seed {}", file_name(&arguments.model), arguments.seed);
    let chart = picture::metamers::Chart {
        name: &arguments.source,
        note: &note,
        spectra,
        kind: model.kind(),
        grid: model.grid(),
        theme: arguments.ground.theme(),
    };
    picture::write(&chart.drawing(), path, format, existing)
}

fn file_name(path: &str) -> String {
    Path::new(path).file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The model: a built-in one has 8 components here, since a colour takes 3 of them.
fn model(arguments: &Arguments) -> anyhow::Result<Model> {
    const COMPONENTS: usize = 8;
    let name = arguments.model.as_str();
    if Model::BUILTIN.contains(&name) {
        let grid = match &arguments.wavelengths {
            Some(grid) => grid.clone(),
            None => Model::builtin(name)?.grid().clone(),
        };
        return Ok(Model::builtin_with(name, grid, arguments.components.unwrap_or(COMPONENTS))?);
    }
    if arguments.components.is_some() {
        let text = format!("-k is for built-in models: {name:?} has the components that it was fitted with");
        return Err(Usage(text).into());
    }
    model_at(name, arguments.wavelengths.as_ref())
}

/// The sensors whose responses are given, and the space that colours are written in.
fn given(arguments: &Arguments, grid: &Grid) -> anyhow::Result<(Sensors, ColourSpace)> {
    let name =
        arguments.space.as_deref().unwrap_or(if image::is_image(&arguments.source) { "srgb" } else { "xyz" });
    let observer =
        || Sensors::builtin(arguments.observer.name()).expect("every observer is a set of sensors");
    let spaces = || ColourSpace::NAMED.into_iter().filter(|(_, space)| *space != ColourSpace::Responses);
    if let Some((_, space)) = spaces().find(|(known, _)| *known == name) {
        return Ok((observer(), space));
    }
    if Sensors::builtin(name).is_none() && !looks_like_a_file(name) {
        let names: Vec<&str> = spaces().map(|(name, _)| name).collect();
        let near = closest(name, names.iter().copied().chain(Sensors::BUILTIN));
        let near = near.map_or_else(|| ";".to_owned(), |near| format!(", did you mean {near:?}?"));
        return Err(Usage(format!(
            "--space: {name:?} is no space of colours and no set of sensors{near} there are {} and {}; or name a file of \
             sensors",
            names.join(", "),
            Sensors::BUILTIN.join(", ")
        ))
        .into());
    }
    Ok((sensors(name, grid)?, ColourSpace::Responses))
}

/// The colours, as responses of the sensors.
fn colours(
    arguments: &Arguments,
    given: &Sensors,
    space: ColourSpace,
    (light, grid): (&Illuminant, &Grid),
) -> anyhow::Result<Colours> {
    let is_image = image::is_image(&arguments.source);
    for (flag, is_set, wants_image) in [
        ("--per-pixel", arguments.per_pixel.is_some(), true),
        ("--crop", !arguments.crop.is_empty(), true),
        ("--per-colour", arguments.per_colour.is_some(), false),
    ] {
        if is_set && is_image != wants_image {
            let kind = if wants_image { "an image (.png)" } else { "a table" };
            return Err(Usage(format!("{flag} is for {kind}, and {:?} is none", arguments.source)).into());
        }
    }
    let conversion = ColourConversion::new(space, arguments.observer, light, grid).ok_or_else(|| {
        Usage(format!("the grid {grid} has no light that the eye sees: colours are none there"))
    })?;
    let convert = |colour: [f64; 3]| conversion.responses(colour).map(|response| response as f32);
    if is_image {
        if !matches!(space, ColourSpace::Srgb | ColourSpace::LinearSrgb) {
            let text = "the pixels of an image are srgb, or linear-srgb where they are not encoded (--space)";
            return Err(Usage(text.to_owned()).into());
        }
        let image = image::read(&arguments.source)?;
        let part = image.part(&arguments.crop)?;
        let responses = image.pixels(part).flat_map(convert).collect();
        let [left, top, width, _] = part;
        let shape = ColourShape::Image { full_width: image.width, left, top, width };
        return Ok(Colours { responses, shape });
    }
    let rows = image::table(&arguments.source, given.len())?;
    if let Some((number, colour)) = out_of_range(&rows, space) {
        let name = ColourSpace::NAMED.iter().find(|(_, named)| *named == space).map_or("", |(name, _)| name);
        let text = format!(
            "{}: colour {}, {colour:?}, is not in {name}, whose values are 0 to 1: divide by 255 or 100, or choose another \
             --space",
            arguments.source,
            number + 1
        );
        return Err(Usage(text).into());
    }
    let responses = match space {
        ColourSpace::Responses => rows.iter().flatten().map(|&value| value as f32).collect(),
        _ => rows.iter().flat_map(|row| convert([row[0], row[1], row[2]])).collect(),
    };
    Ok(Colours { responses, shape: ColourShape::List })
}

/// The first colour whose numbers are those of another scale.
fn out_of_range(rows: &[Vec<f64>], space: ColourSpace) -> Option<(usize, &Vec<f64>)> {
    let most = match space {
        ColourSpace::Srgb | ColourSpace::LinearSrgb => 1.0,
        ColourSpace::Xyz | ColourSpace::Responses => 2.0,
        ColourSpace::Lab => return None,
    };
    rows.iter().enumerate().find(|(_, row)| row.iter().any(|value| *value > most))
}

fn recipe(arguments: &Arguments, model: &Model, light: Illuminant, given: Sensors) -> anyhow::Result<Recipe> {
    let builder = Recipe::builder(model)
        .given(given)
        .quantities([Quantity::Spectra])
        .max_attempts(arguments.max_attempts);
    let builder = if light == Illuminant::D65 { builder } else { builder.illuminant(light) };
    Ok(builder.build()?)
}

/// Refuses more draws than rows of random numbers have.
fn check_size(each: u64, colours: &Colours) -> Result<(), Usage> {
    let row = match colours.shape {
        ColourShape::List => 1,
        ColourShape::Image { full_width, .. } => full_width,
    };
    match row.checked_mul(each).is_some_and(|row| row <= 1 << 31) {
        true => Ok(()),
        false => {
            Err(Usage(format!("{each} spectra for each colour are more than there are random numbers for")))
        }
    }
}

fn tell_report((output, outcome): (&Output, SetStatus), colours: &Colours, report: &Report) {
    let AnswerCounts { sampled, mode, nearest, farthest, skipped, unreachable, .. } = report.answers;
    let what = match colours.shape {
        ColourShape::List => counted(report.colours, "colour", "colours"),
        ColourShape::Image { width, .. } => {
            format!("{width} x {} pixels", report.colours / width)
        }
    };
    tell!("{}: {} of {what}", report.output, counted(report.answers.all(), "spectrum", "spectra"));
    let random = if report.per_colour == 0 { "the most probable of each" } else { "at random" };
    let mut parts = match report.per_colour {
        0 => vec![format!("{} {random}", grouped(mode))],
        _ => vec![format!("{} {random}", grouped(sampled))],
    };
    if report.per_colour > 0 && mode > 0 {
        parts.push(format!("{} the most probable, of hard colours", grouped(mode)));
    }
    if nearest > 0 {
        parts.push(format!("{} of the nearest colour, up to {farthest:.2e} of white away", grouped(nearest)));
    }
    if skipped > 0 {
        parts.push(format!("{} zeros, of hard colours", grouped(skipped)));
    }
    if unreachable > 0 {
        parts.push(format!("{} zeros, of colours that no spectrum has (--nearest)", grouped(unreachable)));
    }
    tell!("  {}, seed {}", parts.join(", "), report.seed);
    if let ([_, ..], true) = (report.unanswered.as_slice(), nearest + skipped + unreachable > 0) {
        let place = |number: &u64| match colours.shape {
            ColourShape::List => (number + 1).to_string(),
            ColourShape::Image { left, top, width, .. } => {
                format!("({}, {})", left + number % width, top + number / width)
            }
        };
        let listed: Vec<String> = report.unanswered.iter().take(LISTED).map(place).collect();
        let more = if report.unanswered.len() > LISTED { ", ..." } else { "" };
        tell!("  without a spectrum of their own: {}{more}", listed.join(", "));
    }
    tell!(
        "  {:.2} s, {:.2} million a second, {}",
        report.seconds,
        report.spectra_per_second / 1e6,
        report.engine
    );
    if let Some(status) = run::status(output, outcome) {
        tell!("  {status}");
    }
}
