//! A program as WGSL text: the hand-written fragments of `shaders/`, and between them code that is generated for the
//! program, with the model's numbers as constants.
//!
//! What the program does not need is not in the text: no luminance without a target, no upper bound for illuminants,
//! no stores but of what was asked for. Straight lines are several times as fast as a loop that reads the model from a
//! buffer, but take time to compile. Beyond [`UNROLLED_GAINS`] the same operations run in such a loop: same order, same
//! bits.
//!
//! A text has one of two forms ([`Arithmetic`]), which differ in the [guards](guards) of their operations alone.

mod acceptance;
mod arithmetic;
mod compute_shader;
mod cover;
mod guards;
#[cfg(test)]
pub(crate) mod layout;
mod mixture;
mod module;
// Only measurements leave parts out.
#[cfg_attr(not(feature = "report"), allow(dead_code, unreachable_pub))]
mod part;
#[cfg(test)]
mod probe;
mod proposal;
mod self_test;
mod shader;
mod store;
mod tables;
mod writer;

pub use compute_shader::{Binding, BindingRole, ComputeShader, ShaderVariant};
pub use module::{ModuleOptions, TableStorage, WgslError};
pub(crate) use module::{keeps_tables_constant, module, table_words};
#[cfg_attr(not(feature = "report"), allow(unreachable_pub))]
pub use part::Part;
pub use self_test::ArithmeticTrait;
pub(crate) use self_test::{CASES, self_test};
pub(crate) use tables::Tables;

#[cfg(any(test, feature = "report"))]
pub(crate) use shader::generator;
#[cfg(feature = "report")]
pub(crate) use shader::shader_without;
pub(crate) use shader::{attempts_per_dispatch, is_sliced, shader, shader_of};

use serde::{Deserialize, Serialize};

use crate::program::{Output, Program};
use crate::quantity::{Dtype, Quantity};

/// Threads a workgroup.
pub(crate) const WORKGROUP: u32 = 64;

/// The binding of the parameters.
pub(crate) const PARAMETERS_AT: u32 = 0;

/// The binding of the tables.
pub(crate) const TABLES_AT: u32 = 1;

/// The binding of the first quantity; that of another is its number more.
pub(crate) const OUTPUTS_AT: u32 = 2;

/// The binding of a cover's boxes or a model's centres.
pub(crate) const PROPOSAL_AT: u32 = OUTPUTS_AT + Quantity::COUNT as u32;

/// The binding of the progress of draws that one dispatch may not end.
pub(crate) const PROGRESS_AT: u32 = PROPOSAL_AT + 1;

/// The binding of the indices of draws, where these are given in a list.
pub(crate) const INDICES_AT: u32 = PROGRESS_AT + 1;

/// The binding of the responses that draws are given.
pub(crate) const GIVEN_AT: u32 = INDICES_AT + 1;

/// The most gains (bands x components) that are written out as constants. At this size lavapipe takes 2.5 s to
/// compile the straight lines, which then run 7 times as fast as the loop: they pay from 2e5 draws on.
const UNROLLED_GAINS: usize = 2048;

/// Form of the arithmetic of a text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Arithmetic {
    /// Operations as they stand: the draws of the CPU on a device whose compiler keeps to them.
    #[default]
    Plain,
    /// Operations that no compiler can fuse or rearrange, roots and quotients corrected: the draws of the CPU on any
    /// device that rounds sums and products to nearest.
    Exact,
}

impl std::fmt::Display for Arithmetic {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Arithmetic::Plain => "plain",
            Arithmetic::Exact => "exact",
        })
    }
}

/// Capabilities of a device on which the text depends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Dialect {
    /// Any device.
    #[default]
    Baseline,
    /// A device with `SHADER_INT64`.
    Int64,
    /// A software adapter with `SHADER_INT64`.
    SoftwareInt64,
}

/// Source of the indices of draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Indexing {
    /// A range, by its first index.
    #[default]
    Range,
    /// A list in a buffer: any indices in any order.
    List,
}

/// Way of the values of a draw to the buffers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Stores {
    /// Each thread writes its own row.
    #[default]
    Direct,
    /// A workgroup gathers the rows of its threads in its own memory (16 KiB at most), and writes them in order: 2 to 3 times
    /// as fast on hardware, which writes neighbouring words together. Values that lie in planes, and draws that run in loops
    /// or in several dispatches, are written by their threads all the same.
    Gathered,
}

/// Form in which a program's arithmetic is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// In straight lines, with the model's numbers as constants.
    Unrolled,
    /// In loops over bands and components that read the model from a buffer (see [`Tables`]).
    Looped,
}

impl Form {
    pub(crate) fn of(program: &Program) -> Form {
        let is_of_sensors = |output: &&Output| output.format.quantity == Quantity::Responses;
        let responses = program.outputs.iter().find(is_of_sensors).map_or(0, |output| output.format.width);
        match (program.bands() + responses) * program.components() {
            ..=UNROLLED_GAINS => Form::Unrolled,
            _ => Form::Looped,
        }
    }
}

/// Number of draws that one thread makes: 2 where they fill words that are wider than a value.
pub(crate) fn draws_per_thread(program: &Program, target: Dialect) -> u32 {
    let halves = program.outputs.iter().any(|output| output.format.dtype == Dtype::F16);
    match (Form::of(program), target) {
        (Form::Unrolled, Dialect::SoftwareInt64) => 2,
        _ if halves => 2,
        _ => 1,
    }
}

/// Names of a thread's draws in the text.
fn draw_names(program: &Program, target: Dialect) -> &'static [&'static str] {
    if draws_per_thread(program, target) == 2 { &["a", "b"] } else { &["a"] }
}

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use rayon::prelude::*;

    use super::arithmetic::arithmetic;
    use super::guards::{Zero, written};
    use super::store::store;
    use super::*;
    use crate::affine::Affine;
    use crate::dataset::SpectrumKind;
    use crate::grid::Grid;
    use crate::mixture::{Centres, Mixture, Spread, triangle};
    use crate::program::{self, Bounds, IntensityLaw, LrvLaw, Proposal, Source, Unit};
    use crate::quantity::{ArrayFormat, Layout};

    /// A program of 3 bands and 2 components, small enough to read.
    fn small(kind: SpectrumKind, target: Option<(LrvLaw, Bounds)>) -> Program {
        program_of(kind, 3, 2, target)
    }

    fn program_of(
        kind: SpectrumKind,
        bands: usize,
        components: usize,
        target: Option<(LrvLaw, Bounds)>,
    ) -> Program {
        let weights = vec![1.0 / bands as f64; bands];
        let spectrum = Affine {
            offset: (0..bands).map(|b| 0.5 + 0.125 * (b % 3) as f64).collect(),
            gain: (0..components)
                .map(|j| (0..bands).map(|b| 0.25 / (1 + j + b % 7) as f64).collect())
                .collect(),
        };
        let outputs = vec![Output { format: ArrayFormat::spectra(bands), source: Source::Spectrum }];
        let target = target.map(|(lrv, bounds)| program::LrvTarget { lrv, weights, bounds });
        Program { target, max_attempts: 100, outputs, ..Program::of(kind, spectrum) }.with_status()
    }

    /// Two centres.
    fn mixture(components: usize, spread: Spread) -> Mixture<f64> {
        let coordinates = (0..2 * components).map(|i| 0.25 * i as f64).collect();
        let centres = Centres { coordinates, spread, shares: vec![1.0, 3.0], components };
        centres.within(&[]).expect("nothing is rejected").0
    }

    /// The program with all that can come out of it, so laid.
    fn with_all(program: Program, layout: Layout, spectra: Dtype) -> Program {
        let (n, k) = (program.bands(), program.components());
        let unit = || if program.scales() { Unit::Scale } else { Unit::One };
        let mut weights = Affine::constant(0.25, k);
        weights.gain[0][0] = 0.5;
        let xyz = program.spectrum.project(&[vec![0.5; n], vec![0.25; n], vec![0.125; n]]);
        let map = |quantity, map: Affine, unit| {
            let format = ArrayFormat { quantity, dtype: Dtype::F32, width: map.offset.len(), layout };
            Output { format, source: Source::Map(map, unit) }
        };
        let over = match program.kind {
            SpectrumKind::Illuminant => Unit::Over(xyz.value(1)),
            SpectrumKind::Reflectance => unit(),
        };
        let mut outputs = vec![
            Output {
                format: ArrayFormat { dtype: spectra, layout, ..ArrayFormat::spectra(n) },
                source: Source::Spectrum,
            },
            map(Quantity::Weights, weights, Unit::One),
            map(Quantity::Xyz, xyz.clone(), over),
            map(Quantity::LinearSrgb, xyz, unit()),
            Output { format: ArrayFormat::status(), source: Source::Status },
        ];
        if program.intensity.is_some() {
            let format =
                ArrayFormat { quantity: Quantity::Intensity, dtype: Dtype::F32, ..ArrayFormat::status() };
            outputs.push(Output { format, source: Source::Intensity });
        }
        if program.has_own_targets() {
            let format = ArrayFormat { quantity: Quantity::Lrv, dtype: Dtype::F32, ..ArrayFormat::status() };
            outputs.push(Output { format, source: Source::TargetLrv });
        }
        outputs.sort_by_key(|output| output.format.quantity);
        Program { outputs, ..program }
    }

    /// The program with one quantity alone.
    fn only(program: Program, quantity: Quantity) -> Program {
        let mut program = with_all(program, Layout::Rows, Dtype::F32);
        program.outputs.retain(|output| output.format.quantity == quantity);
        program
    }

    /// The program with chromaticities alone.
    fn chromaticity(program: Program) -> Program {
        let n = program.bands();
        let xyz = program.spectrum.project(&[vec![0.5; n], vec![0.25; n], vec![0.125; n]]);
        let map = xyz.project(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let format = ArrayFormat {
            quantity: Quantity::Chromaticity,
            dtype: Dtype::F32,
            width: map.offset.len(),
            layout: Layout::Rows,
        };
        let sum = Unit::Over(xyz.project(&[[1.0; 3]]));
        Program { outputs: vec![Output { format, source: Source::Map(map, sum) }], ..program }
    }

    fn validate(text: &str, capabilities: Capabilities) -> Result<(), String> {
        let module = naga::front::wgsl::parse_str(text).map_err(|e| e.emit_to_string(text))?;
        let mut validator = Validator::new(ValidationFlags::all(), capabilities);
        validator.validate(&module).map(drop).map_err(|e| e.emit_to_string(text))
    }

    /// Programs of every kind, size and layout.
    fn programs() -> Vec<Program> {
        let rules = [Bounds::Base, Bounds::Scaled, Bounds::Both];
        let laws = [LrvLaw::Fixed(0.4), LrvLaw::uniform(0.2, 0.6)];
        let mut programs = Vec::new();
        for (bands, components) in [(1, 1), (3, 2), (31, 6), (61, 12), (70, 64), (1000, 64)] {
            let of = |kind, target| program_of(kind, bands, components, target);
            programs.push(of(SpectrumKind::Illuminant, None));
            for level in
                [IntensityLaw::LogUniform { low: 0.5, octaves: 10.0 }, IntensityLaw::OneOf(vec![1.0, 2.0])]
            {
                programs.push(Program { intensity: Some(level), ..of(SpectrumKind::Illuminant, None) });
            }
            let targets = laws.into_iter().flat_map(|law| rules.map(|bounds| Some((law, bounds))));
            programs.extend([None].into_iter().chain(targets).map(|t| of(SpectrumKind::Reflectance, t)));
            for spread in [Spread::Same(0.3), Spread::Own(vec![0.25; 2 * triangle(components)])] {
                let proposal = Some(Proposal::Centres(mixture(components, spread)));
                let plain = of(SpectrumKind::Reflectance, None);
                programs.push(Program { proposal: proposal.clone(), ..plain });
                let scaled = of(SpectrumKind::Reflectance, Some((LrvLaw::Fixed(0.4), Bounds::Scaled)));
                programs.push(Program { proposal, ..scaled });
            }
            if components > 1 {
                programs.push(Program { given: components / 2, ..of(SpectrumKind::Reflectance, None) });
            }
        }
        let layouts = [Layout::Rows, Layout::PaddedRows, Layout::Planes];
        let all = programs.clone().into_iter().flat_map(|program| {
            layouts.into_iter().flat_map(move |layout| {
                [Dtype::F32, Dtype::F16].map(|spectra| with_all(program.clone(), layout, spectra))
            })
        });
        let colours: Vec<_> = programs.iter().cloned().map(chromaticity).collect();
        all.chain(programs).chain(colours).collect()
    }

    #[test]
    fn every_variant_is_valid_with_no_more_than_it_says() {
        let targets = [
            (Dialect::Baseline, Capabilities::empty()),
            (Dialect::Int64, Capabilities::SHADER_INT64),
            (Dialect::SoftwareInt64, Capabilities::SHADER_INT64),
        ];
        programs().into_par_iter().enumerate().for_each(|(number, program)| {
            for (i, (target, needs)) in targets.into_iter().enumerate() {
                // Each form with each dialect, but not of every program: there are hundreds.
                let (indexing, arithmetic) = VARIANTS[(number + i) % 2];
                let stores = [Stores::Direct, Stores::Gathered][(number / 2 + i) % 2];
                let variant = ShaderVariant { dialect: target, indexing, arithmetic, stores };
                let (text, _) = shader_of(&program, variant);
                if let Err(e) = validate(&text, needs) {
                    panic!("{variant:?} {:?} {:?}: {e}", program.target, program.outputs[0].format);
                }
                assert!(!text.contains("//!") && !text.contains("src/"), "notes for us: {text}");
            }
        });
    }

    #[test]
    fn every_module_is_valid_and_two_fit_in_one_shader() {
        // A part of them, of every kind: there are hundreds.
        for program in programs().into_iter().step_by(11) {
            let even = Grid::new(400.0, 0.5, program.bands()).unwrap();
            let uneven: Vec<f64> = (0..program.bands()).map(|b| 400.0 + (b * b) as f64 / 7.0).collect();
            for (arithmetic, grid) in
                [(Arithmetic::Plain, even), (Arithmetic::Exact, Grid::from_wavelengths(&uneven).unwrap())]
            {
                let of = |prefix, binding| {
                    let tables = (!table_words(&program).is_empty())
                        .then_some(TableStorage::Buffer { group: 1, binding });
                    module(&program, &grid, prefix, ModuleOptions { arithmetic, tables }).unwrap()
                };
                let both = format!("{}\n{}", of("wall", 0), of("table_top", 1));
                validate(&both, Capabilities::empty()).unwrap_or_else(|e| panic!("{e}"));
            }
        }
        let grid = Grid::new(400.0, 10.0, 1).unwrap();
        for prefix in ["", "1a", "a b", "a_", "a__b", "_a", "ä"] {
            let made = module(&programs()[0], &grid, prefix, ModuleOptions::default());
            assert_eq!(made, Err(WgslError::Prefix(prefix.to_owned())));
        }
    }

    /// Both forms, and both sources of indices.
    const VARIANTS: [(Indexing, Arithmetic); 2] =
        [(Indexing::Range, Arithmetic::Exact), (Indexing::List, Arithmetic::Plain)];

    #[test]
    fn int64_is_not_taken_without_asking() {
        let (text, _) = shader(&small(SpectrumKind::Illuminant, None), Dialect::Int64);
        assert!(validate(&text, Capabilities::empty()).is_err());
    }

    /// The text between the fragments, for each kind of recipe: a change here is a decision.
    #[test]
    fn what_is_generated() {
        let light = || small(SpectrumKind::Illuminant, None);
        let surface = |target| small(SpectrumKind::Reflectance, target);
        let lrv = |bounds| surface(Some((LrvLaw::Fixed(0.4), bounds)));
        let own_lrv = |bounds| surface(Some((LrvLaw::uniform(0.2, 0.6), bounds)));
        let level = IntensityLaw::LogUniform { low: 0.15, octaves: 10.0 };
        let lamp = || Program { intensity: Some(level.clone()), ..light() };
        let lamps = || Program { intensity: Some(IntensityLaw::OneOf(vec![1.0, 2.0])), ..light() };
        let about =
            |spread, program| Program { proposal: Some(Proposal::Centres(mixture(2, spread))), ..program };
        let generated = |program: &Program, target| {
            let tables = Tables::new(program);
            let text = arithmetic(program, &tables, Arithmetic::Plain, None)
                + &store(program, &tables, target, None, false);
            written(&text, Arithmetic::Plain, Zero::Parameter)
        };
        for (name, program, target) in [
            ("illuminant", light(), Dialect::Baseline),
            ("illuminant_log_uniform", with_all(lamp(), Layout::Rows, Dtype::F32), Dialect::Baseline),
            ("illuminant_of_the_data", only(lamps(), Quantity::Intensity), Dialect::Baseline),
            ("reflectance", surface(None), Dialect::Baseline),
            ("reflectance_in_pairs", surface(None), Dialect::SoftwareInt64),
            (
                "reflectance_in_planes",
                with_all(surface(None), Layout::Planes, Dtype::F32),
                Dialect::SoftwareInt64,
            ),
            (
                "reflectance_in_halves",
                with_all(surface(None), Layout::PaddedRows, Dtype::F16),
                Dialect::Int64,
            ),
            ("kernel", about(Spread::Same(0.3), only(surface(None), Quantity::Weights)), Dialect::Baseline),
            (
                "mixture",
                about(Spread::Own(vec![0.25; 6]), only(surface(None), Quantity::Weights)),
                Dialect::Baseline,
            ),
            ("weights", only(surface(None), Quantity::Weights), Dialect::Baseline),
            ("xyz", only(surface(None), Quantity::Xyz), Dialect::Baseline),
            ("xyz_of_illuminant", only(light(), Quantity::Xyz), Dialect::Baseline),
            ("chromaticity", chromaticity(lamp()), Dialect::Baseline),
            ("attempts", only(surface(None), Quantity::Attempts), Dialect::Baseline),
            ("given", Program { given: 1, ..surface(None) }, Dialect::Baseline),
            ("lrv_base", lrv(Bounds::Base), Dialect::Baseline),
            ("lrv_scaled", lrv(Bounds::Scaled), Dialect::Baseline),
            ("lrv_both_in_pairs", lrv(Bounds::Both), Dialect::SoftwareInt64),
            ("own_lrv_base", with_all(own_lrv(Bounds::Base), Layout::Rows, Dtype::F32), Dialect::Baseline),
            ("own_lrv_scaled", own_lrv(Bounds::Scaled), Dialect::Baseline),
            (
                "own_lrv_both_in_pairs",
                with_all(own_lrv(Bounds::Both), Layout::Planes, Dtype::F16),
                Dialect::SoftwareInt64,
            ),
        ] {
            insta::assert_snapshot!(name, generated(&program, target));
        }
        // What the exact form has in place of `lrv_base`.
        let (program, exact) = (lrv(Bounds::Base), Arithmetic::Exact);
        let tables = Tables::new(&program);
        let text = arithmetic(&program, &tables, exact, None)
            + &store(&program, &tables, Dialect::Baseline, None, false);
        insta::assert_snapshot!("exact_lrv_base", text);
        // Rows that are gathered, in two tiles where there are many bands.
        let variant = ShaderVariant { stores: Stores::Gathered, ..ShaderVariant::default() };
        for (name, bands, spectra) in [("gathered", 70, Dtype::F32), ("gathered_halves", 4, Dtype::F16)] {
            let mut program = program_of(SpectrumKind::Reflectance, bands, 1, None);
            program.outputs[0].format.dtype = spectra;
            let (text, _) = shader_of(&program, variant);
            let (_, stored) = text.split_once("fn store(").expect("it stores");
            let lines = stored.lines().filter(|line| !line.contains("let spectra_"));
            insta::assert_snapshot!(name, lines.collect::<Vec<_>>().join("\n"));
        }
        let large = |law, layout, spectra| {
            with_all(
                program_of(SpectrumKind::Reflectance, 400, 6, Some((law, Bounds::Both))),
                layout,
                spectra,
            )
        };
        let fixed = LrvLaw::Fixed(0.4);
        for (name, law, layout, spectra) in [
            ("looped", fixed, Layout::Rows, Dtype::F32),
            ("looped_in_halves", fixed, Layout::PaddedRows, Dtype::F16),
            ("looped_in_planes", fixed, Layout::Planes, Dtype::F16),
            ("looped_own_lrv", LrvLaw::uniform(0.2, 0.6), Layout::Rows, Dtype::F32),
        ] {
            insta::assert_snapshot!(name, generated(&large(law, layout, spectra), Dialect::Int64));
        }
        // All that differs where draws are given responses.
        let given = Program { given: 1, ..surface(None) };
        let lines = |program: &Program| shader(program, Dialect::Baseline).0;
        let (plain, given) = (lines(&surface(None)), lines(&given));
        let added: Vec<&str> = given.lines().filter(|line| !plain.contains(line)).collect();
        insta::assert_snapshot!("added_where_responses_are_given", added.join("\n"));
    }

    #[test]
    fn what_is_not_asked_for_is_not_in_the_text() {
        let text = |program: &Program| shader(program, Dialect::Baseline).0;
        let plain = text(&small(SpectrumKind::Reflectance, None));
        for word in
            ["luminance", "factor", "scale", "fn half", "u64", "power_of_two", "weights", "xyz", "tables"]
        {
            assert!(!plain.contains(word), "{word}");
        }
        let one = format!("{}u", 1f32.to_bits() - 1);
        let infinity = format!("{}u", f32::INFINITY.to_bits() - 1);
        assert!(plain.contains(&one) && !plain.contains(&infinity));
        let fixed = text(&small(SpectrumKind::Reflectance, Some((LrvLaw::Fixed(0.4), Bounds::Both))));
        let own = text(&small(SpectrumKind::Reflectance, Some((LrvLaw::uniform(0.2, 0.6), Bounds::Both))));
        for word in ["uniform_of", "target_lrv", "result.target_lrv = "] {
            assert!(own.contains(word) && !fixed.contains(word), "{word}");
        }
        assert!(!own.contains("power_of_two"));
        let light = text(&small(SpectrumKind::Illuminant, None));
        assert!(light.contains(&infinity) && !light.contains(&one));
        let xyz = text(&only(small(SpectrumKind::Reflectance, None), Quantity::Xyz));
        assert!(xyz.contains("xyz[") && !xyz.contains("spectra") && !xyz.contains("attempts["));
    }
}
