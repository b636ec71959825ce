//! The parts of a draw and of a fit, one by one: `cargo bench --bench parts`.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use spectroll::{
    Bounds, BuiltinTable, Dataset, Engine, EngineChoice, EngineError, Extrapolation, Fit, Grid, Model, Real,
    Recipe, SpectrumKind, Stream, philox,
};

fn words(c: &mut Criterion) {
    let mut group = c.benchmark_group("words");
    group.throughput(Throughput::Elements(1000));
    group.bench_function("philox, 1000 blocks", |b| {
        b.iter(|| (0..1000).fold(0, |sum: u32, i| sum.wrapping_add(philox([i, 0, 0, 0], [1, 2])[0])))
    });
    group.bench_function("normals in f32, 1000 pairs", |b| {
        b.iter(|| (0..1000u32).map(|i| f32::normal_pair(i << 20, i << 22)[0]).sum::<f32>())
    });
    group.bench_function("normals in f64, 1000 pairs", |b| {
        b.iter(|| (0..1000u32).map(|i| f64::normal_pair(i << 20, i << 22)[0]).sum::<f64>())
    });
    group.finish();
}

fn fits(c: &mut Criterion) {
    let tables = [BuiltinTable::Munsell.table(), BuiltinTable::Vrhel.table()];
    let data =
        || Dataset::new(&tables, Grid::DEFAULT, Extrapolation::Error).expect("the tables cover the grid");
    let resampled = data();
    c.bench_function("resample 632 reflectances", |b| b.iter(|| black_box(data())));
    c.bench_function("fit 632 reflectances", |b| {
        b.iter(|| Fit::new(SpectrumKind::Reflectance).fit(&resampled))
    });
    let model = Model::builtin("munsell-vrhel").expect("it is built in");
    c.bench_function("build a recipe", |b| b.iter(|| Recipe::builder(&model).lrv(0.4).build()));
}

fn draws(c: &mut Criterion) {
    const COUNT: u64 = 200_000;
    let mut group = c.benchmark_group("draws");
    group.throughput(Throughput::Elements(COUNT)).sample_size(20);
    let surface = Model::builtin("munsell-vrhel").expect("it is built in");
    let light = Model::builtin("granada").expect("it is built in");
    let recipes = [
        ("reflectances", Recipe::builder(&surface)),
        ("reflectances of LRV 0.4, scaled", Recipe::builder(&surface).lrv(0.4).bounds(Bounds::Scaled)),
        ("illuminants", Recipe::builder(&light)),
    ];
    let engines = [("cpu", Engine::new(&EngineChoice::Cpu)), ("gpu", Engine::new(&EngineChoice::Gpu))];
    for (name, recipe) in recipes {
        let recipe = recipe.build().expect("it can be drawn");
        for (engine_name, engine) in &engines {
            let Ok(engine) = engine else { continue };
            let draws = Stream::new(1).draws(0..COUNT);
            let mut session = engine.session(&recipe).expect("the engine works");
            group.bench_function(format!("{name}, {engine_name}"), |b| {
                b.iter(|| session.draw::<EngineError>(draws, |_| Ok(())))
            });
        }
    }
    group.finish();
}

criterion_group!(benches, words, fits, draws);
criterion_main!(benches);
