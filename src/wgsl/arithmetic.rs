//! Arithmetic of a candidate, in straight lines or in loops.
//!
//! Either way the functions are the same, of a candidate's `Normals`, and so is the order of operations:
//! - `normals(key, index, stream, attempt) -> Normals`: k standard normals; or, of a cover,
//!   `candidate(key, index, stream, attempt) -> Candidate`;
//! - `worst(z) -> u32`: the largest `excess` of a band before scaling;
//! - `factor(z) -> f32`: the factor that scales it to the target, where there is one;
//! - `is_accepted(z) -> bool`;
//! - `scale(z, key, index, stream) -> f32`: what multiplies a draw's spectrum, where something does.
//!
//! Where each draw has a target of its own, `target_lrv_of(key, index, stream) -> f32` makes it, and the functions that
//! depend on it take it: `factor(z, target_lrv)`, `scale(z, target_lrv)` and, where the scaled spectrum is bounded,
//! `is_accepted(z, target_lrv)`.

use super::acceptance::acceptance;
use super::shader::{LOOPED, LUMINANCE, NORMALS};
use super::tables::Tables;
use super::writer::{Text, float, list, word};
use super::{Arithmetic, Form, Part};
use crate::affine::Affine;
use crate::mixture::Mixture;
use crate::program::{IntensityLaw, LrvLaw, LrvTarget, Program, Proposal, Source, Unit};
use crate::random::real::DrawOperations;
use crate::random::stream;

/// Writes all of the arithmetic but a part, with guards. The form says how a long sum is written alone.
pub(super) fn arithmetic(program: &Program, tables: &Tables, form: Arithmetic, part: Option<Part>) -> String {
    let mut text = match Form::of(program) {
        Form::Unrolled => unrolled(program, form),
        Form::Looped => looped(program, tables),
    };
    if let Some(target) = &program.target {
        factor(&mut text, target);
    }
    acceptance(&mut text, program, part);
    if program.has_own_targets() {
        text.block("fn scale(z: Normals, target_lrv: f32) -> f32", |body| {
            body.line("return factor(z, target_lrv);");
        });
    } else if program.scales() {
        text.block("fn scale(z: Normals, key: vec2<u32>, index: vec2<u32>, stream: u32) -> f32", |body| {
            match &program.intensity {
                Some(level) => draw_level(body, level, tables),
                None => body.line("return factor(z);"),
            }
        });
    }
    text.0
}

/// Writes the factor that scales a candidate to the target, and each draw's target where it has its own.
fn factor(text: &mut Text, target: &LrvTarget) {
    let floor = <f32 as DrawOperations>::FLOOR;
    match target.lrv {
        LrvLaw::Fixed(lrv) => text.block("fn factor(z: Normals) -> f32", |body| {
            body.line(&format!("return ratio({}, max(luminance(z), {floor:?}f));", float(lrv)));
        }),
        LrvLaw::Uniform { low, span, high } => {
            let head = "fn target_lrv_of(key: vec2<u32>, index: vec2<u32>, stream: u32) -> f32";
            text.block(head, |body| {
                body.line(&draw_word());
                let [low, span, high] = [low, span, high].map(float);
                body.line(&format!(
                    "return min(rounded({low} + rounded({span} * uniform_of(word))), {high});"
                ));
            });
            text.block("fn factor(z: Normals, target_lrv: f32) -> f32", |body| {
                body.line(&format!("return ratio(target_lrv, max(luminance(z), {floor:?}f));"));
            });
        }
    }
}

/// The word of a draw's own.
fn draw_word() -> String {
    format!("let word = philox(vec4(index, 0u, stream | {}u), key).x;", stream::DRAW_BLOCK)
}

fn draw_level(body: &mut Text, level: &IntensityLaw, tables: &Tables) {
    body.line(&draw_word());
    match level {
        IntensityLaw::LogUniform { low, octaves } => {
            body.line(&format!(
                "return rounded({} * power_of_two(rounded(uniform_of(word) * {})));",
                float(*low),
                float(*octaves)
            ));
        }
        IntensityLaw::OneOf(levels) => {
            body.line(&format!("return number({}u + mul_wide(word, {}u).y);", tables.levels, levels.len()));
        }
    }
}

fn unrolled(program: &Program, form: Arithmetic) -> Text {
    let (n, k) = (program.bands(), program.components());
    let mut text = Text::default();
    text.line(&format!("alias Normals = array<f32, {k}>;"));
    given(&mut text, program.given);
    match program.proposal.as_ref().map(Proposal::rounded) {
        Some(Proposal::Boxes(boxes)) => text.line(&boxes.text(k)),
        Some(Proposal::Centres(mixture)) => {
            text.line("");
            text.0 += &mixture.chooser();
            normals(&mut text, 0, k, Some(&mixture));
        }
        None => normals(&mut text, program.given, program.normals(), None),
    }
    text.line("");
    forms(&mut text, "band", &program.spectrum);
    text.block("fn worst(z: Normals) -> u32", |body| {
        body.line("var e = 0u;");
        (0..n).for_each(|b| body.line(&format!("e = max(e, excess(band{b}(z)));")));
        body.line("return e;");
    });
    if let Some(target) = &program.target {
        text.block("fn luminance(z: Normals) -> f32", |body| {
            let products =
                target.weights.iter().enumerate().map(|(b, w)| format!("{} * band{b}(z)", float(*w)));
            long_sum(body, form, products);
        });
    }
    for output in &program.outputs {
        if let Source::Map(map, unit) = &output.source {
            text.line("");
            forms(&mut text, &format!("{}_", output.format.quantity), map);
            if let Unit::Over(map) = unit {
                forms(&mut text, &format!("{}_over_", output.format.quantity), map);
            }
        }
    }
    text
}

/// Declares the responses that are given to each draw, where there are any.
fn given(text: &mut Text, given: usize) {
    if given > 0 {
        text.line(&format!("alias Given = array<f32, {given}>;"));
    }
}

/// Writes the function that makes normals, which follow the responses that are given, or candidates of a mixture.
fn normals(text: &mut Text, given: usize, k: usize, mixture: Option<&Mixture<f32>>) {
    let parameter = if given > 0 { ", given: Given" } else { "" };
    text.block(
        &format!(
            "fn normals(key: vec2<u32>, index: vec2<u32>, stream: u32, attempt: u32{parameter}) -> Normals"
        ),
        |body| {
            let words = mixture.map_or(k, |mixture| mixture.choice() + 1);
            for block in 0..words.div_ceil(4) {
                body.line(&format!("let w{block} = philox(vec4(index, attempt, stream | {block}u), key);"));
            }
            for pair in 0..k.div_ceil(2) {
                let [x, y] = [word(2 * pair), word(2 * pair + 1)];
                body.line(&format!("let p{pair} = normal_pair({x}, {y});"));
            }
            let normal = |j: usize| format!("p{}.{}", j / 2, if j.is_multiple_of(2) { "x" } else { "y" });
            if let Some(mixture) = mixture {
                body.line(&mixture.read(&word(mixture.choice())));
            }
            let input = |i: usize| match mixture {
                Some(mixture) => mixture.coordinate(i, normal),
                None if i < given => format!("given[{i}]"),
                None => normal(i - given),
            };
            body.line(&format!("return Normals({});", list(given + k, input)));
        },
    );
}

/// Returns a sum of products, in their order. Compilers refuse to nest as many guards as there may be bands.
fn long_sum(body: &mut Text, form: Arithmetic, mut products: impl Iterator<Item = String>) {
    if form == Arithmetic::Plain {
        return body.line(&format!("return {};", products.collect::<Vec<_>>().join(" + ")));
    }
    body.line(&format!("var s = rounded({});", products.next().expect("there are bands")));
    products.for_each(|product| body.line(&format!("s = rounded(s + rounded({product}));")));
    body.line("return s;");
}

/// A function of the normals for each value of a map: its name is `name` and the value's number. Gains of 0 are left
/// out, which changes no sum: an offset of -0 is rounded to 0.
fn forms(text: &mut Text, name: &str, map: &Affine) {
    for (row, &offset) in map.offset.iter().enumerate() {
        let gains = map.gain.iter().map(|gain| gain[row]).enumerate().filter(|(_, g)| *g as f32 != 0.0);
        let first = float(offset + 0.0);
        let sum = gains.fold(first, |sum, (j, g)| format!("rounded({sum} + rounded({} * z[{j}]))", float(g)));
        text.line(&format!("fn {name}{row}(z: Normals) -> f32 {{ return {sum}; }}"));
    }
}

/// The components that are written out one after another. Drivers take long over more.
const TILE: usize = 64;

/// Number of times that a sum over so many components goes round its loop.
pub(super) fn tiles(components: usize) -> usize {
    if components > TILE { components / TILE } else { 0 }
}

/// The fragment `normals_looped.wgsl`, whose normals follow the responses that are given.
fn after_given(normals: &str, given: usize) -> String {
    if given == 0 {
        return normals.to_owned();
    }
    let copies: String = (0..given).map(|i| format!("    z[{i}] = given[{i}];\n")).collect();
    normals
        .replace("attempt: u32)", "attempt: u32, given: Given)")
        .replace("    var z: Normals;\n", &format!("    var z: Normals;\n{copies}"))
        .replace("z[4u * block", &format!("z[{given}u + 4u * block"))
}

/// The fragment `arithmetic_looped.wgsl` with the program's constants.
fn looped(program: &Program, tables: &Tables) -> Text {
    let (n, k) = (program.bands(), program.components());
    let mut text = Text::default();
    for (name, value) in [("BANDS", n), ("BLOCKS", program.normals().div_ceil(4))] {
        text.line(&format!("const {name} = {value}u;"));
    }
    text.line("");
    let first = program.given;
    text.0 += &match first {
        0 => LOOPED.to_owned(),
        _ => LOOPED.replace("array<f32, 4u * BLOCKS>", &format!("array<f32, {first}u + 4u * BLOCKS>")),
    };
    given(&mut text, first);
    text.line("\n// A row of the model: a band, or a value of another quantity.");
    text.line("fn form(z: ptr<function, Normals>, row: u32) -> f32 {");
    text.line(&format!("    let start = row * {}u;", k + 1));
    text.line("    var s = number(start);");
    let looped = TILE * tiles(k);
    let add = |number: String, z: String| format!("s = rounded(s + rounded(number({number}) * (*z)[{z}]));");
    if looped > 0 {
        text.line(&format!("    for (var j = 0u; j < {looped}u; j += {TILE}u) {{"));
        (0..TILE).for_each(|i| {
            let line = add(format!("start + j + {}u", i + 1), format!("j + {i}u"));
            text.line(&format!("        {line}"));
        });
        text.line("    }");
    }
    (looped..k).for_each(|j| {
        let line = add(format!("start + {}u", j + 1), j.to_string());
        text.line(&format!("    {line}"));
    });
    text.line("    return s;\n}\n");
    match program.proposal.as_ref().map(Proposal::rounded) {
        Some(Proposal::Boxes(boxes)) => text.0 += &boxes.text(4 * k.div_ceil(4)),
        Some(Proposal::Centres(mixture)) => {
            text.0 += &mixture.looped();
            text.0 += &NORMALS.replace("    return z;\n", &(mixture.call() + "    return z;\n"));
        }
        None => text.0 += &after_given(NORMALS, first),
    }
    if program.target.is_some() {
        text.line("");
        text.0 += &LUMINANCE.replace("LRV_WEIGHTS", &format!("{}u", tables.lrv_weights));
    }
    text
}
