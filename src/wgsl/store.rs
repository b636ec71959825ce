//! Stores of a thread's draws: `fn store`, and the buffers that it writes.
//!
//! It writes its rows as they are made, or by way of the workgroup's memory (see `shaders/gathered.wgsl`).

use super::tables::Tables;
use super::writer::Text;
use super::{Dialect, Form, OUTPUTS_AT, Part, draw_names};
use crate::draw_status::DrawStatus;
use crate::program::{Output, Program, Source, Unit};
use crate::quantity::{ArrayFormat, Dtype, Layout, Quantity, ValueRange};
use crate::random::real::DrawOperations;

/// The most words of a row that are gathered at a time: a workgroup has 16 KiB everywhere.
const MOST_GATHERED: usize = 63;
const _: () = assert!(size_of::<u32>() * super::WORKGROUP as usize * pitch_of(MOST_GATHERED) <= 16 << 10);

/// Packing of an output's values into words of its buffer.
#[derive(Clone, Copy, PartialEq)]
enum Word {
    /// A value is a word.
    Value,
    /// Two 32-bit values are a word of 64 bits.
    Pair,
    /// Two 16-bit values are a word of 32 bits.
    Halves,
}

impl Word {
    fn of(format: &ArrayFormat, form: Form, target: Dialect) -> Word {
        match (format.dtype, form, target) {
            (Dtype::F16, ..) => Word::Halves,
            (_, Form::Unrolled, Dialect::SoftwareInt64) => Word::Pair,
            _ => Word::Value,
        }
    }

    fn values(self) -> usize {
        if self == Word::Value { 1 } else { 2 }
    }

    fn name(self, dtype: Dtype) -> &'static str {
        match (self, dtype) {
            (Word::Value, Dtype::F32) => "f32",
            (Word::Value, _) | (Word::Halves, _) => "u32",
            (Word::Pair, _) => "u64",
        }
    }

    /// The word of its values.
    fn pack(self, dtype: Dtype, values: &[String]) -> String {
        match (self, dtype, values) {
            (Word::Value, _, [value]) => value.clone(),
            (Word::Pair, Dtype::F32, [low, high]) => format!("float_word({low}, {high})"),
            (Word::Pair, _, [low, high]) => format!("word({low}, {high})"),
            (Word::Halves, _, [low, high]) => format!("half({low}) | (half({high}) << 16u)"),
            _ => unreachable!("a word has as many values as it says"),
        }
    }
}

/// Place of a value in a row.
#[derive(Clone, Copy)]
enum At<'a> {
    /// The value of this number, in straight lines.
    Number(usize),
    /// The value that a variable numbers, in a loop.
    Variable(&'a str),
}

struct Store<'a> {
    program: &'a Program,
    tables: &'a Tables,
    target: Dialect,
    form: Form,
    /// The names of the thread's draws.
    draws: &'static [&'static str],
    /// Part that is left out.
    part: Option<Part>,
    /// Whether rows go by way of the workgroup's memory.
    gathers: bool,
}

/// Number of words of a row that are gathered at a time.
fn tile(words: usize) -> usize {
    words.div_ceil(words.div_ceil(MOST_GATHERED))
}

/// Distance of gathered rows: odd, so that neighbouring threads write to different banks of memory.
const fn pitch_of(words: usize) -> usize {
    words | 1
}

/// Whether rows of these values are gathered, where any are.
fn is_gathered(format: &ArrayFormat) -> bool {
    format.width > 1 && format.layout != Layout::Planes
}

/// Largest distance of gathered rows; `None` where there are none.
pub(super) fn pitch(program: &Program, target: Dialect) -> Option<usize> {
    let form = Form::of(program);
    if form == Form::Looped || target == Dialect::SoftwareInt64 {
        return None;
    }
    let draws = draw_names(program, target).len();
    let formats = program.outputs.iter().map(|output| &output.format).filter(|format| is_gathered(format));
    let words = formats.map(|format| draws * format.stride() / Word::of(format, form, target).values());
    words.map(|words| pitch_of(tile(words))).max()
}

/// Writes the stores of all but a part.
pub(super) fn store(
    program: &Program,
    tables: &Tables,
    target: Dialect,
    part: Option<Part>,
    gathers: bool,
) -> String {
    let draws = draw_names(program, target);
    let store = Store { program, tables, target, form: Form::of(program), draws, part, gathers };
    let mut text = Text::default();
    for output in &program.outputs {
        let ArrayFormat { quantity, dtype, .. } = output.format;
        let word = Word::of(&output.format, store.form, target);
        text.line(&format!(
            "@group(0) @binding({}) var<storage, read_write> {quantity}: array<{}>;",
            OUTPUTS_AT + quantity as u32,
            word.name(dtype)
        ));
    }
    let arguments: String = draws.iter().map(|d| format!(", {d}: Draw")).collect();
    let where_to = if gathers { "thread: u32, local: u32, is_there: bool" } else { "thread: u32" };
    text.block(&format!("fn store({where_to}{arguments})"), |body| {
        if gathers {
            let (count, rest) = (draws.len(), draws.len() - 1);
            body.line("let first = thread - local;");
            body.line(&format!("let end = (parameters.count + {rest}u) / {count}u;"));
            body.line("let rows = min(THREADS, max(end, first) - first);");
        }
        for d in draws {
            body.line(&format!("let ok_{d} = {d}.attempts != 0u;"));
            if store.form == Form::Looped {
                body.line(&format!("var z_{d} = {d}.z;"));
            }
        }
        for (i, output) in program.outputs.iter().enumerate() {
            store.output(body, i, output);
        }
    });
    text.0
}

impl Store<'_> {
    fn output(&self, body: &mut Text, i: usize, output: &Output) {
        let format = &output.format;
        if let Source::Map(_, Unit::Over(_)) = output.source {
            for d in self.draws {
                let over = match self.form {
                    Form::Unrolled => format!("{}_over_0({d}.z)", format.quantity),
                    Form::Looped => format!("form(&z_{d}, {}u)", self.tables.units[i]),
                };
                let floor = <f32 as DrawOperations>::FLOOR;
                body.line(&format!("let {}_unit_{d} = ratio(1f, max({over}, {floor:?}f));", format.quantity));
            }
        }
        match self.form {
            Form::Looped if format.width > 1 => self.in_a_loop(body, i, output),
            _ => self.in_lines(body, i, output),
        }
    }

    /// A value of a draw, 0 where it failed.
    fn value(&self, i: usize, output: &Output, d: &str, at: At) -> String {
        let quantity = output.format.quantity;
        let form = |name: &str, first: usize| match (self.form, at) {
            (Form::Unrolled, At::Number(j)) => format!("{name}{j}({d}.z)"),
            (Form::Looped, At::Number(j)) => format!("form(&z_{d}, {}u)", first + j),
            (_, At::Variable(j)) => format!("form(&z_{d}, {first}u + {j})"),
        };
        let value = match &output.source {
            Source::Spectrum if self.program.scales() => format!("{} * {d}.scale", form("band", 0)),
            Source::Spectrum => form("band", 0),
            Source::Map(_, unit) => {
                let map = form(&format!("{quantity}_"), self.tables.maps.get(i).copied().unwrap_or(0));
                match unit {
                    Unit::One => map,
                    Unit::Scale => format!("{map} * {d}.scale"),
                    Unit::Over(_) => format!("{map} * {quantity}_unit_{d}"),
                }
            }
            Source::Intensity => format!("{d}.scale"),
            Source::TargetLrv => format!("{d}.target_lrv"),
            Source::Status if self.program.may_exceed_one() => {
                let above_one = format!("ok_{d} && rounded(peak(worst({d}.z)) * {d}.scale) >= 1f");
                return format!("{d}.attempts | select(0u, {}u, {above_one})", DrawStatus::ABOVE_ONE);
            }
            Source::Status => return format!("{d}.attempts"),
        };
        let value = match (&output.source, output.format.dtype) {
            (Source::Spectrum, Dtype::F16) => {
                within(&format!("rounded({value})"), self.program.value_range())
            }
            _ => value,
        };
        format!("select(0f, {value}, ok_{d})")
    }

    fn in_lines(&self, body: &mut Text, i: usize, output: &Output) {
        let format = &output.format;
        let ArrayFormat { quantity, dtype, width, .. } = *format;
        let word = Word::of(format, self.form, self.target);
        // Both draws band by band, so that they share the constants.
        for (j, d) in (0..width).flat_map(|j| self.draws.iter().map(move |d| (j, d))) {
            let value = self.value(i, output, d, At::Number(j));
            body.line(&format!("let {quantity}_{d}{j} = {value};"));
        }
        let named = |d: &str, j: usize| match j < width {
            true => format!("{quantity}_{d}{j}"),
            false => "0f".to_owned(), // padding
        };
        let runs: Vec<(String, Vec<String>)> = match format.layout {
            Layout::Rows | Layout::PaddedRows => {
                let values = self.draws.iter().flat_map(|d| (0..format.stride()).map(move |j| named(d, j)));
                let words = self.draws.len() * format.stride() / word.values();
                vec![(format!("thread * {words}u"), values.collect())]
            }
            Layout::Planes => {
                let words = self.draws.len() / word.values();
                let run = |j| {
                    let plane = plane(word, At::Number(j));
                    (format!("{plane} + thread * {words}u"), self.draws.iter().map(|d| named(d, j)).collect())
                };
                (0..width).map(run).collect()
            }
        };
        if self.part == Some(Part::Store) && quantity == Quantity::Spectra {
            // The sum of all words, so that all are computed.
            let words = runs.iter().flat_map(|(_, values)| values.chunks_exact(word.values()));
            let sum = words.map(|values| word.pack(dtype, values)).collect::<Vec<_>>().join(" + ");
            return body.line(&format!("{quantity}[thread] = {sum};"));
        }
        if self.gathers && is_gathered(format) {
            let words = runs.iter().flat_map(|(_, row)| row.chunks_exact(word.values()));
            let words: Vec<_> = words.map(|values| word.pack(dtype, values)).collect();
            return gather(body, quantity, word.name(dtype), &words);
        }
        let stores = |body: &mut Text| {
            for (start, values) in &runs {
                for (at, values) in values.chunks_exact(word.values()).enumerate() {
                    body.line(&format!("{quantity}[{start} + {at}u] = {};", word.pack(dtype, values)));
                }
            }
        };
        match self.gathers {
            true => body.block("if is_there", stores),
            false => stores(body),
        }
    }

    fn in_a_loop(&self, body: &mut Text, i: usize, output: &Output) {
        let format = &output.format;
        let ArrayFormat { quantity, dtype, width, .. } = *format;
        let word = Word::of(format, self.form, self.target);
        let value = |d: &str, j: &str| self.value(i, output, d, At::Variable(j));
        match (format.layout, word) {
            (Layout::Planes, _) => {
                let words = self.draws.len() / word.values();
                body.block(&format!("for (var j = 0u; j < {width}u; j++)"), |body| {
                    let values: Vec<_> = self.draws.iter().map(|d| value(d, "j")).collect();
                    let start = format!("{} + thread * {words}u", plane(word, At::Variable("j")));
                    for (at, values) in values.chunks_exact(word.values()).enumerate() {
                        body.line(&format!("{quantity}[{start} + {at}u] = {};", word.pack(dtype, values)));
                    }
                });
            }
            (_, Word::Halves) => {
                // A word may have the end of one row and the start of the next.
                let stride = format.stride();
                body.block(&format!("for (var at = 0u; at < {stride}u; at++)"), |body| {
                    body.line("var values = vec2(0f);");
                    body.block("for (var half_at = 0u; half_at < 2u; half_at++)", |body| {
                        body.line("let position = 2u * at + half_at;");
                        for (row, d) in self.draws.iter().enumerate() {
                            let (first, end) = (row * stride, row * stride + width);
                            body.block(&format!("if position >= {first}u && position < {end}u"), |body| {
                                body.line(&format!("let j = position - {first}u;"));
                                body.line(&format!("values[half_at] = {};", value(d, "j")));
                            });
                        }
                    });
                    let halves = ["values.x".to_owned(), "values.y".to_owned()];
                    body.line(&format!(
                        "{quantity}[thread * {stride}u + at] = {};",
                        word.pack(dtype, &halves)
                    ));
                });
            }
            _ => {
                let stride = format.stride();
                for (row, d) in self.draws.iter().enumerate() {
                    let start = format!("(thread * {}u + {row}u) * {stride}u", self.draws.len());
                    body.block(&format!("for (var j = 0u; j < {width}u; j++)"), |body| {
                        body.line(&format!("{quantity}[{start} + j] = {};", value(d, "j")));
                    });
                    for j in width..stride {
                        body.line(&format!("{quantity}[{start} + {j}u] = 0f;"));
                    }
                }
            }
        }
    }
}

/// Writes the words of each thread's row by way of the workgroup's memory, tile by tile.
fn gather(body: &mut Text, quantity: Quantity, word: &str, words: &[String]) {
    let (all, tile) = (words.len(), tile(words.len()));
    for (n, part) in words.chunks(tile).enumerate() {
        let (start, count) = (n * tile, part.len());
        let pitch = pitch_of(count);
        body.line("workgroupBarrier();");
        for (at, value) in part.iter().enumerate() {
            body.line(&format!("gathered[local * {pitch}u + {at}u] = bitcast<u32>({value});"));
        }
        body.line("workgroupBarrier();");
        body.block(&format!("for (var at = local; at < rows * {count}u; at += THREADS)"), |body| {
            let (row, column) = (format!("(at / {count}u)"), format!("at % {count}u"));
            let from = if pitch == count { "at".to_owned() } else { format!("{row} * {pitch}u + {column}") };
            let to = match count == all {
                true => format!("first * {all}u + at"),
                false => format!("(first + {row}) * {all}u + {start}u + {column}"),
            };
            body.line(&format!("{quantity}[{to}] = bitcast<{word}>(gathered[{from}]);"));
        });
    }
}

/// A value that is about to be rounded to 16 bits, kept where that leaves it in the interval.
fn within(value: &str, interval: ValueRange) -> String {
    let [least, largest] = interval.halves();
    match largest.is_finite() {
        true => format!("clamp({value}, {least:?}f, {largest:?}f)"),
        false => format!("max({value}, {least:?}f)"),
    }
}

/// Offset of a plane, in words.
fn plane(word: Word, at: At) -> String {
    let number = match at {
        At::Number(j) => format!("{j}u"),
        At::Variable(j) => j.to_owned(),
    };
    match word {
        Word::Value => format!("{number} * parameters.plane"),
        Word::Pair | Word::Halves => format!("{number} * (parameters.plane / 2u)"),
    }
}
