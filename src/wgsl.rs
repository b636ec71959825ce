//! A program as WGSL text: the hand-written fragments of `shaders/`, and between them code that is generated for the
//! program, with the model's numbers as constants.
//!
//! What the program does not need is not in the text: no luminance without a target, no upper bound for illuminants.
//! Straight lines are several times as fast as a loop that reads the model from a buffer, but take time to compile.
//! Beyond [`UNROLLED_GAINS`] the same operations run in such a loop: same order, same bits.
//!
//! The generated functions, whose types differ from form to form, are:
//! - `normals(key, index, stream, attempt) -> Normals`: k standard normals;
//! - `is_accepted(Normals) -> bool`;
//! - `store(Draw, row) -> bool`: writes the spectrum of a draw from element `row` on, zeros where it failed, and says
//! - `tally(Draw, above_one) -> u32`.

use std::fmt::Write;

use crate::dataset::Kind;
use crate::normal::Real;
use crate::program::{Program, Tally};

/// Threads a workgroup.
pub(crate) const WORKGROUP: u32 = 64;

/// The most gains (bands x components) that are written out as constants. At this size lavapipe takes 2.5 s to
/// compile the straight lines, which then run 7 times as fast as the loop: they pay from 2e5 draws on.
const UNROLLED_GAINS: usize = 2048;

const MUL_WIDE: &str = include_str!("../shaders/mul_wide.wgsl");
const MUL_WIDE_INT64: &str = include_str!("../shaders/mul_wide_int64.wgsl");
const PHILOX: &str = include_str!("../shaders/philox.wgsl");
const NORMAL: &str = include_str!("../shaders/normal.wgsl");
const PHYSICAL: &str = include_str!("../shaders/physical.wgsl");
const LOOPED: &str = include_str!("../shaders/looped.wgsl");
const DRAW: &str = include_str!("../shaders/draw.wgsl");
const PARAMETERS: &str = include_str!("../shaders/parameters.wgsl");
const MAIN: &str = include_str!("../shaders/main.wgsl");
const MAIN_PAIRS: &str = include_str!("../shaders/main_pairs.wgsl");

/// What a device can do, as far as the text depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    /// Any device.
    Baseline,
    /// A device with `SHADER_INT64`.
    Int64,
    /// A software adapter with `SHADER_INT64`.
    SoftwareInt64,
}

/// How a program's arithmetic is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// In straight lines, with the model's numbers as constants.
    Unrolled,
    /// In loops over bands and components that read the model from a buffer (see [`model_buffer`]).
    Looped,
}

impl Form {
    pub(crate) fn of(program: &Program) -> Form {
        match program.bands() * program.components() {
            ..=UNROLLED_GAINS => Form::Unrolled,
            _ => Form::Looped,
        }
    }
}

/// How many draws one thread makes.
pub(crate) fn draws_per_thread(program: &Program, target: Target) -> u32 {
    match (Form::of(program), target) {
        (Form::Unrolled, Target::SoftwareInt64) => 2,
        _ => 1,
    }
}

/// The fragments that make random words and normals: the whole of what does not depend on a program.
pub(crate) fn generator(target: Target) -> String {
    let mul_wide = match target {
        Target::Baseline => MUL_WIDE,
        Target::Int64 | Target::SoftwareInt64 => MUL_WIDE_INT64,
    };
    [mul_wide, PHILOX, NORMAL].join("\n")
}

/// The compute shader of a program.
pub(crate) fn shader(program: &Program, target: Target) -> String {
    let paired = draws_per_thread(program, target) == 2;
    let arithmetic = match Form::of(program) {
        Form::Unrolled => unrolled(program, paired),
        Form::Looped => looped(program),
    };
    let main = if paired { MAIN_PAIRS } else { MAIN }
        .replace("WORKGROUP", &WORKGROUP.to_string())
        .replace("ROW", &format!("{}u", program.bands()));
    [&generator(target), PHYSICAL, &arithmetic, DRAW, &tally(program), PARAMETERS, &main].join("\n")
}

/// The numbers that the looped form reads: for each band its offset and its k gains; then, with a target, the LRV
/// weight of each band.
pub(crate) fn model_buffer(program: &Program) -> Vec<f32> {
    let rows = (0..program.bands()).flat_map(|b| {
        let gains = program.gain.iter().map(move |gain| gain[b]);
        std::iter::once(program.offset[b]).chain(gains)
    });
    let weights = program.target.iter().flat_map(|t| &t.weights).copied();
    rows.chain(weights).map(|v| v as f32).collect()
}

fn unrolled(program: &Program, paired: bool) -> String {
    let (n, k) = (program.bands(), program.components());
    let mut text = Text::default();
    text.line(&format!("struct Normals {{ {} }}", list(k, |j| format!("z{j}: f32"))));
    text.line(&format!("struct Spectrum {{ {} }}", list(n, |b| format!("b{b}: f32"))));
    text.block(
        "fn normals(key: vec2<u32>, index: vec2<u32>, stream: u32, attempt: u32) -> Normals",
        |body| {
            for block in 0..k.div_ceil(4) {
                body.line(&format!("let w{block} = philox(vec4(index, attempt, stream | {block}u), key);"));
            }
            for pair in 0..k.div_ceil(2) {
                let [x, y] = if pair % 2 == 0 { ["x", "y"] } else { ["z", "w"] };
                body.line(&format!("let p{pair} = normal_pair(w{0}.{x}, w{0}.{y});", pair / 2));
            }
            let normal = |j| format!("p{}.{}", j / 2, if j % 2 == 0 { "x" } else { "y" });
            body.line(&format!("return Normals({});", list(k, normal)));
        },
    );
    text.line("");
    for b in 0..n {
        let gains =
            program.gain.iter().enumerate().map(|(j, gain)| format!(" + {} * z.z{j}", float(gain[b])));
        let sum = float(program.offset[b]) + &gains.collect::<String>();
        text.line(&format!("fn band{b}(z: Normals) -> f32 {{ return {sum}; }}"));
    }
    text.block("fn spectrum(z: Normals) -> Spectrum", |body| {
        body.line(&format!("return Spectrum({});", list(n, |b| format!("band{b}(z)"))));
    });
    if let Some(target) = &program.target {
        text.block("fn factor(s: Spectrum) -> f32", |body| {
            let products = target.weights.iter().enumerate().map(|(b, w)| format!("{} * s.b{b}", float(*w)));
            body.line(&format!("let lrv = {};", products.collect::<Vec<_>>().join(" + ")));
            body.line(&format!("return {};", factor(target.lrv, "lrv")));
        });
    }
    text.block("fn is_accepted(z: Normals) -> bool", |body| {
        body.line("let s = spectrum(z);");
        body.line("var e = 0u;");
        if program.tests_base() {
            (0..n).for_each(|b| body.line(&format!("e = max(e, excess(s.b{b}));")));
        }
        if program.tests_scaled() {
            body.line("let f = factor(s);");
            (0..n).for_each(|b| body.line(&format!("e = max(e, excess(s.b{b} * f));")));
        }
        body.line(&format!("return e < {};", limit(program)));
    });
    text.0 += &unrolled_store(program, paired);
    text.0
}

/// `fn store`. Values of both draws of a pair are computed band by band, so that they share the constants.
fn unrolled_store(program: &Program, paired: bool) -> String {
    let n = program.bands();
    let scaled = program.target.is_some();
    let (draws, arguments, result): (&[&str], _, _) = match paired {
        true => (&["a", "b"], "a: Draw, b: Draw", "vec2<bool>"),
        false => (&["a"], "a: Draw", "bool"),
    };
    let mut text = Text::default();
    text.block(&format!("fn store({arguments}, row: u32) -> {result}"), |body| {
        for d in draws {
            body.line(&format!("let ok_{d} = {d}.attempts != 0u;"));
            if scaled {
                body.line(&format!("let f_{d} = factor(spectrum({d}.z));"));
            }
        }
        for (b, d) in (0..n).flat_map(|b| draws.iter().map(move |d| (b, d))) {
            let factor = if scaled { format!(" * f_{d}") } else { String::new() };
            body.line(&format!("let {d}{b} = select(0f, band{b}({d}.z){factor}, ok_{d});"));
        }
        let values: Vec<_> = draws.iter().flat_map(|d| (0..n).map(move |b| format!("{d}{b}"))).collect();
        match paired {
            true => values.chunks_exact(2).enumerate().for_each(|(i, pair)| {
                body.line(&format!("spectra[row + {i}u] = float_word({}, {});", pair[0], pair[1]));
            }),
            false => values.iter().enumerate().for_each(|(i, value)| {
                body.line(&format!("spectra[row + {i}u] = {value};"));
            }),
        }
        let above_one = draws.iter().map(|d| match program.may_exceed_one() {
            true => (0..n).map(|b| format!("({d}{b} >= 1f)")).collect::<Vec<_>>().join(" | "),
            false => "false".to_owned(),
        });
        body.line(&format!("return {result}({});", above_one.collect::<Vec<_>>().join(", ")));
    });
    text.0
}

/// The fragment `looped.wgsl` with the program's constants and tests.
fn looped(program: &Program) -> String {
    let (n, k) = (program.bands(), program.components());
    let mut text = Text::default();
    for (name, value) in [("BANDS", n), ("COMPONENTS", k), ("BLOCKS", k.div_ceil(4))] {
        text.line(&format!("const {name} = {value}u;"));
    }
    text.line(&format!("const LIMIT = {};\n", limit(program)));
    let factor = program.target.as_ref().map_or("1f".to_owned(), |t| factor(t.lrv, "luminance(&z)"));
    let accepted = match (program.tests_base(), program.tests_scaled()) {
        (true, false) => "return all_physical(&z, 1f);".to_owned(),
        (false, _) => format!("return all_physical(&z, {factor});"),
        (true, true) => format!("return all_physical(&z, 1f) && all_physical(&z, {factor});"),
    };
    text.line(&LOOPED.replace("ACCEPTED", &accepted).replace("FACTOR", &factor));
    text.0
}

/// What scales a spectrum of the luminous reflectance `of` to the target.
fn factor(lrv: f64, of: &str) -> String {
    format!("{} / max({of}, {:?}f)", float(lrv), <f32 as Real>::FLOOR)
}

/// `fn tally`, the word of [`Tally`].
fn tally(program: &Program) -> String {
    let mut text = Text::default();
    text.block("fn tally(d: Draw, above_one: bool) -> u32", |body| {
        body.line(&match program.may_exceed_one() {
            true => format!("return d.attempts | select(0u, {}u, above_one);", Tally::ABOVE_ONE),
            false => "return d.attempts;".to_owned(),
        });
    });
    text.0
}

/// What `excess` of every tested value must be below: that of 1, or for illuminants that of infinity.
fn limit(program: &Program) -> String {
    let bound = match program.kind {
        Kind::Reflectance => 1f32,
        Kind::Illuminant => f32::INFINITY,
    };
    format!("{}u", bound.to_bits() - 1)
}

/// A number rounded to f32, as WGSL: the shortest decimal that reads back the same.
fn float(value: f64) -> String {
    format!("{:?}f", value as f32)
}

fn list(count: usize, item: impl Fn(usize) -> String) -> String {
    (0..count).map(item).collect::<Vec<_>>().join(", ")
}

/// Text under construction.
#[derive(Default)]
struct Text(String);

impl Text {
    fn line(&mut self, line: &str) {
        self.0 += line;
        self.0.push('\n');
    }

    /// A function: its head, and an indented body.
    fn block(&mut self, head: &str, body: impl FnOnce(&mut Text)) {
        let mut inner = Text::default();
        body(&mut inner);
        writeln!(self.0, "\n{head} {{\n    {}\n}}", inner.0.trim_end().replace('\n', "\n    "))
            .expect("no I/O");
    }
}

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;
    use crate::program::{self, Bounds};

    /// A program of 3 bands and 2 components, small enough to read.
    fn small(kind: Kind, target: Option<(f64, Bounds)>) -> Program {
        program_of(kind, 3, 2, target)
    }

    fn program_of(kind: Kind, bands: usize, components: usize, target: Option<(f64, Bounds)>) -> Program {
        let weights = vec![1.0 / bands as f64; bands];
        Program {
            kind,
            offset: (0..bands).map(|b| 0.5 + 0.125 * (b % 3) as f64).collect(),
            gain: (0..components)
                .map(|j| (0..bands).map(|b| 0.25 / (1 + j + b % 7) as f64).collect())
                .collect(),
            target: target.map(|(lrv, bounds)| program::Target { lrv, weights, bounds }),
            max_attempts: 100,
        }
    }

    fn validate(text: &str, capabilities: Capabilities) -> Result<(), String> {
        let module = naga::front::wgsl::parse_str(text).map_err(|e| e.emit_to_string(text))?;
        let mut validator = Validator::new(ValidationFlags::all(), capabilities);
        validator.validate(&module).map(drop).map_err(|e| e.emit_to_string(text))
    }

    #[test]
    fn every_variant_is_valid_with_no_more_than_it_says() {
        let rules = [None, Some(Bounds::Base), Some(Bounds::Scaled), Some(Bounds::Both)];
        for (bands, components) in [(1, 1), (3, 2), (31, 6), (61, 12), (70, 64), (1000, 64)] {
            for kind in [Kind::Illuminant, Kind::Reflectance] {
                for rule in rules.into_iter().filter(|rule| kind == Kind::Reflectance || rule.is_none()) {
                    let program = program_of(kind, bands, components, rule.map(|bounds| (0.4, bounds)));
                    for (target, needs) in [
                        (Target::Baseline, Capabilities::empty()),
                        (Target::Int64, Capabilities::SHADER_INT64),
                        (Target::SoftwareInt64, Capabilities::SHADER_INT64),
                    ] {
                        let checked = validate(&shader(&program, target), needs);
                        assert!(
                            checked.is_ok(),
                            "{kind} {bands}x{components} {rule:?} {target:?}: {}",
                            checked.unwrap_err()
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn int64_is_not_taken_without_asking() {
        let text = shader(&small(Kind::Illuminant, None), Target::Int64);
        assert!(validate(&text, Capabilities::empty()).is_err());
    }

    /// The text between the fragments, for each kind of recipe: a change here is a decision.
    #[test]
    fn what_is_generated() {
        let reflectance = |target| small(Kind::Reflectance, target);
        for (name, text) in [
            ("illuminant", unrolled(&small(Kind::Illuminant, None), false)),
            ("reflectance", unrolled(&reflectance(None), false)),
            ("reflectance_in_pairs", unrolled(&reflectance(None), true)),
            ("lrv_base", unrolled(&reflectance(Some((0.4, Bounds::Base))), false)),
            ("lrv_scaled", unrolled(&reflectance(Some((0.4, Bounds::Scaled))), false)),
            ("lrv_both_in_pairs", unrolled(&reflectance(Some((0.4, Bounds::Both))), true)),
            ("lrv_both_looped", looped(&reflectance(Some((0.4, Bounds::Both))))),
        ] {
            insta::assert_snapshot!(name, text);
        }
    }

    #[test]
    fn what_is_not_asked_for_is_not_in_the_text() {
        let plain = shader(&small(Kind::Reflectance, None), Target::Baseline);
        let light = shader(&small(Kind::Illuminant, None), Target::Baseline);
        let target = shader(&small(Kind::Reflectance, Some((0.4, Bounds::Scaled))), Target::Baseline);
        for absent in ["lrv", "factor", "u64", "model"] {
            assert!(!plain.contains(absent) && !light.contains(absent), "{absent}");
        }
        assert!(target.contains("lrv"));
        let one = format!("{}u", 1f32.to_bits() - 1);
        assert!(plain.contains(&one) && !light.contains(&one), "an illuminant has no upper bound");
    }

    #[test]
    fn numbers_read_back_as_they_are() {
        for value in [0.1, -1e-7, 1.0, 123456.78, 1e-30, f64::from(f32::MIN_POSITIVE), 1e30] {
            let text = float(value);
            assert_eq!(text.strip_suffix('f').unwrap().parse::<f32>().unwrap(), value as f32, "{text}");
        }
    }
}
