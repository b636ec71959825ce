//! TOML, read so that every complaint names its key and its line.
//!
//! Deserializing into structs would be shorter, but its messages speak of types of Rust, and lose the place of what
//! is wrong once a table is read.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::SceneErrorKind;
use crate::suggestion::closest;

/// Something wrong with a key.
#[derive(Debug)]
pub(super) struct Wrong {
    /// The bytes of the text that are to blame.
    pub(super) span: Range<usize>,
    /// The name of the group, as far as it is known.
    pub(super) group: Option<String>,
    pub(super) key: String,
    pub(super) problem: Box<SceneErrorKind>,
}

impl Wrong {
    /// Adds all accepted choices to a complaint about a type.
    pub(super) fn expecting(mut self, all: &'static str) -> Wrong {
        if let SceneErrorKind::Type { expected, .. } = &mut *self.problem {
            *expected = all;
        }
        self
    }
}

/// A table of which the keys are known.
pub(super) struct Section<'a> {
    table: &'a DeTable<'a>,
    span: Range<usize>,
    /// Name in complaints: `lrv` for a table under that key, empty for a group.
    path: String,
    group: Option<String>,
}

/// A value and its key.
pub(super) struct Entry<'a> {
    value: &'a DeValue<'a>,
    span: Range<usize>,
    path: String,
    group: Option<String>,
}

impl<'a> Section<'a> {
    /// A table that has no other keys than these.
    pub(super) fn new(
        table: &'a DeTable<'a>,
        span: Range<usize>,
        path: &str,
        known: &[&str],
    ) -> Result<Section<'a>, Wrong> {
        let name =
            table.iter().find(|(key, _)| key.get_ref() == "name").and_then(|(_, v)| v.get_ref().as_str());
        let group = name.filter(|_| path.is_empty()).map(str::to_owned);
        let section = Section { table, span, path: path.to_owned(), group };
        let unknown = section.table.keys().find(|key| !known.contains(&key.get_ref().as_ref()));
        match unknown {
            None => Ok(section),
            Some(key) => Err(Wrong {
                span: key.span(),
                group: section.group.clone(),
                key: section.join(key.get_ref()),
                problem: Box::new(SceneErrorKind::UnknownKey {
                    suggestion: closest(key.get_ref(), known.iter().copied()),
                    known: known.join(", "),
                }),
            }),
        }
    }

    /// Makes the section a part of a group.
    fn of(mut self, group: Option<String>) -> Section<'a> {
        self.group = group;
        self
    }

    fn join(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// The value of a key, if there is one.
    pub(super) fn get(&self, key: &str) -> Option<Entry<'a>> {
        let (found, value) = self.table.iter().find(|(found, _)| found.get_ref() == key)?;
        let (path, group) = (self.join(key), self.group.clone());
        Some(Entry { value: value.get_ref(), span: found.span().start..value.span().end, path, group })
    }

    /// The value of a key that must be there, for example so.
    pub(super) fn need(&self, key: &str, example: &'static str) -> Result<Entry<'a>, Wrong> {
        self.get(key).ok_or_else(|| self.wrong(key, SceneErrorKind::Missing { example }))
    }

    /// A complaint about the table, under a key that it lacks.
    pub(super) fn wrong(&self, key: &str, problem: SceneErrorKind) -> Wrong {
        let key = if key.is_empty() { self.path.clone() } else { self.join(key) };
        Wrong { span: self.span.clone(), group: self.group.clone(), key, problem: Box::new(problem) }
    }

    /// Places of the keys.
    pub(super) fn spans(&self) -> impl Iterator<Item = (&'a str, Range<usize>)> {
        self.table.keys().map(|key| (key.get_ref().as_ref(), key.span()))
    }
}

impl<'a> Entry<'a> {
    /// A complaint about the value.
    pub(super) fn wrong(&self, problem: SceneErrorKind) -> Wrong {
        Wrong {
            span: self.span.clone(),
            group: self.group.clone(),
            key: self.path.clone(),
            problem: Box::new(problem),
        }
    }

    fn is_not(&self, expected: &'static str) -> Wrong {
        self.wrong(SceneErrorKind::Type { expected, found: describe(self.value) })
    }

    /// A number.
    pub(super) fn number(&self) -> Result<f64, Wrong> {
        number(self.value).ok_or_else(|| self.is_not("a number"))
    }

    /// A whole number from 0 on.
    pub(super) fn whole(&self) -> Result<u64, Wrong> {
        let integer = self.value.as_integer();
        integer
            .and_then(|integer| u64::from_str_radix(integer.as_str(), integer.radix()).ok())
            .ok_or_else(|| self.is_not("a whole number from 0 to 18446744073709551615"))
    }

    /// true or false.
    pub(super) fn flag(&self) -> Result<bool, Wrong> {
        self.value.as_bool().ok_or_else(|| self.is_not("true or false"))
    }

    /// Text.
    pub(super) fn text(&self) -> Result<&'a str, Wrong> {
        self.value.as_str().ok_or_else(|| self.is_not("text in quotes"))
    }

    /// One of some words.
    pub(super) fn choice<T: Copy>(&self, known: &[(&str, T)]) -> Result<T, Wrong> {
        let text = self.text()?;
        let names = || known.iter().map(|(name, _)| *name);
        known.iter().find(|(name, _)| *name == text).map(|(_, value)| *value).ok_or_else(|| {
            self.wrong(SceneErrorKind::Choice {
                found: text.to_owned(),
                suggestion: closest(text, names()),
                known: names().collect::<Vec<_>>().join(", "),
            })
        })
    }

    /// A list of some words.
    pub(super) fn choices<T: Copy>(
        &self,
        known: &[(&str, T)],
        expected: &'static str,
    ) -> Result<Vec<T>, Wrong> {
        let items = self.value.as_array().ok_or_else(|| self.is_not(expected))?;
        let item = |item: &'a Spanned<DeValue<'a>>| {
            let (path, group) = (self.path.clone(), self.group.clone());
            Entry { value: item.get_ref(), span: item.span(), path, group }.choice(known)
        };
        items.iter().map(item).collect()
    }

    /// A list of numbers, if it is a list.
    pub(super) fn list(&self) -> Option<Result<Vec<f64>, Wrong>> {
        let items = self.value.as_array()?;
        Some(
            items
                .iter()
                .map(|item| number(item.get_ref()).ok_or_else(|| self.is_not("numbers alone")))
                .collect(),
        )
    }

    /// A list of N numbers.
    pub(super) fn numbers<const N: usize>(&self, expected: &'static str) -> Result<[f64; N], Wrong> {
        let found = || describe(self.value);
        let list =
            self.list().ok_or_else(|| self.wrong(SceneErrorKind::Type { expected, found: found() }))??;
        list.try_into().map_err(|_| self.wrong(SceneErrorKind::Type { expected, found: found() }))
    }

    /// A table of no other keys than these, if it is a table.
    pub(super) fn section(&self, known: &[&str]) -> Option<Result<Section<'a>, Wrong>> {
        let table = self.value.as_table()?;
        let section = Section::new(table, self.span.clone(), &self.path, known);
        let owned = |wrong: Wrong| Wrong { group: self.group.clone(), ..wrong };
        Some(section.map(|section| section.of(self.group.clone())).map_err(owned))
    }

    /// A list of tables, as `[[key]]` writes them, each with the place of its header.
    pub(super) fn tables(&self) -> Result<Vec<(&'a DeTable<'a>, Range<usize>)>, Wrong> {
        let expected = "tables, each under a line of its own in [[double brackets]]";
        let items = self.value.as_array().ok_or_else(|| self.is_not(expected))?;
        let table = |item: &'a Spanned<DeValue<'a>>| Some((item.get_ref().as_table()?, item.span()));
        items.iter().map(table).collect::<Option<_>>().ok_or_else(|| self.is_not(expected))
    }
}

fn number(value: &DeValue) -> Option<f64> {
    match value {
        DeValue::Integer(integer) => {
            i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|i| i as f64)
        }
        DeValue::Float(float) => float.as_str().parse().ok(),
        _ => None,
    }
}

/// A value, short enough for a message.
fn describe(value: &DeValue) -> String {
    match value {
        DeValue::String(text) => format!("the text {text:?}"),
        DeValue::Integer(integer) => integer.to_string(),
        DeValue::Float(float) => float.to_string(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(date) => format!("the date {date}"),
        DeValue::Array(items) => match items.iter().count() {
            1 => "a list of 1 value".to_owned(),
            count => format!("a list of {count} values"),
        },
        DeValue::Table(_) => "a table".to_owned(),
    }
}
