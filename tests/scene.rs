//! Scenes: the same on every engine, whatever else is drawn with them, and as an independent program has them.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use spectroll::scene::{
    Copies, GroupKind, Hue, Illuminants, IntensityScope, LrvLevels, PRESETS, PreparedScene, Scene,
    SceneBuilder, SceneSampler, Surfaces, TargetConstraint, Targets,
};
use spectroll::{
    Bounds, Engine, EngineError, Grid, Intensity, Model, Quantity, Recipe, Stream, colorimetry, wgpu,
};

mod engines;
#[path = "../examples/host/mod.rs"]
#[allow(dead_code)] // tests render nothing
mod host;

use engines::{cpu, gpu, gpu_is_software};

fn daylight() -> Model {
    Model::builtin("granada").expect("it is built in")
}

fn surfaces() -> Model {
    Model::builtin("munsell-vrhel").expect("it is built in")
}

fn preset(name: &str) -> Scene {
    Scene::preset(name).expect("it is built in")
}

/// The bytes of every array of some scenes, those that serve all scenes included.
fn arrays(scene: &Scene, engine: &Engine, scenes: std::ops::Range<u64>) -> BTreeMap<String, Vec<u8>> {
    let mut session = scene.session(engine).expect("it can be drawn");
    let constants = session.constants().into_iter().map(|(array, bytes)| (array.name.clone(), bytes));
    let mut all: BTreeMap<_, _> = constants.collect();
    let mut next = scenes.start;
    let drawn = session.draw(scenes.clone(), |window| {
        assert_eq!(window.scenes.start, next);
        next = window.scenes.end;
        for (array, bytes) in window.arrays() {
            let count = (window.scenes.end - window.scenes.start) as usize;
            assert_eq!(bytes.len(), count * array.bytes(), "{}", array.name);
            all.entry(array.name.clone()).or_default().extend_from_slice(bytes);
        }
        Ok::<_, EngineError>(())
    });
    drawn.expect("every draw finds a candidate");
    assert_eq!(next, scenes.end);
    all
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytemuck::pod_collect_to_vec(bytes)
}

/// A group of every sort.
fn everything() -> SceneBuilder {
    let levels = || LrvLevels::even(0.2, 0.6, 10);
    let target = |name, aim| Targets::new(name, &surfaces(), aim).bounds(Bounds::Scaled);
    let plain = |name, aim| Targets::new(name, &surfaces(), aim);
    let log = Intensity::LogUniform(0.15, 150.0);
    Scene::builder(1000)
        .seed(7)
        .group(Illuminants::new("lights", &daylight(), 3).intensity(log, IntensityScope::Scene))
        .group(Illuminants::new("lamps", &daylight(), 2).intensity(Intensity::Data, IntensityScope::Light))
        .group(Illuminants::new("twins", &daylight(), 4).same_shape().intensity(log, IntensityScope::Light))
        .group(
            Illuminants::new("panels", &daylight(), 4)
                .same_shape()
                .fixed()
                .intensity(log, IntensityScope::Light),
        )
        .group(Illuminants::new("sun", &daylight(), 1).mean(&colorimetry::d65(&Grid::DEFAULT)))
        .group(Surfaces::new("background", &surfaces(), 99))
        .group(Surfaces::new("walls", &surfaces(), 5).fixed())
        .group(target("target", TargetConstraint::Lrv(levels())).count(2))
        .group(target("scaled", TargetConstraint::Lrv(levels())).copies(Copies::Scaled))
        .group(target("same", TargetConstraint::Lrv(levels())).copies(Copies::SameShape))
        .group(target("any", TargetConstraint::Lrv(LrvLevels::Uniform(0.1, 0.6))))
        .group(plain("colour", TargetConstraint::Xyz([0.3, 0.3, 0.3])))
        .group(plain(
            "hues",
            TargetConstraint::Hue(Hue { levels: 6, saturation: (0.2, 0.3), lightness: (0.3, 0.4) }),
        ))
        .group(Targets::flat("grey", levels()))
}

#[test]
fn presets_are_the_same_on_every_engine() {
    let software = gpu_is_software();
    for (name, _) in PRESETS {
        let scene = preset(name);
        let ours = arrays(&scene, cpu(), 3..43);
        if software {
            assert!(ours == arrays(&scene, gpu(), 3..43), "{name}");
        }
    }
    let scene = everything().build().expect("it is possible");
    if software {
        assert!(arrays(&scene, cpu(), 0..60) == arrays(&scene, gpu(), 0..60));
    }
}

/// Groups one at a time, in the other order, and scenes one at a time or in other windows.
#[test]
fn nothing_depends_on_what_else_is_drawn() {
    let scene = everything().build().expect("it is possible");
    let all = arrays(&scene, cpu(), 0..50);
    for group in scene.groups().map(str::to_owned).collect::<Vec<_>>() {
        let alone = everything().build().expect("it is possible").only(&group).expect("it is there");
        for (name, bytes) in arrays(&alone, cpu(), 0..50) {
            assert!(bytes == all[&name], "{name} alone");
        }
    }
    let one = arrays(&scene, cpu(), 37..38);
    for array in scene.arrays().filter(|array| array.per_scene) {
        let bytes = array.bytes();
        assert!(one[&array.name] == all[&array.name][37 * bytes..38 * bytes], "{} of scene 37", array.name);
    }
    let reordered = Scene::builder(40)
        .seed(7)
        .group(Surfaces::new("background", &surfaces(), 120))
        .group(Surfaces::new("another", &surfaces(), 3))
        .group(
            Illuminants::new("lights", &daylight(), 3)
                .intensity(Intensity::LogUniform(0.15, 150.0), IntensityScope::Scene),
        );
    let reordered = arrays(&reordered.build().expect("it is possible"), cpu(), 0..40);
    assert!(reordered["lights"][..] == all["lights"][..40 * 3 * 31 * 4]);
    // More of them in a scene: those that were there stay.
    let (few, many) = (floats(&all["background"]), floats(&reordered["background"]));
    for scene in 0..40 {
        assert!(
            few[scene * 99 * 31..(scene + 1) * 99 * 31] == many[scene * 120 * 31..(scene * 120 + 99) * 31]
        );
    }
}

#[test]
fn a_shared_intensity_multiplies_all_lights_of_a_scene() {
    let all = arrays(&everything().build().expect("it is possible"), cpu(), 0..20);
    let (lights, intensity) = (floats(&all["lights"]), floats(&all["lights_intensity"]));
    assert_eq!((lights.len(), intensity.len()), (20 * 3 * 31, 20));
    let recipe = Recipe::builder(&daylight()).build().expect("it is possible");
    let stream = Stream::named(7, "lights").in_rows(3);
    for (i, spectrum) in lights.chunks_exact(31).enumerate() {
        let plain = recipe.draw::<f32>(stream, i as u64);
        let expected: Vec<f32> = plain.spectrum().iter().map(|v| v * intensity[i / 3]).collect();
        assert_eq!(spectrum, expected);
    }
    // Twins have one shape in a scene, and panels one in all.
    let (twins, scales) = (floats(&all["twins"]), floats(&all["twins_intensity"]));
    assert_eq!(scales.len(), 20 * 4);
    let shape = |values: &[f32], scales: &[f32], i: usize| values[i * 31 + 7] / scales[i];
    for i in 0..80 {
        let first = shape(&twins, &scales, i / 4 * 4);
        assert!((shape(&twins, &scales, i) / first - 1.0).abs() < 1e-6);
    }
    assert!((shape(&twins, &scales, 0) / shape(&twins, &scales, 4) - 1.0).abs() > 1e-4);
    let (panels, scales) = (floats(&all["panels"]), floats(&all["panels_intensity"]));
    for i in 0..80 {
        assert!((shape(&panels, &scales, i) / shape(&panels, &scales, 0) - 1.0).abs() < 1e-6);
    }
}

/// A mean is replaced by one of the same power: the draws' mean is that of the new one.
#[test]
fn a_mean_can_be_replaced() {
    let d65 = colorimetry::d65(&Grid::DEFAULT);
    let scene = Scene::builder(4000).group(Illuminants::new("sun", &daylight(), 5).mean(&d65));
    let spectra = floats(&arrays(&scene.build().expect("it is possible"), cpu(), 0..4000)["sun"]);
    let power = d65.iter().sum::<f64>() / 31.0;
    for (band, expected) in d65.iter().map(|v| v / power).enumerate() {
        let mean = spectra.iter().skip(band).step_by(31).map(|&v| f64::from(v)).sum::<f64>() / 20_000.0;
        assert!((mean - expected).abs() < 0.02, "{band}: {mean} {expected}");
    }
}

#[test]
fn a_mean_is_the_power_of_a_light() {
    let build = |mean: &[f64]| {
        let scene = Scene::builder(1).group(Illuminants::new("sun", &daylight(), 5).mean(mean)).build();
        scene.map(|_| ()).map_err(|error| error.to_string())
    };
    let mut mean = [1.0; 31];
    mean[10] = 0.0;
    assert_eq!(build(&mean), Ok(()), "a band may be dark");
    mean[10] = -1e-9;
    let refused = build(&mean).expect_err("no light is negative");
    assert!(refused.contains("at 500 nm is -0.000000001") && refused.contains("raise it to 0"), "{refused}");
    let refused = build(&[0.0; 31]).expect_err("no light is dark");
    assert!(refused.contains("mean power is 0"), "{refused}");
    let refused = build(&[1.0; 30]).expect_err("a band has no value");
    assert!(refused.contains("30 values where the model has 31 bands"), "{refused}");
}

#[test]
fn copies_are_at_their_levels_and_within_bounds() {
    let scene = everything().build().expect("it is possible");
    let all = arrays(&scene, cpu(), 0..1000);
    let weights = colorimetry::lrv_weights(&Grid::DEFAULT).expect("it is visible");
    let lrv_of = |s: &[f32]| s.iter().zip(&weights).map(|(&s, w)| f64::from(s) * w).sum::<f64>();
    for name in ["target", "scaled", "same", "any"] {
        let (spectra, lrv) = (floats(&all[name]), floats(&all[&format!("{name}_lrv")]));
        let count = lrv.len() / 1000;
        for (i, (spectrum, &lrv)) in spectra.chunks_exact(31).zip(&lrv).enumerate() {
            assert!((lrv_of(spectrum) - f64::from(lrv)).abs() < 1e-6, "{name} {i}");
            assert!(spectrum.iter().all(|&v| v > 0.0 && v < 1.0), "{name} {i}");
            if name != "any" {
                let level = 0.2 + 0.4 / 9.0 * (i / count % 10) as f64;
                assert!((f64::from(lrv) - level).abs() < 1e-7, "{name} {i}: {lrv}");
            }
        }
    }
    // Copies of a round are one spectrum, those of others another; and so are all copies of a shape.
    let shape = |name: &str, i: usize| {
        let (spectra, lrv) = (floats(&all[name]), floats(&all[&format!("{name}_lrv")]));
        spectra[i * 31 + 3] / lrv[i]
    };
    let same = |name, a, b| (shape(name, a) / shape(name, b) - 1.0f32).abs() < 1e-6;
    assert!((0..10).all(|i| same("scaled", 0, i)) && !same("scaled", 0, 10));
    assert!((0..100).all(|i| same("same", 0, i)) && !same("target", 0, 2));
    // Accepted by the lightest copy, which has the acceptance of that level alone: 0.543, and not 0.779.
    let attempts: Vec<u32> = bytemuck::pod_collect_to_vec(&all["scaled_attempts"]);
    let rounds: Vec<u32> = attempts.iter().step_by(10).copied().collect();
    let acceptance = rounds.len() as f64 / f64::from(rounds.iter().sum::<u32>());
    assert!((0.35..0.70).contains(&acceptance), "{acceptance}");
    // Greys are their level in every band.
    let (grey, lrv) = (floats(&all["grey"]), floats(&all["grey_lrv"]));
    assert!(grey.chunks_exact(31).zip(&lrv).all(|(s, lrv)| s.iter().all(|v| v == lrv)));
}

#[test]
fn exact_tristimulus_values_are_met_to_1e_5() {
    let all = arrays(&everything().build().expect("it is possible"), cpu(), 0..1000);
    let weights = colorimetry::xyz_weights(&Grid::DEFAULT).expect("it is visible");
    let worst = |name: &str, target: &dyn Fn(usize, usize) -> f32| {
        let spectra = floats(&all[name]);
        let error = |(i, spectrum): (usize, &[f32])| {
            assert!(spectrum.iter().all(|&v| v > 0.0 && v < 1.0), "{name} {i}");
            let value = |w: &Vec<f64>| w.iter().zip(spectrum).map(|(w, &s)| w * f64::from(s)).sum::<f64>();
            let errors = (0..3).map(|axis| (value(&weights[axis]) - f64::from(target(i, axis))).abs());
            errors.fold(0.0, f64::max)
        };
        spectra.chunks_exact(31).enumerate().map(error).fold(0.0, f64::max)
    };
    let given = floats(&all["hues_xyz"]);
    let (colour, hues) = (worst("colour", &|_, _| 0.3), worst("hues", &|i, axis| given[3 * i + axis]));
    println!("largest error of X, Y or Z: {colour:.1e} at one target, {hues:.1e} over hues");
    assert!(colour < 1e-5 && hues < 1e-5);
    // The hues are red, yellow, green, ... in turn, and their saturation and lightness are within their ranges.
    for (i, xyz) in given.chunks_exact(3).enumerate() {
        let [r, g, b] = colorimetry::linear_srgb([xyz[0], xyz[1], xyz[2]].map(f64::from));
        let (high, low) = (r.max(g).max(b), r.min(g).min(b));
        assert!((0.2999..0.4001).contains(&high) && (0.1999..0.3001).contains(&(1.0 - low / high)));
        let channel = [r, g, b][[0, 0, 1, 1, 2, 2][i % 6]];
        assert!((channel - high).abs() < 1e-6, "{i}");
    }
}

/// Groups that are drawn by the engine, once and on the CPU, asked for all that tristimulus values give.
fn coloured(quantities: &[Quantity]) -> Scene {
    let asked = || quantities.iter().copied();
    let log = Intensity::LogUniform(0.15, 150.0);
    let lights = |name, count| Illuminants::new(name, &daylight(), count).quantities(asked());
    let target = |name, aim| Targets::new(name, &surfaces(), aim).quantities(asked());
    let scene = Scene::builder(100)
        .seed(9)
        .group(lights("lights", 3).intensity(log, IntensityScope::Scene))
        .group(lights("lamps", 2).intensity(Intensity::Fixed(3.0), IntensityScope::Scene))
        .group(lights("twins", 4).same_shape().intensity(log, IntensityScope::Light))
        .group(lights("sun", 2).fixed())
        .group(lights("panels", 4).same_shape().fixed().intensity(log, IntensityScope::Light))
        .group(Surfaces::new("background", &surfaces(), 9).quantities(asked()))
        .group(Surfaces::new("walls", &surfaces(), 5).fixed().quantities(asked()))
        .group(target("target", TargetConstraint::Lrv(LrvLevels::even(0.2, 0.6, 10))).bounds(Bounds::Scaled))
        .group(target("same", TargetConstraint::Lrv(LrvLevels::even(0.2, 0.6, 10))).copies(Copies::SameShape))
        .group(target(
            "hues",
            TargetConstraint::Hue(Hue { levels: 6, saturation: (0.2, 0.3), lightness: (0.3, 0.4) }),
        ))
        .group(Targets::flat("grey", LrvLevels::even(0.2, 0.6, 10)).quantities(asked()));
    scene.build().expect("it is possible")
}

/// The same bytes on every engine, and what f64 makes of the spectra, to 1e-6 of the white: of the light itself, where
/// it is one.
#[test]
fn colours_are_those_of_the_spectra() {
    const COLOURS: [Quantity; 3] = [Quantity::Xyz, Quantity::Chromaticity, Quantity::LinearSrgb];
    let scene = coloured(&[&[Quantity::Spectra], &COLOURS[..]].concat());
    let all = arrays(&scene, cpu(), 3..43);
    if gpu_is_software() {
        assert!(arrays(&scene, gpu(), 3..43) == all);
    }
    let grid = &Grid::DEFAULT;
    let reflected = colorimetry::xyz_weights(grid).expect("it is visible");
    let emitted = colorimetry::cmf(grid).map(|f| f.iter().map(|v| v * 10.0).collect::<Vec<_>>());
    let mut worst = [0f64; 3];
    for group in scene.groups() {
        let kind = scene.arrays().find(|array| array.group == group).expect("it has arrays").kind;
        let is_light = kind == GroupKind::Illuminant;
        let weights = if is_light { &emitted } else { &reflected };
        let spectra = floats(&all[group]);
        let values = COLOURS.map(|quantity| floats(&all[&format!("{group}_{quantity}")]));
        let count = spectra.len() / 31;
        for (i, spectrum) in spectra.chunks_exact(31).enumerate() {
            let dot = |w: &Vec<f64>| w.iter().zip(spectrum).map(|(w, &s)| w * f64::from(s)).sum::<f64>();
            let xyz = weights.each_ref().map(dot);
            let white = if is_light { xyz[1] } else { 1.0 };
            let sum: f64 = xyz.iter().sum();
            let expected =
                [xyz.to_vec(), vec![xyz[0] / sum, xyz[1] / sum], colorimetry::linear_srgb(xyz).to_vec()];
            for (number, expected) in expected.iter().enumerate() {
                let width = expected.len();
                // Chromaticities of lights that are fixed are there once, whatever their intensities.
                let given = values[number].len() / width;
                assert!(
                    given == count || (number == 1 && count.is_multiple_of(given)),
                    "{group}: {given} of {count}"
                );
                let scale = if number == 1 { 1.0 } else { white };
                for (a, b) in values[number][i % given * width..][..width].iter().zip(expected) {
                    worst[number] = worst[number].max((f64::from(*a) - b).abs() / scale);
                }
            }
        }
    }
    println!("XYZ {:.1e}, chromaticity {:.1e}, linear sRGB {:.1e} of white", worst[0], worst[1], worst[2]);
    assert!(worst.iter().all(|&worst| worst < 2e-6), "{worst:?}");
}

#[test]
fn spectra_that_nobody_asks_for_are_in_no_array() {
    let with = arrays(&coloured(&[Quantity::Spectra, Quantity::Xyz]), cpu(), 0..10);
    let scene = coloured(&[Quantity::Xyz]);
    let without = arrays(&scene, cpu(), 0..10);
    assert!(scene.groups().all(|group| with.contains_key(group) && !without.contains_key(group)));
    assert!(without.iter().all(|(name, bytes)| with[name] == *bytes));
    let text = scene.workload(10).left_out.join("\n");
    assert!(text.contains("background: its spectra are neither computed nor stored"), "{text}");
    assert!(text.contains("walls: its spectra are not stored"), "{text}");
    let plain = preset("condition2").workload(10).left_out.join("\n");
    assert!(!plain.contains("quantities"), "{plain}");
    let asked = Surfaces::new("walls", &surfaces(), 5).quantities([Quantity::Weights]);
    let error = Scene::builder(1).group(asked).build().err().expect("no group has weights").to_string();
    assert!(error.contains("quantities of \"walls\"") && error.contains("spectra, xyz,"), "{error}");
}

/// A renderer takes the spectra, whatever else is asked for.
#[test]
fn a_host_has_spectra_all_the_same() {
    let (device, queue) = host::device();
    let expected = arrays(&coloured(&[Quantity::Spectra]), cpu(), 0..2);
    let scene = coloured(&[Quantity::Xyz]);
    let sampler = SceneSampler::new(&device, &scene).expect("it is possible");
    let prepared = sampler.prepare(&device, 0..2).expect("they are few");
    let mut encoder = device.create_command_encoder(&Default::default());
    prepared.record(&mut encoder);
    for (group, found) in read(&device, &queue, encoder, &prepared, &scene) {
        let expected = floats(&expected[&group]);
        let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-5 * b.abs().max(1.0);
        assert!(found.len() >= expected.len() && found.iter().zip(&expected).all(close), "{group}");
    }
    assert!(prepared.values("hues_xyz").is_some());
    assert_eq!(prepared.values("lamps_intensity"), Some([3.0; 2].as_slice()));
    assert_eq!(prepared.values("twins_intensity").map(<[f32]>::len), Some(2 * 4));
}

/// In a host's encoder the buffers hold what an engine draws.
/// More spectra in one scene than a software adapter binds to one dispatch.
#[test]
fn scenes_too_large_for_one_dispatch_are_drawn_in_parts() {
    let text = "scenes = 1\nseed = 4\n[[illuminant]]\nname = \"sun\"\nmodel = \"granada\"\ncount = 3\n\
                [[surface]]\nname = \"wall\"\nmodel = \"munsell-vrhel\"\ncount = 1100000\n";
    let scene = Scene::parse("walls.toml", text, Path::new("")).expect("it is a scene");
    let limits = gpu().adapter().expect("it is one");
    let (on_cpu, on_gpu) = (arrays(&scene, cpu(), 0..1), arrays(&scene, gpu(), 0..1));
    assert_eq!(on_cpu.keys().collect::<Vec<_>>(), on_gpu.keys().collect::<Vec<_>>());
    if gpu_is_software() {
        assert!(on_cpu == on_gpu, "{limits}");
    }
}

#[test]
fn a_host_records_the_same_scenes() {
    let (device, queue) = host::device();
    let software = device.adapter_info().device_type == wgpu::DeviceType::Cpu;
    let scene = everything().build().expect("it is possible");
    let expected = arrays(&scene, cpu(), 5..9);
    let sampler = SceneSampler::new(&device, &scene).expect("it is possible");
    let prepared = sampler.prepare(&device, 5..9).expect("they are few");
    let mut encoder = device.create_command_encoder(&Default::default());
    prepared.record(&mut encoder);
    for (group, found) in read(&device, &queue, encoder, &prepared, &scene) {
        let expected = floats(&expected[&group]);
        let found = &found[..expected.len()];
        if software {
            assert!(found == expected, "{group}");
        }
        let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-5 * b.abs().max(1.0);
        assert!(found.iter().zip(&expected).all(close), "{group}");
    }
    let intensity = floats(&expected["lights_intensity"]);
    assert_eq!(prepared.values("lights_intensity"), Some(intensity.as_slice()));
    assert_eq!(prepared.values("target_lrv"), Some(floats(&expected["target_lrv"]).as_slice()));
    assert!(prepared.buffer("nonesuch").is_none());
}

/// The buffer of each group, once what was recorded has run.
fn read(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    mut encoder: wgpu::CommandEncoder,
    prepared: &PreparedScene,
    scene: &Scene,
) -> Vec<(String, Vec<f32>)> {
    let mut copies = Vec::new();
    for group in scene.groups() {
        let buffer = prepared.buffer(group).expect("it is a group");
        let copy = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: buffer.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, None);
        copies.push((group, copy));
    }
    queue.submit([encoder.finish()]);
    copies
        .iter()
        .for_each(|(_, copy)| copy.map_async(wgpu::MapMode::Read, .., |mapped| mapped.expect("it maps")));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    let values = |(group, copy): (&str, wgpu::Buffer)| {
        (group.to_owned(), floats(&copy.get_mapped_range(..).expect("it is mapped")))
    };
    copies.into_iter().map(values).collect()
}

#[test]
fn what_is_left_out_is_said() {
    let shaders = |name| preset(name).workload(1000).shaders;
    assert_eq!([shaders("condition1"), shaders("condition2"), shaders("condition3")], [0, 1, 2]);
    let workload = preset("condition1").workload(1000);
    assert_eq!(workload.draws, 1 + 999 + 1000);
    let text = workload.left_out.join("\n");
    assert!(text.contains("background: it is fixed, so it is drawn and stored once"), "{text}");
    let lights = Illuminants::new("sky", &daylight(), 3).fixed();
    let brightened = lights.clone().intensity(Intensity::LogUniform(0.5, 2.0), IntensityScope::Light);
    for (lights, said) in [
        (lights, "sky: it is fixed, so it is drawn and stored once"),
        (brightened, "sky: its spectra are fixed, so they are drawn once, on the CPU, and only scaled"),
    ] {
        let text = Scene::builder(10)
            .group(lights)
            .build()
            .expect("it is possible")
            .workload(10)
            .left_out
            .join("\n");
        assert!(text.contains(said), "{text}");
    }
    let shared = Scene::builder(10)
        .group(Surfaces::new("a", &surfaces(), 3))
        .group(Surfaces::new("b", &surfaces(), 4))
        .build()
        .expect("it is possible")
        .workload(10);
    assert_eq!(shared.shaders, 1);
    let text = shared.left_out.join("\n");
    assert!(
        text.contains("b: no shader of its own") && text.contains("illuminants: the scene has none"),
        "{text}"
    );
    assert!(!text.contains("same shape"), "{text}");
}

/// The statistics of each preset against a program that shares none of the code. SPECTROLL_PYTHON names a Python that
/// has NumPy and SciPy; `make test` makes one.
#[test]
fn presets_agree_with_numpy() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = |name: &str| folder.path().join(name);
    for (name, text) in [("granada", daylight().to_json()), ("munsell-vrhel", surfaces().to_json())] {
        std::fs::write(path(&format!("{name}.json")), text).expect("it can be written");
    }
    let python = std::env::var("SPECTROLL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    for (name, _) in PRESETS {
        let scenes = preset(name).scenes();
        let program = env!("CARGO_BIN_EXE_spectroll");
        let file = format!("{name}.npz");
        let arguments = ["scene", "--example", name, "-o", &file, "--engine", "cpu", "-q"];
        let limit = ["--scenes".to_owned(), format!("0..{}", scenes.min(1000))];
        let drawn = Command::new(program).args(arguments).args(limit).current_dir(folder.path()).status();
        assert!(drawn.expect("it runs").success());
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scene_reference.py");
        let output =
            Command::new(&python).arg(script).args([name, &file]).current_dir(folder.path()).output();
        let output = output.expect("Python runs");
        let text =
            String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        println!("{text}");
        assert!(output.status.success(), "{name}: {text}");
    }
}
