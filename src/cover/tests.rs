//! Covers of the regions that rules make.

use std::time::Instant;

use super::*;
use crate::colorimetry::lrv_weights;
use crate::model::Model;
use crate::program::{Bounds, Program, Target};
use crate::region::{Room, half_spaces, room};

fn program(lrv: Option<f64>, covariance_scale: f64) -> Program {
    let model = Model::builtin("munsell-vrhel").unwrap();
    let weights = lrv_weights(model.grid()).unwrap();
    let target = lrv.map(|lrv| Target { lrv, weights, bounds: Bounds::Scaled });
    Program::new(&model, covariance_scale, target, 1000)
}

fn cover(program: &Program) -> Cover {
    let half_spaces = half_spaces(program);
    let Room::Ball { centre, .. } = room(&half_spaces) else { panic!("{:?}", room(&half_spaces)) };
    Cover::new(&half_spaces, &centre).unwrap()
}

/// The cover of reflectances that are scaled to a luminous reflectance of 0.99.
pub(crate) fn near_white() -> Cover {
    cover(&program(Some(0.99), 1.0))
}

#[test]
fn figures() {
    for (lrv, scale) in [
        (Some(0.95), 1.0),
        (Some(0.98), 1.0),
        (Some(0.985), 1.0),
        (Some(0.99), 1.0),
        (Some(0.992), 1.0),
        (None, 1.0),
        (None, 25.0),
        (None, 100.0),
        (None, 1e4),
        (None, 1e6),
    ] {
        let program = program(lrv, scale);
        let start = Instant::now();
        let half_spaces = half_spaces(&program);
        let room = room(&half_spaces);
        let solved = start.elapsed();
        let cover = cover(&program);
        let built = start.elapsed();
        let estimate = cover.estimate(Stream::new(1), 65536);
        println!(
            "{lrv:?} {scale}: {} boxes, mass {:.3e}, {estimate:?}, room {solved:.1?}, built {built:.1?}, estimated {:.1?} {}",
            cover.len(),
            cover.mass(),
            start.elapsed() - built,
            match room {
                Room::Ball { radius, .. } => radius,
                _ => 0.0,
            }
        );
    }
}
