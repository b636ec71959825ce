//! The draw as a module of functions, for shaders of others: no bindings, no entry points, and a prefix on every name,
//! so that several models live in one shader.

use std::collections::HashSet;

use super::guards::{Zero, written};
use super::shader::functions;
use super::tables::Tables;
use super::writer::{PARTS, Text, float, list};
use super::{Arithmetic, Dialect, Form};
use crate::dataset::SpectrumKind;
use crate::grid::Grid;
use crate::program::{Program, Proposal, Source, Unit};
use crate::quantity::Quantity;
use crate::random::real::DrawOperations;

/// The most words of a table that is written as a constant: what WGSL lets an array's constructor have.
const MOST_CONSTANTS: usize = 2047;

/// Error returned where a recipe has no WGSL module of that kind.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum WgslError {
    #[error("{0:?} cannot start a name in WGSL: use letters, digits and single _, a letter first")]
    Prefix(String),
    #[error("{0} bands, which are too many for one draw of a shader: draw on the CPU")]
    TooManyBands(usize),
    #[error("a table of {words} words, and constants hold {MOST_CONSTANTS} at most: keep it in a buffer")]
    LargeTable { words: usize },
    #[error(
        "the centres of a distribution are read number by number, and compilers copy a constant for each: keep them in a buffer"
    )]
    ConstantCentres,
}

/// Place of the tables that a module reads, where a recipe needs some.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableStorage {
    /// A constant in the text. Some compilers copy all of it for each number that is read.
    Const,
    /// A storage buffer that the module declares and the host fills with [`Recipe::tables`](crate::Recipe::tables).
    Buffer {
        /// Number of the bind group.
        group: u32,
        /// Number of the binding.
        binding: u32,
    },
}

/// Settings of a WGSL module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModuleOptions {
    /// Form of the arithmetic. In the exact form the functions that draw take one argument more, a `zero`.
    pub arithmetic: Arithmetic,
    /// Place of the tables; where it is `None`, a constant of up to 2,047 words, and beyond that, or of a
    /// [`Distribution`](crate::Distribution) that is not a Gaussian, a buffer at group 0 and binding 0.
    pub tables: Option<TableStorage>,
}

/// Words of the tables that a program's module reads, numbers and then boxes or centres; none of most programs.
pub(crate) fn table_words(program: &Program) -> Vec<u32> {
    let numbers = Tables::new(program).values.into_iter().map(f32::to_bits);
    let rows = program.proposal.iter().flat_map(Proposal::words);
    numbers.chain(rows.flatten()).collect()
}

/// Whether a module keeps a program's tables in a constant unless it is told otherwise. Those of centres are read number by
/// number, and a compiler copies all of a constant for each.
pub(crate) fn keeps_tables_constant(program: &Program) -> bool {
    !has_centres(program) && table_words(program).len() <= MOST_CONSTANTS
}

fn has_centres(program: &Program) -> bool {
    matches!(program.proposal, Some(Proposal::Centres(_)))
}

/// The module of a program on a grid.
pub(crate) fn module(
    program: &Program,
    grid: &Grid,
    prefix: &str,
    options: ModuleOptions,
) -> Result<String, WgslError> {
    let starts_well = prefix.starts_with(|c: char| c.is_ascii_alphabetic());
    let holds = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if !starts_well || !prefix.chars().all(holds) || prefix.contains("__") || prefix.ends_with('_') {
        return Err(WgslError::Prefix(prefix.to_owned()));
    }
    let is_exact = options.arithmetic == Arithmetic::Exact;
    let tables = Tables::new(program);
    let dialect = (Dialect::Baseline, options.arithmetic);
    let draw = functions(program, &tables, dialect, (false, is_exact), None);
    // What naga_oil imports may name structures, but no other types.
    let normals = match Form::of(program) {
        Form::Unrolled => program.components(),
        Form::Looped => program.given + 4 * program.normals().div_ceil(4),
    };
    let draw = without_alias(&draw, "Given", program.given);
    let draw = without_alias(&draw, "Normals", normals);
    let storage = storage(program, tables.values.len(), options.tables)?;
    let interface = interface(program, &tables, grid, is_exact);
    let text = written(&format!("{storage}{draw}\n{interface}"), options.arithmetic, Zero::Argument);
    Ok(prefixed(&text, prefix))
}

/// Takes the alias of an array away, whose name then stands nowhere.
fn without_alias(text: &str, name: &str, count: usize) -> String {
    let lines = text.lines().filter(|line| !line.starts_with(&format!("alias {name} = ")));
    lines.map(|line| line.replace(name, &format!("array<f32, {count}>")) + "\n").collect()
}

/// Writes the tables, and the functions that read them; nothing where there are none.
fn storage(program: &Program, numbers: usize, storage: Option<TableStorage>) -> Result<String, WgslError> {
    let words = table_words(program);
    if words.is_empty() {
        return Ok(String::new());
    }
    let fits = keeps_tables_constant(program);
    let default = || if fits { TableStorage::Const } else { TableStorage::Buffer { group: 0, binding: 0 } };
    let mut text = Text::default();
    let name = match storage.unwrap_or_else(default) {
        TableStorage::Const if has_centres(program) => return Err(WgslError::ConstantCentres),
        TableStorage::Const if !fits => return Err(WgslError::LargeTable { words: words.len() }),
        TableStorage::Const => {
            let count = words.len();
            text.line(&format!(
                "const TABLES = array<u32, {count}>({});",
                list(count, |i| format!("{}u", words[i]))
            ));
            "TABLES"
        }
        TableStorage::Buffer { group, binding } => {
            text.line(&format!("@group({group}) @binding({binding}) var<storage, read> tables: array<u32>;"));
            "tables"
        }
    };
    if numbers > 0 {
        text.block("fn number(i: u32) -> f32", |body| {
            body.line(&format!("return bitcast<f32>({name}[i]);"));
        });
    }
    if has_centres(program) {
        text.block("fn proposal_word(i: u32) -> u32", |body| {
            body.line(&format!("return {name}[{numbers}u + i];"));
        });
    }
    if program.proposal.is_some() {
        text.block("fn proposal_row(i: u32) -> vec4<u32>", |body| {
            body.line(&format!("let at = {numbers}u + 4u * i;"));
            body.line(&format!(
                "return vec4({name}[at], {name}[at + 1u], {name}[at + 2u], {name}[at + 3u]);"
            ));
        });
    }
    text.line("");
    Ok(text.0)
}

/// Writes the functions that a host calls, and the constants of the grid.
fn interface(program: &Program, tables: &Tables, grid: &Grid, is_exact: bool) -> String {
    let mut text = Text::default();
    if Form::of(program) == Form::Unrolled {
        text.line(&format!("const BANDS = {}u;", program.bands()));
    }
    text.line(&format!("const FIRST_NM = {};", float(grid.first())));
    if let Some(step) = grid.step() {
        text.line(&format!("const STEP_NM = {};", float(step)));
    }
    draw(&mut text, program, is_exact);
    for (i, output) in program.outputs.iter().enumerate() {
        let quantity = output.format.quantity;
        match &output.source {
            Source::Spectrum => spectrum(&mut text, program, grid),
            Source::Map(_, unit) => {
                let row = |first: usize, j: usize| format!("form(&z, {}u)", first + j);
                let (value, over): (Box<dyn Fn(usize) -> String>, String) = match Form::of(program) {
                    Form::Unrolled => {
                        (Box::new(|j| format!("{quantity}_{j}(d.z)")), format!("{quantity}_over_0(d.z)"))
                    }
                    Form::Looped => (Box::new(move |j| row(tables.maps[i], j)), row(tables.units[i], 0)),
                };
                map(&mut text, program, output.format.width, (quantity, unit), (value, over));
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

/// Writes the functions that make a draw of an index, and of the responses that it is given: a vector of two to four of
/// them, so that a texel goes in as it is.
fn draw(text: &mut Text, program: &Program, is_exact: bool) {
    let (attempts, given) = (program.max_attempts, program.given);
    let (kind, parts) = match given {
        0 | 1 => ("f32".to_owned(), "c".to_owned()),
        2..=4 => (format!("vec{given}<f32>"), list(given, |i| format!("c.{}", PARTS[i]))),
        _ => (format!("array<f32, {given}>"), list(given, |i| format!("c[{i}]"))),
    };
    let (name, condition, parameter, argument) = match given {
        0 => ("draw", "", String::new(), String::new()),
        _ => {
            let argument = format!(", array<f32, {given}>({parts})");
            ("draw_given", ", given the responses c", format!(", c: {kind}"), argument)
        }
    };
    let mut function = |notes: &[&str], head: &str, stream: &str| {
        notes.iter().for_each(|note| text.line(note));
        text.line(&format!("fn {head}, index: vec2<u32>{parameter}) -> Draw {{"));
        text.line(&format!("    return draw_of(seed, index, {stream}, {attempts}u{argument});\n}}"));
    };
    let words = "(low word, high word)";
    let first =
        format!("\n// Draw `index` {words} under a seed {words}{condition}, as every engine makes it.");
    let zero =
        "// `zero` must be 0 and known at run time alone, as from a uniform, or compilers see through it.";
    let notes = [first.as_str(), zero];
    function(&notes[..1 + usize::from(is_exact)], &format!("{name}(seed: vec2<u32>"), "0u");
    function(
        &[
            "\n// The same, of the stream of this number, which sets draws apart from others of the same seed.",
        ],
        &format!("{name}_in(stream: u32, seed: vec2<u32>"),
        "stream << 8u",
    );
}

/// Writes the function of a quantity that is a map of the normals: of each value, and of what all are divided by.
fn map(
    text: &mut Text,
    program: &Program,
    width: usize,
    (quantity, unit): (Quantity, &Unit),
    (value, over): (impl Fn(usize) -> String, String),
) {
    let (result, head) = match quantity {
        Quantity::Xyz | Quantity::LinearSrgb => ("vec3<f32>".to_owned(), "vec3"),
        Quantity::Chromaticity => ("vec2<f32>".to_owned(), "vec2"),
        Quantity::Lrv => ("f32".to_owned(), ""),
        _ => (format!("array<f32, {width}>"), "array"),
    };
    text.block(&format!("fn {quantity}(d: Draw) -> {result}"), |body| {
        if Form::of(program) == Form::Looped {
            body.line("var z = d.z;");
        }
        let factor = match unit {
            Unit::One => None,
            Unit::Scale => Some("d.scale"),
            Unit::Over(_) => {
                let floor = <f32 as DrawOperations>::FLOOR;
                body.line(&format!("let unit = ratio(1f, max({over}, {floor:?}f));"));
                Some("unit")
            }
        };
        let values = list(width, |j| match factor {
            Some(factor) => format!("rounded({factor} * {})", value(j)),
            None => value(j),
        });
        body.line(&format!("return {head}({values});"));
    });
}

/// Writes the functions of a spectrum: all of it, a band, and at any wavelength.
fn spectrum(text: &mut Text, program: &Program, grid: &Grid) {
    let n = program.bands();
    let scaled = |band: String| match program.scales() {
        true => format!("rounded({band} * d.scale)"),
        false => band,
    };
    match Form::of(program) {
        Form::Unrolled => {
            let band = |b: usize| scaled(format!("band{b}(d.z)"));
            text.block(&format!("fn spectrum(d: Draw) -> array<f32, {n}>"), |body| {
                body.line(&format!("return array({});", list(n, band)));
            });
            text.block("fn at(d: Draw, band: u32) -> f32", |body| {
                body.line("switch band {");
                (0..n).for_each(|b| body.line(&format!("    case {b}u: {{ return {}; }}", band(b))));
                body.line("    default: { return 0f; }");
                body.line("}");
            });
        }
        Form::Looped => {
            text.block(&format!("fn spectrum(d: Draw) -> array<f32, {n}>"), |body| {
                body.line("var z = d.z;");
                body.line(&format!("var values: array<f32, {n}>;"));
                body.line("for (var b = 0u; b < BANDS; b++) {");
                body.line(&format!("    values[b] = {};", scaled("form(&z, b)".to_owned())));
                body.line("}");
                body.line("return values;");
            });
            text.block("fn at(d: Draw, band: u32) -> f32", |body| {
                body.line("var z = d.z;");
                body.line("if band >= BANDS {\n    return 0f;\n}");
                body.line(&format!("return {};", scaled("form(&z, band)".to_owned())));
            });
        }
    }
    at_any_wavelength(text, program, grid);
}

/// Writes the value at any wavelength: between two bands on the line between them, outside the grid that of its end.
fn at_any_wavelength(text: &mut Text, program: &Program, grid: &Grid) {
    let name = match program.kind {
        SpectrumKind::Illuminant => "power",
        SpectrumKind::Reflectance => "reflectance",
    };
    let n = program.bands();
    if grid.step().is_none() {
        text.block("fn wavelength(band: u32) -> f32", |body| {
            body.line("switch band {");
            grid.wavelengths().enumerate().for_each(|(b, nm)| {
                body.line(&format!("    case {b}u: {{ return {}; }}", float(nm)));
            });
            body.line("    default: { return 0f; }");
            body.line("}");
        });
    }
    text.block(&format!("fn {name}(d: Draw, nm: f32) -> f32"), |body| {
        if n == 1 {
            return body.line("return at(d, 0u);");
        }
        if grid.step().is_some() {
            body.line("let place = clamp(ratio(rounded(nm - FIRST_NM), STEP_NM), 0f, f32(BANDS - 1u));");
            body.line("let band = min(u32(place), BANDS - 2u);");
            body.line("let share = rounded(place - f32(band));");
        } else {
            body.line("var band = 0u;");
            body.line("while band + 2u < BANDS && wavelength(band + 1u) <= nm {\n    band++;\n}");
            body.line("let low_nm = wavelength(band);");
            body.line("let width = rounded(wavelength(band + 1u) - low_nm);");
            body.line("let share = clamp(ratio(rounded(nm - low_nm), width), 0f, 1f);");
        }
        body.line("let low = at(d, band);");
        body.line("return rounded(low + rounded(share * rounded(at(d, band + 1u) - low)));");
    });
}

/// The text with `prefix` before every name that it declares. What follows a dot or comes before a colon is a member
/// or an argument, and is left alone.
fn prefixed(text: &str, prefix: &str) -> String {
    let names: HashSet<&str> = text.lines().filter_map(declared).collect();
    let mut result = String::new();
    for line in text.lines() {
        let (code, comment) = line.split_at(line.find("//").unwrap_or(line.len()));
        let is_binding = line.starts_with("@group(");
        let mut rest = code;
        while let Some(start) = rest.find(is_name) {
            let (before, from) = rest.split_at(start);
            let (word, after) = from.split_at(from.find(|c| !is_name(c)).unwrap_or(from.len()));
            result += before;
            if names.contains(word) && !before.ends_with('.') && (is_binding || !after.starts_with(':')) {
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

/// Name that a line declares, where it declares one outside of functions.
fn declared(line: &str) -> Option<&str> {
    let named = ["fn ", "struct ", "const ", "alias "].iter().find_map(|word| line.strip_prefix(word));
    let bound = || line.strip_prefix("@group(")?.split_once("> ").map(|(_, name)| name);
    named.or_else(bound)?.split(|c: char| !is_name(c)).next()
}

fn is_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}
