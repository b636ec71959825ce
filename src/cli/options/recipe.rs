//! Options of a recipe.

use spectroll::{
    Bounds, DEFAULT_MAX_ATTEMPTS, Intensity, Lrv, Model, Observer, ProposalKind, Quantity, Recipe,
    RecipeSettings, ResponseScale, XyzScale,
};

use super::sensors::{IlluminantSource, TargetSource, illuminant, sensors, target};
use crate::cli::parse::{attempts, factor};

/// Settings of the draws, and the quantities to write of them.
#[derive(Clone, clap::Args)]
#[command(group = clap::ArgGroup::new("aim").args(["lrv", "target"]))]
pub(in crate::cli) struct RecipeArguments {
    /// Scale every reflectance to this luminous reflectance value (LRV): CIE Y of the 1931 2 degree observer under D65
    /// (unless --observer or --illuminant say otherwise), 1 for a perfect white; or, as LOW..HIGH, each to one of its own,
    /// uniform between the two (--quantities lrv writes it)
    #[arg(long, value_name = "Y|LOW..HIGH", allow_hyphen_values = true, value_parser = lrv)]
    pub(in crate::cli) lrv: Option<Lrv>,
    /// Scale every reflectance to this response of a sensor, as --lrv does to a luminous reflectance: ss2.L=0.3 or
    /// camera.csv.R=0.2..0.6, of a set of --sensors and one of its channels, 1 for a perfect white
    #[arg(long, value_name = "SET.CHANNEL=Y|LOW..HIGH", value_parser = target, conflicts_with = "lrv")]
    target: Option<TargetSource>,
    /// Spectrum that must be between 0 and 1 where there is an --lrv or a --target
    #[arg(long, value_enum, default_value = "base", requires = "aim")]
    bounds: Bounds,
    /// Multiply the covariance of the weights
    #[arg(long, default_value_t = 1.0, value_name = "C", value_parser = factor, allow_negative_numbers = true)]
    cov_scale: f64,
    /// Multiply illuminants: a number, LOW..HIGH (uniform in the logarithm), or data (resample the measured spectra's own
    /// mean powers)
    #[arg(long, value_name = "I", value_parser = intensity, allow_hyphen_values = true)]
    intensity: Option<Intensity>,
    /// Quantities to write for each draw (comma-separated)
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST", default_value = "spectra")]
    quantities: Vec<Quantity>,
    /// Sensors of --quantities responses: cie1931, cie1964, the cones ss2, ss10 (Stockman & Sharpe) or smith-pokorny, rods,
    /// melanopsin, or a file in any format that `fit` reads, whose columns are the channels (FILE:ARRAY@WAVELENGTHS picks
    /// one of several arrays)
    #[arg(long, value_name = "NAME|FILE")]
    sensors: Option<String>,
    /// The scale of responses: relative to a perfect white, or the integral of power times sensitivity over nm [default:
    /// white for reflectances, absolute for illuminants]
    #[arg(long, value_enum)]
    response_scale: Option<ResponseScale>,
    /// The observer of XYZ, chromaticity, linear sRGB and LRV, and of --lrv
    #[arg(long, value_enum, default_value = "cie1931")]
    observer: Observer,
    /// The illuminant of reflectances' responses, XYZ, chromaticity, linear sRGB and LRV, and of --lrv and --target: d65,
    /// d50, d55, d75, a, c, e, f2, f7, f11, a daylight by its temperature as in 5600K, or a file of one spectrum; linear
    /// sRGB has the matrix of D65, without chromatic adaptation
    #[arg(long, value_name = "NAME|FILE|TEMPERATUREK", default_value = "d65", value_parser = illuminant)]
    illuminant: IlluminantSource,
    /// The scale of illuminants' XYZ and linear sRGB
    #[arg(long, value_enum, default_value = "absolute")]
    xyz_scale: XyzScale,
    /// The distribution that candidates are drawn from
    #[arg(long, value_enum, default_value = "auto")]
    proposal: ProposalKind,
    /// The most candidates that a draw may take
    #[arg(long, default_value_t = DEFAULT_MAX_ATTEMPTS, value_name = "N", value_parser = attempts,
          allow_negative_numbers = true)]
    max_attempts: u32,
}

impl RecipeArguments {
    /// The recipe that this asks for, of a model.
    pub(in crate::cli) fn recipe(&self, model: &Model) -> anyhow::Result<Recipe> {
        Ok(self.settings(model)?.builder(model).build()?)
    }

    /// The settings of that recipe, with the files that they name read.
    pub(in crate::cli) fn settings(&self, model: &Model) -> anyhow::Result<RecipeSettings> {
        let grid = model.grid();
        Ok(RecipeSettings {
            lrv: self.lrv,
            xyz: None,
            given: None,
            target: self.target.as_ref().map(|target| target.resolve(grid)).transpose()?,
            bounds: self.bounds,
            covariance_scale: self.cov_scale,
            intensity: self.intensity,
            quantities: self.quantities.clone(),
            illuminant: self.illuminant.on(grid)?,
            observer: self.observer,
            sensors: self.sensors.as_ref().map(|name| sensors(name, grid)).transpose()?,
            response_scale: self.response_scale,
            xyz_scale: self.xyz_scale,
            proposal: self.proposal,
            max_attempts: self.max_attempts,
        })
    }
}

/// A target LRV.
fn lrv(text: &str) -> Result<Lrv, String> {
    range("--lrv", text)
}

/// A target of an option: a number, or LOW..HIGH. What no model could reach is left to the recipe, which knows the model.
pub(super) fn range(option: &str, text: &str) -> Result<Lrv, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let parsed = match text.split_once("..") {
        Some((low, high)) => number(low).zip(number(high)).map(|(low, high)| Lrv::Uniform(low, high)),
        None => number(text).map(Lrv::Fixed),
    };
    let is_percentage = |value: f64| (2.0..100.0).contains(&value);
    let instead = match parsed {
        None => return Err("expected a number or LOW..HIGH, as in 0.4 or 0.2..0.6".to_owned()),
        Some(Lrv::Fixed(lrv)) if is_percentage(lrv) => format!("{}", lrv / 100.0),
        Some(Lrv::Uniform(low, high)) if is_percentage(high) && low < high => {
            format!("{}..{}", low / 100.0, high / 100.0)
        }
        Some(Lrv::Uniform(low, high)) if low > high => {
            return Err(format!("the lower end comes first; did you mean {high}..{low}?"));
        }
        Some(Lrv::Uniform(low, high)) if low == high => {
            return Err(format!("the ends are the same; did you mean {low}?"));
        }
        Some(lrv) => return Ok(lrv),
    };
    Err(format!("{option} is a fraction between 0 and 1; did you mean {instead}?"))
}

fn intensity(text: &str) -> Result<Intensity, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let parsed = match text.split_once("..") {
        Some((low, high)) => number(low).zip(number(high)).map(|(a, b)| Intensity::LogUniform(a, b)),
        None if text == "data" => Some(Intensity::Data),
        None => number(text).map(Intensity::Fixed),
    };
    parsed.ok_or_else(|| "expected a number, LOW..HIGH as in 0.15..150, or data".to_owned())
}
