//! The generator's fragments on an adapter, function by function, against their CPU twins: where a draw differs,
//! these say which part of it does.

use crate::dataset::{BuiltinTable, Dataset, SpectrumKind};
use crate::engine::compute::{Compute, Words};
use crate::engine::{Engine, EngineChoice};
use crate::grid::{Extrapolation, Grid};
use crate::model::{Fit, Model};
use crate::program::Bounds;
use crate::quantity::Quantity;
use crate::random::normal::{circle, radius};
use crate::random::philox::{KNOWN_ANSWERS, philox};
use crate::random::stream::Stream;
use crate::random::truncated::truncated;
use crate::recipe::{Intensity, Recipe};
use crate::wgsl::guards::{Zero, written};
use crate::wgsl::{Arithmetic, Dialect, ModuleOptions, TableStorage, generator, table_words};

/// Runs `body` for each `i` on the best adapter, and returns `output`.
fn run(target: Dialect, body: &str, input: &[u32], output_words: usize) -> Option<Vec<u32>> {
    run_with(target, "", &[], body, input, output_words)
}

/// Runs `body` as [`run`] does, with fragments of its own, and a buffer for them at binding 2 unless it would be
/// empty.
fn run_with(
    target: Dialect,
    fragments: &str,
    table: &[u32],
    body: &str,
    input: &[u32],
    output_words: usize,
) -> Option<Vec<u32>> {
    let engine = Engine::new(&EngineChoice::Gpu).expect("these tests need an adapter");
    let (device, queue) = engine.device().expect("the engine is a GPU's");
    if target != Dialect::Baseline && !device.features().contains(wgpu::Features::SHADER_INT64) {
        return None;
    }
    let text = format!(
        "{}
{fragments}
@group(0) @binding(0) var<storage, read> input: array<u32>;
@group(0) @binding(1) var<storage, read_write> output: array<u32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{ let i = id.x; {body} }}",
        generator(target)
    );
    let compute = Compute::new(
        device,
        queue,
        text,
        &[Words::Given(input), Words::Written(output_words), Words::Given(table)],
    );
    compute.run(&compute.pipeline("main"), output_words as u32);
    Some(compute.read(1))
}

const PHILOX: &str = "if i < arrayLength(&output) / 4u {
    let w = philox(vec4(input[6u*i], input[6u*i+1u], input[6u*i+2u], input[6u*i+3u]), vec2(input[6u*i+4u], input[6u*i+5u]));
    output[4u*i] = w.x; output[4u*i+1u] = w.y; output[4u*i+2u] = w.z; output[4u*i+3u] = w.w;
}";

/// The vectors of Random123, and 10,000 counters and keys that are themselves random.
#[test]
fn philox_gives_the_known_answers_in_both_multiplications() {
    let stream = Stream::new(9);
    let random = (0..10_000).map(|i| {
        let [[a, b, c, d], [e, f, ..]] = [0, 1].map(|block| stream.block(i, 0, block));
        ([a, b, c, d], [e, f])
    });
    let cases: Vec<_> = KNOWN_ANSWERS.iter().map(|&(counter, key, _)| (counter, key)).chain(random).collect();
    let input: Vec<u32> =
        cases.iter().flat_map(|(counter, key)| counter.iter().chain(key)).copied().collect();
    let expected: Vec<u32> = cases.iter().flat_map(|&(counter, key)| philox(counter, key)).collect();
    for target in [Dialect::Baseline, Dialect::Int64] {
        if let Some(words) = run(target, PHILOX, &input, 4 * cases.len()) {
            assert_eq!(words, expected, "{target:?}");
        }
    }
}

/// Random words, and those next to every power of two.
fn words() -> Vec<u32> {
    let stream = Stream::new(1);
    let random = (0..250_000).flat_map(|i| stream.block(i, 0, 0));
    let ends = (0..32).flat_map(|bit| [1u32 << bit, (1 << bit) - 1, !(1 << bit), !((1 << bit) - 1)]);
    random.chain(ends).collect()
}

/// The largest distance between two lists of floats, in units in the last place.
fn ulps(a: &[u32], b: impl Iterator<Item = f32>) -> u32 {
    let ordered = |bits: u32| if bits >> 31 == 0 { bits as i64 } else { -((bits & 0x7FFF_FFFF) as i64) };
    let distance = |(&a, b): (&u32, f32)| (ordered(a) - ordered(b.to_bits())).unsigned_abs() as u32;
    a.iter().zip(b).map(distance).max().unwrap_or(0)
}

/// 0 on software adapters, which do not fuse; a few elsewhere.
fn allowed_ulps() -> u32 {
    let engine = Engine::new(&EngineChoice::Gpu).expect("these tests need an adapter");
    if engine.adapter().is_some_and(|adapter| adapter.kind == "software") { 0 } else { 8 }
}

#[test]
fn radius_and_circle_are_those_of_their_twins() {
    let words = words();
    let bits = |function: &str| {
        let body = format!("if i < arrayLength(&output) {{ output[i] = bitcast<u32>({function}); }}");
        run(Dialect::Baseline, &body, &words, words.len()).expect("every adapter runs the baseline")
    };
    let allowed = allowed_ulps();
    assert!(ulps(&bits("radius(input[i])"), words.iter().map(|&w| radius(w))) <= allowed);
    // Near a zero of the sine or cosine a ULP is tiny, but the angle is exact there, so the bound holds.
    assert!(ulps(&bits("circle(input[i]).x"), words.iter().map(|&w| circle(w)[0])) <= allowed);
    assert!(ulps(&bits("circle(input[i]).y"), words.iter().map(|&w| circle(w)[1])) <= allowed);
}

/// Wide axes and narrow ones, near the mean and far from it, at many words each.
#[test]
fn truncated_normals_are_those_of_their_twin() {
    let cover = crate::cover::tests::near_white();
    let axes = &cover.proposal().rounded::<f32>().words();
    let axes: Vec<_> = axes.iter().filter(|axis| axis[3] != 0).step_by(11).collect();
    let words = words();
    let cases: Vec<_> = words.iter().step_by(7).zip(axes.iter().cycle()).collect();
    let input: Vec<u32> =
        cases.iter().flat_map(|(word, axis)| std::iter::once(**word).chain(axis.iter().copied())).collect();
    let fragments = written(include_str!("../../shaders/truncated.wgsl"), Arithmetic::Plain, Zero::Parameter);
    let allowed = allowed_ulps();
    for (element, name) in ["x", "y"].into_iter().enumerate() {
        let body = format!(
            "if i < arrayLength(&output) {{
                let axis = bitcast<vec4<f32>>(vec4(input[5u*i+1u], input[5u*i+2u], input[5u*i+3u], input[5u*i+4u]));
                output[i] = bitcast<u32>(truncated(axis, input[5u*i]).{name});
            }}"
        );
        let found = run_with(Dialect::Baseline, &fragments, &[], &body, &input, cases.len());
        let expected = cases.iter().map(|(word, axis)| truncated(axis.map(f32::from_bits), **word)[element]);
        assert!(ulps(&found.expect("every adapter runs the baseline"), expected) <= allowed);
    }
}

const BOX_ROW: &str = "
@group(0) @binding(2) var<storage, read> cover: array<vec4<u32>>;
fn proposal_row(i: u32) -> vec4<u32> { return cover[i]; }";

/// Whole candidates: every coordinate, and whether thinning keeps them.
#[test]
fn candidates_of_a_cover_are_those_of_their_twin() {
    const COUNT: u64 = 20_000;
    let cover = crate::cover::tests::near_white();
    let proposal = cover.proposal().rounded::<f32>();
    let stream = Stream::new(0x0123_4567_89AB_CDEF);
    let fields: Vec<_> = (0..6).map(|j| format!("z{j}: f32")).collect();
    let candidates = written(&proposal.text(6), Arithmetic::Plain, Zero::Parameter);
    let fragments = format!("struct Normals {{ {} }}\n{candidates}{BOX_ROW}", fields.join(", "));
    let body = "if i < arrayLength(&output) / 7u {
        let c = candidate(vec2(0x89ABCDEFu, 0x01234567u), vec2(i, 0u), 0u, 3u);
        output[7u*i] = bitcast<u32>(c.z.z0); output[7u*i+1u] = bitcast<u32>(c.z.z1);
        output[7u*i+2u] = bitcast<u32>(c.z.z2); output[7u*i+3u] = bitcast<u32>(c.z.z3);
        output[7u*i+4u] = bitcast<u32>(c.z.z4); output[7u*i+5u] = bitcast<u32>(c.z.z5);
        output[7u*i+6u] = bitcast<u32>(select(0f, 1f, c.kept)) + input[0];
    }";
    let words = proposal.words();
    let found = run_with(Dialect::Baseline, &fragments, words.as_flattened(), body, &[0], 7 * COUNT as usize);
    let mut expected = Vec::new();
    for i in 0..COUNT {
        let mut coordinates = [[0f32]; 6];
        let [kept] = proposal.propose(&mut coordinates, |b| stream.block(i, 3, b));
        expected.extend(coordinates.as_flattened());
        expected.push(f32::from(u8::from(kept)));
    }
    let found = found.expect("every adapter runs the baseline");
    assert!(ulps(&found, expected.into_iter()) <= allowed_ulps());
}

/// Recipes with every kind of module: in straight lines and in loops, with tables and without, on even and uneven grids.
fn recipes_of_modules() -> Vec<(&'static str, Recipe)> {
    let surface = Model::builtin("munsell-vrhel").unwrap();
    let light = Model::builtin("granada").unwrap();
    let uneven = Grid::from_wavelengths(&[401.0, 443.5, 490.0, 510.0, 555.0, 670.0]).unwrap();
    let uneven = Model::builtin_at("munsell-vrhel", uneven).unwrap();
    let grid = "390:1:730".parse().unwrap();
    let data = Dataset::new(&[BuiltinTable::Vrhel.table()], grid, Extrapolation::Error).unwrap();
    let fine = Fit::new(SpectrumKind::Reflectance).components(7).fit(&data).unwrap();
    let bounded = |model, bounds| Recipe::builder(model).lrv(0.2..0.8).bounds(bounds);
    let recipes = [
        ("base", bounded(&surface, Bounds::Base)),
        ("scaled", bounded(&surface, Bounds::Scaled)),
        ("both", bounded(&surface, Bounds::Both)),
        ("plain", Recipe::builder(&surface)),
        ("uneven", Recipe::builder(&uneven).lrv(0.4)),
        ("cover", Recipe::builder(&surface).lrv(0.99).bounds(Bounds::Scaled)),
        ("log-uniform", Recipe::builder(&light).intensity(Intensity::LogUniform(0.15, 150.0))),
        ("of the data", Recipe::builder(&light).intensity(Intensity::Data)),
        ("looped", Recipe::builder(&fine).lrv(0.4).bounds(Bounds::Both)),
    ];
    let quantities = [Quantity::Spectra, Quantity::Xyz, Quantity::Weights];
    recipes.map(|(name, builder)| (name, builder.quantities(quantities).build().unwrap())).into()
}

/// The functions that a host calls, in both forms, from a buffer and, where the table is small, a constant.
#[test]
fn modules_make_the_draws_of_their_recipe() {
    const COUNT: u64 = 1031;
    const VALUES: usize = 8;
    let stream = Stream::named(0x0123_4567_89AB_CDEF, "wall");
    for (name, recipe) in recipes_of_modules() {
        let (grid, bands) = (recipe.model().grid(), recipe.model().bands());
        let [low_nm, high_nm, third] = [1, 2, 3].map(|band| grid.wavelength(band) as f32);
        let between = low_nm + 0.25 * (high_nm - low_nm);
        let tables = table_words(recipe.program());
        let buffer = TableStorage::Buffer { group: 0, binding: 2 };
        let places = match tables.len() {
            0 => vec![None],
            1..=2047 => vec![Some(TableStorage::Const), Some(buffer)],
            _ => vec![Some(buffer)],
        };
        let at = if recipe.model().kind() == SpectrumKind::Illuminant { "power" } else { "reflectance" };
        let sampler = recipe.scalar_sampler::<f32>();
        let mut expected = Vec::new();
        for index in 0..COUNT {
            let drawn = sampler.draw(stream, index);
            let (spectrum, xyz) = (drawn.spectrum(), drawn.values(Quantity::Xyz));
            let share = match grid.step() {
                Some(step) => (between - grid.first() as f32) / step as f32 - 1.0,
                None => (between - low_nm) / (high_nm - low_nm),
            };
            let value = spectrum[1] + share * (spectrum[2] - spectrum[1]);
            let weights = drawn.values(Quantity::Weights);
            let values = [spectrum[0], spectrum[bands - 1], spectrum[3], value, xyz[0], xyz[2], weights[0]];
            expected.extend(values.into_iter().chain([f32::from_bits(drawn.status().attempts())]));
        }
        let forms = [Arithmetic::Plain, Arithmetic::Exact];
        for (arithmetic, tables_at) in
            forms.into_iter().flat_map(|form| places.iter().map(move |&p| (form, p)))
        {
            let options = ModuleOptions { arithmetic, tables: tables_at };
            // A word of a buffer is a zero that no compiler knows.
            let zero = if arithmetic == Arithmetic::Exact { ", input[0]" } else { "" };
            let values = [
                "wall_at(d, 0u)".to_owned(),
                format!("wall_spectrum(d)[{}]", bands - 1),
                format!("wall_{at}(d, {third:?}f)"),
                format!("wall_{at}(d, {between:?}f)"),
                "wall_xyz(d).x".to_owned(),
                "wall_xyz(d).z".to_owned(),
                "wall_weights(d)[0]".to_owned(),
                "bitcast<f32>(d.attempts)".to_owned(),
            ];
            let stores = values.iter().enumerate();
            let stores: String = stores
                .map(|(j, value)| format!("output[{VALUES}u*i+{j}u] = bitcast<u32>({value}) + input[0];\n"))
                .collect();
            let body = format!(
                "if i < arrayLength(&output) / {VALUES}u {{
                    let d = wall_draw_in({}u, vec2(0x89ABCDEFu, 0x01234567u), vec2(i, 0u){zero});
                    {stores}
                }}",
                stream.id()
            );
            let table: &[u32] = if tables_at == Some(buffer) { &tables } else { &[] };
            let text = recipe.wgsl_with("wall", options).unwrap();
            let found = run_with(Dialect::Baseline, &text, table, &body, &[0], VALUES * COUNT as usize);
            let found = found.expect("every adapter runs the baseline");
            assert!(ulps(&found, expected.iter().copied()) <= allowed_ulps(), "{name}, {options:?}");
        }
    }
}
