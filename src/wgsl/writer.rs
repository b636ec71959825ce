//! Text under construction.

use std::fmt::Write;

#[derive(Default)]
pub(super) struct Text(pub(super) String);

impl Text {
    pub(super) fn line(&mut self, line: &str) {
        self.0 += line;
        self.0.push('\n');
    }

    /// A function: its head, and an indented body.
    pub(super) fn block(&mut self, head: &str, body: impl FnOnce(&mut Text)) {
        let mut inner = Text::default();
        body(&mut inner);
        writeln!(self.0, "\n{head} {{\n    {}\n}}", inner.0.trim_end().replace('\n', "\n    "))
            .expect("no I/O");
    }
}

/// A number rounded to f32, as WGSL: the shortest decimal that reads back the same.
pub(super) fn float(value: f64) -> String {
    format!("{:?}f", value as f32)
}

/// Names of the parts of a vector.
pub(super) const PARTS: [&str; 4] = ["x", "y", "z", "w"];

/// A random word of an attempt, by its number from the first on, where the words of block b are the vector `wb`.
pub(super) fn word(number: usize) -> String {
    format!("w{}.{}", number / 4, PARTS[number % 4])
}

pub(super) fn list(count: usize, item: impl Fn(usize) -> String) -> String {
    (0..count).map(item).collect::<Vec<_>>().join(", ")
}
