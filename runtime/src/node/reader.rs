//! What a parameter is, and the reader that collects the mistakes of a whole table, each with its place.

use std::ops::Range;

use serde::de::DeserializeOwned;

use super::bounds::Bounds;
use super::file_path::FilePath;
use super::mistake::{At, Mistake, Mistakes};
use super::param_spec::{Declared, ParamSpec, Repeats, Written};
use crate::source::{Code, suggest_name, suggestion};
use crate::source::{Item, Key, SourceMap, Table, Value};

/// Something a graph file may set.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a type of a parameter",
    note = "a struct or an enum of yours becomes one with `#[derive(Param)]`"
)]
pub trait Param: Sized {
    /// What it takes, for a person: `a number`.
    const EXPECTS: &'static str;
    /// How often the fields are there.
    const REPEATS: Repeats = Repeats::Once;
    /// Whether it is a number, or made of numbers, so that it takes a range.
    const IS_NUMBER: bool = false;
    /// The words it takes, each with its meaning, if it is one of a few.
    const WORDS: &'static [(&'static str, &'static str)] = &[];

    /// Reads it; a mistake goes to the reader.
    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self>;

    /// What it takes in full, for the reference: `a list, each a number greater than 0`.
    #[must_use]
    fn takes(bounds: Option<&Bounds>) -> String {
        bounds.map_or_else(|| Self::EXPECTS.into(), |bounds| bounds.describe(Self::EXPECTS))
    }

    /// The fields of a table.
    #[must_use]
    fn fields() -> Vec<ParamSpec> {
        Vec::new()
    }

    /// What it is when it is not given and has no default; none if it must be given.
    #[must_use]
    fn when_missing() -> Option<Self> {
        None
    }

    /// As a graph file would say it, for the reference; none if it says nothing, or cannot say it.
    #[must_use]
    fn written(&self) -> Option<Written> {
        None
    }
}

/// Collects the mistakes while parameters are read.
pub struct Reader<'a> {
    sources: &'a SourceMap,
    /// Range of the numbers of the field that is being read.
    pub(super) bounds: Option<Bounds>,
    /// What is wrong so far.
    pub mistakes: Mistakes,
}

/// A table that is being read: what is left of it, and its place.
pub struct OpenTable {
    rest: Table,
    span: Range<usize>,
    /// Fields that must be given and are not.
    missing: Vec<(&'static str, String)>,
}

impl<'a> Reader<'a> {
    /// A reader of values that stand in `sources`.
    #[must_use]
    pub const fn new(sources: &'a SourceMap) -> Self {
        Self { sources, bounds: None, mistakes: Vec::new() }
    }

    /// Says that the value at `span` will not do.
    pub fn bad(&mut self, span: Range<usize>, message: impl Into<String>) {
        self.mistakes.push(Mistake::new(Code::BadValue, At::Span(span), message));
    }

    /// Says that `value` is not what is expected.
    pub fn wrong_type(&mut self, value: &Value, expected: &str) {
        self.bad(value.span.clone(), format!("expected {expected}, found {}", value.described()));
    }

    /// Opens a table.
    pub fn table(&mut self, value: &Value) -> Option<OpenTable> {
        match &value.item {
            Item::Table(table) => {
                Some(OpenTable { rest: table.clone(), span: value.span.clone(), missing: Vec::new() })
            }
            _ => {
                self.wrong_type(value, "a table");
                None
            }
        }
    }

    /// Reads one field of a table; `None` stands for a mistake that is noted.
    pub fn field<T: Param>(
        &mut self,
        table: &mut OpenTable,
        declared: &Declared,
        default: Option<fn() -> T>,
    ) -> Option<T> {
        let Declared { name, bounds, .. } = *declared;
        if let Some((_, value)) = table.rest.remove(name) {
            let outer = std::mem::replace(&mut self.bounds, bounds);
            let read = T::read(&value, self);
            self.bounds = outer;
            return read;
        }
        let default = default.map(|default| default()).or_else(T::when_missing);
        if default.is_none() {
            // Of a list it says no more than that it is one.
            let is_whole = T::takes(None) == T::EXPECTS;
            let expects = if is_whole { T::takes(bounds.as_ref()) } else { T::EXPECTS.into() };
            table.missing.push((name, expects));
        }
        default
    }

    /// Reads one of the words of `T` and returns its index.
    pub fn word<T: Param>(&mut self, value: &Value) -> Option<usize> {
        let text: String = read_leaf(value, self, T::EXPECTS)?;
        let found = T::WORDS.iter().position(|(word, _)| *word == text);
        if found.is_none() {
            self.wrong_type(value, T::EXPECTS);
        }
        found
    }

    /// Reads a number; it is a mistake if it is not in the range of the field.
    pub(super) fn number<T: DeserializeOwned + Copy>(
        &mut self,
        value: &Value,
        expects: &str,
        number: impl Fn(T) -> f64,
    ) -> Option<T> {
        let Some(bounds) = self.bounds else { return read_leaf(value, self, expects) };
        let expects = bounds.describe(expects);
        let read: T = read_leaf(value, self, &expects)?;
        if !bounds.contains(number(read)) {
            self.wrong_type(value, &expects);
            return None;
        }
        Some(read)
    }

    /// Every key that is left is one too many, and what was not given is missing, unless it was only misspelt.
    pub fn close(&mut self, table: OpenTable, known: &[&str]) {
        // One that is missing and one that is strange are one mistake.
        let is_renamed = match (table.missing.as_slice(), table.rest.entries.as_slice()) {
            ([(missing, _)], [(strange, _)]) => {
                suggest_name(&strange.name, known.iter().copied()).is_none_or(|m| m == *missing)
            }
            _ => false,
        };
        let renamed = table.missing.first().filter(|_| is_renamed).map(|(name, _)| format!("did you mean `{name}`?"));
        for (name, expects) in table.missing {
            let is_misspelt = |(key, _): &(Key, Value)| suggest_name(&key.name, known.iter().copied()) == Some(name);
            if !is_renamed && !table.rest.entries.iter().any(is_misspelt) {
                let message = format!("`{name}` is missing: expected {expects}");
                self.mistakes.push(Mistake::new(Code::MissingKey, At::Span(table.span.clone()), message));
            }
        }
        for (key, _) in table.rest.entries {
            let message = format!("`{}` is not a parameter here", key.name);
            let help = renamed.clone().unwrap_or_else(|| suggestion(&key.name, known.iter().copied(), "parameters"));
            self.mistakes.push(Mistake::new(Code::UnknownKey, At::Span(key.span), message).help(help));
        }
    }

    /// A file as it is named at `span`: relative to the folder of the file it stands in, or built in.
    pub fn file(&mut self, text: &str, span: Range<usize>) -> Option<FilePath> {
        let path = self.sources.path(text, span.start);
        match self.sources.builtin(&path) {
            Ok(builtin) => Some(FilePath { path, span, builtin }),
            Err((message, help)) => {
                self.mistakes.push(Mistake::new(Code::Unreadable, At::Span(span), message).help(help));
                None
            }
        }
    }
}

/// Reads a value whose type serde knows: what most leaves need.
pub fn read_leaf<T: DeserializeOwned>(value: &Value, reader: &mut Reader<'_>, expects: &str) -> Option<T> {
    let read = value.read();
    if read.is_none() {
        reader.wrong_type(value, expects);
    }
    read
}
