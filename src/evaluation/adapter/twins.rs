//! Draws of every kind of recipe in both forms of arithmetic, beside those of the CPU.

use serde::Serialize;

use super::AdapterError;
use crate::colorimetry::Illuminant;
use crate::dataset::{BuiltinTable, Dataset, SpectrumKind};
use crate::engine::{ArithmeticChoice, Batch, Engine, EngineChoice, EngineError};
use crate::grid::Extrapolation;
use crate::model::{Fit, FitDistribution, Model};
use crate::program::Bounds;
use crate::quantity::{Dtype, Layout, Quantity};
use crate::random::stream::Stream;
use crate::recipe::{Intensity, Recipe, RecipeBuilder};
use crate::wgsl::Arithmetic;

/// Number of draws of a recipe; of those that run in loops, a part of it.
const DRAWS: u64 = 1 << 16;

/// Draws of a recipe on an adapter, beside those of the CPU.
#[derive(Clone, Debug, Serialize)]
pub struct Twin {
    /// Kind of the recipe.
    pub recipe: &'static str,
    /// Form of arithmetic.
    pub arithmetic: Arithmetic,
    /// Number of draws.
    pub draws: u64,
    /// Number of draws of which a byte differs.
    pub differing: u64,
}

/// Recipes of every kind, in rows.
fn recipes() -> Result<Vec<(&'static str, Recipe)>, AdapterError> {
    let model = |name| Model::builtin(name).expect("it is built in");
    let surfaces = || Recipe::builder(&model("munsell-vrhel"));
    let lights = || Recipe::builder(&model("granada"));
    let fitted = |grid: &str, components, distribution| {
        let grid = grid.parse().expect("it is a grid");
        let data = Dataset::new(&[BuiltinTable::Vrhel.table()], grid, Extrapolation::Error);
        let fit = Fit::new(SpectrumKind::Reflectance).components(components).distribution(distribution);
        fit.fit(&data.expect("the table has these wavelengths")).expect("it has that rank")
    };
    let fine = fitted("390:1:730", 40, FitDistribution::Gaussian);
    let fine_kernel = fitted("390:1:730", 40, FitDistribution::Kernel(Some(0.3)));
    let mixture = fitted("400:10:700", 6, FitDistribution::Mixture(3));
    let everything = Quantity::ALL.iter().copied();
    let all = everything.filter(|q| !matches!(q, Quantity::Intensity | Quantity::Responses));
    let of_lights = [Quantity::Spectra, Quantity::Xyz, Quantity::Intensity, Quantity::Attempts];
    let builders: Vec<(&str, RecipeBuilder)> = vec![
        ("reflectances", surfaces().quantities(all.clone())),
        ("illuminants", lights().quantities([Quantity::Spectra, Quantity::Xyz, Quantity::Attempts])),
        ("LRV, base", surfaces().lrv(0.6)),
        ("LRV, scaled", surfaces().lrv(0.4).bounds(Bounds::Scaled).quantities(all.clone())),
        ("LRV, both", surfaces().lrv(0.6).bounds(Bounds::Both)),
        ("an LRV for each draw", surfaces().lrv(0.2..0.6).bounds(Bounds::Both).quantities(all)),
        ("cover", surfaces().lrv(0.99).bounds(Bounds::Scaled)),
        ("kernel", Recipe::builder(&model("munsell-vrhel-kernel"))),
        ("mixture", Recipe::builder(&mixture)),
        ("XYZ", surfaces().xyz([0.3, 0.3, 0.3])),
        (
            "log-uniform intensity",
            lights().intensity(Intensity::LogUniform(0.15, 150.0)).quantities(of_lights),
        ),
        ("intensity of the data", lights().intensity(Intensity::Data).quantities(of_lights)),
        ("XYZ under A", surfaces().illuminant(Illuminant::A).quantities([Quantity::Xyz])),
        ("16 bits", surfaces().spectra_dtype(Dtype::F16)),
        ("padded rows", surfaces().layout(Layout::PaddedRows)),
        ("loops", Recipe::builder(&fine)),
        ("loops, kernel", Recipe::builder(&fine_kernel)),
        ("loops, LRV", Recipe::builder(&fine).lrv(0.4).bounds(Bounds::Scaled)),
    ];
    builders.into_iter().map(|(name, builder)| Ok((name, builder.build()?))).collect()
}

/// Draws every recipe in both forms.
pub(super) fn measure(
    choice: &EngineChoice,
    say: &dyn Fn(&str) -> Result<(), AdapterError>,
) -> Result<Vec<Twin>, AdapterError> {
    let forms = [(Arithmetic::Plain, ArithmeticChoice::Plain), (Arithmetic::Exact, ArithmeticChoice::Exact)];
    let cpu = Engine::new(&EngineChoice::Cpu)?;
    let mut twins = Vec::new();
    for (recipe, built) in recipes()? {
        let draws = if recipe.starts_with("loops") { DRAWS / 16 } else { DRAWS };
        let expected = rows(&cpu, &built, draws)?;
        for (arithmetic, form) in forms {
            say(&format!("draws beside those of the CPU: {recipe}, {arithmetic} arithmetic"))?;
            let found = rows(&Engine::new(choice)?.with_arithmetic(form), &built, draws)?;
            let differs = |draw: &usize| {
                let row = |(bytes, width): &(Vec<u8>, usize)| bytes[draw * width..][..*width].to_vec();
                expected.iter().zip(&found).any(|(ours, theirs)| row(ours) != row(theirs))
            };
            let differing = (0..draws as usize).filter(differs).count() as u64;
            twins.push(Twin { recipe, arithmetic, draws, differing });
        }
    }
    Ok(twins)
}

/// Bytes of each quantity of some draws, and those of a row.
fn rows(engine: &Engine, recipe: &Recipe, draws: u64) -> Result<Vec<(Vec<u8>, usize)>, EngineError> {
    let mut all = Vec::new();
    engine.draw(recipe, Stream::named(0, "adapter").draws(0..draws), |batch: Batch| {
        all.resize_with(batch.formats().len(), || (Vec::new(), 0));
        for (format, (bytes, width)) in batch.formats().iter().zip(&mut all) {
            *width = format.stride() * format.dtype.size();
            bytes.extend_from_slice(&batch.bytes(format.quantity)[..*width * batch.draws.count as usize]);
        }
        Ok::<_, EngineError>(())
    })?;
    Ok(all)
}
