//! The text of a shader: fragments, and what is generated for a program between them.

use super::arithmetic::{self, arithmetic};
use super::guards::{Zero, written};
use super::store::{pitch, store};
use super::writer::list;
use super::{
    Arithmetic, Dialect, Form, GIVEN_AT, INDICES_AT, Indexing, PROGRESS_AT, PROPOSAL_AT, Part, ShaderVariant,
    Stores, TABLES_AT, Tables, WORKGROUP, draw_names, draws_per_thread, part,
};
use crate::program::{IntensityLaw, Program, Proposal};
use crate::quantity::Dtype;

/// The most iterations that the loops of an invocation make in one dispatch, nested ones counted: llvmpipe ends them
/// after 65,535, without a word. It also keeps a dispatch short, as the watchdogs of real GPUs want it.
const MOST_ITERATIONS: u64 = 65_535;

const MUL_WIDE: &str = include_str!("../../shaders/mul_wide.wgsl");
const MUL_WIDE_INT64: &str = include_str!("../../shaders/mul_wide_int64.wgsl");
const PHILOX: &str = include_str!("../../shaders/philox.wgsl");
const NORMAL: &str = include_str!("../../shaders/normal.wgsl");
const UNIFORM: &str = include_str!("../../shaders/uniform.wgsl");
const LOG_UNIFORM: &str = include_str!("../../shaders/log_uniform.wgsl");
const PHYSICAL: &str = include_str!("../../shaders/physical.wgsl");
pub(super) const LOOPED: &str = include_str!("../../shaders/arithmetic_looped.wgsl");
pub(super) const NORMALS: &str = include_str!("../../shaders/normals_looped.wgsl");
pub(super) const LUMINANCE: &str = include_str!("../../shaders/luminance_looped.wgsl");
const DRAW: &str = include_str!("../../shaders/draw.wgsl");
const PARAMETERS: &str = include_str!("../../shaders/parameters.wgsl");
const WORDS: &str = include_str!("../../shaders/words.wgsl");
const HALF: &str = include_str!("../../shaders/half.wgsl");
const MAIN: &str = include_str!("../../shaders/main.wgsl");
const GATHERED: &str = include_str!("../../shaders/gathered.wgsl");
const SLICES: &str = include_str!("../../shaders/slices.wgsl");
const GIVEN: &str = include_str!("../../shaders/given.wgsl");

/// The most candidates that a draw tries in one dispatch. At 0 the program has too many bands for any.
pub(crate) fn attempts_per_dispatch(program: &Program, target: Dialect) -> u32 {
    let (stores, candidate) = match Form::of(program) {
        Form::Unrolled => (0, 1),
        Form::Looped => {
            let value = 1 + arithmetic::tiles(program.components());
            let strides: usize = program.outputs.iter().map(|output| output.format.stride()).sum();
            // A target takes the luminance too, for each candidate, and to scale and to judge the one that is stored.
            let has_target = usize::from(program.target.is_some());
            let candidate = (1 + has_target) * program.bands() * value;
            // Halves are stored in a loop of two within another.
            let stores = (2 + value) * strides + 2 * has_target * program.bands() * value;
            let placed = match &program.proposal {
                Some(Proposal::Centres(mixture)) => mixture.rounded::<f32>().iterations(),
                _ => 0,
            };
            (stores, 1 + candidate + program.normals().div_ceil(4) + placed)
        }
    };
    let draws = u64::from(draws_per_thread(program, target));
    let left = MOST_ITERATIONS.saturating_sub(stores as u64 * draws);
    u32::try_from(left / (candidate as u64 * draws)).expect("it is less than all iterations")
}

/// Whether a draw may take more candidates than one dispatch tries.
pub(crate) fn is_sliced(program: &Program, target: Dialect) -> bool {
    program.max_attempts > attempts_per_dispatch(program, target)
}

/// Keeps of a fragment the lines that have no condition, and those whose condition holds.
pub(super) fn kept(fragment: &str, holds: impl Fn(&str) -> bool) -> String {
    let line = |line: &str| match line.rsplit_once(" // if ") {
        Some((line, word)) => holds(word).then(|| line.to_owned() + "\n"),
        None => Some(line.to_owned() + "\n"),
    };
    fragment.lines().filter_map(line).collect()
}

/// The fragments that make random words and normals, plain: the whole of what does not depend on a program.
#[cfg(any(test, feature = "report"))]
pub(crate) fn generator(target: Dialect) -> String {
    written(&generator_without(target, None), Arithmetic::Plain, Zero::Parameter)
}

fn generator_without(target: Dialect, part: Option<Part>) -> String {
    let mul_wide = match target {
        Dialect::Baseline => MUL_WIDE,
        Dialect::Int64 | Dialect::SoftwareInt64 => MUL_WIDE_INT64,
    };
    let philox = if part == Some(Part::Philox) { part::PHILOX } else { PHILOX };
    let normal = if part == Some(Part::Normals) { part::NORMAL } else { NORMAL };
    [mul_wide, philox, normal].join("\n")
}

/// The compute shader of a program, in its plain form and for ranges of draws, and the numbers that it reads.
pub(crate) fn shader(program: &Program, target: Dialect) -> (String, Tables) {
    shader_of(program, ShaderVariant { dialect: target, ..ShaderVariant::default() })
}

/// The compute shader of a program in one of its variants, and the numbers that it reads.
pub(crate) fn shader_of(program: &Program, variant: ShaderVariant) -> (String, Tables) {
    shader_without(program, variant, None)
}

/// The compute shader of a program. Where it lacks a part, what it draws is wrong, and its time shows what the part costs.
pub(crate) fn shader_without(
    program: &Program,
    ShaderVariant { dialect: target, indexing, arithmetic, stores }: ShaderVariant,
    part: Option<Part>,
) -> (String, Tables) {
    let changed = (part == Some(Part::Reconstruction)).then(|| one_gain_each(program));
    let program = changed.as_ref().unwrap_or(program);
    let tables = Tables::new(program);
    let draws = draws_per_thread(program, target);
    let sliced = is_sliced(program, target);
    let holds = |word: &str| match word {
        "sliced" => sliced,
        "whole" => !sliced,
        "given" => program.given > 0,
        "ranged" => indexing == Indexing::Range,
        "listed" => indexing == Indexing::List,
        "exact" => arithmetic == Arithmetic::Exact,
        other => unreachable!("a fragment has a line for shaders that are {other:?}"),
    };
    let mut parts = vec![
        functions(program, &tables, (target, arithmetic), (sliced, false), part),
        kept(PARAMETERS, holds)
            .replace("INDICES_AT", &INDICES_AT.to_string())
            .replace("GIVEN_AT", &GIVEN_AT.to_string())
            .replace(" GIVEN_ARGUMENT", given(program, ", given_at(i)")),
    ];
    if program.given > 0 {
        let count = program.given;
        parts.push(GIVEN.replace("VALUES", &list(count, |j| format!("givens[{count}u * i + {j}u]"))));
    }
    if sliced {
        parts.push(SLICES.replace("PROGRESS_AT", &PROGRESS_AT.to_string()));
    }
    if !tables.values.is_empty() {
        let table = format!("@group(0) @binding({TABLES_AT}) var<storage, read> tables: array<f32>;\n\n");
        parts.push(table + "fn number(i: u32) -> f32 { return tables[i]; }\n");
    }
    if program.proposal.is_some() {
        let rows =
            format!("@group(0) @binding({PROPOSAL_AT}) var<storage, read> proposal: array<vec4<u32>>;\n\n");
        parts.push(rows + "fn proposal_row(i: u32) -> vec4<u32> { return proposal[i]; }\n");
        if let Some(Proposal::Centres(_)) = program.proposal {
            parts.push("fn proposal_word(i: u32) -> u32 { return proposal[i / 4u][i % 4u]; }\n".to_owned());
        }
    }
    let elements = || program.outputs.iter().map(|output| output.format.dtype);
    if elements().any(|element| element == Dtype::F16) {
        parts.push(HALF.to_owned());
    }
    if target == Dialect::SoftwareInt64 && draws == 2 && elements().any(|element| element != Dtype::F16) {
        parts.push(WORDS.to_owned());
    }
    // Draws that are sliced may be written already; and a thread that gathers waits for the others.
    let may_gather = stores == Stores::Gathered && !sliced && part != Some(Part::Store);
    let pitch = pitch(program, target).filter(|_| may_gather);
    parts.push(store(program, &tables, target, part, pitch.is_some()));
    let names = draw_names(program, target);
    let drawn = ["draw_at(i)", "draw_at(i + 1u)"];
    let main = match pitch {
        Some(pitch) => {
            let declared = names.iter().map(|name| format!("var {name}: Draw;"));
            let made = names.iter().zip(drawn).map(|(name, draw)| format!("{name} = {draw};"));
            GATHERED
                .replace("PITCH", &pitch.to_string())
                .replace("DECLARED", &declared.collect::<Vec<_>>().join("\n    "))
                .replace("DRAWN", &made.collect::<Vec<_>>().join("\n        "))
                .replace("NAMES", &names.join(", "))
        }
        None => {
            let done = if draws == 2 { "is_done(i) && is_done(i + 1u)" } else { "is_done(i)" };
            kept(MAIN, holds).replace("ALL_DONE", done).replace("DRAWS", &drawn[..names.len()].join(", "))
        }
    };
    let main = main.replace("PER_THREAD", &format!("{draws}u")).replace("WORKGROUP", &WORKGROUP.to_string());
    parts.push(main);
    (written(&parts.join("\n"), arithmetic, Zero::Parameter), tables)
}

/// The functions that make a draw, down to `draw_of`, with guards: whether in slices, and whether a draw carries a zero.
pub(super) fn functions(
    program: &Program,
    tables: &Tables,
    (target, form): (Dialect, Arithmetic),
    (sliced, carries_zero): (bool, bool),
    part: Option<Part>,
) -> String {
    let holds = |word: &str| match word {
        "sliced" => sliced,
        "whole" => !sliced,
        "scaled" => program.scales(),
        "own_targets" => program.has_own_targets(),
        "covered" => program.is_covered(),
        "plain" => !program.is_covered(),
        "carries_zero" => carries_zero,
        other => unreachable!("draw.wgsl has a line for programs that are {other:?}"),
    };
    let draw = kept(DRAW, holds);
    let judged = if program.tests_own_targets() { "z, result.target_lrv" } else { "z" };
    let scaled = match program.has_own_targets() {
        true => "result.z, result.target_lrv",
        false => "result.z, key, index, stream",
    };
    let draw = draw.replace("JUDGED", judged).replace("SCALED", scaled);
    let draw = draw.replace(" GIVEN_PARAMETER", given(program, ", given: Given"));
    let draw = draw.replace(" GIVEN_ARGUMENT", given(program, ", given"));
    let mut parts = vec![generator_without(target, part), PHYSICAL.to_owned()];
    if let Some(IntensityLaw::LogUniform { .. }) = program.intensity {
        parts.push(LOG_UNIFORM.replace("UNIFORM\n", UNIFORM));
    }
    if program.has_own_targets() {
        parts.push(UNIFORM.to_owned());
    }
    parts.extend([arithmetic(program, tables, form, part), draw]);
    parts.join("\n")
}

/// A text, where the draws of a program are given responses.
fn given<'a>(program: &Program, text: &'a str) -> &'a str {
    if program.given > 0 { text } else { "" }
}

/// Changes a program to one product in each band, with every normal in use.
fn one_gain_each(program: &Program) -> Program {
    let mut program = program.clone();
    let components = program.components();
    for (j, gain) in program.spectrum.gain.iter_mut().enumerate() {
        for (band, gain) in gain.iter_mut().enumerate() {
            if band % components != j {
                *gain = 0.0;
            }
        }
    }
    program
}
