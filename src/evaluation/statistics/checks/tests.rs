//! Checks by value: what SciPy makes of small samples.

use super::*;
use crate::evaluation::statistics::{Scenario, oracle, tinted};
use crate::random::real::Real;

/// The budget of false alarms, won back from each threshold.
#[test]
fn thresholds_spend_the_budget() {
    for comparisons in [1, 7, 500] {
        let spent = |p: f64| p * comparisons as f64 * RUNS as f64 / FALSE_ALARMS;
        assert!((spent(two_sided(sigmas(comparisons))) - 1.0).abs() < 1e-6);
        assert!((spent(2.0 * (-2.0 * supremum(comparisons).powi(2)).exp()) - 1.0).abs() < 1e-9);
    }
    let alarm =
        |p: f64| Finding { p_values: vec![0.5, p], worst: "the second".to_owned(), fault: None }.alarm();
    let limit = FALSE_ALARMS / RUNS as f64 / 2.0;
    assert_eq!((alarm(1.01 * limit), alarm(0.99 * limit)), (None, Some("the second".to_owned())));
    let mut finding = Finding::default();
    [0.5, 0.1, 0.3].into_iter().for_each(|p| finding.compare(p, || p.to_string()));
    assert_eq!((finding.worst.as_str(), finding.p_values), ("0.1", vec![0.5, 0.1, 0.3]));
}

/// Three draws, by hand.
#[test]
fn covariances_are_those_of_the_formula() {
    let scenario = Scenario::named("untruncated");
    let sample = |a: &[f64], b: &[f64]| sample(&scenario, &[a, b], &[], &[1.0; 3]);
    let (one, other) = (sample(&[1.0, 2.0, 6.0], &[2.0, 0.0, 1.0]), sample(&[1.0; 3], &[1.0, 2.0, 3.0]));
    // Deviations -2, -1, 3 and 1, -1, 0: products -2, 1, 0 with the mean -1/3 and the variance 14/9. The other sample's
    // are 0.
    let expected = two_sided((1.0 / 3.0) / (14.0f64 / 9.0 / 3.0).sqrt());
    let found = Check::named("covariance").run(&one, &other);
    assert!((found.p_values[1] - expected).abs() < 1e-12, "{found:?}");
}

#[test]
fn known_draws_are_compared_to_their_tolerance() {
    let scenario = Scenario::named("untruncated");
    let library = oracle(&scenario, 1, 8);
    let fault = |change: fn(&mut Sample)| {
        let mut sample = library.clone();
        change(&mut sample);
        known_draws(&sample, &library).fault
    };
    assert_eq!(fault(|s| s.bands[3][5] += 0.9e-4), None);
    assert!(fault(|s| s.bands[3][5] -= 1.1e-4).is_some_and(|fault| fault.starts_with("draw 5")));
    // One draw may be another, whatever its values; two may not.
    let flip = |s: &mut Sample, i: usize| {
        s.attempts[i] += 1.0;
        s.bands[0][i] += 0.5;
    };
    assert_eq!(fault(|s| s.attempts[2] += 1.0), None);
    let mut sample = library.clone();
    flip(&mut sample, 2);
    assert_eq!(known_draws(&sample, &library).fault, None);
    flip(&mut sample, 6);
    assert!(known_draws(&sample, &library).fault.is_some_and(|fault| fault.starts_with("2 draws")));
}

/// A number that is no multiple of the draws that share a generator.
#[test]
fn samples_have_as_many_draws_as_asked_for() {
    assert_eq!(oracle(&Scenario::named("untruncated"), 1, 1500).len(), 1500);
}

/// A sample of a scenario that has these series and no others.
fn sample<'a>(scenario: &'a Scenario, weights: &[&[f64]], bands: &[&[f64]], attempts: &[f64]) -> Sample<'a> {
    let owned = |series: &[&[f64]]| series.iter().map(|series| series.to_vec()).collect();
    Sample { scenario, weights: owned(weights), bands: owned(bands), attempts: attempts.to_vec() }
}

/// Six draws, and eight others.
fn samples(scenario: &Scenario) -> [Sample<'_>; 2] {
    [
        sample(
            scenario,
            &[&[1.0, 2.0, 4.0, 7.0, 3.0, 5.0], &[2.0, -1.0, 0.0, 3.0, 1.0, 4.0]],
            &[&[0.0005, 0.001, 0.3, 0.4, -0.0002, 0.2], &[0.5, 0.6, 0.9995, 1.0, 1.5, 0.3]],
            &[1.0, 2.0, 1.0, 3.0, 1.0, 2.0],
        ),
        sample(
            scenario,
            &[&[2.0, 1.0, 5.0, 6.0, 4.0, 8.0, 9.0, 3.0], &[0.0, 1.0, -2.0, 2.0, 5.0, 3.0, 1.0, 1.0]],
            &[&[0.0001, 0.2, 0.3, 0.2, 0.5, 0.7, 0.6, 0.3], &[0.4, 0.9991, 0.4, 0.4, 0.999, 0.8, 0.7, 0.2]],
            &[1.0, 1.0, 2.0, 4.0, 1.0, 1.0, 2.0, 1.0],
        ),
    ]
}

fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{what}: {found:?} where {expected:?} is right");
    }
}

#[test]
fn p_values_are_those_of_scipy() {
    let scenario = Scenario::named("untruncated");
    let [one, other] = samples(&scenario);
    let expected: [(&str, &[f64]); 5] = [
        ("acceptance", &[0.9288028096299434]),
        ("covariance", &[0.26940430024586837, 0.4567661329475926, 0.6894473501244044]),
        ("distribution", &[0.982890273573239, 0.999999998920501]),
        ("edges", &[0.3471525278629798, 0.3471525278629798, 0.07775989643932948]),
        (
            "neighbours",
            &[
                0.7427484576011969,
                0.46783065712424854,
                0.6423873645805428,
                0.1982248203587329,
                0.7331057124130173,
                0.6726038174415165,
                0.39822403745612067,
                0.5072768338651343,
                0.07299804543011548,
            ],
        ),
    ];
    for (name, p_values) in expected {
        let finding = Check::named(name).run(&one, &other);
        assert_eq!(finding.fault, None, "{name}");
        assert_close(&finding.p_values, p_values, name);
    }
    let means = Check::named("means").run(&one, &other).p_values;
    assert_close(&means[means.len() - 2..], &[0.378831851696519, 0.8981082501501875], "means of weights");
}

/// The model's own means and variances, so that the scale and the mean count.
#[test]
fn gaussians_are_those_of_the_model() {
    let scenario = Scenario::named("untruncated, tinted");
    let weights =
        weights_of(&scenario, &[[-1.5, -2.0], [-0.2, -1.0], [0.1, 0.3], [0.4, 0.5], [1.1, 0.6], [2.0, 0.7]]);
    let sample = sample(&scenario, &[&weights[0], &weights[1]], &[], &[1.0; 6]);
    let p_values = GAUSSIAN.run(&sample, &sample).p_values;
    assert_close(&p_values, &[0.8333783065026146, 0.716105346825894], "gaussian");
}

/// The first two weights of these normals.
fn weights_of(scenario: &Scenario, normals: &[[f64; 2]]) -> [Vec<f64>; 2] {
    let parts = scenario.model.parts();
    [0, 1].map(|j| {
        let deviation = (scenario.scale * parts.weight_covariance[(j, j)]).sqrt();
        normals.iter().map(|z| parts.weight_mean[j] + deviation * z[j]).collect()
    })
}

/// Radii whose last byte is below 128, and angles with every byte.
#[test]
fn low_bits_are_those_of_the_words() {
    let scenario = Scenario::named("untruncated, tinted");
    let word = |i: u32, byte: u32| i.wrapping_mul(0x9E37_79B9) & !0xFF | byte;
    let normals: Vec<_> =
        (0..256).map(|i| f64::normal_pair(word(2 * i, i % 128), word(2 * i + 1, i))).collect();
    let weights = weights_of(&scenario, &normals);
    let sample = sample(&scenario, &[&weights[0], &weights[1]], &[], &[1.0; 256]);
    assert_close(&LOW_BITS.run(&sample, &sample).p_values, &[5.14441874528483e-56, 1.0], "low bits");
}

#[test]
fn smallest_errors_are_those_of_the_formulas() {
    let scenario = Scenario::named("untruncated");
    let [mut one, _] = samples(&scenario);
    let smallest = smallest_errors(&one);
    let of = |s: &Smallest| [s.acceptance, s.mean, s.correlation, s.variance, s.edge, s.independence];
    let expected = [
        3.269262566761182,
        5.299617399801397,
        5.2729262116841085,
        7.457043761956252,
        52.464953374158895,
        3.799876922700432,
    ];
    assert_close(&of(&smallest), &expected, "smallest errors");
    assert_close(
        &[smallest.distribution, smallest.gaussian],
        &[2.9782498704115534, 2.1059406794359656],
        "distributions",
    );
    one.attempts.fill(1.0);
    assert_eq!(smallest_errors(&one).acceptance, 0.0);
}

/// The properties that its description promises, and no fit gives.
#[test]
fn the_tinted_model_is_tinted() {
    let model = tinted();
    let parts = model.parts();
    let values = parts.weight_covariance.clone().symmetric_eigenvalues();
    let largest = values.max();
    assert_eq!(values.iter().filter(|&&value| value > 1e-12 * largest).count(), parts.basis.nrows() - 2);
    assert!(parts.weight_mean.iter().all(|mean| *mean != 0.0));
    assert!((0..6).all(|i| (0..i).all(|j| parts.weight_covariance[(i, j)].abs() > 1e-6 * largest)));
}
