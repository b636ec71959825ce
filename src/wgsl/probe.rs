//! The generator's fragments on an adapter, function by function, against their CPU twins: where a draw differs,
//! these say which part of it does.

use crate::engine::compute::{Compute, Words};
use crate::engine::{Engine, EngineChoice};
use crate::model::Model;
use crate::program::Bounds;
use crate::quantity::Quantity;
use crate::random::normal::{circle, radius};
use crate::random::philox::{KNOWN_ANSWERS, philox};
use crate::random::stream::Stream;
use crate::random::truncated::truncated;
use crate::recipe::Recipe;
use crate::wgsl::{Dialect, generator};

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
    let fragments = include_str!("../../shaders/truncated.wgsl");
    let allowed = allowed_ulps();
    for (element, name) in ["x", "y"].into_iter().enumerate() {
        let body = format!(
            "if i < arrayLength(&output) {{
                let axis = bitcast<vec4<f32>>(vec4(input[5u*i+1u], input[5u*i+2u], input[5u*i+3u], input[5u*i+4u]));
                output[i] = bitcast<u32>(truncated(axis, input[5u*i]).{name});
            }}"
        );
        let found = run_with(Dialect::Baseline, fragments, &[], &body, &input, cases.len());
        let expected = cases.iter().map(|(word, axis)| truncated(axis.map(f32::from_bits), **word)[element]);
        assert!(ulps(&found.expect("every adapter runs the baseline"), expected) <= allowed);
    }
}

/// Whole candidates: every coordinate, and whether thinning keeps them.
#[test]
fn candidates_of_a_cover_are_those_of_their_twin() {
    const COUNT: u64 = 20_000;
    let cover = crate::cover::tests::near_white();
    let proposal = cover.proposal().rounded::<f32>();
    let stream = Stream::new(0x0123_4567_89AB_CDEF);
    let fields: Vec<_> = (0..6).map(|j| format!("z{j}: f32")).collect();
    let fragments = format!("struct Normals {{ {} }}\n{}", fields.join(", "), proposal.text(6, 2));
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

/// The functions that a host calls: a draw's own target, and the spectrum that was scaled to it.
#[test]
fn modules_make_the_draws_of_their_recipe() {
    const COUNT: u64 = 4097;
    let model = Model::builtin("munsell-vrhel").unwrap();
    for bounds in [Bounds::Base, Bounds::Scaled, Bounds::Both] {
        let recipe = Recipe::builder(&model).lrv(0.2..0.8).bounds(bounds);
        let recipe = recipe.quantities([Quantity::Spectra, Quantity::Lrv]).build().unwrap();
        let stream = Stream::named(0x0123_4567_89AB_CDEF, "wall");
        let body = format!(
            "if i < arrayLength(&output) / 3u {{
                let d = wall_draw_in({}u, vec2(0x89ABCDEFu, 0x01234567u), vec2(i, 0u));
                output[3u*i] = bitcast<u32>(wall_lrv(d)) + input[0];
                output[3u*i+1u] = bitcast<u32>(wall_at(d, 0u));
                output[3u*i+2u] = bitcast<u32>(wall_spectrum(d)[30]);
            }}",
            stream.id()
        );
        let words = 3 * COUNT as usize;
        let found = run_with(Dialect::Baseline, &recipe.wgsl("wall").unwrap(), &[], &body, &[0], words);
        let sampler = recipe.scalar_sampler::<f32>();
        let expected = (0..COUNT).flat_map(|index| {
            let drawn = sampler.draw(stream, index);
            [drawn.values(Quantity::Lrv)[0], drawn.spectrum()[0], drawn.spectrum()[30]]
        });
        let found = found.expect("every adapter runs the baseline");
        assert!(ulps(&found, expected) <= allowed_ulps(), "{bounds:?}");
    }
}
