//! Counters at their ends: seeds, indices, words and counts; and a device with no more than WebGPU promises.

use wgpu::util::DeviceExt;

use super::examine::*;
use super::{Answer, Case, case, good, within};
use crate::engine::Engine;
use crate::program::Bounds;
use crate::quantity::Quantity;
use crate::random::real::Real;
use crate::random::stream::{DrawRange, Stream};
use crate::recipe::Recipe;
use crate::sampler::Sampler;

pub(super) const CASES: &[Case] = &[
    case("seeds 0, 1 and 2^64 - 1", "words of a key that are all the same", seeds),
    case("indices across 2^32 and up to 2^64 - 1", "the carry into the high word", indices),
    case("words 0 and 2^32 - 1 as normals", "the logarithm of 0; a radius that cancels", words),
    case("counts 0, 1, and a workgroup or a window, one more or less", "draws that are left out", counts),
    case("a device with the least limits of WebGPU", "limits that only good hardware has", least_limits),
];

fn plain() -> Result<Recipe, String> {
    build(Recipe::builder(&builtin("munsell-vrhel")))
}

fn seeds(engine: &Engine) -> Answer {
    let recipe = plain()?;
    let mut firsts: Vec<Vec<f32>> = Vec::new();
    let parts = [0, 1, u64::MAX].map(|seed| {
        let draws = Stream::new(seed).draws(0..1000);
        let answer = draw(engine, &recipe, draws).and_then(|(spectra, _)| {
            firsts.push(spectra);
            within("1000 draws", examine(engine, &recipe, draws)?.error, ERROR)
        });
        (format!("{seed}"), answer)
    });
    let [a, b, c] = firsts.as_slice() else { return all(parts) };
    if a == b || b == c || a == c {
        return Err("two seeds have the same draws".to_owned());
    }
    all(parts)
}

fn indices(engine: &Engine) -> Answer {
    let recipe = plain()?;
    let stream = Stream::new(1);
    let last = DrawRange { first: u64::MAX - 999, ..stream.draws(0..1000) };
    all([
        ("2^32".to_owned(), stream.draws((1 << 32) - 500..(1 << 32) + 500)),
        ("2^64 - 1".to_owned(), last),
        ("past 2^64 - 1, which go on at 0".to_owned(), DrawRange { first: u64::MAX - 499, ..last }),
    ]
    .map(|(name, draws)| {
        let answer = examine(engine, &recipe, draws).and_then(|e| within("1000 draws", e.error, ERROR));
        (name, answer)
    }))
}

/// Checks words of f32 on the CPU, to which the twins tie every adapter.
fn words(_: &Engine) -> Answer {
    let ends = [0, 1, 0x7FFF_FFFF, 0x8000_0000, u32::MAX - 1, u32::MAX];
    let mut worst = 0f64;
    for (x, y) in ends.into_iter().flat_map(|x| ends.map(|y| (x, y))) {
        let (pair, exact) = (f32::normal_pair(x, y), f64::normal_pair(x, y));
        for (a, b) in pair.into_iter().zip(exact) {
            if !a.is_finite() || a.abs() > 6.77 {
                return Err(format!("words {x} and {y} give {a}"));
            }
            worst = worst.max((f64::from(a) - b).abs());
        }
    }
    within("36 pairs, the largest 6.76 (absolute error)", worst, 2e-6)
}

/// Checks that short ranges are, bit for bit, the beginning of the longest.
fn counts(engine: &Engine) -> Answer {
    let recipe = plain()?;
    let bands = recipe.model().bands();
    let window = (8 << 20) / (4 * bands as u64); // bytes of the largest window, by bytes of a spectrum
    let stream = Stream::new(2);
    let (longest, statuses) = draw(engine, &recipe, stream.draws(0..2 * window + 1))?;
    let counts = [0, 1, 2, 63, 64, 65, 127, 128, 129, window - 1, window, window + 1, 2 * window];
    for count in counts {
        let (spectra, found) = draw(engine, &recipe, stream.draws(0..count))?;
        if spectra != longest[..bands * count as usize] || found != statuses[..count as usize] {
            return Err(format!("{count} draws are not the first of {}", 2 * window + 1));
        }
    }
    good(format!("0 to {}: the same bits whatever the count", 2 * window))
}

/// Draws as a guest on a device without any feature, and with the default limits, which every implementation has.
fn least_limits(engine: &Engine) -> Answer {
    let Some(wanted) = engine.adapter() else { return good("the CPU has no such limits") };
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let is_wanted = |a: &wgpu::Adapter| {
        a.get_info().name == wanted.name && a.get_info().backend.to_string() == wanted.backend
    };
    let adapter = adapters.iter().find(|a| is_wanted(a)).ok_or("the adapter is gone")?;
    let limits = wgpu::Limits::default();
    let (device, queue) =
        pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            required_limits: limits.clone(),
            ..Default::default()
        }))
        .map_err(|e| e.to_string())?;
    let recipe = build(target(&builtin("munsell-vrhel"), 0.4, Bounds::Scaled))?;
    let sampler = Sampler::new(&device, &recipe).map_err(|e| e.to_string())?;
    if sampler.max_count(&limits) < DRAWS {
        return Err(format!("only {} draws at once", sampler.max_count(&limits)));
    }
    let draws = Stream::new(3).draws(0..DRAWS);
    let prepared = sampler.prepare(&device, draws).map_err(|e| e.to_string())?;
    let mut encoder = device.create_command_encoder(&Default::default());
    prepared.record(&mut encoder);
    let bytes = 4 * draws.count * recipe.model().bands() as u64;
    let staging = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: &vec![0; bytes as usize],
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
    });
    let spectra = prepared.buffer(Quantity::Spectra).ok_or("no spectra")?;
    encoder.copy_buffer_to_buffer(spectra, 0, &staging, 0, bytes);
    queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |_| {});
    device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| e.to_string())?;
    let view = staging.get_mapped_range(..).map_err(|e| e.to_string())?;
    let spectra: &[f32] = bytemuck::cast_slice(&view);
    let (expected, _) = draw(engine, &recipe, draws)?;
    // Other limits, and no 64-bit multiplication: the same words, and values to the last digits.
    let apart = spectra.iter().zip(&expected).map(|(a, b)| f64::from((a - b).abs()));
    within(
        format!("{DRAWS} draws as by the engine; at most {} at once", sampler.max_count(&limits)),
        apart.fold(0.0, f64::max),
        SCALED_ERROR,
    )
}
