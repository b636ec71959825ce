//! The test of a candidate: whether its spectrum is physical, before scaling, after it or both. CPU twin:
//! `src/cpu/acceptance.rs`.

use super::Part;
use super::writer::Text;
use crate::dataset::SpectrumKind;
use crate::program::Program;

/// Writes `fn is_accepted`, which accepts all where the test is the part that is left out.
pub(super) fn acceptance(text: &mut Text, program: &Program, part: Option<Part>) {
    let (parameter, argument) = match program.tests_own_targets() {
        true => (", target_lrv: f32", ", target_lrv"),
        false => ("", ""),
    };
    text.block(&format!("fn is_accepted(z: Normals{parameter}) -> bool"), |body| {
        // What the excess of every band must be below: that of 1, or of infinity.
        let bound = match program.kind {
            SpectrumKind::Reflectance if program.tests_base() => 1f32,
            _ => f32::INFINITY,
        };
        let limit = bound.to_bits() - 1;
        match program.tests_scaled() {
            _ if part == Some(Part::Test) => body.line("return true;"),
            false => body.line(&format!("return worst(z) < {limit}u;")),
            true => {
                body.line("let e = worst(z);");
                body.line(&format!("return e < {limit}u && rounded(peak(e) * factor(z{argument})) < 1f;"));
            }
        }
    });
}
