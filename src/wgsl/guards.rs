//! Guards of a text: calls that keep an operation to one rounding, and what the two forms of a text make of them.
//!
//! Fragments and generators write every f32 sum and product of which another operation makes use as `rounded(a * b)`, every
//! root as `root(x)`, every quotient as `ratio(a, b)`, and a conversion that may round as `float_of(i)`. A product by a
//! power of two needs no guard, nor does the last operation before a store. The exact form has these functions, from
//! `shaders/rounding.wgsl`; the plain form has the operations alone. So the two cannot come to differ in anything else.
//!
//! Texts are as this program writes them: operators between two values have a space on either side.

use std::collections::HashSet;

use super::Arithmetic;

const ROUNDING: &str = include_str!("../../shaders/rounding.wgsl");

/// Names of the guards.
const GUARDS: [&str; 4] = ["rounded", "root", "ratio", "float_of"];

/// Source of the zero that no compiler knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Zero {
    /// A word of the parameters.
    Parameter,
    /// An argument that every function hands on, since a module has no bindings.
    Argument,
}

/// Writes the functions of the exact form, with an expression for the zero that no compiler knows.
pub(super) fn rounding(zero: &str) -> String {
    without_notes(&ROUNDING.replace("ZERO", zero))
}

/// Writes a text in one of its forms, without the notes for whoever reads its fragments here.
pub(super) fn written(text: &str, arithmetic: Arithmetic, zero: Zero) -> String {
    let text = without_notes(text);
    match (arithmetic, zero) {
        (Arithmetic::Plain, _) => plain(&text),
        (Arithmetic::Exact, Zero::Parameter) => rounding("parameters.zero") + "\n" + &text,
        (Arithmetic::Exact, Zero::Argument) => carrying_zero(&(rounding("zero") + "\n" + &text)),
    }
}

/// Leaves out the lines that start with `//!`, and an empty line after them.
fn without_notes(text: &str) -> String {
    let mut kept = String::new();
    let mut follows_note = false;
    for line in text.lines() {
        let is_note = line.starts_with("//!");
        let is_gap = follows_note && line.is_empty();
        if !(is_note || is_gap) {
            kept += line;
            kept.push('\n');
        }
        follows_note = is_note;
    }
    kept
}

/// A call in a text.
struct Call<'a> {
    before: &'a str,
    name: &'a str,
    arguments: &'a str,
    after: &'a str,
}

/// First call of a function that is wanted, outside of comments and of the function's own head.
fn first_call<'a>(text: &'a str, is_wanted: impl Fn(&str) -> bool) -> Option<Call<'a>> {
    let is_name = |b: u8| b.is_ascii_alphanumeric() || b == b'_';
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        if bytes[at..].starts_with(b"//") {
            at += text[at..].find('\n').unwrap_or(text.len() - at);
        } else if is_name(bytes[at]) {
            let end = at + bytes[at..].iter().take_while(|&&b| is_name(b)).count();
            let is_head = text[..at].ends_with("fn ");
            if bytes.get(end) == Some(&b'(') && !is_head && is_wanted(&text[at..end]) {
                let close = end + 1 + closing(&text[end + 1..]);
                let (arguments, after) = (&text[end + 1..close], &text[close + 1..]);
                return Some(Call { before: &text[..at], name: &text[at..end], arguments, after });
            }
            at = end;
        } else {
            at += 1;
        }
    }
    None
}

/// Place of the parenthesis that closes one which was opened before this text.
fn closing(text: &str) -> usize {
    let mut depth = 0;
    let at = text.bytes().position(|b| {
        depth += i32::from(b == b'(') - i32::from(b == b')');
        depth < 0
    });
    at.expect("parentheses are closed")
}

/// Whether a text has one of some operators outside of all brackets.
fn has_outside(text: &str, operators: [&str; 2]) -> bool {
    split_outside(text, |rest| operators.iter().any(|operator| rest.starts_with(operator))).is_some()
}

/// Splits a text before the first place outside of all brackets at which something holds of the rest.
fn split_outside(text: &str, holds: impl Fn(&str) -> bool) -> Option<(&str, &str)> {
    let mut depth = 0;
    for (at, character) in text.char_indices() {
        match character {
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            _ if depth == 0 && holds(&text[at..]) => return Some(text.split_at(at)),
            _ => {}
        }
    }
    None
}

const SUMS: [&str; 2] = [" + ", " - "];
const PRODUCTS: [&str; 2] = [" * ", " / "];

/// Takes the guards away, with parentheses where the order of operations needs them.
fn plain(text: &str) -> String {
    let mut written = String::new();
    let mut rest = text;
    while let Some(call) = first_call(rest, |name| GUARDS.contains(&name)) {
        written += call.before;
        let inner = plain(call.arguments);
        let value = match call.name {
            "root" => format!("sqrt({inner})"),
            "float_of" => format!("f32({inner})"),
            "ratio" => {
                let (a, b) = split_outside(&inner, |rest| rest.starts_with(',')).expect("it has two");
                let b = b[1..].trim_start();
                let a = if has_outside(a, SUMS) { format!("({a})") } else { a.to_owned() };
                let is_single = !has_outside(b, SUMS) && !has_outside(b, PRODUCTS);
                if is_single { format!("{a} / {b}") } else { format!("{a} / ({b})") }
            }
            _ => inner,
        };
        let follows = |operators: [&str; 2]| operators.iter().any(|operator| written.ends_with(operator));
        let precedes =
            |operators: [&str; 2]| operators.iter().any(|operator| call.after.starts_with(operator));
        // A product after a product would be regrouped, as a sum would after anything but a sum that ends before it.
        let needs_parentheses = match (has_outside(&value, SUMS), has_outside(&value, PRODUCTS)) {
            (true, _) => follows(SUMS) || follows(PRODUCTS) || precedes(PRODUCTS) || written.ends_with('-'),
            (false, true) => follows(PRODUCTS),
            (false, false) => false,
        };
        written += &if needs_parentheses { format!("({value})") } else { value };
        rest = call.after;
    }
    written + rest
}

/// Hands `zero` on from function to function, to all that have guards somewhere within. A function of a draw takes it from
/// there.
fn carrying_zero(text: &str) -> String {
    let parts = parts(text);
    let mut carriers = HashSet::from(["rounded"]);
    loop {
        let calls_one = |body: &str| first_call(body, |name| carriers.contains(name)).is_some();
        let others = parts.iter().filter(|part| !carriers.contains(part.name) && calls_one(part.body()));
        let new: Vec<_> = others.map(|part| part.name).collect();
        if new.is_empty() {
            break;
        }
        carriers.extend(new);
    }
    // What has it from a draw takes no argument.
    let of_draws: HashSet<_> = parts.iter().filter(|part| part.is_of_draw()).map(|part| part.name).collect();
    carriers.retain(|name| !of_draws.contains(name));
    let takes_zero = |name: &str| carriers.contains(name);
    let mut written = String::new();
    for part in &parts {
        let zero = if part.is_of_draw() { "d.zero" } else { "zero" };
        let text = with_argument(part.text, zero, &takes_zero);
        if takes_zero(part.name) {
            let close = part.head() + closing(&text[part.head()..]);
            written += &format!("{}, zero: u32{}", &text[..close], &text[close..]);
        } else {
            written += &text;
        }
    }
    written
}

/// A function of a text, from its head on; or what comes before the first, without a name.
struct FunctionText<'a> {
    name: &'a str,
    text: &'a str,
}

impl FunctionText<'_> {
    /// Place after the parenthesis that opens its parameters.
    fn head(&self) -> usize {
        "fn (".len() + self.name.len()
    }

    fn body(&self) -> &str {
        if self.name.is_empty() { "" } else { &self.text[self.head()..] }
    }

    fn is_of_draw(&self) -> bool {
        self.body().starts_with("d: Draw")
    }
}

/// The functions of a text, each with what follows it up to the next.
fn parts(text: &str) -> Vec<FunctionText<'_>> {
    let starts = text.match_indices("fn ").map(|(at, _)| at);
    let mut starts: Vec<_> = starts.filter(|&at| at == 0 || text.as_bytes()[at - 1] == b'\n').collect();
    starts.push(text.len());
    let before = FunctionText { name: "", text: &text[..starts[0]] };
    let function = |ends: &[usize]| {
        let text = &text[ends[0]..ends[1]];
        FunctionText { name: text["fn ".len()..].split('(').next().unwrap_or_default(), text }
    };
    std::iter::once(before).chain(starts.windows(2).map(function)).collect()
}

/// Adds an argument to every call of some functions.
fn with_argument(text: &str, argument: &str, is_wanted: &impl Fn(&str) -> bool) -> String {
    let mut written = String::new();
    let mut rest = text;
    while let Some(call) = first_call(rest, is_wanted) {
        let inner = with_argument(call.arguments, argument, is_wanted);
        written += &format!("{}{}({inner}, {argument})", call.before, call.name);
        rest = call.after;
    }
    written + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_text_keeps_the_order_of_operations() {
        for (guarded, expected) in [
            ("rounded(rounded(p * t) - 0.5f)", "p * t - 0.5f"),
            ("rounded(t + rounded(rounded(t * t) * p))", "t + t * t * p"),
            ("rounded(rounded(a + b) * c)", "(a + b) * c"),
            ("rounded(a * rounded(b + c))", "a * (b + c)"),
            ("rounded(a + rounded(b + c))", "a + (b + c)"),
            ("rounded(a - rounded(b * c))", "a - b * c"),
            ("rounded(a * rounded(b * c))", "a * (b * c)"),
            ("root(-2f * rounded(e + f(t)))", "sqrt(-2f * (e + f(t)))"),
            ("ratio(rounded(s * n), d)", "s * n / d"),
            ("rounded(m * ratio(a, b))", "m * (a / b)"),
            ("ratio(rounded(a + b), rounded(c * d))", "(a + b) / (c * d)"),
            ("ratio(1f, max(rounded(a + b), 1e-30f))", "1f / max(a + b, 1e-30f)"),
            ("rounded(float_of(x) + 0.5f)", "f32(x) + 0.5f"),
            ("select(rounded(1f - w), -w, c) // rounded(x)", "select(1f - w, -w, c) // rounded(x)"),
            ("unrounded(a * b)", "unrounded(a * b)"),
        ] {
            assert_eq!(plain(guarded), expected, "{guarded}");
        }
    }

    #[test]
    fn zero_reaches_every_guard() {
        let text = "fn rounded(x: f32) -> f32 {\n    return x ^ zero;\n}\n\nfn half(x: f32) -> f32 { return x; }\n\
                    fn twice(x: f32) -> f32 { return rounded(half(x) + rounded(x * 3f)); }\n\n\
                    fn of(d: Draw) -> f32 {\n    return twice(d.z); // twice(x)\n}\n\n\
                    fn all(d: Draw) -> f32 {\n    return of(d);\n}\n";
        let expected = "fn rounded(x: f32, zero: u32) -> f32 {\n    return x ^ zero;\n}\n\n\
                        fn half(x: f32) -> f32 { return x; }\n\
                        fn twice(x: f32, zero: u32) -> f32 { return rounded(half(x) + rounded(x * 3f, zero), zero); }\n\n\
                        fn of(d: Draw) -> f32 {\n    return twice(d.z, d.zero); // twice(x)\n}\n\n\
                        fn all(d: Draw) -> f32 {\n    return of(d);\n}\n";
        assert_eq!(carrying_zero(text), expected);
    }

    #[test]
    fn notes_are_left_out() {
        assert_eq!(without_notes("//! a\n//! b\n\n// c\nfn d() {}\n//! e\nf\n"), "// c\nfn d() {}\nf\n");
    }
}
