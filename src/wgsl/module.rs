//! The draw as a module of functions, for shaders of others: no bindings, no entry points, and a prefix on every name,
//! so that several models live in one shader.

use super::shader::functions;
use super::tables::Tables;
use super::writer::{Text, list};
use super::{Dialect, Form, UNROLLED_GAINS};
use crate::program::{IntensityLaw, Program, Source, Unit};
use crate::quantity::Quantity;
use crate::random::real::Arithmetic;

/// Error returned where a recipe has no WGSL module.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum WgslError {
    #[error("{0:?} cannot start a name in WGSL: use letters, digits and single _, a letter first")]
    Prefix(String),
    #[error(
        "{bands} bands x {components} components are too many to write out ({UNROLLED_GAINS} at most): fit fewer, \
         or let a Sampler draw"
    )]
    TooLarge { bands: usize, components: usize },
    #[error("{0} are a table, which needs a buffer: do without, or let a Sampler draw")]
    Table(&'static str),
}

/// The module of a program.
pub(crate) fn module(program: &Program, prefix: &str) -> Result<String, WgslError> {
    let starts_well = prefix.starts_with(|c: char| c.is_ascii_alphabetic());
    let holds = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if !starts_well || !prefix.chars().all(holds) || prefix.contains("__") || prefix.ends_with('_') {
        return Err(WgslError::Prefix(prefix.to_owned()));
    }
    if Form::of(program) == Form::Looped {
        return Err(WgslError::TooLarge { bands: program.bands(), components: program.components() });
    }
    if let Some(IntensityLaw::OneOf(_)) = program.intensity {
        return Err(WgslError::Table("intensities of the data"));
    }
    if program.proposal.is_some() {
        return Err(WgslError::Table("the boxes that candidates are proposed from"));
    }
    let draw = functions(program, &Tables::default(), Dialect::Baseline, false, None);
    // What naga_oil imports may name structures, but no other types.
    let normals = format!("array<f32, {}>", program.components());
    let draw = draw.replace(&format!("alias Normals = {normals};\n"), "").replace("Normals", &normals);
    let given = format!("array<f32, {}>", program.given);
    let draw = draw.replace(&format!("alias Given = {given};\n"), "").replace("Given", &given);
    Ok(prefixed(&format!("{draw}\n{}", interface(program)), prefix))
}

/// Writes the functions that a host calls.
fn interface(program: &Program) -> String {
    let attempts = program.max_attempts;
    let mut text = Text::default();
    if program.given > 0 {
        draw_given(&mut text, program);
    } else {
        draw(&mut text, attempts);
    }
    for output in &program.outputs {
        let quantity = output.format.quantity;
        let width = output.format.width;
        match &output.source {
            Source::Spectrum => spectrum(&mut text, program),
            Source::Map(_, unit) => {
                let (result, head) = match quantity {
                    Quantity::Xyz | Quantity::LinearSrgb => ("vec3<f32>".to_owned(), "vec3".to_owned()),
                    Quantity::Chromaticity => ("vec2<f32>".to_owned(), "vec2".to_owned()),
                    Quantity::Lrv => ("f32".to_owned(), String::new()),
                    _ => (format!("array<f32, {width}>"), "array".to_owned()),
                };
                let values = list(width, |j| format!("{quantity}_{j}(d.z)"));
                text.block(&format!("fn {quantity}(d: Draw) -> {result}"), |body| {
                    body.line(&match unit {
                        Unit::One => format!("return {head}({values});"),
                        Unit::Scale => format!("return d.scale * {head}({values});"),
                        Unit::Over(_) => {
                            let over =
                                format!("max({quantity}_over_0(d.z), {:?}f)", <f32 as Arithmetic>::FLOOR);
                            format!("return (1f / {over}) * {head}({values});")
                        }
                    });
                });
            }
            Source::Intensity => text.block(&format!("fn {quantity}(d: Draw) -> f32"), |body| {
                body.line("return d.scale;");
            }),
            Source::TargetLrv => text.block(&format!("fn {quantity}(d: Draw) -> f32"), |body| {
                body.line("return d.target_lrv;");
            }),
            Source::Status => {} // it is in the Draw
        }
    }
    text.0
}

/// Writes the functions that make a draw of an index.
fn draw(text: &mut Text, attempts: u32) {
    text.line("// Draw `index` (low word, high word) under a seed (the same), as every engine makes it.");
    text.0 += "fn draw(seed: vec2<u32>, index: vec2<u32>) -> Draw {\n";
    text.line(&format!("    return draw_of(seed, index, 0u, {attempts}u);\n}}\n"));
    text.line("// The same, of the stream of this number.");
    text.0 += "fn draw_in(stream: u32, seed: vec2<u32>, index: vec2<u32>) -> Draw {\n";
    text.line(&format!("    return draw_of(seed, index, stream << 8u, {attempts}u);\n}}"));
}

/// Writes the functions that make a draw of an index and of the responses that it is given: a vector of two to four of
/// them, so that a texel goes in as it is.
fn draw_given(text: &mut Text, program: &Program) {
    let (attempts, count) = (program.max_attempts, program.given);
    let (kind, parts) = match count {
        1 => ("f32".to_owned(), "c".to_owned()),
        2..=4 => (format!("vec{count}<f32>"), list(count, |i| format!("c.{}", ["x", "y", "z", "w"][i]))),
        _ => (format!("array<f32, {count}>"), list(count, |i| format!("c[{i}]"))),
    };
    let given = format!("array<f32, {count}>({parts})");
    text.line("// Draw `index` (low word, high word) under a seed (the same), given the responses c, as every engine makes it.");
    text.0 += &format!("fn draw_given(seed: vec2<u32>, index: vec2<u32>, c: {kind}) -> Draw {{\n");
    text.line(&format!("    return draw_of(seed, index, 0u, {attempts}u, {given});\n}}\n"));
    text.line("// The same, of the stream of this number.");
    text.0 +=
        &format!("fn draw_given_in(stream: u32, seed: vec2<u32>, index: vec2<u32>, c: {kind}) -> Draw {{\n");
    text.line(&format!("    return draw_of(seed, index, stream << 8u, {attempts}u, {given});\n}}"));
}

fn spectrum(text: &mut Text, program: &Program) {
    let scale = if program.scales() { " * d.scale" } else { "" };
    let n = program.bands();
    text.block(&format!("fn spectrum(d: Draw) -> array<f32, {n}>"), |body| {
        body.line(&format!("return array({});", list(n, |b| format!("band{b}(d.z){scale}"))));
    });
    text.block("fn at(d: Draw, band: u32) -> f32", |body| {
        body.line("switch band {");
        (0..n).for_each(|b| body.line(&format!("    case {b}u: {{ return band{b}(d.z){scale}; }}")));
        body.line("    default: { return 0f; }");
        body.line("}");
    });
}

/// The text with `prefix` before every name that it declares. What follows a dot or comes before a colon is a member
/// or an argument, and is left alone.
fn prefixed(text: &str, prefix: &str) -> String {
    let declared = |line: &str| {
        let rest = ["fn ", "struct ", "const ", "alias "].iter().find_map(|word| line.strip_prefix(word))?;
        Some(rest.split(|c: char| !is_name(c)).next().expect("there is a first part").to_owned())
    };
    let names: Vec<_> = text.lines().filter_map(declared).collect();
    let mut result = String::new();
    for line in text.lines() {
        let (code, comment) = line.split_at(line.find("//").unwrap_or(line.len()));
        let mut rest = code;
        while let Some(start) = rest.find(is_name) {
            let (before, from) = rest.split_at(start);
            let (word, after) = from.split_at(from.find(|c| !is_name(c)).unwrap_or(from.len()));
            result += before;
            if names.iter().any(|name| name == word) && !before.ends_with('.') && !after.starts_with(':') {
                result += prefix;
                result.push('_');
            }
            result += word;
            rest = after;
        }
        result += rest;
        result += comment;
        result.push('\n');
    }
    result
}

fn is_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}
