//! What comes out of a draw, quantity by quantity and layout by layout: the same bytes from every engine, and the
//! values that f64 gives for the same random words.

mod engines;

use engines::{cpu, forms, gpu, gpu_is_software, kernel_surfaces, lamps, lights, surfaces};
use spectroll::{
    ArrayFormat, Bounds, DrawRange, Dtype, Engine, EngineError, Illuminant, Intensity, Layout, Lrv,
    ProposalKind, Quantity, Recipe, RecipeBuilder, Stream, XyzScale, colorimetry,
};

/// Draws of each recipe: not a multiple of 4, so that planes have padding and pairs a half.
const COUNT: u64 = 20_003;

/// The largest error of a value, in parts of the largest value of its quantity in the same draw (of Y, for sRGB; of 1,
/// for weights). What sets it are the darkest draws, and the components of saturated colours, which are small
/// differences.
const BOUND: f64 = 2e-5;

fn all_but(quantity: Quantity) -> impl Iterator<Item = Quantity> {
    Quantity::ALL.iter().copied().filter(move |q| *q != quantity)
}

/// Recipes that ask for all that they can.
fn recipes() -> Vec<(&'static str, Recipe)> {
    let reflected = |builder: RecipeBuilder| builder.quantities(all_but(Quantity::Intensity));
    let shining = |builder: RecipeBuilder| builder.quantities(all_but(Quantity::Lrv));
    let recipes = [
        ("reflectances", reflected(surfaces())),
        ("reflectances under A", reflected(surfaces()).illuminant(Illuminant::A)),
        ("LRV 0.4", reflected(surfaces()).lrv(0.4)),
        ("LRV 0.6, scaled", reflected(surfaces()).lrv(0.6).bounds(Bounds::Scaled)),
        ("LRV of its own", reflected(surfaces()).lrv(0.2..0.6)),
        ("LRV of its own, both", reflected(surfaces()).lrv(0.2..0.8).bounds(Bounds::Both)),
        (
            "LRV of its own, from a cover",
            reflected(surfaces()).lrv(0.2..0.6).covariance_scale(25.0).proposal(ProposalKind::Cover),
        ),
        ("kernel", reflected(kernel_surfaces())),
        ("kernel, LRV 0.6, scaled", reflected(kernel_surfaces()).lrv(0.6).bounds(Bounds::Scaled)),
        ("kernel, LRV of its own", reflected(kernel_surfaces()).lrv(0.2..0.6)),
        ("lights of a mixture", shining(lamps()).intensity(Intensity::LogUniform(0.15, 150.0))),
        ("log-uniform lights", shining(lights()).intensity(Intensity::LogUniform(0.15, 150.0))),
        ("measured lights", shining(lights()).intensity(Intensity::Data)),
        ("lights of intensity 3", shining(lights()).intensity(Intensity::Fixed(3.0))),
        (
            "lights of Y = 1",
            shining(lights()).intensity(Intensity::LogUniform(1e-6, 1e6)).xyz_scale(XyzScale::UnitY),
        ),
    ];
    recipes.map(|(name, builder)| (name, builder.build().unwrap_or_else(|e| panic!("{name}: {e}")))).into()
}

/// The bytes of each quantity of each window, padding left out.
fn values(engine: &Engine, recipe: &Recipe, draws: DrawRange) -> Vec<(ArrayFormat, Vec<u32>)> {
    let mut all: Vec<(ArrayFormat, Vec<u32>)> = Vec::new();
    let made = engine.draw(recipe, draws, |batch| {
        all.resize_with(batch.formats().len(), || (batch.formats()[0], Vec::new()));
        for (format, (slot, words)) in batch.formats().iter().zip(&mut all) {
            *slot = *format;
            let bytes = batch.bytes(format.quantity);
            for (i, j) in (0..batch.draws.count as usize).flat_map(|i| (0..format.width).map(move |j| (i, j)))
            {
                let at = match format.layout {
                    Layout::Planes => j * batch.draws.count.next_multiple_of(4) as usize + i,
                    _ => i * format.stride() + j,
                };
                words.push(match format.dtype {
                    Dtype::F16 => u16::from_le_bytes([bytes[2 * at], bytes[2 * at + 1]]).into(),
                    _ => u32::from_le_bytes(bytes[4 * at..4 * at + 4].try_into().expect("there are 4")),
                });
            }
        }
        Ok::<_, EngineError>(())
    });
    made.unwrap_or_else(|e| panic!("{engine}: {e}"));
    all
}

#[test]
fn every_layout_has_the_same_values_on_every_engine() {
    let software = gpu_is_software();
    let layouts = [Layout::Rows, Layout::PaddedRows, Layout::Planes];
    for (i, layout) in layouts.into_iter().enumerate() {
        for half in [false, true] {
            let ask = |builder: RecipeBuilder| {
                let builder = builder.layout(layout);
                (if half { builder.spectra_dtype(Dtype::F16) } else { builder })
                    .build()
                    .expect("it can be drawn")
            };
            let recipes = [
                ask(surfaces().quantities(all_but(Quantity::Intensity)).lrv(0.4)),
                ask(surfaces()
                    .quantities(all_but(Quantity::Intensity))
                    .lrv(0.2..0.8)
                    .bounds([Bounds::Base, Bounds::Scaled, Bounds::Both][i])),
                ask(lights().quantities(all_but(Quantity::Lrv)).intensity(
                    [Intensity::LogUniform(0.1, 10.0), Intensity::Data, Intensity::Fixed(2.0)][i],
                )),
            ];
            for recipe in recipes {
                let draws = Stream::new(30).draws(5..5 + COUNT);
                let ours = values(cpu(), &recipe, draws);
                for engine in forms() {
                    let is_same = ours == values(engine, &recipe, draws);
                    assert!(is_same || !software, "{layout:?}, half: {half}, {:?}", engine.verdict());
                }
                let padded = ours.iter().all(|(format, words)| words.len() == format.width * COUNT as usize);
                assert!(padded, "{layout:?}");
            }
        }
    }
}

#[test]
fn every_recipe_has_the_same_values_on_every_engine() {
    let software = gpu_is_software();
    for (name, recipe) in recipes() {
        let draws = Stream::named(31, name).draws(0..COUNT);
        let ours = values(cpu(), &recipe, draws);
        for engine in forms() {
            assert!(!software || ours == values(engine, &recipe, draws), "{name}, {:?}", engine.verdict());
        }
    }
}

/// One quantity alone is what it is among all.
#[test]
fn quantities_do_not_depend_on_their_company() {
    let all = surfaces().quantities(all_but(Quantity::Intensity)).lrv(0.4).build().expect("it can be drawn");
    let draws = Stream::new(32).draws(0..1000);
    for (format, words) in values(cpu(), &all, draws) {
        let alone = surfaces().quantities([format.quantity]).lrv(0.4).build().expect("it can be drawn");
        for engine in [cpu(), gpu()] {
            let found = values(engine, &alone, draws);
            let found = found.iter().find(|(f, _)| f.quantity == format.quantity);
            assert!(found == Some(&(format, words.clone())), "{} on {engine}", format.quantity);
        }
    }
}

/// Spectra in the caller's memory are those of the windows, put end to end.
#[test]
fn what_is_filled_is_what_is_drawn() {
    let draws = Stream::new(35).draws(9..9 + COUNT);
    for layout in [Layout::Rows, Layout::PaddedRows] {
        let recipe = surfaces().quantities(all_but(Quantity::Intensity)).layout(layout).build();
        let recipe = recipe.expect("it can be drawn");
        for engine in [cpu(), gpu()] {
            let mut windows = Vec::new();
            let summary = engine.draw(&recipe, draws, |batch| {
                windows.extend_from_slice(batch.spectra());
                Ok::<_, EngineError>(())
            });
            let mut filled = vec![1.0; windows.len()];
            let mut session = engine.session(&recipe).expect("the engine works");
            if layout == Layout::PaddedRows {
                filled.fill(0.0); // the CPU leaves padding as it is
            }
            assert_eq!(session.fill(draws, &mut filled), summary);
            assert!(filled == windows, "{engine}");
        }
    }
}

/// A program in loops has the same quantities, too.
#[test]
fn programs_in_loops_have_the_same_values_on_every_engine() {
    use spectroll::{BuiltinTable, Dataset, Extrapolation, Fit, SpectrumKind};
    const LRVS: [Lrv; 2] = [Lrv::Fixed(0.4), Lrv::Uniform(0.2, 0.6)];
    let grid = "390:1:730".parse().expect("a grid");
    let data = Dataset::new(&[BuiltinTable::Vrhel.table()], grid, Extrapolation::Error)
        .expect("the table covers it");
    let model =
        Fit::new(SpectrumKind::Reflectance).components(7).fit(&data).expect("the data have that rank");
    let software = gpu_is_software();
    for layout in [Layout::Rows, Layout::PaddedRows, Layout::Planes] {
        for (half, lrv) in [false, true].into_iter().flat_map(|half| LRVS.map(|lrv| (half, lrv))) {
            let builder =
                Recipe::builder(&model).quantities(all_but(Quantity::Intensity)).lrv(lrv).layout(layout);
            let builder = if half { builder.spectra_dtype(Dtype::F16) } else { builder };
            let recipe = builder.build().expect("it can be drawn");
            let draws = Stream::new(33).draws(0..1003);
            let ours = values(cpu(), &recipe, draws);
            for engine in forms() {
                let is_same = ours == values(engine, &recipe, draws);
                assert!(!software || is_same, "{layout:?}, half: {half}, {lrv:?}, {:?}", engine.verdict());
            }
        }
    }
}

/// Against f64, and against what the f64 spectrum itself says: each quantity's largest error over the draws, in parts
/// of its own largest value.
#[test]
fn values_are_those_of_f64() {
    for (name, recipe) in recipes() {
        let grid = recipe.model().grid();
        let under_a = name.ends_with('A').then(|| colorimetry::illuminant_a(grid));
        let xyz_weights = match name.contains("lights") {
            true => colorimetry::cmf(grid).map(|f| f.iter().map(|v| v * grid.widths()[0]).collect()),
            false => {
                let light = under_a.unwrap_or_else(|| colorimetry::d65(grid));
                colorimetry::xyz_weights_under(&light, grid).expect("the grid is visible")
            }
        };
        let (mut worst, mut of_white) = ([0f64; Quantity::ALL.len()], 0f64);
        let stream = Stream::named(34, name);
        let (single, double) = (recipe.scalar_sampler::<f32>(), recipe.scalar_sampler::<f64>());
        for index in 0..COUNT {
            let (ours, exact) = (single.draw(stream, index), double.draw(stream, index));
            if ours.status() != exact.status() {
                continue; // flips are counted elsewhere
            }
            let dot = |w: &Vec<f64>| w.iter().zip(exact.spectrum()).map(|(w, s)| w * s).sum::<f64>();
            let mut xyz = xyz_weights.each_ref().map(dot);
            if name.ends_with("Y = 1") {
                xyz = xyz.map(|v| v / xyz[1]);
            }
            let srgb = colorimetry::linear_srgb(xyz);
            let chromaticity = [0, 1].map(|i| xyz[i] / xyz.iter().sum::<f64>());
            for format in recipe.formats() {
                let quantity = format.quantity;
                let expected = match quantity {
                    Quantity::Xyz => &xyz[..],
                    Quantity::LinearSrgb => &srgb[..],
                    Quantity::Chromaticity => &chromaticity[..],
                    _ => exact.values(quantity),
                };
                let peak = match quantity {
                    // Components of a saturated colour are small differences.
                    Quantity::LinearSrgb => xyz[1],
                    Quantity::Weights => 1.0,
                    _ => expected.iter().fold(0.0, |a: f64, v| a.max(v.abs())),
                };
                for (a, b) in ours.values(quantity).iter().zip(expected) {
                    let error = (f64::from(*a) - b).abs() / peak;
                    worst[quantity as usize] = worst[quantity as usize].max(error);
                    if name.starts_with("reflectances") && [Quantity::Xyz, Quantity::Lrv].contains(&quantity)
                    {
                        of_white = of_white.max(error * peak);
                    }
                }
                for (a, b) in exact.values(quantity).iter().zip(expected) {
                    assert!((a - b).abs() <= 1e-11 * peak.max(1.0), "{name}: {quantity} {a} {b}");
                }
            }
        }
        let listed = recipe.formats().into_iter().map(|f| f.quantity).filter(|q| *q != Quantity::Attempts);
        let listed: Vec<_> = listed.map(|q| format!("{q} {:.1e}", worst[q as usize])).collect();
        println!("{name}: {}", listed.join(", "));
        for quantity in Quantity::ALL.iter().copied() {
            assert!(worst[quantity as usize] < BOUND, "{name}: {quantity} {:e}", worst[quantity as usize]);
        }
        // Of a white that is 1, whatever the surface reflects.
        assert!(of_white < 5e-7, "{name}: {of_white:e} of white");
    }
}

/// Spectra in 16 bits that would lose their digits: what they may be is known before they are drawn.
#[test]
fn dim_spectra_are_not_asked_for_in_sixteen_bits() {
    let halves = |recipe: RecipeBuilder| recipe.spectra_dtype(Dtype::F16).build().map(|_| ());
    let dim = lights().intensity(Intensity::LogUniform(1e-12, 1.0));
    let error = halves(dim.clone()).expect_err("some are dim").to_string();
    assert!(
        error.contains("do not fit float16, which loses digits below 6.1e-5: ask for float32"),
        "{error}"
    );
    for recipe in
        [lights().intensity(Intensity::Fixed(1e-6)), surfaces().lrv(1e-6), surfaces().lrv(1e-6..0.5)]
    {
        assert!(halves(recipe).is_err());
    }
    for recipe in [lights().intensity(Intensity::LogUniform(1e-3, 1.0)), surfaces(), surfaces().lrv(1e-3)] {
        assert_eq!(halves(recipe), Ok(()));
    }
    // In 32 bits they fit, and where there are no spectra nothing has to.
    assert!(dim.clone().build().is_ok());
    assert_eq!(halves(dim.quantities([Quantity::Xyz])), Ok(()));
}
