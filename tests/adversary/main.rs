//! Draws on devices that do all that WGSL and Vulkan allow with f32, without a GPU: the shipped text in its exact form has
//! the CPU's bytes on every one of them, and on none where a guard is missing.

mod lint;
mod machine;
mod metal;
mod tape;

use std::collections::BTreeMap;
use std::num::NonZeroUsize;

use lint::findings;
use machine::{Liberties, Machine};
use rayon::prelude::*;
use spectroll::{
    Arithmetic, Batch, BindingRole, Bounds, BuiltinTable, ComputeShader, Dataset, Dtype, Engine,
    EngineChoice, EngineError, Extrapolation, Fit, FitDistribution, Intensity, Layout, Model, ProposalKind,
    Quantity, Recipe, RecipeBuilder, Sensors, ShaderVariant, SpectrumKind, Stream,
};
use tape::Tape;

/// Draws that one machine makes before the next begins.
const CHUNK: u64 = 500;

fn exact() -> ShaderVariant {
    ShaderVariant { arithmetic: Arithmetic::Exact, ..ShaderVariant::default() }
}

fn builtin(name: &str) -> Model {
    Model::builtin(name).expect("it is built in")
}

fn surfaces() -> RecipeBuilder {
    Recipe::builder(&builtin("munsell-vrhel"))
}

fn lights() -> RecipeBuilder {
    Recipe::builder(&builtin("granada"))
}

/// Surfaces about three centres.
fn mixture() -> RecipeBuilder {
    Recipe::builder(&fit("400:10:700", 6, FitDistribution::Mixture(3)))
}

/// A model of Vrhel's reflectances.
fn fit(grid: &str, components: usize, distribution: FitDistribution) -> Model {
    let grid = grid.parse().expect("a grid");
    let data =
        Dataset::new(&[BuiltinTable::Vrhel.table()], grid, Extrapolation::Error).expect("they cover it");
    let fit = Fit::new(SpectrumKind::Reflectance).components(components).distribution(distribution);
    fit.fit(&data).expect("they have that rank")
}

/// Surfaces of 341 bands, which run in loops.
fn fine_surfaces() -> RecipeBuilder {
    Recipe::builder(&fit("390:1:730", 7, FitDistribution::Gaussian))
}

/// Recipes of every kind of text, all with every quantity that they can have.
fn recipes() -> Vec<(&'static str, Recipe)> {
    use Quantity::{Attempts, Chromaticity, LinearSrgb, Lrv, Spectra, Weights, Xyz};
    let all = [Spectra, Weights, Xyz, Chromaticity, LinearSrgb, Lrv, Attempts];
    let of = |builder: RecipeBuilder| builder.quantities(all).build().expect("it can be drawn");
    let intensity = Intensity::LogUniform(0.15, 150.0);
    let lit = |builder: RecipeBuilder| {
        let quantities = [Spectra, Weights, Xyz, Chromaticity, LinearSrgb, Quantity::Intensity, Attempts];
        builder.quantities(quantities).build().expect("it can be drawn")
    };
    vec![
        ("plain", of(surfaces())),
        ("lrv scaled", of(surfaces().lrv(0.4).bounds(Bounds::Scaled))),
        ("lrv base", of(surfaces().lrv(0.6).layout(Layout::Planes))),
        ("lrv each", of(surfaces().lrv(0.2..0.6).bounds(Bounds::Both).layout(Layout::PaddedRows))),
        ("halves", of(surfaces().lrv(0.6).bounds(Bounds::Both).spectra_dtype(Dtype::F16))),
        ("cover", of(surfaces().lrv(0.99).bounds(Bounds::Scaled))),
        ("kernel", of(Recipe::builder(&builtin("munsell-vrhel-kernel")))),
        ("mixture", of(mixture())),
        ("log-uniform", lit(lights().intensity(intensity))),
        ("of the data", lit(lights().intensity(Intensity::Data))),
        ("given", of(surfaces().given(Sensors::builtin("cie1931").expect("it is built in")))),
        ("looped", of(fine_surfaces())),
        ("looped lrv each", of(fine_surfaces().lrv(0.2..0.6).bounds(Bounds::Both))),
    ]
}

fn words(bytes: &[u8]) -> impl Iterator<Item = u32> {
    // The last word of an odd number of halves is half a word.
    bytes.chunks(4).map(|chunk| chunk.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte)))
}

/// The CPU engine, on the caller's thread.
fn engine() -> Engine {
    Engine::with_threads(&EngineChoice::Cpu, NonZeroUsize::new(1)).expect("a CPU")
}

/// Responses that draws are given: greys and what is near them.
fn colours(width: usize, first: u64, count: u64) -> Vec<f32> {
    let grey = |draw: u64| 0.2 + 0.3 * (draw % 97) as f32 / 97.0;
    let of = |draw| (0..width).map(move |channel| grey(draw) + 0.01 * channel as f32);
    (first..first + count).flat_map(of).collect()
}

/// The words of each output buffer, as the CPU makes them.
fn expected(engine: &Engine, recipe: &Recipe, stream: Stream, first: u64, count: u64) -> Vec<Vec<u32>> {
    let mut arrays = vec![Vec::new(); recipe.formats().len()];
    let mut session = engine.session(recipe).expect("the CPU draws");
    let draws = stream.draws(first..first + count);
    let sink = |batch: Batch| {
        for (array, format) in arrays.iter_mut().zip(batch.formats()) {
            array.extend(words(batch.bytes(format.quantity)));
        }
        Ok::<_, EngineError>(())
    };
    let drawn = match recipe.settings().given.as_ref().map_or(0, Sensors::len) {
        0 => session.draw(draws, sink),
        width => session.draw_given(draws, &colours(width, first, count), sink),
    };
    drawn.expect("the CPU draws");
    arrays
}

/// Buffers of a machine for a range of draws.
fn buffers(
    shader: &ComputeShader,
    stream: Stream,
    first: u64,
    count: u64,
    bindings: &[u32],
) -> Vec<Vec<u32>> {
    let role =
        |binding: &u32| shader.bindings().iter().find(|b| b.binding == *binding).expect("it is listed").role;
    let words = |role| match role {
        BindingRole::Parameters => {
            bytemuck::cast_slice(&shader.parameters(stream.draws(first..first + count), count)).to_vec()
        }
        BindingRole::Given => {
            let width = shader.bytes(BindingRole::Given, 4) as usize / 16;
            colours(width, first, count.next_multiple_of(2)).into_iter().map(f32::to_bits).collect()
        }
        role => match shader.contents(role) {
            Some(bytes) => bytemuck::cast_slice(bytes).to_vec(),
            None => vec![0; (shader.bytes(role, count) / 4) as usize],
        },
    };
    bindings.iter().map(|binding| words(role(binding))).collect()
}

/// Number of draws of which a value differs from the CPU's. Those of halves count by two, which share words.
fn differing(recipe: &Recipe, shader: &ComputeShader, text: &str, liberties: Liberties, count: u64) -> u64 {
    let tape = Tape::new(text);
    let stream = Stream::named(20_261_126, "adversary");
    let draws_per_thread = shader.draws_per_workgroup() / u64::from(ComputeShader::WORKGROUP_SIZE);
    let chunk = |number: u64| {
        let engine = engine();
        let first = number * CHUNK;
        let size = CHUNK.min(count - first);
        let expected = expected(&engine, recipe, stream, first, size);
        let mut machine =
            Machine::new(&tape, liberties, buffers(shader, stream, first, size, &tape.bindings));
        (0..size.div_ceil(draws_per_thread)).for_each(|thread| machine.run(thread as u32));
        let mut differs = vec![false; size as usize];
        for (format, expected) in recipe.formats().iter().zip(&expected) {
            let role = BindingRole::Output(format.quantity);
            let binding =
                shader.bindings().iter().find(|binding| binding.role == role).expect("it is listed");
            let at = tape.bindings.iter().position(|b| *b == binding.binding).expect("the text has it");
            let found = &machine.buffers[at];
            let words = expected.len();
            let plane = words / format.planes();
            let row = (format.stride() * format.dtype.size()).div_ceil(4).max(1);
            let differing = (0..words).filter(|&word| found[word] != expected[word]);
            for word in differing {
                let draw = word % plane / row;
                if let Some(differs) = differs.get_mut(draw) {
                    *differs = true;
                }
            }
        }
        differs.into_iter().filter(|&differs| differs).count() as u64
    };
    (0..count.div_ceil(CHUNK)).into_par_iter().map(chunk).sum()
}

/// Number of differing draws of a recipe in one of its forms.
fn of_form(recipe: &Recipe, arithmetic: Arithmetic, liberties: Liberties, count: u64) -> u64 {
    let variant = ShaderVariant { arithmetic, ..ShaderVariant::default() };
    let shader = recipe.compute_shader(variant).expect("it has few bands");
    differing(recipe, &shader, shader.text(), liberties, count)
}

const MODES: [(&str, Liberties); 3] = [
    ("all", Liberties::ALL),
    ("all always", Liberties::ALL.and(Liberties::ALWAYS)),
    ("all, looser", Liberties::ALL.and(Liberties::LOOSER)),
];

#[test]
fn without_liberties_both_forms_have_the_bytes_of_the_cpu() {
    for (name, recipe) in recipes() {
        for arithmetic in [Arithmetic::Plain, Arithmetic::Exact] {
            assert_eq!(of_form(&recipe, arithmetic, Liberties::NONE, 400), 0, "{name}, {arithmetic}");
        }
    }
}

#[test]
fn the_exact_form_has_the_bytes_of_the_cpu_whatever_a_device_does() {
    for (name, recipe) in recipes() {
        let count = if name.starts_with("looped") { 200 } else { 1000 };
        for (mode, liberties) in MODES {
            assert_eq!(of_form(&recipe, Arithmetic::Exact, liberties, count), 0, "{name}, {mode}");
        }
    }
}

/// A million draws of each kind, and a tenth of that in the other modes; part of `make exhaustive`.
#[test]
#[ignore = "takes an hour"]
fn a_million_draws_of_each_kind_have_the_bytes_of_the_cpu() {
    for (number, (mode, liberties)) in MODES.into_iter().enumerate() {
        for (name, recipe) in recipes() {
            let count = if number == 0 { 1_000_000 } else { 100_000 };
            let start = std::time::Instant::now();
            let off = of_form(&recipe, Arithmetic::Exact, liberties, count);
            let seconds = start.elapsed().as_secs_f64();
            println!("{name}, {mode}: {off} of {count} draws differ ({seconds:.0} s)");
            assert_eq!(off, 0, "{name}, {mode}");
        }
    }
}

/// Each liberty changes draws of the plain form, so that none is an empty threat.
#[test]
fn every_liberty_changes_plain_draws() {
    let recipe = surfaces().lrv(0.4).bounds(Bounds::Scaled).build().expect("it can be drawn");
    for (name, liberty) in [
        ("fusion", Liberties::FUSE),
        ("order", Liberties::REORDER),
        ("roots and quotients", Liberties::LOOSE),
        ("conversions", Liberties::CONVERT),
    ] {
        let off = of_form(&recipe, Arithmetic::Plain, liberty, 2000);
        println!("{name}: {off} of 2000 plain draws differ");
        assert!(off > 0, "{name}");
    }
}

/// The exact text with one kind of guard taken out.
fn without(text: &str, guard: &str) -> String {
    let (from, to) = match guard {
        "rounded" => ("return bitcast<f32>(bitcast<u32>(x) ^ parameters.zero);", "return x;"),
        "root" => (
            "fn root(x: f32) -> f32 {\n",
            "fn root(x: f32) -> f32 {\n    return sqrt(x);\n}\nfn old_root(x: f32) -> f32 {\n",
        ),
        "ratio" => (
            "fn ratio(a: f32, b: f32) -> f32 {\n",
            "fn ratio(a: f32, b: f32) -> f32 {\n    return a / b;\n}\nfn old_ratio(a: f32, b: f32) -> f32 {\n",
        ),
        "float_of" => ("return rounded(f32(i >> 16u) * 65536f + f32(i & 0xFFFF));", "return f32(i);"),
        other => panic!("no guard is {other}"),
    };
    assert_eq!(text.matches(from).count(), 1, "{guard}");
    text.replace(from, to)
}

#[test]
fn no_kind_of_guard_can_be_spared() {
    let recipe = surfaces().lrv(0.4).bounds(Bounds::Scaled).build().expect("it can be drawn");
    let shader = recipe.compute_shader(exact()).expect("it has few bands");
    assert_eq!(differing(&recipe, &shader, shader.text(), Liberties::ALL, 2000), 0);
    for guard in ["rounded", "root", "ratio", "float_of"] {
        let text = without(shader.text(), guard);
        let off = differing(&recipe, &shader, &text, Liberties::ALL, 2000);
        println!("without {guard}: {off} of 2000 draws differ");
        assert!(off > 0, "{guard}");
    }
    for (guards, seen) in [("products", Liberties::SEE_PRODUCTS), ("sums", Liberties::SEE_SUMS)] {
        let off = differing(&recipe, &shader, shader.text(), Liberties::ALL.and(seen), 2000);
        println!("without the guards of {guards}: {off} of 2000 draws differ");
        assert!(off > 0, "{guards}");
    }
}

#[test]
fn no_operation_of_the_exact_form_can_be_joined_with_another() {
    for (name, recipe) in recipes() {
        let of = |arithmetic| {
            let variant = ShaderVariant { arithmetic, ..ShaderVariant::default() };
            findings(&Tape::new(recipe.compute_shader(variant).expect("it has few bands").text()))
        };
        let (plain, exact) = (of(Arithmetic::Plain), of(Arithmetic::Exact));
        println!("{name}: {} findings in the plain form, {} in the exact one", plain.len(), exact.len());
        assert!(plain.len() > 20 && exact.is_empty(), "{name}: {exact:?}");
    }
}

/// Recipes of few bands and quantities, whose texts have every guard all the same.
fn small_recipes() -> Vec<(&'static str, Recipe)> {
    let [surface, light] = ["munsell-vrhel", "granada"].map(|name| {
        let grid = "400:50:700".parse().expect("a grid");
        Recipe::builder(&Model::builtin_at(name, grid).expect("its data have these wavelengths"))
    });
    let of = |builder: RecipeBuilder| {
        builder
            .quantities([Quantity::Spectra, Quantity::Xyz, Quantity::Attempts])
            .build()
            .expect("it can be drawn")
    };
    let cover = surface.clone().covariance_scale(25.0).proposal(ProposalKind::Cover);
    let kernel = |grid: &str, components| {
        let model = Model::builtin_with("munsell-vrhel-kernel", grid.parse().expect("a grid"), components);
        Recipe::builder(&model.expect("its data have these wavelengths"))
    };
    vec![
        ("lrv each", of(surface.clone().lrv(0.2..0.6).bounds(Bounds::Both))),
        ("lrv base", of(surface.lrv(0.6).spectra_dtype(Dtype::F16))),
        ("cover", of(cover)),
        ("kernel", of(kernel("400:50:700", 6))),
        ("looped kernel", of(kernel("400:1:700", 8))),
        ("log-uniform", of(light.intensity(Intensity::LogUniform(0.15, 150.0)))),
        ("looped lrv each", of(fine_surfaces().lrv(0.2..0.6).bounds(Bounds::Both))),
    ]
}

/// Each guard, taken out in turn, is missed, but for a few after which nothing follows that could be joined with them.
#[test]
fn every_guard_that_is_missing_is_found() {
    let mut unmissed: BTreeMap<String, usize> = BTreeMap::new();
    let mut missed = 0;
    for (name, recipe) in small_recipes() {
        let text = recipe.compute_shader(exact()).expect("it has few bands").text().to_owned();
        // One band and one value of each quantity stand for all.
        let representative = |at: usize| {
            let head = text[..at].rfind("fn ").expect("it is in a function");
            let function = text[head + 3..].split('(').next().expect("it has a name");
            let number: String = function.chars().filter(char::is_ascii_digit).collect();
            (number.is_empty() || number == "1").then(|| function.to_owned())
        };
        let reached = Tape::new(&text).functions;
        let guards = text.match_indices("rounded(").filter(|(at, _)| !text[..*at].ends_with("fn "));
        for (at, guard) in guards {
            let Some(function) = representative(at).filter(|name| reached.contains(name)) else { continue };
            let bare = format!("{}({}", &text[..at], &text[at + guard.len()..]);
            if findings(&Tape::new(&bare)).is_empty() {
                *unmissed.entry(format!("{name}: {function}")).or_default() += 1;
            } else {
                missed += 1;
            }
        }
    }
    println!("{missed} guards are missed; not: {unmissed:?}");
    assert!(missed > 150);
    // Operations after which only an integer follows, or a store, and products by a power of two.
    let spared = ["band1", "xyz_1", "circle", "uniform_of", "tails"];
    let is_spared =
        |(place, &count): (&String, &usize)| count <= 2 && spared.iter().any(|name| place.ends_with(name));
    assert!(unmissed.iter().all(is_spared), "{unmissed:?}");
}

/// What naga writes for Metal, which leaves fast math on, by a compiler that has it too.
#[test]
fn metal_by_a_fast_compiler_has_the_bytes_of_the_cpu_in_the_exact_form_alone() {
    if !metal::has_compiler() {
        println!("skipped: there is no g++");
        return;
    }
    let strict = "-O2 -ffp-contract=off";
    let fast = "-Ofast -march=native -mrecip -ffp-contract=fast";
    let kinds = ["plain", "lrv scaled", "cover", "log-uniform", "looped lrv each"];
    for (name, recipe) in recipes().into_iter().filter(|(name, _)| kinds.contains(name)) {
        let count = if name.starts_with("looped") { 500 } else { 5000 };
        let folder = tempfile::tempdir().expect("a folder");
        let of = |arithmetic, options| metal::differing(&recipe, arithmetic, options, count, folder.path());
        let plain = [strict, fast].map(|options| of(Arithmetic::Plain, options));
        let exact = [strict, fast].map(|options| of(Arithmetic::Exact, options));
        println!("{name}: of {count} draws differ {plain:?} in the plain form, {exact:?} in the exact one");
        assert!(plain[0] == 0 && plain[1] > 0 && exact == [0, 0], "{name}");
    }
}
