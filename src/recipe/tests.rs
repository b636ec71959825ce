//! Recipes that are refused, and the first draws of those that are not.

use super::*;
use crate::colorimetry::{Illuminant, Observer};
use crate::program::Bounds;
use crate::sensors::{ResponseScale, Sensors};

fn message(recipe: RecipeBuilder) -> String {
    recipe.build().unwrap_err().to_string()
}

/// The ends of a range, and the last of the data's powers, by the words that choose them.
#[test]
fn intensities_reach_both_of_their_ends() {
    let model = Model::builtin("granada").unwrap();
    let law = |intensity| {
        let recipe = Recipe::builder(&model).intensity(intensity).build().unwrap();
        recipe.program().intensity.clone().expect("it varies")
    };
    let range = law(Intensity::LogUniform(0.15, 150.0));
    for (word, share) in [(0, 0.0), (1 << 30, 0.25), (1 << 31, 0.5), (u32::MAX, 1.0)] {
        assert!((range.of(word) / (0.15 * 1000f64.powf(share)) - 1.0).abs() < 1e-8, "{word}");
    }
    let (powers, data) = (&model.parts().powers, law(Intensity::Data));
    let count = powers.len() as u64;
    assert_eq!(count, 2600);
    for (i, &power) in powers.iter().enumerate() {
        // The first and the last word that choose one of so many.
        let first = ((i as u64) << 32).div_ceil(count);
        let last = ((i as u64 + 1) << 32).div_ceil(count) - 1;
        assert_eq!([first, last].map(|word| data.of(word as u32)), [power; 2], "{i}");
    }
}

#[test]
fn what_cannot_be_drawn_says_why() {
    let surface = Recipe::builder(&Model::builtin("munsell-vrhel").unwrap());
    let light = Recipe::builder(&Model::builtin("granada").unwrap());
    let cones = || Sensors::builtin("ss2").unwrap();
    let aim = |channel: &str, response: f64| ResponseTarget::new(cones(), channel, response);
    for (recipe, part) in [
        (surface.clone().lrv(f64::NAN), "NaN: it is a fraction above 0 and below 1"),
        (surface.clone().lrv(0.0), "reflectance of 0:"),
        (surface.clone().lrv(0.996), "the largest is 0.995928"),
        (surface.clone().lrv(0.6..0.2), "between 0.6 and 0.2: the first must be below the second"),
        (surface.clone().lrv(0.4..0.4), "between 0.4 and 0.4: the first must be below the second"),
        (surface.clone().lrv(0.4..f64::NAN), "NaN: it is a fraction above 0 and below 1"),
        (surface.clone().lrv(0.0..0.4), "reflectance of 0:"),
        (surface.clone().lrv(0.2..1.5), "reflectance of 1.5:"),
        (surface.clone().lrv(0.2..0.996), "the largest is 0.995928"),
        (
            surface.clone().lrv(0.2..0.995).bounds(Bounds::Scaled),
            "upper end of target luminous reflectances between 0.2 and 0.995: none of 65536 was; lower that end",
        ),
        (
            surface.clone().lrv(0.2..0.95).bounds(Bounds::Both).max_attempts(100),
            "attempts or more, or lower that end",
        ),
        (
            surface.clone().lrv(0.2..0.6).bounds(Bounds::Both).proposal(ProposalKind::Cover),
            "no cover serves every target luminous reflectance between 0.2 and 0.6",
        ),
        (light.clone().lrv(0.2..0.5), "of illuminants"),
        (surface.clone().covariance_scale(f64::NAN), "finite and not negative"),
        (surface.clone().max_attempts(0), "at least 1 attempt"),
        (surface.clone().max_attempts(u32::MAX), "at most 2147483647"),
        (surface.clone().covariance_scale(1e6).proposal(ProposalKind::Plain), "none of 65536 was"),
        (surface.clone().covariance_scale(100.0).max_attempts(50), "attempts or more"),
        (light.clone().lrv(0.5), "of illuminants"),
        (light.clone().xyz([0.3; 3]), "of illuminants"),
        (surface.clone().xyz([0.3, 1.0, 0.3]), "Y above 0 and below 1"),
        (surface.clone().xyz([0.3, f64::NAN, 0.3]), "must be finite"),
        (surface.clone().xyz([0.3; 3]).lrv(0.3), "leave the target for it out"),
        (surface.clone().xyz([0.3; 3]).covariance_scale(0.0), "fit it with more components"),
        (surface.clone().bounds(Bounds::Both), "needs a target luminous reflectance"),
        (
            surface.clone().illuminant(Illuminant::E),
            "needs the quantity xyz, chromaticity, linear_srgb, lrv or responses of reflectances",
        ),
        (surface.clone().xyz_scale(XyzScale::UnitY).quantities([Quantity::Xyz]), "of illuminants"),
        (surface.clone().observer(Observer::Cie1964), "an observer needs the quantity xyz,"),
        (surface.clone().sensors(cones()), "a set of sensors needs the quantity responses"),
        (surface.clone().quantities([Quantity::Responses]), "it needs a set of sensors"),
        (surface.clone().quantities([Quantity::ColorSignal]), "it is of surfaces in scenes"),
        (
            surface.clone().response_scale(ResponseScale::Absolute),
            "a scale of responses needs the quantity responses",
        ),
        (
            light
                .clone()
                .sensors(cones())
                .response_scale(ResponseScale::White)
                .quantities([Quantity::Responses]),
            "relative to white needs reflectances",
        ),
        (surface.clone().target(aim("L", 0.0)), "a target response of ss2.L of 0:"),
        (surface.clone().target(aim("L", 40.0)), "did you mean 0.4?"),
        (surface.clone().target(aim("L", 0.9999)), "a response of ss2.L of 0.9999: the largest is 0.99"),
        (surface.clone().target(aim("K", 0.3)), "ss2 has no channel \"K\"; there are L, M, S"),
        (surface.clone().target(aim("L", 0.3)).lrv(0.3), "scaled to one of them, so leave the other out"),
        (surface.clone().target(aim("L", 0.3)).xyz([0.3; 3]), "leave the target for it out"),
        (light.clone().target(aim("L", 0.3)), "and this model is of illuminants"),
        (
            surface
                .clone()
                .target(ResponseTarget::new(cones(), "S", 0.2..0.6))
                .bounds(Bounds::Both)
                .proposal(ProposalKind::Cover),
            "no cover serves every target response of ss2.S between 0.2 and 0.6",
        ),
        (
            surface.clone().illuminant(Illuminant::Daylight(3000.0)).quantities([Quantity::Lrv]),
            "a daylight of 3000 K",
        ),
    ] {
        let text = message(recipe);
        assert!(text.contains(part), "{text}");
    }
    // What the message advises is enough.
    let advised = message(surface.clone().covariance_scale(100.0).max_attempts(50));
    let attempts = advised.split("; allow ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(surface.covariance_scale(100.0).max_attempts(attempts).build().is_ok());
}

#[test]
fn tristimulus_values_out_of_reach_come_with_the_nearest() {
    let surface = Recipe::builder(&Model::builtin("munsell-vrhel").unwrap());
    for xyz in [[0.1, 0.4, 0.05], [0.9, 0.3, 0.1], [0.95, 0.99, 1.07], [0.01, 0.02, 0.6]] {
        let error = surface.clone().xyz(xyz).build().unwrap_err();
        let RecipeError::UnreachableXyz { nearest: Some(nearest), .. } = error else { panic!("{error}") };
        assert!(error.to_string().contains(&format!("Y = {}, Z", nearest[1])), "{error}");
        assert!(surface.clone().xyz(nearest).build().is_ok(), "{error}");
    }
}

#[test]
fn a_model_without_room_names_its_wavelengths() {
    let mut parts = Model::builtin("munsell-vrhel").unwrap().parts().clone();
    parts.mean[3] = 9.0;
    parts.mean[4] = -9.0;
    let text = message(Recipe::builder(&Model::new(parts).unwrap()));
    assert!(text.contains("the bounds at 430 nm, 440 nm leave no room"), "{text}");
}

#[test]
fn values_beyond_f32_are_refused() {
    let mut parts = Model::builtin("granada").unwrap().parts().clone();
    parts.mean *= 1e35;
    assert!(message(Recipe::builder(&Model::new(parts).unwrap())).contains("where draws in f32 need"));
}

/// Frozen, so that a changed stream is a decision and not an accident.
#[test]
fn the_first_draw_stays_what_it_is() {
    let recipe = Recipe::builder(&Model::builtin("munsell-vrhel").unwrap()).build().unwrap();
    let drawn = recipe.draw::<f32>(Stream::new(1), 0);
    let (spectrum, status) = (drawn.spectrum(), drawn.status());
    let ends = [spectrum[0], spectrum[15], spectrum[30]].map(f32::to_bits);
    assert_eq!((ends, status.attempts(), status.above_one()), (FIRST, 1, false));
}

const FIRST: [u32; 3] = [1050670988, 1051942847, 1058168784];

#[test]
fn the_first_draw_with_a_target_of_its_own_stays_what_it_is() {
    let recipe = Recipe::builder(&Model::builtin("munsell-vrhel").unwrap()).lrv(0.2..0.6);
    let recipe = recipe.bounds(Bounds::Scaled).quantities([Quantity::Spectra, Quantity::Lrv]).build();
    let drawn = recipe.unwrap().draw::<f32>(Stream::new(1), 0);
    let (spectrum, lrv) = (drawn.spectrum(), drawn.values(Quantity::Lrv)[0]);
    assert_eq!([lrv, spectrum[0], spectrum[30]].map(f32::to_bits), FIRST_OF_ITS_OWN);
}

const FIRST_OF_ITS_OWN: [u32; 3] = [1058549709, 1057498696, 1064905033];
