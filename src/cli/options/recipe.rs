//! Options of a recipe.

use clap::ValueEnum;
use spectroll::{
    Bounds, DEFAULT_MAX_ATTEMPTS, Illuminant, Intensity, Lrv, Model, ProposalKind, Quantity, Recipe,
    RecipeError, RecipeSettings, XyzScale,
};

use crate::cli::parse::{attempts, factor};

/// Settings of the draws, and the quantities to write of them.
#[derive(Clone, clap::Args)]
pub(in crate::cli) struct RecipeArguments {
    /// Scale every reflectance to this luminous reflectance value (LRV): CIE Y of the 1931 2 degree observer under D65,
    /// 1 for a perfect white; or, as LOW..HIGH, each to one of its own, uniform between the two (--quantities lrv
    /// writes it)
    #[arg(long, value_name = "Y|LOW..HIGH", allow_hyphen_values = true, value_parser = lrv)]
    pub(in crate::cli) lrv: Option<Lrv>,
    /// Spectrum that must be between 0 and 1 where there is an --lrv
    #[arg(long, value_enum, default_value = "base", requires = "lrv")]
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
    /// The illuminant of reflectances' XYZ, chromaticity and linear sRGB; linear sRGB has the matrix of D65, without
    /// chromatic adaptation
    #[arg(long, value_enum, default_value = "d65")]
    illuminant: IlluminantName,
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

/// The illuminants that have a name.
#[derive(Clone, Copy, ValueEnum)]
enum IlluminantName {
    /// Noon daylight
    D65,
    /// Incandescent light
    A,
    /// Equal energy
    E,
}

impl RecipeArguments {
    /// The recipe that this asks for, of a model.
    pub(in crate::cli) fn recipe(&self, model: &Model) -> Result<Recipe, RecipeError> {
        self.settings().builder(model).build()
    }

    fn settings(&self) -> RecipeSettings {
        RecipeSettings {
            lrv: self.lrv,
            xyz: None,
            bounds: self.bounds,
            covariance_scale: self.cov_scale,
            intensity: self.intensity,
            quantities: self.quantities.clone(),
            illuminant: match self.illuminant {
                IlluminantName::D65 => Illuminant::D65,
                IlluminantName::A => Illuminant::A,
                IlluminantName::E => Illuminant::E,
            },
            xyz_scale: self.xyz_scale,
            proposal: self.proposal,
            max_attempts: self.max_attempts,
        }
    }
}

/// A target LRV. What no model could reach is left to the recipe, which knows the model.
fn lrv(text: &str) -> Result<Lrv, String> {
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
    Err(format!("--lrv is a fraction between 0 and 1; did you mean {instead}?"))
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
