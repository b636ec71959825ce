//! The generator's fragments on an adapter, function by function, against their CPU twins: where a draw differs,
//! these say which part of it does.

use wgpu::BufferUsages;
use wgpu::util::DeviceExt;

use crate::engine::{Choice, Engine};
use crate::normal::{circle, radius};
use crate::philox::{KNOWN_ANSWERS, philox};
use crate::stream::Stream;
use crate::wgsl::{Target, generator};

/// What `body` writes to `output` for each `i`, on the best adapter.
fn run(target: Target, body: &str, input: &[u32], output_words: usize) -> Option<Vec<u32>> {
    let engine = Engine::new(&Choice::Gpu).expect("these tests need an adapter");
    let (device, queue) = engine.device().expect("the engine is a GPU's");
    if target != Target::Baseline && !device.features().contains(wgpu::Features::SHADER_INT64) {
        return None;
    }
    let text = format!(
        "{}
@group(0) @binding(0) var<storage, read> input: array<u32>;
@group(0) @binding(1) var<storage, read_write> output: array<u32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{ let i = id.x; {body} }}",
        generator(target)
    );
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    });
    let size = 4 * output_words as u64;
    let buffer = |usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    };
    let input = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::cast_slice(input),
        usage: BufferUsages::STORAGE,
    });
    let output = buffer(BufferUsages::STORAGE | BufferUsages::COPY_SRC);
    let staging = buffer(BufferUsages::MAP_READ | BufferUsages::COPY_DST);
    let entries = [&input, &output].into_iter().zip(0..);
    let entries: Vec<_> = entries
        .map(|(buffer, binding)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups((output_words as u32).div_ceil(64), 1, 1);
    }
    encoder.copy_buffer_to_buffer(&output, 0, &staging, 0, None);
    queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |result| result.expect("it maps"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    let words = bytemuck::cast_slice(&staging.get_mapped_range(..).expect("it is mapped")).to_vec();
    Some(words)
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
    for target in [Target::Baseline, Target::Int64] {
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
    let engine = Engine::new(&Choice::Gpu).expect("these tests need an adapter");
    if engine.adapter().is_some_and(|adapter| adapter.kind == "software") { 0 } else { 8 }
}

#[test]
fn radius_and_circle_are_those_of_their_twins() {
    let words = words();
    let bits = |function: &str| {
        let body = format!("if i < arrayLength(&output) {{ output[i] = bitcast<u32>({function}); }}");
        run(Target::Baseline, &body, &words, words.len()).expect("every adapter runs the baseline")
    };
    let allowed = allowed_ulps();
    assert!(ulps(&bits("radius(input[i])"), words.iter().map(|&w| radius(w))) <= allowed);
    // Near a zero of the sine or cosine a ULP is tiny, but the angle is exact there, so the bound holds.
    assert!(ulps(&bits("circle(input[i]).x"), words.iter().map(|&w| circle(w)[0])) <= allowed);
    assert!(ulps(&bits("circle(input[i]).y"), words.iter().map(|&w| circle(w)[1])) <= allowed);
}
