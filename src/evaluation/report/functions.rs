//! Functions of Box-Muller on each engine, ours and built-in: their errors, the effect of those on candidates, and
//! their cost.

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use super::engines::Subject;
use super::estimate::median;
use super::{Bench, ReportError};
use crate::dataset::SpectrumKind;
use crate::engine::compute::{Compute, Words};
use crate::random::normal::{circle, radius};
use crate::random::real::Real;
use crate::random::stream::Stream;
use crate::recipe::Recipe;
use crate::wgsl::{self, generator};

/// Number of pairs of normals that a thread makes when they are timed.
const TIMED: u32 = 64;

/// Number of threads when they are timed.
const THREADS: u32 = 1 << 15;

/// Functions that make normals on an engine.
#[derive(Clone, Debug, Serialize)]
pub struct Functions {
    /// The engine, as an index into the report's.
    pub engine: usize,
    /// Name of the functions.
    pub name: &'static str,
    /// Number of candidates that were compared.
    pub candidates: u64,
    /// Largest error of a radius, which reaches 6.76.
    pub radius: f64,
    /// Largest error of a sine or cosine.
    pub circle: f64,
    /// Largest error of a normal.
    pub normal: f64,
    /// Largest error of a candidate's value, where all else is computed in f64.
    pub spectrum: f64,
    /// Candidates that are accepted and should not be, or the other way round, per million.
    pub flips_per_million: f64,
    /// Nanoseconds per pair of normals, with all cores of the engine at work.
    pub nanoseconds: f64,
}

/// Radius, cosine and sine.
type Polar = [f32; 3];

const NAMES: [&str; 2] = ["own polynomials", "built-in log, sin, cos"];

/// Shader that writes radius, cosine and sine for each pair of words, in our way and in the textbooks'.
const SHADER: &str = "
@group(0) @binding(0) var<storage, read> words: array<vec2<u32>>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;

fn uniform_of(x: u32) -> f32 { return (f32(x) + 0.5f) * 2.3283064e-10f; }

fn builtin_radius(x: u32) -> f32 { return sqrt(max(-2f * log(uniform_of(x)), 0f)); }

fn builtin_circle(y: u32) -> vec2<f32> {
    let a = 6.2831855f * uniform_of(y);
    return vec2(cos(a), sin(a));
}

@compute @workgroup_size(64)
fn compare(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if i >= arrayLength(&words) { return; }
    let w = words[i];
    let own = circle(w.y);
    let builtin = builtin_circle(w.y);
    results[6u * i] = radius(w.x);
    results[6u * i + 1u] = own.x;
    results[6u * i + 2u] = own.y;
    results[6u * i + 3u] = builtin_radius(w.x);
    results[6u * i + 4u] = builtin.x;
    results[6u * i + 5u] = builtin.y;
}

@compute @workgroup_size(64)
fn time_own(@builtin(global_invocation_id) id: vec3<u32>) {
    var sum = vec2(f32(words[0].x & 1u));
    for (var j = 0u; j < TIMEDu; j++) {
        let x = (id.x * TIMEDu + j) * 2654435761u;
        sum += radius(x) * circle(x ^ 0x9E3779B9u);
    }
    results[id.x] = sum.x + sum.y;
}

@compute @workgroup_size(64)
fn time_builtin(@builtin(global_invocation_id) id: vec3<u32>) {
    var sum = vec2(f32(words[0].x & 1u));
    for (var j = 0u; j < TIMEDu; j++) {
        let x = (id.x * TIMEDu + j) * 2654435761u;
        sum += builtin_radius(x) * builtin_circle(x ^ 0x9E3779B9u);
    }
    results[id.x] = sum.x + sum.y;
}
";

pub(super) fn measure(bench: &Bench, recipe: &Recipe) -> Result<Vec<Functions>, ReportError> {
    let candidates = bench.effort.pick(1 << 16, 1 << 17, 1 << 18);
    let words = words(bench.seed, recipe.program().components(), candidates);
    let mut all = Vec::new();
    for (engine, target) in bench.targets.iter().enumerate() {
        bench.agenda.say(&format!("functions of {}", target.facts.name))?;
        let Some((results, nanoseconds)) = results(target, &words) else { continue };
        for ((name, polar), nanoseconds) in NAMES.into_iter().zip(results).zip(nanoseconds) {
            all.push(judge(engine, name, recipe, &words, &polar, nanoseconds));
        }
    }
    Ok(all)
}

/// Words of the normals of candidates: a pair of words for each pair of normals.
fn words(seed: u64, components: usize, candidates: u64) -> Vec<[u32; 2]> {
    let stream = Stream::named(seed, "functions");
    let pairs = components.div_ceil(2);
    let of = |i: u64| {
        let blocks = (0..components.div_ceil(4) as u32).flat_map(move |b| stream.block(i, 0, b));
        blocks.collect::<Vec<_>>().as_chunks::<2>().0[..pairs].to_vec()
    };
    (0..candidates).into_par_iter().flat_map_iter(of).collect()
}

/// Results of our functions and of the built-in ones for the words, and nanoseconds per pair of normals of each.
fn results(target: &Subject, words: &[[u32; 2]]) -> Option<([Vec<Polar>; 2], [f64; 2])> {
    let engine = target.engine()?;
    Some(match engine.device() {
        Some((device, queue)) => on_device(device, queue, words),
        None => on_cpu(words),
    })
}

fn on_cpu(words: &[[u32; 2]]) -> ([Vec<Polar>; 2], [f64; 2]) {
    let own = |x, y| {
        let [cosine, sine] = circle(y);
        [radius(x), cosine, sine]
    };
    let builtin = |x: u32, y: u32| {
        let uniform = |x: u32| (x as f32 + 0.5) * 2f32.powi(-32);
        let (sine, cosine) = (std::f32::consts::TAU * uniform(y)).sin_cos();
        [(-2.0 * uniform(x).ln()).max(0.0).sqrt(), cosine, sine]
    };
    let make = |f: &(dyn Fn(u32, u32) -> Polar + Sync)| words.par_iter().map(|&[x, y]| f(x, y)).collect();
    ([make(&own), make(&builtin)], [time_cpu(own), time_cpu(builtin)])
}

/// Times a function in lanes, as the engine draws, but with the instructions that every processor has.
fn time_cpu(f: impl Fn(u32, u32) -> Polar + Sync) -> f64 {
    const LANES: u32 = 16;
    let run = || {
        let start = Instant::now();
        let thread = |t: u32| {
            let mut sums = [0f32; LANES as usize];
            for j in (0..TIMED).step_by(LANES as usize) {
                for (lane, sum) in (0..LANES).zip(&mut sums) {
                    let x = (t * TIMED + j + lane).wrapping_mul(2_654_435_761);
                    let [r, c, s] = f(x, x ^ 0x9E37_79B9);
                    *sum += r * c + r * s;
                }
            }
            sums.iter().sum::<f32>()
        };
        std::hint::black_box((0..THREADS).into_par_iter().with_min_len(256).map(thread).sum::<f32>());
        1e9 * start.elapsed().as_secs_f64() / f64::from(THREADS * TIMED)
    };
    median(&[(); 5].map(|()| run()))
}

fn on_device(device: &wgpu::Device, queue: &wgpu::Queue, words: &[[u32; 2]]) -> ([Vec<Polar>; 2], [f64; 2]) {
    let text = generator(wgsl::Dialect::Baseline) + &SHADER.replace("TIMED", &TIMED.to_string());
    let buffers =
        [Words::Given(words.as_flattened()), Words::Written((6 * words.len()).max(THREADS as usize))];
    let compute = Compute::new(device, queue, text, &buffers);
    let time = |entry: &str| {
        let pipeline = compute.pipeline(entry);
        compute.run(&pipeline, THREADS); // the first compiles
        1e9 * median(&[(); 5].map(|()| compute.run(&pipeline, THREADS))) / f64::from(THREADS * TIMED)
    };
    let nanoseconds = ["time_own", "time_builtin"].map(time);
    compute.run(&compute.pipeline("compare"), words.len() as u32);
    let results = compute.read(1);
    let rows = bytemuck::cast_slice::<_, [Polar; 2]>(&results[..6 * words.len()]);
    ([0, 1].map(|i| rows.iter().map(|row| row[i]).collect()), nanoseconds)
}

fn judge(
    engine: usize,
    name: &'static str,
    recipe: &Recipe,
    words: &[[u32; 2]],
    polar: &[Polar],
    nanoseconds: f64,
) -> Functions {
    let program = recipe.program();
    let pairs = program.components().div_ceil(2);
    let limit = if program.kind == SpectrumKind::Reflectance { 1.0 } else { f64::INFINITY };
    let candidate = |z: &[f64]| -> Vec<f64> {
        let band = |b: usize| {
            program.spectrum.offset[b]
                + program.spectrum.gain.iter().zip(z).map(|(g, z)| g[b] * z).sum::<f64>()
        };
        (0..program.bands()).map(band).collect()
    };
    let accepted = |s: &[f64]| s.iter().all(|&s| s > 0.0 && s < limit);
    let of = |(words, polar): (&[[u32; 2]], &[Polar])| {
        let exact: Vec<f64> = words.iter().flat_map(|&[x, y]| f64::normal_pair(x, y)).collect();
        let ours: Vec<f64> =
            polar.iter().flat_map(|&[r, c, s]| [f64::from(r * c), f64::from(r * s)]).collect();
        let (a, b) = (candidate(&exact), candidate(&ours));
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        let (mut radius, mut circle) = (0f64, 0f64);
        for (exact, &[r, c, s]) in exact.as_chunks::<2>().0.iter().zip(polar) {
            let length = exact[0].hypot(exact[1]);
            radius = radius.max((f64::from(r) - length).abs());
            circle = circle.max((f64::from(c) - exact[0] / length).abs());
            circle = circle.max((f64::from(s) - exact[1] / length).abs());
        }
        let flip = f64::from(u8::from(accepted(&a) != accepted(&b)));
        [radius, circle, apart(&exact, &ours), apart(&a, &b), flip]
    };
    let chunks = words.par_chunks_exact(pairs).zip(polar.par_chunks_exact(pairs));
    let candidates = words.len() / pairs;
    let [radius, circle, normal, spectrum, flips] = chunks.map(of).reduce(
        || [0.0; 5],
        |a, b| [a[0].max(b[0]), a[1].max(b[1]), a[2].max(b[2]), a[3].max(b[3]), a[4] + b[4]],
    );
    Functions {
        engine,
        name,
        candidates: candidates as u64,
        radius,
        circle,
        normal,
        spectrum,
        flips_per_million: 1e6 * flips / candidates as f64,
        nanoseconds,
    }
}
