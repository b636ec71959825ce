//! The arguments that make a recipe, for the commands that draw from one.

use clap::ValueEnum;
use spectroll::{
    Bounds, DEFAULT_MAX_ATTEMPTS, Intensity, Luminance, Model, Proposal, Quantity, Recipe, RecipeBuilder,
    colorimetry,
};

use super::Usage;

#[derive(clap::Args)]
pub(super) struct RecipeArguments {
    /// Scale every reflectance to this luminous reflectance (LRV), above 0 and below 1
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    lrv: Option<f64>,
    /// What must be between 0 and 1 where there is an --lrv
    #[arg(long, value_enum, default_value = "base", requires = "lrv")]
    bounds: BoundsName,
    /// Multiply the covariance of the weights
    #[arg(long, default_value_t = 1.0, value_name = "C", allow_negative_numbers = true)]
    cov_scale: f64,
    /// Multiply illuminants: a number, LOW..HIGH (uniform in the logarithm), or data (what the model's were divided by)
    #[arg(long, value_name = "I")]
    intensity: Option<String>,
    /// What comes out, separated by commas
    #[arg(long, value_enum, value_delimiter = ',', default_value = "spectra")]
    quantities: Vec<QuantityName>,
    /// The illuminant of reflectances' XYZ and sRGB
    #[arg(long, value_enum, default_value = "d65")]
    light: LightName,
    /// Give illuminants' XYZ and sRGB with Y = 1
    #[arg(long)]
    unit_luminance: bool,
    /// Where candidates come from
    #[arg(long, value_enum, default_value = "auto")]
    proposal: ProposalName,
    /// How many candidates a draw may take
    #[arg(long, default_value_t = DEFAULT_MAX_ATTEMPTS, value_name = "N")]
    max_attempts: u32,
}

#[derive(Clone, Copy, ValueEnum)]
enum BoundsName {
    /// The spectrum before scaling
    Base,
    /// The spectrum after scaling
    Scaled,
    /// Both
    Both,
}

#[derive(Clone, Copy, ValueEnum)]
enum ProposalName {
    /// Whatever is expected to cost less
    Auto,
    /// The model's Gaussian
    Plain,
    /// Boxes that cover what is acceptable
    Cover,
}

#[derive(Clone, Copy, ValueEnum)]
enum LightName {
    /// Noon daylight
    D65,
    /// Incandescent
    A,
    /// Equal energy
    E,
}

#[derive(Clone, Copy, ValueEnum)]
enum QuantityName {
    /// A value for each band
    Spectra,
    /// A value for each component
    Weights,
    /// Tristimulus values
    Xyz,
    /// Linear Rec. 709 components
    Srgb,
    /// The luminous reflectance
    Lrv,
    /// How many candidates each draw took
    Attempts,
    /// What each illuminant was multiplied by
    Intensity,
}

impl QuantityName {
    fn quantity(self) -> Quantity {
        match self {
            QuantityName::Spectra => Quantity::Spectra,
            QuantityName::Weights => Quantity::Weights,
            QuantityName::Xyz => Quantity::Xyz,
            QuantityName::Srgb => Quantity::Srgb,
            QuantityName::Lrv => Quantity::Lrv,
            QuantityName::Attempts => Quantity::Attempts,
            QuantityName::Intensity => Quantity::Intensity,
        }
    }
}

impl RecipeArguments {
    /// The recipe, ready to be built.
    pub(super) fn recipe(&self, model: &Model) -> Result<RecipeBuilder, Usage> {
        let mut recipe = Recipe::new(model)
            .covariance_scale(self.cov_scale)
            .max_attempts(self.max_attempts)
            .proposal(match self.proposal {
                ProposalName::Auto => Proposal::Auto,
                ProposalName::Plain => Proposal::Plain,
                ProposalName::Cover => Proposal::Cover,
            })
            .quantities(self.quantities.iter().map(|q| q.quantity()));
        if let Some(lrv) = self.lrv {
            recipe = recipe.lrv(lrv).bounds(match self.bounds {
                BoundsName::Base => Bounds::Base,
                BoundsName::Scaled => Bounds::Scaled,
                BoundsName::Both => Bounds::Both,
            });
        }
        if let Some(text) = &self.intensity {
            recipe = recipe.intensity(intensity(text)?);
        }
        if self.unit_luminance {
            recipe = recipe.luminance(Luminance::One);
        }
        Ok(match self.light {
            LightName::D65 => recipe,
            LightName::A => recipe.light(&colorimetry::illuminant_a(model.grid())),
            LightName::E => recipe.light(&vec![1.0; model.bands()]),
        })
    }
}

fn intensity(text: &str) -> Result<Intensity, Usage> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let parsed = match text.split_once("..") {
        Some((low, high)) => {
            number(low).zip(number(high)).map(|(low, high)| Intensity::LogUniform(low, high))
        }
        None if text == "data" => Some(Intensity::Data),
        None => number(text).map(Intensity::Fixed),
    };
    parsed.ok_or_else(|| {
        Usage(format!("--intensity {text:?}: write a number, LOW..HIGH as in 0.15..150, or data"))
    })
}
