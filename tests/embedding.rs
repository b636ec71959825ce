//! Spectroll as a guest: on a host's device with no features and small limits, in its encoders and in its shaders.

#![allow(clippy::duplicate_mod)] // all examples have the host's boilerplate

mod buffers;

use std::sync::OnceLock;

use buffers::read;
use spectroll::{
    Engine, EngineChoice, EngineError, Layout, Model, ProposalKind, Quantity, Recipe, Sampler, SamplerError,
    Stream, colorimetry, wgpu,
};

#[path = "../examples/embed.rs"]
mod embed;
#[path = "../examples/inline.rs"]
mod inline;
#[path = "../examples/scene.rs"]
mod scene;
use embed::host;

/// The device of a host, one for all tests.
fn device() -> (wgpu::Device, wgpu::Queue) {
    static DEVICE: OnceLock<(wgpu::Device, wgpu::Queue)> = OnceLock::new();
    DEVICE.get_or_init(host::device).clone()
}

fn surfaces() -> Recipe {
    let model = Model::builtin("munsell-vrhel").expect("it is built in");
    Recipe::builder(&model)
        .quantities([Quantity::Spectra, Quantity::Attempts])
        .build()
        .expect("it can be drawn")
}

#[test]
fn several_ranges_in_one_encoder_do_not_clash() {
    let host = device();
    let recipe = surfaces();
    let sampler = Sampler::new(&host.0, &recipe).expect("two buffers are few");
    let ranges = [Stream::new(1).draws(0..1001), Stream::named(2, "other").draws(500..600)];
    let prepared = ranges.map(|draws| sampler.prepare(&host.0, draws).expect("they are few"));
    let mut encoder = host.0.create_command_encoder(&Default::default());
    prepared.iter().for_each(|prepared| prepared.record(&mut encoder));
    let buffers: Vec<_> =
        prepared.iter().map(|p| p.buffer(Quantity::Spectra).expect("it is asked for")).collect();
    assert!(prepared[0].buffer(Quantity::Xyz).is_none());
    for (draws, words) in ranges.iter().zip(read(&host, encoder, &buffers)) {
        for (i, row) in words.chunks_exact(31).take(draws.count as usize).enumerate() {
            let drawn = recipe.draw::<f32>(draws.stream, draws.first + i as u64);
            let close = |(a, b): (&u32, &f32)| (f32::from_bits(*a) - b).abs() < 1e-6;
            assert!(row.iter().zip(drawn.spectrum()).all(close), "draw {i}");
        }
    }
}

/// Frame after frame in the same buffers, with fewer draws at times.
#[test]
fn a_host_draws_anew_in_each_frame() {
    let host = device();
    let recipe = surfaces();
    let sampler = Sampler::new(&host.0, &recipe).expect("two buffers are few");
    let mut prepared = sampler.prepare(&host.0, Stream::new(1).draws(0..100)).expect("they are few");
    let scalar = recipe.scalar_sampler::<f32>();
    for (seed, count) in [(1, 100), (2, 37), (3, 100)] {
        let draws = Stream::new(seed).draws(5..5 + count);
        prepared.set_draws(&host.1, draws).expect("there is room");
        let mut encoder = host.0.create_command_encoder(&Default::default());
        prepared.record(&mut encoder);
        let buffer = prepared.buffer(Quantity::Spectra).expect("it is asked for");
        let words = read(&host, encoder, &[buffer]).remove(0);
        for (i, row) in words.chunks_exact(31).take(count as usize).enumerate() {
            let drawn = scalar.draw(draws.stream, draws.first + i as u64);
            let close = |(a, b): (&u32, &f32)| (f32::from_bits(*a) - b).abs() < 1e-6;
            assert!(row.iter().zip(drawn.spectrum()).all(close), "seed {seed}, draw {i}");
        }
    }
    let error = prepared.set_draws(&host.1, Stream::new(4).draws(0..101)).unwrap_err();
    assert_eq!(error, SamplerError::NoRoom { count: 101, prepared: 100 });
}

#[test]
fn what_does_not_fit_is_refused_with_the_limit() {
    let (device, _) = device();
    let sampler = Sampler::new(&device, &surfaces()).expect("two buffers are few");
    let limits = device.limits();
    let largest = sampler.max_count(&limits);
    let bytes = limits.max_storage_buffer_binding_size;
    let threads = u64::from(limits.max_compute_workgroups_per_dimension) * 64;
    assert_eq!(largest, (bytes / (4 * 4 * 31) * 4).min(threads));
    let error = sampler.prepare(&device, Stream::new(1).draws(0..largest + 1)).unwrap_err();
    assert!(error.to_string().contains(&format!("at most {largest} at once")), "{error}");

    let model = Model::builtin("munsell-vrhel").expect("it is built in");
    let many = Recipe::builder(&model)
        .quantities(Quantity::ALL.iter().copied().filter(|q| *q != Quantity::Intensity))
        .build()
        .expect("it can be drawn");
    let error = Sampler::new(&device, &many).unwrap_err();
    assert_eq!(error, SamplerError::TooManyBuffers { buffers: 7, largest: 4 });
}

/// A device with limits of its own.
fn limited(change: impl FnOnce(&mut wgpu::Limits)) -> (wgpu::Device, wgpu::Queue) {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))
        .expect("there is an adapter");
    let mut limits = adapter.limits();
    change(&mut limits);
    let description = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
    pollster::block_on(adapter.request_device(&description)).expect("it has a device")
}

/// Errors and no panic, whatever becomes of the device.
#[test]
fn a_lost_device_is_an_error() {
    let (device, queue) = limited(|_| ());
    device.on_uncaptured_error(std::sync::Arc::new(|_| ()));
    let recipe = surfaces();
    let sampler = Sampler::new(&device, &recipe).expect("two buffers are few");
    let mut prepared = sampler.prepare(&device, Stream::new(1).draws(0..10)).expect("they are few");
    device.destroy();
    let error = sampler.prepare(&device, Stream::new(1).draws(0..10)).unwrap_err();
    assert_eq!(error, SamplerError::NoBuffer { label: "spectroll parameters" });
    assert!(error.to_string().contains("it was lost"), "{error}");
    let covered = Recipe::builder(recipe.model())
        .proposal(ProposalKind::Cover)
        .lrv(0.98)
        .build()
        .expect("it has a cover");
    assert!(matches!(Sampler::new(&device, &covered), Err(SamplerError::NoBuffer { .. })));
    let scene = spectroll::scene::Scene::preset("condition3").expect("it is built in");
    let made = spectroll::scene::SceneSampler::new(&device, &scene);
    assert!(made.is_err() || made.is_ok_and(|sampler| sampler.prepare(&device, 0..2).is_err()));
    // What was prepared before records and submits nothing, and says so by the device's own errors.
    prepared.set_draws(&queue, Stream::new(1).draws(0..5)).expect("there is room");
    let mut encoder = device.create_command_encoder(&Default::default());
    prepared.record(&mut encoder);
    queue.submit([encoder.finish()]);
}

#[test]
fn tables_that_a_device_cannot_bind_are_an_error() {
    let (device, _) = limited(|limits| {
        limits.max_buffer_size = 4096;
        limits.max_storage_buffer_binding_size = 4096;
        limits.max_uniform_buffer_binding_size = 4096;
    });
    let recipe = Recipe::builder(surfaces().model())
        .proposal(ProposalKind::Cover)
        .lrv(0.98)
        .build()
        .expect("it has a cover");
    let error = Sampler::new(&device, &recipe).unwrap_err();
    let SamplerError::LargeTable { label, bytes, largest, limit } = error else { panic!("{error}") };
    assert!(label == "spectroll proposal" && bytes > 4096 && largest == 4096, "{label} {bytes} {largest}");
    assert_eq!(limit, "max_buffer_size");
}

/// A module as `naga_oil` imports it into another shader.
#[test]
fn naga_oil_composes_a_module() {
    use naga_oil::compose::{ComposableModuleDescriptor, Composer, NagaModuleDescriptor};
    let recipe = Recipe::builder(&Model::builtin("granada").expect("it is built in"))
        .build()
        .expect("it can be drawn");
    let module = format!("#define_import_path spectroll::sun\n{}", recipe.wgsl("sun").expect("it is small"));
    let mut composer = Composer::default();
    let added = composer.add_composable_module(ComposableModuleDescriptor {
        source: &module,
        file_path: "sun.wgsl",
        ..Default::default()
    });
    added.expect("it is a module");
    let source = "#import spectroll::sun\n
        @fragment fn fragment() -> @location(0) vec4<f32> {
            return vec4(spectroll::sun::sun_at(spectroll::sun::sun_draw(vec2(1u, 0u), vec2(7u, 0u)), 3u));
        }";
    let made = composer.make_naga_module(NagaModuleDescriptor {
        source,
        file_path: "host.wgsl",
        ..Default::default()
    });
    let module = made.expect("it composes");
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    validator.validate(&module).expect("it is valid");
}

/// How many pixels of a picture differ from what the CPU makes of the same draws, and by how much at most.
fn differences(pixels: &[[u8; 4]], width: u32, expected: impl Fn(u32, u32) -> [f64; 3]) -> (usize, u8) {
    let mut differ = (0, 0);
    for (i, pixel) in pixels.iter().enumerate() {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let expected = colorimetry::encode_srgb(expected(x, y));
        let most = expected.iter().zip(pixel).map(|(a, b)| a.abs_diff(*b)).max().expect("there are three");
        if most > 0 {
            differ = (differ.0 + 1, differ.1.max(most));
        }
    }
    differ
}

/// 0.13 encoded, as the background is.
const BACKGROUND: [f64; 3] = [0.015_258; 3];

#[test]
fn spheres_have_the_colours_of_the_cpu() {
    let image = embed::picture().expect("it can be made");
    assert_eq!((image.width, image.height), (960, 600));
    let (surfaces, daylights) =
        (embed::surfaces().expect("it can be drawn"), embed::daylights().expect("it can be drawn"));
    let observer = colorimetry::cmf(surfaces.model().grid());
    let stream = Stream::new(1);
    let colours: Vec<_> = (0..u64::from(embed::COLUMNS * embed::ROWS))
        .map(|sphere| {
            let light = daylights.draw::<f64>(stream, sphere / u64::from(embed::COLUMNS));
            let surface = surfaces.draw::<f64>(stream, sphere);
            let seen = |f: &Vec<f64>| (0..f.len()).map(|b| f[b] * light.spectrum()[b]).collect::<Vec<_>>();
            let seen = observer.each_ref().map(seen);
            let white: f64 = seen[1].iter().sum();
            let product =
                |f: &Vec<f64>| f.iter().zip(surface.spectrum()).map(|(f, r)| f * r).sum::<f64>() / white;
            colorimetry::linear_srgb(seen.each_ref().map(product))
        })
        .collect();
    let size = f64::from(embed::CELL);
    let (count, most) = differences(&image.pixels, image.width, |x, y| {
        let colour = colours[(y / embed::CELL * embed::COLUMNS + x / embed::CELL) as usize];
        let at = [x, y].map(|v| (f64::from(v % embed::CELL) + 0.5) / size * 2.0 - 1.0).map(|v| v / 0.94);
        let depth = 1.0 - at[0] * at[0] - at[1] * at[1];
        if depth <= 0.0 {
            return BACKGROUND;
        }
        let length = (0.5f64 * 0.5 + 0.6 * 0.6 + 0.8 * 0.8).sqrt();
        let lambert = ((-0.5 * at[0] - 0.6 * at[1] + 0.8 * depth.sqrt()) / length).max(0.0);
        colour.map(|v| v * (0.12 + 0.88 * lambert))
    });
    println!("{count} of {} pixels differ, by at most {most}", image.pixels.len());
    assert!(count < image.pixels.len() / 200 && most <= 1, "{count} pixels differ, by up to {most}");
}

#[test]
fn chips_have_the_colours_of_the_cpu_and_one_luminance() {
    let image = inline::picture().expect("it can be made");
    let chips = inline::chips().expect("it can be drawn");
    let half = inline::COLUMNS / 2;
    let colours: Vec<Vec<f64>> = (0..u64::from(inline::COLUMNS * inline::ROWS))
        .map(|chip| chips.draw::<f64>(Stream::new(2), chip).values(Quantity::LinearSrgb).to_vec())
        .collect();
    let (count, most) = differences(&image.pixels, image.width, |x, y| {
        let inside = |v: u32| (2..inline::CELL - 2).contains(&(v % inline::CELL));
        let (column, row) = (x / inline::CELL, y / inline::CELL);
        match (inside(x) && inside(y), column < half) {
            (false, _) => BACKGROUND,
            (true, true) => {
                let colour = &colours[(row * inline::COLUMNS + column) as usize];
                [colour[0], colour[1], colour[2]]
            }
            (true, false) => [0.3; 3],
        }
    });
    println!("{count} of {} pixels differ, by at most {most}", image.pixels.len());
    assert!(count < image.pixels.len() / 200 && most <= 1, "{count} pixels differ, by up to {most}");
}

#[test]
fn walls_have_the_colours_of_the_cpu() {
    let image = scene::picture().expect("it can be made");
    let walls = scene::walls().expect("it can be drawn");
    let observer = colorimetry::cmf(walls.grid());
    let bands = walls.grid().len();
    let engine = Engine::new(&EngineChoice::Cpu).expect("the CPU is always there");
    let mut spectra: [Vec<f32>; 3] = Default::default();
    let mut session = walls.session(&engine).expect("it can be drawn");
    let drawn = session.draw(0..u64::from(scene::SCENES), |window| {
        for (spectra, group) in spectra.iter_mut().zip(["lamp", "wall", "target"]) {
            spectra.extend_from_slice(window.values(group));
        }
        Ok::<_, EngineError>(())
    });
    drawn.expect("every draw finds a candidate");
    let [lamps, tiles, targets] = &spectra;
    let spectrum = |of: &[f32], number: u32| -> Vec<f64> {
        of[number as usize * bands..][..bands].iter().map(|&s| f64::from(s)).collect()
    };
    let colour = |number: u32, reflectance: &[f64]| {
        let lamp = spectrum(lamps, number);
        let seen = observer.each_ref().map(|f| f.iter().zip(&lamp).map(|(f, l)| f * l).collect::<Vec<_>>());
        let white: f64 = seen[1].iter().sum();
        let product = |f: &Vec<f64>| f.iter().zip(reflectance).map(|(f, r)| f * r).sum::<f64>() / white;
        colorimetry::linear_srgb(seen.each_ref().map(product))
    };
    let side = scene::TILES;
    let of_targets: Vec<_> = (0..scene::SCENES).map(|s| colour(s, &spectrum(targets, s))).collect();
    let of_tiles: Vec<_> = (0..scene::SCENES * side * side)
        .map(|number| colour(number / (side * side), &spectrum(tiles, number)))
        .collect();
    let cell = (side + 1) * scene::TILE;
    let middle = (side - 5) / 2..(side + 5) / 2;
    let (count, most) = differences(&image.pixels, image.width, |x, y| {
        let number = y / cell * (scene::SCENES / 2) + x / cell;
        // Half a tile of frame on each side.
        let tile = [x, y].map(|v| (v % cell).checked_sub(scene::TILE / 2).map(|v| v / scene::TILE));
        match tile {
            [Some(x), Some(y)] if x < side && y < side => match middle.contains(&x) && middle.contains(&y) {
                true => of_targets[number as usize],
                false => of_tiles[((number * side + y) * side + x) as usize],
            },
            _ => BACKGROUND,
        }
    });
    println!("{count} of {} pixels differ, by at most {most}", image.pixels.len());
    assert!(count < image.pixels.len() / 200 && most <= 1, "{count} pixels differ, by up to {most}");
}

/// A host reads padded rows as `vec4`s, at any offset that its own alignment allows.
#[test]
fn rows_are_padded_for_vec4() {
    let model = Model::builtin("munsell-vrhel").expect("it is built in");
    let recipe = Recipe::builder(&model).layout(Layout::PaddedRows).build().expect("it can be drawn");
    let host = device();
    let sampler = Sampler::new(&host.0, &recipe).expect("one buffer is few");
    let prepared = sampler.prepare(&host.0, Stream::new(3).draws(0..10)).expect("they are few");
    let mut encoder = host.0.create_command_encoder(&Default::default());
    prepared.record(&mut encoder);
    let buffer = prepared.buffer(Quantity::Spectra).expect("it is asked for");
    assert_eq!(buffer.size(), 10 * 32 * 4);
    let words = read(&host, encoder, &[buffer]).remove(0);
    assert!(words.chunks_exact(32).all(|row| row[31] == 0 && row[..31].iter().all(|&w| w != 0)));
}
