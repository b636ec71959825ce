//! Errors of recipes.

use std::fmt::{self, Display, Formatter};

use super::pilot::{PILOT, TOLERABLE_FAILURE, failure};
use crate::colorimetry::IlluminantError;
use crate::cover::MOST_COMPONENTS;
use crate::grid::Grid;
use crate::quantity::Quantity;
use crate::sensors::SensorError;
use crate::wording::counted;

/// Error returned by [`RecipeBuilder::build`](crate::RecipeBuilder::build).
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum RecipeError {
    #[error("a target luminous reflectance of {}: {}", .0, not_an_lrv(*.0))]
    Lrv(f64),
    #[error("a target luminous reflectance belongs to reflectances, and this model is of illuminants")]
    LrvOfIlluminant,
    #[error("the grid {0} has no light that the eye sees, so nothing on it has a luminous reflectance")]
    Invisible(Grid),
    #[error("no reflectance of this model has a luminous reflectance of {lrv}: the largest is {largest:.6}")]
    UnreachableLrv { lrv: f64, largest: f64 },
    #[error("a target response of {sensor} of {response}: {}", not_an_lrv(*response))]
    Response { sensor: String, response: f64 },
    #[error(
        "a target response of {sensor} belongs to reflectances, and this model is of illuminants: scale them by an \
         intensity"
    )]
    ResponseOfIlluminant { sensor: String },
    #[error(
        "no reflectance of this model has a response of {sensor} of {response}: the largest is {largest:.6}"
    )]
    UnreachableResponse { sensor: String, response: f64, largest: f64 },
    #[error("a target response of {sensor} between {low} and {high}: the first must be below the second")]
    ResponseRange { sensor: String, low: f64, high: f64 },
    #[error(
        "a target luminous reflectance and a target response of {sensor}: a spectrum is scaled to one of them, so leave \
         the other out"
    )]
    TwoTargets { sensor: String },
    #[error(transparent)]
    Sensors(Box<SensorError>),
    #[error(transparent)]
    Illuminant(#[from] IlluminantError),
    #[error("a target luminous reflectance between {low} and {high}: the first must be below the second")]
    LrvRange { low: f64, high: f64 },
    #[error(
        "too few candidates would be accepted at the upper end of target {what} between {low} and \
         {high}: {}",
        hopeless(*acceptance, *max_attempts, "lower that end, or ask for one target, for which covers can propose")
    )]
    HopelessLrvRange { what: Box<str>, low: f64, high: f64, acceptance: f64, max_attempts: u32 },
    #[error(
        "no cover serves every target {what} between {low} and {high}, each of which bounds the spectrum \
         in its own way: let plain rejection propose, bound only the spectrum before scaling, or ask for one target"
    )]
    CoverOfLrvRange { what: Box<str>, low: f64, high: f64 },
    #[error("tristimulus values of {0:?}: they must be finite, and Y above 0 and below 1")]
    Xyz([f64; 3]),
    #[error("target tristimulus values belong to reflectances, and this model is of illuminants")]
    XyzOfIlluminant,
    #[error("target tristimulus values say what the luminous reflectance is: leave the target for it out")]
    XyzAndLrv,
    #[error(
        "target tristimulus values take 3 of the directions in which a model varies, and it needs 4 or more: fit it \
         with more components"
    )]
    TooFewDirections,
    #[error(
        "{other} beside responses that each draw is given: leave it out, for these say what the draws are like"
    )]
    GivenAnd { other: &'static str },
    #[error(
        "the {channels} responses of {name} that draws are given take as many directions in which a model varies, and this \
         one, of {components} components, has no other left or does not vary in all of them: fit it with more components"
    )]
    TooFewToGive { name: String, channels: usize, components: usize },
    #[error("{}", unreachable_xyz(*xyz, *nearest))]
    UnreachableXyz { xyz: [f64; 3], nearest: Option<[f64; 3]> },
    #[error("an intensity of {0}: it must be above 0, from 1e-30 to 1e30")]
    Intensity(f64),
    #[error(
        "an intensity between {low} and {high}: the second must be above the first, and at most 2^126 times it"
    )]
    IntensityRange { low: f64, high: f64 },
    #[error("an intensity belongs to illuminants, and this model is of reflectances")]
    IntensityOfReflectance,
    #[error(
        "this model does not hold what its data were divided by: fit it again, normalized, or give intensities"
    )]
    NoPowers,
    #[error("the quantity {quantity}: {reason}")]
    Quantity { quantity: Quantity, reason: &'static str },
    #[error("nothing is asked for: a recipe has at least one quantity")]
    Nothing,
    #[error(
        "an illuminant of {} where the model has {}",
        counted(*found as u64, "value", "values"),
        counted(*expected as u64, "band", "bands")
    )]
    Light { found: usize, expected: usize },
    #[error(
        "the illuminant that surfaces are seen under has no luminance, or a value that is negative or not finite"
    )]
    DarkLight,
    #[error("a covariance scale of {0}: it must be finite and not negative")]
    CovarianceScale(f64),
    #[error("a draw needs at least 1 attempt and at most 2147483647, not {0}")]
    MaxAttempts(u32),
    #[error(
        "the model has values of {value:e} where draws in f32 need {low:e} to {high:e}: fit it to rescaled or \
         normalised data"
    )]
    Scale { value: f64, low: f64, high: f64 },
    #[error(
        "spectra of up to {largest:.1e} do not fit float16, which loses digits below 6.1e-5: ask for float32, or for \
         brighter spectra"
    )]
    DimHalves { largest: f64 },
    #[error(
        "no spectrum of this model can be accepted: the bounds at {} leave no room",
        nanometres(wavelengths)
    )]
    Empty { wavelengths: Vec<f64> },
    #[error("{}", no_cover(*components))]
    NoCover { components: usize },
    #[error(
        "a {name} model and {other}: some of what is measured would be drawn more often than the rest; use the Gaussian \
         model of the same data"
    )]
    CentresAnd { name: &'static str, other: &'static str },
    #[error(
        "of the {count} normal distributions of this {name} model none has 1 spectrum in 64 that can be accepted: ask for \
         less extreme spectra, or use the Gaussian model of the same data"
    )]
    NoCentres { name: &'static str, count: usize },
    #[error("{0}")]
    Pointless(PointlessSetting),
    #[error(
        "too few candidates would be accepted: {}",
        hopeless(*acceptance, *max_attempts, "ask for less extreme spectra")
    )]
    Hopeless { acceptance: f64, max_attempts: u32 },
}

/// A setting that changes nothing without another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what they are
pub enum PointlessSetting {
    Bounds,
    Illuminant,
    Observer,
    Sensors,
    ResponseScale,
    WhiteResponseScale,
    XyzScale,
}

impl Display for PointlessSetting {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            PointlessSetting::Bounds => "a choice of bounds needs a target luminous reflectance",
            PointlessSetting::Illuminant => {
                "an illuminant for reflectances needs the quantity xyz, chromaticity, linear_srgb, lrv or responses of \
                 reflectances"
            }
            PointlessSetting::Observer => {
                "an observer needs the quantity xyz, chromaticity, linear_srgb or lrv, or a target of these"
            }
            PointlessSetting::Sensors => "a set of sensors needs the quantity responses",
            PointlessSetting::ResponseScale => "a scale of responses needs the quantity responses",
            PointlessSetting::WhiteResponseScale => {
                "a scale of responses relative to white needs reflectances: illuminants have none"
            }
            PointlessSetting::XyzScale => {
                "a scale of tristimulus values needs the quantity xyz or linear_srgb of illuminants"
            }
        })
    }
}

impl From<SensorError> for RecipeError {
    fn from(error: SensorError) -> RecipeError {
        RecipeError::Sensors(Box::new(error))
    }
}

/// The share of candidates that would be accepted, and what helps besides more attempts.
fn hopeless(acceptance: f64, max_attempts: u32, remedy: &str) -> String {
    if acceptance == 0.0 {
        return format!("none of {PILOT} was; {remedy}");
    }
    let needed = (TOLERABLE_FAILURE.ln() / (-acceptance).ln_1p()).ceil();
    format!(
        "about 1 draw in {} would find no acceptable spectrum in {max_attempts} {}; allow {needed:.0} attempts or more, \
         or {remedy}",
        one_in(1.0 / failure(acceptance, max_attempts)),
        if max_attempts == 1 { "attempt" } else { "attempts" },
    )
}

/// A number of draws as people say it.
fn one_in(draws: f64) -> String {
    if draws < 1e6 { format!("{draws:.0}") } else { format!("{draws:.0e}") }
}

/// Says what is wrong with a target luminous reflectance: most that is above 1 was meant in percent.
fn not_an_lrv(lrv: f64) -> String {
    match lrv {
        2.0..100.0 => format!(
            "it is a fraction between 0 and 1 (a perfect white); did you mean {}?",
            rounded(lrv / 100.0)
        ),
        0.0..1.0 if lrv > 0.0 => "the least is 1e-30".to_owned(),
        _ => "it is a fraction above 0 and below 1, which is a perfect white".to_owned(),
    }
}

/// Without the rounding error of a division.
fn rounded(value: f64) -> f64 {
    (value * 1e12).round() / 1e12
}

fn no_cover(components: usize) -> String {
    match components > MOST_COMPONENTS {
        true => format!(
            "covers are for models of up to {MOST_COMPONENTS} components, and this one has {components}: let plain \
             rejection propose, or fit fewer"
        ),
        false => "no cover was found for what this rule accepts: let plain rejection propose".to_owned(),
    }
}

fn unreachable_xyz(xyz: [f64; 3], nearest: Option<[f64; 3]>) -> String {
    let nearest = match nearest {
        Some([x, y, z]) => format!(
            "the nearest that can be drawn are X = {x}, Y = {y}, Z = {z} (by the largest of the differences)"
        ),
        None => "nor are any near them that can be drawn".to_owned(),
    };
    let [x, y, z] = xyz;
    format!("no reflectance of this model has the tristimulus values X = {x}, Y = {y}, Z = {z}: {nearest}")
}

fn nanometres(wavelengths: &[f64]) -> String {
    wavelengths.iter().map(|w| format!("{w} nm")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_luminous_reflectance_in_percent_is_told_from_others() {
        let message = |lrv| RecipeError::Lrv(lrv).to_string();
        assert!(message(40.0).ends_with("did you mean 0.4?"), "{}", message(40.0));
        assert!(message(7.0).ends_with("did you mean 0.07?"), "{}", message(7.0));
        assert!(message(1e-40).ends_with("the least is 1e-30"), "{}", message(1e-40));
        for lrv in [0.0, -1.0, 1.0, 100.0, f64::NAN] {
            assert!(message(lrv).ends_with("below 1, which is a perfect white"), "{}", message(lrv));
        }
    }

    #[test]
    fn a_hopeless_recipe_says_how_many_draws_fail_and_what_would_do() {
        let error = RecipeError::Hopeless { acceptance: 0.75, max_attempts: 1 }.to_string();
        assert!(
            error.contains("about 1 draw in 4 would find no acceptable spectrum in 1 attempt;"),
            "{error}"
        );
        assert!(error.contains("allow 20 attempts or more"), "{error}");
    }
}
