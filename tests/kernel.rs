//! Draws about measured spectra, and from mixtures of normal distributions: as varied as the data, in the proportions that the
//! model says, at the ends of what can be asked for.

mod engines;
mod program;

use std::time::Instant;

use engines::{cpu, kernel_surfaces, surfaces};
use nalgebra::{DMatrix, DVector};
use program::{fails, script, succeeds};
use spectroll::evaluation::comparison::{Comparison, ComparisonFigures};
use spectroll::scene::{LrvLevels, Scene, TargetConstraint, Targets};
use spectroll::{
    Bounds, BuiltinTable, Dataset, Distribution, EngineError, Extrapolation, Fit, FitDistribution, Grid,
    MixtureComponent, Model, ModelError, ProposalKind, Quantity, Recipe, RecipeError, Sensors, SpectrumKind,
    Stream,
};

fn builtin(name: &str) -> Model {
    Model::builtin(name).expect("it is built in")
}

fn data(tables: &[BuiltinTable]) -> Dataset {
    let tables: Vec<_> = tables.iter().map(|table| table.table()).collect();
    Dataset::new(&tables, Grid::DEFAULT, Extrapolation::Error).expect("they have these wavelengths")
}

/// Figures of so many draws that chance moves none by more than 0.002.
fn figures(model: &Model, data: &Dataset) -> ComparisonFigures {
    let recipe = Recipe::builder(model).build().expect("it can be drawn");
    Comparison::new(&recipe, data, Stream::new(0), 300_000).expect("the data are of its kind").figures()
}

/// What is wanted of draws that are as varied as the data, and does not hold.
fn unlike(figures: &ComparisonFigures) -> Vec<&'static str> {
    let ratio = figures.drawn.determinant_ratio.expect("the data vary in all directions");
    let p = figures.drawn.chromaticity_p_value.expect("the grid is visible");
    let wanted = [
        (
            "means within 0.1 standard deviations",
            figures.weights.iter().all(|w| w.drawn.mean_shift.abs() < 0.1),
        ),
        ("a determinant of 0.75 to 1.2 of the data's", (0.75..1.2).contains(&ratio)),
        ("Kolmogorov-Smirnov distances below 0.1", figures.weights.iter().all(|w| w.drawn.distance < 0.1)),
        ("chromaticities that an energy test does not tell apart", p > 0.01),
    ];
    wanted.into_iter().filter(|(_, holds)| !holds).map(|(name, _)| name).collect()
}

/// Draws of the built-in kernels are like the data, which those of the Gaussian of the surfaces are not in any respect.
#[test]
fn draws_are_as_varied_as_the_data() {
    let (surfaces, daylights) =
        (data(&[BuiltinTable::Munsell, BuiltinTable::Vrhel]), data(&[BuiltinTable::Granada]));
    for (name, data) in [("munsell-vrhel-kernel", &surfaces), ("granada-kernel", &daylights)] {
        let figures = figures(&builtin(name), data);
        println!("{name}: {figures:#?}");
        assert_eq!(unlike(&figures), [""; 0], "{name}");
    }
    assert_eq!(unlike(&figures(&builtin("munsell-vrhel"), &surfaces)).len(), 4);
    assert!(!unlike(&figures(&builtin("granada"), &daylights)).is_empty());
}

/// The bandwidths that the built-in models have are those that a fit finds.
#[test]
fn bandwidths_of_built_in_models_are_found_by_a_fit() {
    for (name, kind, tables) in [
        (
            "munsell-vrhel-kernel",
            SpectrumKind::Reflectance,
            &[BuiltinTable::Munsell, BuiltinTable::Vrhel][..],
        ),
        ("granada-kernel", SpectrumKind::Illuminant, &[BuiltinTable::Granada]),
    ] {
        let fitted = Fit::new(kind).distribution(FitDistribution::Kernel(None)).fit(&data(tables)).unwrap();
        let bandwidth = |model: &Model| match model.distribution() {
            Distribution::Kernel { bandwidth, weights } => (*bandwidth, weights.nrows()),
            other => panic!("{other}"),
        };
        assert_eq!(bandwidth(&fitted), bandwidth(&builtin(name)), "{name}");
    }
}

/// Against NumPy, by scripts that choose among measured spectra in another way: at a false alarm rate of 1e-7 a comparison.
#[test]
fn draws_are_those_of_numpy() {
    let folder = tempfile::tempdir().unwrap();
    for (command, bandwidth) in
        [("munsell vrhel", "auto"), ("munsell vrhel", "0.08"), ("koivisto", "0.2"), ("granada", "auto")]
    {
        let fit =
            format!("fit {command} --distribution kernel --bandwidth {bandwidth} -o kernel.json --force");
        succeeds(folder.path(), &fit);
        let sample = "sample kernel.json -n 100000 --seed 5 --engine cpu --force -q";
        succeeds(folder.path(), &format!("{sample} -o spectra.npy"));
        succeeds(folder.path(), &format!("{sample} --quantities attempts -o attempts.npy"));
        let said = script(folder.path(), "kernel", "");
        assert!(said.contains("they agree"), "{command}: {said}");
    }
}

/// Weights of draws of a model, by the CPU engine, and the share of candidates that were accepted.
fn weights(model: &Model, seed: u64, count: u64) -> (Vec<Vec<f64>>, f64) {
    let recipe = Recipe::builder(model).quantities([Quantity::Weights]).build().expect("it can be drawn");
    let mut rows = Vec::new();
    let summary = cpu().draw(&recipe, Stream::new(seed).draws(0..count), |batch| {
        let values: &[f32] = bytemuck::cast_slice(batch.bytes(Quantity::Weights));
        rows.extend(
            values.chunks_exact(model.components()).map(|w| w.iter().map(|&w| f64::from(w)).collect()),
        );
        Ok::<_, EngineError>(())
    });
    let acceptance = summary.expect("every draw succeeds").acceptance().expect("there are draws");
    (rows, acceptance)
}

/// Largest distance of the distributions of a weight in two samples of equal size, times the root of half of that.
fn distance(a: &[Vec<f64>], b: &[Vec<f64>], weight: usize) -> f64 {
    let sorted = |rows: &[Vec<f64>]| {
        let mut values: Vec<f64> = rows.iter().map(|row| row[weight]).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let (a, b) = (sorted(a), sorted(b));
    let below = |values: &[f64], v: f64| values.partition_point(|x| *x <= v) as f64 / values.len() as f64;
    let largest = a.iter().map(|&v| (below(&a, v) - below(&b, v)).abs()).fold(0.0, f64::max);
    largest * (a.len() as f64 / 2.0).sqrt()
}

/// `sup` of two samples of one distribution is above this once in 10^8 times (Dvoretzky, Kiefer & Wolfowitz, with
/// Massart's constant).
const FAR: f64 = 3.1;

fn with_kernel(bandwidth: f64, weights: DMatrix<f64>) -> Model {
    builtin("munsell-vrhel").with_distribution(Distribution::Kernel { bandwidth, weights }).unwrap()
}

fn measured_weights(model: &Model) -> DMatrix<f64> {
    match model.distribution() {
        Distribution::Kernel { weights, .. } => weights.clone(),
        other => panic!("{other}"),
    }
}

#[test]
fn a_bandwidth_of_one_is_the_gaussian() {
    let measured = measured_weights(&builtin("munsell-vrhel-kernel"));
    let (gaussian, acceptance) = weights(&builtin("munsell-vrhel"), 1, 50_000);
    let (same, of_same) = weights(&with_kernel(1.0, measured.clone()), 2, 50_000);
    assert!((acceptance - of_same).abs() < 0.012, "{acceptance} {of_same}"); // 5.5 standard errors
    let (other, _) = weights(&with_kernel(0.9, measured), 3, 50_000);
    for weight in 0..6 {
        assert!(distance(&gaussian, &same, weight) < FAR, "weight {weight}");
    }
    assert!(distance(&gaussian, &other, 0) > FAR, "and one of 0.9 is told from it");
}

/// At a bandwidth of 0 the draws are the measured spectra, those alone that are physical, and each as often.
#[test]
fn a_bandwidth_of_zero_repeats_the_measured_spectra() {
    let model = builtin("munsell-vrhel-kernel");
    let measured = measured_weights(&model);
    let is_physical = |i: usize| {
        let row: Vec<f64> = measured.row(i).iter().copied().collect();
        model.reconstruct(&row).iter().all(|&s| s > 0.0 && s < 1.0)
    };
    let inside: Vec<usize> = (0..measured.nrows()).filter(|&i| is_physical(i)).collect();
    let model = with_kernel(0.0, measured.clone());
    let recipe = Recipe::builder(&model).build().unwrap();
    assert_eq!(recipe.left_out(), measured.nrows() - inside.len());
    assert!(recipe.left_out() > 0, "some are outside once they are projected");
    let (drawn, acceptance) = weights(&model, 4, 100_000);
    assert_eq!(acceptance, 1.0);
    let mut counts = vec![0u32; measured.nrows()];
    for row in &drawn {
        let nearest = |&i: &usize| -> f64 { (0..6).map(|j| (measured[(i, j)] - row[j]).powi(2)).sum() };
        let at = (0..measured.nrows()).min_by(|a, b| nearest(a).total_cmp(&nearest(b))).unwrap();
        assert!(nearest(&at).sqrt() < 2e-5, "{row:?}");
        counts[at] += 1;
    }
    let expected = 100_000.0 / inside.len() as f64;
    let statistic: f64 = inside.iter().map(|&i| (f64::from(counts[i]) - expected).powi(2) / expected).sum();
    // A chi-square of some 625 degrees of freedom is beyond 5.5 standard deviations once in 10^7 times.
    let freedom = inside.len() as f64 - 1.0;
    assert!((statistic - freedom).abs() < 5.5 * (2.0 * freedom).sqrt(), "{statistic}");
    assert!((0..counts.len()).all(|i| inside.contains(&i) || counts[i] == 0));
}

/// Under every rule each spectrum that has a share has an equal one, to the error of its acceptance's estimate; without the
/// odds, those that are mostly rejected would have next to none.
#[test]
fn spectra_have_equal_shares_under_every_rule() {
    let measured = measured_weights(&builtin("munsell-vrhel-kernel"));
    let model = with_kernel(0.05, measured.clone());
    for rule in [None, Some((0.4, Bounds::Scaled)), Some((0.6, Bounds::Both))] {
        let builder = Recipe::builder(&model).quantities([Quantity::Weights]);
        let builder = rule.map_or(builder.clone(), |(lrv, bounds)| builder.lrv(lrv).bounds(bounds));
        let recipe = builder.build().unwrap();
        let mut counts = vec![0u32; measured.nrows()];
        let scale: Vec<f64> =
            model.parts().weight_covariance.diagonal().iter().map(|v| v.sqrt().recip()).collect();
        let drawn = cpu().draw(&recipe, Stream::new(3).draws(0..200_000), |batch| {
            for row in bytemuck::cast_slice::<_, f32>(batch.bytes(Quantity::Weights)).chunks_exact(6) {
                let distance = |&i: &usize| -> f64 {
                    (0..6).map(|j| (scale[j] * (measured[(i, j)] - f64::from(row[j]))).powi(2)).sum()
                };
                let nearest = (0..counts.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
                counts[nearest] += 1;
            }
            Ok::<_, EngineError>(())
        });
        drawn.expect("every draw succeeds");
        let kept = measured.nrows() - recipe.left_out();
        let expected = 200_000.0 / kept as f64;
        let errors: Vec<f64> = counts
            .iter()
            .filter(|count| **count > 0)
            .map(|&count| f64::from(count) / expected - 1.0)
            .collect();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        println!("{rule:?}: {kept} spectra, rms {rms:.3}, by chance {:.3}", expected.sqrt().recip());
        // A few are so near to others that a draw about one is nearer to the other.
        assert!(errors.len().abs_diff(kept) <= kept / 50, "{rule:?}: {} of {kept}", errors.len());
        assert!(rms < 0.25, "{rule:?}: {rms}");
    }
}

#[test]
fn one_spectrum_and_repeated_spectra() {
    let measured = measured_weights(&builtin("munsell-vrhel-kernel"));
    // Near the mean, so that next to nothing is rejected.
    let near = |&a: &usize, &b: &usize| measured.row(a).norm().total_cmp(&measured.row(b).norm());
    let one = (0..measured.nrows()).min_by(near).unwrap();
    let (alone, acceptance) = weights(&with_kernel(0.1, measured.rows(one, 1).into_owned()), 5, 20_000);
    assert!(acceptance > 0.9);
    let factor = (1.0f64 - 0.01).sqrt();
    let mean: f64 = alone.iter().map(|row| row[0]).sum::<f64>() / 20_000.0;
    let deviation = 0.1 * builtin("munsell-vrhel").parts().weight_covariance[(0, 0)].sqrt();
    assert!((mean - factor * measured[(one, 0)]).abs() < 6.0 * deviation / 20_000f64.sqrt(), "{mean}");

    let twice = DMatrix::from_fn(2 * measured.nrows(), 6, |i, j| measured[(i / 2, j)]);
    let (once, twice) =
        (weights(&with_kernel(0.3, measured), 6, 50_000), weights(&with_kernel(0.3, twice), 7, 50_000));
    for weight in 0..6 {
        assert!(distance(&once.0, &twice.0, weight) < FAR, "weight {weight}");
    }
}

/// Spectra far outside the bounds have no share, and take none of the others'.
#[test]
fn spectra_outside_the_bounds_are_left_out() {
    let measured = measured_weights(&builtin("munsell-vrhel-kernel"));
    let rows = measured.nrows();
    let added =
        DMatrix::from_fn(rows + 50, 6, |i, j| if i < rows { measured[(i, j)] } else { 20.0 + i as f64 });
    let recipe = |weights| Recipe::builder(&with_kernel(0.25, weights)).build().unwrap();
    let (before, after) = (recipe(measured.clone()), recipe(added.clone()));
    assert_eq!(after.left_out(), before.left_out() + 50);
    let (once, more) =
        (weights(&with_kernel(0.25, measured), 8, 50_000), weights(&with_kernel(0.25, added), 9, 50_000));
    assert!((once.1 - more.1).abs() < 0.012);
    for weight in 0..6 {
        assert!(distance(&once.0, &more.0, weight) < FAR, "weight {weight}");
    }
    let outside = Recipe::builder(&with_kernel(0.1, DMatrix::from_element(3, 6, 50.0))).build();
    assert!(matches!(outside, Err(RecipeError::NoCentres { count: 3, .. })), "{outside:?}");
}

/// A distribution with next to no share is next to never drawn, and takes nothing from the others.
#[test]
fn shares_may_differ_by_any_factor() {
    let model = builtin("munsell-vrhel");
    let covariance = model.parts().weight_covariance.clone() * 0.0025;
    let component = |share, first: f64| MixtureComponent {
        share,
        mean: DVector::from_fn(6, |j, _| if j == 0 { first } else { 0.0 }),
        covariance: covariance.clone(),
    };
    let mixture = |shares: [f64; 2]| {
        let components = vec![component(shares[0], -0.5), component(shares[1], 0.5)];
        model.with_distribution(Distribution::Mixture(components)).unwrap()
    };
    let positive = |shares| {
        let (drawn, _) = weights(&mixture(shares), 10, 100_000);
        drawn.iter().filter(|row| row[0] > 0.0).count()
    };
    assert_eq!(positive([1.0, 1e-12]), 0);
    let quarter = positive([3.0, 1.0]) as f64 / 100_000.0;
    assert!((quarter - 0.25).abs() < 6.0 * (0.25f64 * 0.75 / 1e5).sqrt(), "{quarter}");
}

/// As many spectra as the table of an adapter holds; what is built is not slower than it may be by far on any machine.
#[test]
fn a_million_spectra() {
    let measured = measured_weights(&builtin("munsell-vrhel-kernel"));
    let many = |count: usize| {
        let moved = |i: usize, j: usize| measured[(i % 632, j)] * (1.0 + 1e-3 * (i / 632) as f64 / 1659.0);
        DMatrix::from_fn(count, 6, moved)
    };
    let model = with_kernel(0.2, many(1 << 20));
    let start = Instant::now();
    let recipe = Recipe::builder(&model).quantities([Quantity::Weights]).build().unwrap();
    println!("a table of 2^20 spectra took {:.2} s", start.elapsed().as_secs_f64());
    // Eight numbers and a word of the alias table for each.
    assert_eq!(recipe.tables().len(), 36 << 20);
    let (drawn, _) = weights(&model, 11, 50_000);
    let (few, _) = weights(&with_kernel(0.2, measured.clone()), 12, 50_000);
    for weight in 0..6 {
        assert!(distance(&drawn, &few, weight) < FAR, "weight {weight}");
    }
    let too_many = Distribution::Kernel { bandwidth: 0.2, weights: many((1 << 20) + 1) };
    let refused = builtin("munsell-vrhel").with_distribution(too_many);
    assert!(matches!(refused, Err(ModelError::Centres { found: 1_048_577, .. })));
    let model = with_kernel(0.2, many(2600));
    let start = Instant::now();
    Recipe::builder(&model).build().unwrap();
    println!("a recipe of 2,600 spectra took {:.0} ms", 1e3 * start.elapsed().as_secs_f64());
}

/// What would change the shares of the spectra is refused, with its reason.
#[test]
fn what_would_change_the_shares_is_refused() {
    let sensors = Sensors::builtin("cie1931").unwrap();
    for (builder, other) in [
        (kernel_surfaces().xyz([0.3, 0.3, 0.3]), "target tristimulus values"),
        (kernel_surfaces().proposal(ProposalKind::Cover), "a cover"),
        (kernel_surfaces().lrv(0.2..0.6).bounds(Bounds::Scaled), "a target of each draw's own"),
        (kernel_surfaces().given(sensors), "responses that each draw is given"),
    ] {
        let refused = builder.build().unwrap_err().to_string();
        assert!(refused.contains(other), "{refused}");
    }
    // Where the base is bounded, a target of each draw's own changes nothing.
    assert!(kernel_surfaces().lrv(0.2..0.6).build().is_ok());
    // The same recipe of the Gaussian is drawn.
    assert!(surfaces().lrv(0.2..0.6).bounds(Bounds::Scaled).build().is_ok());
    // So are the targets of scenes; levels that all scenes have are each a recipe of its own.
    let scene = |model: &str, levels, bounds| {
        let targets = Targets::new("walls", &builtin(model), TargetConstraint::Lrv(levels));
        Scene::builder(10).group(targets.bounds(bounds)).build()
    };
    let kernel = "munsell-vrhel-kernel";
    let own = LrvLevels::Uniform(0.2, 0.6);
    let refused = scene(kernel, own.clone(), Bounds::Scaled).err().expect("it is refused").to_string();
    assert!(refused.contains("walls") && refused.contains("a target of each draw's own"), "{refused}");
    assert!(scene(kernel, own.clone(), Bounds::Base).is_ok());
    assert!(scene(kernel, LrvLevels::Each(vec![0.2, 0.6]), Bounds::Scaled).is_ok());
    assert!(scene("munsell-vrhel", own, Bounds::Scaled).is_ok());
}

/// A model file keeps its distribution, and one that is no distribution is refused with what is wrong.
#[test]
fn model_files_keep_their_distribution() {
    for distribution in [FitDistribution::Kernel(Some(0.125)), FitDistribution::Mixture(3)] {
        let fit = Fit::new(SpectrumKind::Reflectance).components(4).distribution(distribution);
        let model = fit.fit(&data(&[BuiltinTable::Macbeth])).unwrap();
        assert_eq!(Model::from_json("model", &model.to_json()).unwrap(), model);
    }
    assert!(!builtin("munsell-vrhel").to_json().contains("distribution"));
    let text = with_kernel(0.5, DMatrix::from_element(1, 6, 0.0)).to_json();
    for (from, to, message) in [
        ("\"bandwidth\": 0.5", "\"bandwidth\": 1.5", "a bandwidth of 1.5"),
        ("\"kind\": \"kernel\"", "\"kind\": \"kernal\"", "unknown variant `kernal`"),
        ("\"bandwidth\": 0.5", "\"bandwith\": 0.5", "unknown field `bandwith`"),
    ] {
        assert!(text.contains(from), "{text}");
        let error = Model::from_json("model", &text.replacen(from, to, 1)).unwrap_err();
        let said = std::iter::successors(Some(&error as &dyn std::error::Error), |e| e.source());
        let said: String = said.map(|e| e.to_string() + "; ").collect();
        assert!(said.contains(message), "{said}");
    }
    let weights = DMatrix::from_element(2, 5, 0.1);
    let refused =
        builtin("munsell-vrhel").with_distribution(Distribution::Kernel { bandwidth: 0.5, weights });
    assert!(matches!(refused, Err(ModelError::Shape { found: 5, expected: 6, .. })), "{refused:?}");
}

#[test]
fn options_of_a_fit_belong_to_their_distribution() {
    let folder = tempfile::tempdir().unwrap();
    let fit = |options: &str| format!("fit macbeth -k 4 -o m.json {options}");
    for (options, code, message) in [
        ("--bandwidth 0.2", 2, "--bandwidth needs --distribution kernel"),
        ("--distribution mixture --bandwidth 0.2", 2, "--bandwidth needs --distribution kernel"),
        ("--distribution kernel -g 2", 2, "--mixture-components needs --distribution mixture"),
        ("--distribution kernel --bandwidth wide", 2, "expected auto, or a number from 0 to 1"),
        ("--distribution kernel --bandwidth 1.5", 4, "a bandwidth of 1.5"),
        ("--distribution kernel --bandwidth -1", 4, "a bandwidth of -1"),
        ("--distribution mixture -g 0", 4, "a mixture of 0"),
        ("--distribution mixture -g 13", 4, "at most half as many as spectra"),
    ] {
        fails(folder.path(), &fit(options), code, message);
    }
    let (_, said) = succeeds(folder.path(), &fit("--distribution mixture -g 2"));
    assert!(said.contains("mixture of 2 normal distributions: "), "{said}");
    let (said, _) = succeeds(folder.path(), "inspect m.json");
    assert!(said.contains("mixture of 2 normal distributions: "), "{said}");
}
