//! Answers to colours of which no draw was accepted, and to those that no spectrum has.

use super::*;

fn answers(
    recipe: &Recipe,
    engine: &Engine,
    colours: &[f32],
    hard: HardColours,
    far: UnreachableColours,
) -> (AnswerCounts, Vec<Answer>, Vec<f32>) {
    let count = (colours.len() / 3) as u64;
    let (mut all, mut spectra) = (Vec::new(), Vec::new());
    let counts = Metamers::new(engine, recipe)
        .expect("it works")
        .hard(hard)
        .unreachable(far)
        .draw(Stream::new(9).draws(0..count), colours, |window| {
            all.extend_from_slice(window.answers);
            spectra.extend(bytemuck::pod_collect_to_vec::<u8, f32>(window.arrays().next().expect("spectra")));
            Ok::<_, MetamerError>(())
        })
        .expect("it draws");
    (counts, all, spectra)
}

#[test]
fn hard_and_unreachable_colours_have_their_answers() {
    let recipe = given().max_attempts(5).build().expect("it can be drawn");
    let colours: Vec<f32> = [HARD, [0.33, 0.30, 0.24], [1.0, 1.0, 1.0], [0.1, 0.9, 0.1], HARD].concat();
    let weights = seen();
    let error = |number: usize, spectra: &[f32]| {
        let spectrum = &spectra[31 * number..][..31];
        let differences = weights
            .iter()
            .zip(&colours[3 * number..])
            .map(|(w, c)| (product(w, spectrum) - f64::from(*c)).abs());
        differences.fold(0.0, f64::max)
    };
    let (counts, found, spectra) =
        answers(&recipe, cpu(), &colours, HardColours::Mode, UnreachableColours::Leave);
    assert_eq!((counts.mode, counts.sampled, counts.unreachable), (2, 1, 2), "{found:?}");
    assert!(matches!(
        found[..],
        [Answer::Mode, Answer::Sampled { .. }, Answer::Unreachable, Answer::Unreachable, Answer::Mode]
    ));
    assert!(error(0, &spectra) < BOUND && spectra[..31].iter().all(|&v| v > 0.0 && v < 1.0));
    assert!(spectra[62..124].iter().all(|&v| v == 0.0));
    assert_eq!(spectra[..31], spectra[124..]); // the mode takes no random numbers
    assert_eq!((found.clone(), spectra.clone()), {
        let (_, found, spectra) =
            answers(&recipe, gpu(), &colours, HardColours::Mode, UnreachableColours::Leave);
        (
            found,
            if gpu_is_software() {
                spectra
            } else {
                answers(&recipe, cpu(), &colours, HardColours::Mode, UnreachableColours::Leave).2
            },
        )
    });

    let (counts, found, spectra) =
        answers(&recipe, cpu(), &colours, HardColours::Skip, UnreachableColours::Nearest);
    assert_eq!((counts.skipped, counts.nearest), (2, 2), "{found:?}");
    assert!(spectra[..31].iter().all(|&v| v == 0.0));
    for number in [2, 3] {
        let Answer::Nearest { distance } = found[number] else { panic!("{:?}", found[number]) };
        assert!((error(number, &spectra) - f64::from(distance)).abs() < BOUND && distance > 0.0);
        assert!(spectra[31 * number..][..31].iter().all(|&v| v > 0.0 && v < 1.0));
    }
    // White is nearly there.
    assert!(found[2].distance() < 0.03, "{found:?}");

    let failed = Metamers::new(cpu(), &recipe)
        .expect("it works")
        .hard(HardColours::Error)
        .draw(Stream::new(9).draws(0..5), &colours, |_| Ok::<_, MetamerError>(()))
        .unwrap_err();
    assert!(
        failed
            .to_string()
            .contains("draw 0: no spectrum with the responses [0.43, 0.6, 0.06] was found in 5"),
        "{failed}"
    );
}

/// Each answer's other quantities are those of its spectrum, also where no engine drew it.
#[test]
fn quantities_of_answers_are_those_of_their_spectra() {
    use Quantity::{Chromaticity, LinearSrgb, Lrv, Spectra, Weights, Xyz};
    let wanted = [Spectra, Weights, Xyz, Chromaticity, LinearSrgb, Lrv];
    let recipe = given().max_attempts(5).quantities(wanted).build().expect("it can be drawn");
    let colours: Vec<f32> = [HARD, [0.33, 0.30, 0.24], [1.0, 1.0, 1.0]].concat();
    let metamers = Metamers::new(cpu(), &recipe).expect("it works");
    let mut all: Vec<(Quantity, Vec<f32>)> = Vec::new();
    let counts = metamers
        .hard(HardColours::Mode)
        .unreachable(UnreachableColours::Nearest)
        .draw(Stream::new(9).draws(0..3), &colours, |window| {
            let values = window.arrays().map(bytemuck::pod_collect_to_vec::<u8, f32>);
            all.extend(window.formats().iter().map(|format| format.quantity).zip(values));
            Ok::<_, MetamerError>(())
        })
        .expect("it draws");
    assert_eq!([counts.mode, counts.sampled, counts.nearest], [1; 3]);
    let of = |quantity: Quantity, draw: usize| -> Vec<f64> {
        let (_, values) = all.iter().find(|(other, _)| *other == quantity).expect("it was asked for");
        let width = values.len() / 3;
        values[draw * width..][..width].iter().map(|&value| value.into()).collect()
    };
    let weights = colorimetry::xyz_weights(&Grid::DEFAULT).expect("it is visible");
    let luminance: f64 = weights[1].iter().sum();
    for draw in 0..3 {
        let spectrum: Vec<f32> = of(Spectra, draw).into_iter().map(|value| value as f32).collect();
        let xyz = [0, 1, 2].map(|i| product(&weights[i], &spectrum) / luminance);
        let sum: f64 = xyz.iter().sum();
        let rgb = of(LinearSrgb, draw);
        let expected = [
            (Xyz, xyz.to_vec()),
            (Chromaticity, vec![xyz[0] / sum, xyz[1] / sum]),
            (Lrv, vec![xyz[1]]),
            (Weights, model().project(&of(Spectra, draw)).as_slice().to_vec()),
        ];
        for (quantity, expected) in expected {
            let found = of(quantity, draw);
            assert_eq!(found.len(), expected.len(), "{quantity:?}");
            let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < BOUND, "{quantity:?} of draw {draw}: {found:?} where {expected:?} is right");
        }
        let again = colorimetry::linear_srgb_to_xyz([rgb[0], rgb[1], rgb[2]]);
        assert!(again.iter().zip(xyz).all(|(a, b)| (a - b).abs() < BOUND), "{again:?} {xyz:?}");
    }
}

/// What stands in for a draw has the colour of that draw, in every window of a large run: rows of 301 bands are so long that
/// a part of it takes several.
#[test]
fn answers_have_their_own_colours_in_every_window() {
    let model = Model::builtin_with("munsell-vrhel", "400:1:700".parse().expect("a grid"), 8);
    let model = model.expect("it is built in");
    let recipe = Recipe::builder(&model).given(eye()).max_attempts(1).build().expect("it can be drawn");
    let weights = colorimetry::xyz_weights(model.grid()).expect("it is visible");
    let weights = weights.map(|w| w.iter().map(|v| v / w.iter().sum::<f64>()).collect::<Vec<f64>>());
    let count = 1 << 17;
    let some = colours_of_draws(97);
    let colours: Vec<f32> = some.iter().copied().cycle().take(3 * count).collect();
    let mut windows = 0;
    let counts = Metamers::new(cpu(), &recipe)
        .expect("it works")
        .draw(Stream::new(4).draws(0..count as u64), &colours, |window| {
            windows += 1;
            let spectra: &[f32] = bytemuck::cast_slice(window.arrays().next().expect("there are spectra"));
            for (number, answer) in window.answers.iter().enumerate().step_by(7) {
                if matches!(answer, Answer::Unreachable) {
                    continue; // on this grid, and with these components
                }
                let colour = &colours[3 * (window.draws.first as usize + number)..][..3];
                let spectrum = &spectra[301 * number..][..301];
                for (weights, given) in weights.iter().zip(colour) {
                    let difference = (product(weights, spectrum) - f64::from(*given)).abs();
                    assert!(difference < BOUND, "draw {} of {answer:?}: {difference}", window.draws.first);
                }
            }
            Ok::<_, MetamerError>(())
        })
        .expect("it draws");
    // Parts begin at 0, 2^14, 2^15 and 2^16: more windows than parts.
    assert!(windows > 4 && counts.mode > 1000 && counts.unreachable < counts.mode, "{windows} {counts:?}");
}

/// Colours that are far from what any spectrum has are drawn once and known from then on; it shows in no answer.
#[test]
fn colours_that_came_up_before_have_the_same_answers() {
    let mut colours = colours_of_draws(3000);
    for (number, colour) in colours.chunks_exact_mut(3).enumerate() {
        match number % 3 {
            0 => colour.fill(1.0),
            // Hard, or out of reach by little or by far.
            1 => colour.copy_from_slice(&[0.93, 0.90, 0.05 + 0.01 * (number % 40) as f32]),
            _ => {}
        }
    }
    let recipe =
        given().quantities([Quantity::Spectra, Quantity::Attempts]).max_attempts(200).build().unwrap();
    for engine in [cpu(), gpu()] {
        for unreachable in [UnreachableColours::Leave, UnreachableColours::Nearest] {
            let metamers = Metamers::new(engine, &recipe).unwrap_or_else(|e| panic!("{engine}: {e}"));
            let mut metamers = metamers.unreachable(unreachable);
            let mut answers = || {
                let (mut all, mut bytes) = (Vec::new(), Vec::new());
                let counts = metamers.draw(Stream::new(3).draws(5..3005), &colours, |window| {
                    assert_eq!(window.draws.first, 5 + all.len() as u64);
                    all.extend_from_slice(window.answers);
                    bytes.resize_with(window.formats().len(), Vec::new);
                    bytes.iter_mut().zip(window.arrays()).for_each(|(all, some)| all.extend_from_slice(some));
                    Ok::<_, MetamerError>(())
                });
                (all, bytes, counts.expect("every colour may be left or moved"))
            };
            let (first, second) = (answers(), answers());
            assert!(first == second, "{engine}, {unreachable:?}");
            assert_eq!(first.0.len(), 3000);
            let kinds = |kind: fn(&Answer) -> bool| first.0.iter().filter(|answer| kind(answer)).count();
            assert!(kinds(|answer| matches!(answer, Answer::Sampled { .. })) >= 1000);
            assert!(kinds(|answer| matches!(answer, Answer::Nearest { .. } | Answer::Unreachable)) >= 1000);
        }
    }
}

/// The mode is smooth in the model's sense: no other spectrum of that colour is more probable, and drawn ones are less.
#[test]
fn no_draw_is_more_probable_than_the_mode() {
    let recipe = given().max_attempts(1_000_000).build().expect("it can be drawn");
    let model = model();
    let inverse = model.parts().weight_covariance.clone().try_inverse().expect("it has full rank");
    let improbable = |spectrum: &[f32]| {
        let values = DVector::from_fn(31, |band, _| f64::from(spectrum[band])) - &model.parts().mean;
        let weights = &model.parts().basis * &values - &model.parts().weight_mean;
        (weights.transpose() * &inverse * &weights)[0]
    };
    for colour in [HARD, [0.33, 0.30, 0.24], [0.7, 0.75, 0.6]] {
        let mut mode = Vec::new();
        Metamers::new(cpu(), &recipe)
            .expect("it works")
            .modes(&colour, |window| {
                mode = bytemuck::pod_collect_to_vec::<u8, f32>(window.arrays().next().expect("spectra"));
                Ok::<_, MetamerError>(())
            })
            .expect("it has one");
        let least = improbable(&mode);
        let drawn = of_colour(&recipe, 80, colour, 2000);
        assert!(drawn.chunks(31).all(|spectrum| improbable(spectrum) > least - 1e-3), "{colour:?} {least}");
    }
}

/// All of a cube of sRGB colours, with the numbers that the guide states; `cargo test --release --test metamers -- --ignored
/// --nocapture cube`.
#[test]
#[ignore = "a quarter of a million colours"]
fn all_of_the_srgb_cube_is_answered() {
    let recipe = given().max_attempts(1000).build().expect("it can be drawn");
    let weights = seen();
    let decode = |i: u32| {
        let v = f64::from(i) / 63.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    };
    let whites =
        colorimetry::xyz_weights(&Grid::DEFAULT).expect("it is visible").map(|w| w.iter().sum::<f64>());
    let colours: Vec<f32> = (0..1u32 << 18)
        .flat_map(|i| {
            let xyz = colorimetry::linear_srgb_to_xyz([i >> 12, (i >> 6) & 63, i & 63].map(decode));
            [0, 1, 2].map(|c| (xyz[c] / whites[c]) as f32)
        })
        .collect();
    let start = std::time::Instant::now();
    let (counts, found, spectra) =
        answers(&recipe, cpu(), &colours, HardColours::Mode, UnreachableColours::Nearest);
    let seconds = start.elapsed().as_secs_f64();
    let mut worst = 0.0f64;
    for ((answer, spectrum), colour) in found.iter().zip(spectra.chunks(31)).zip(colours.chunks(3)) {
        assert!(spectrum.iter().all(|&value| value > 0.0 && value < 1.0), "{answer:?}");
        let errors = weights.iter().zip(colour).map(|(w, c)| (product(w, spectrum) - f64::from(*c)).abs());
        worst = worst.max(errors.fold(0.0, f64::max) - f64::from(answer.distance()));
    }
    println!("{counts:?}, largest error {worst:.1e}, {seconds:.1} s");
    assert_eq!(counts.all(), 1 << 18);
    assert!(worst < BOUND, "{worst}");
}
