//! The contract of a parameter, and the reader that collects all mistakes of a table, each with its place.

use std::ops::Range;

use serde::de::DeserializeOwned;

use super::bounds::Bounds;
use super::file_path::FilePath;
use super::mistake::{At, Mistake, Mistakes};
use super::param_spec::{Contents, Declared, ParamSpec, Written};
use super::usual::Usual;
use crate::source::{Code, suggest_name, suggestion};
use crate::source::{Key, SourceMap, Table, Value};

/// A type that a graph file can set. `#[derive(Param)]` implements it for a struct (a table) and an enum (a word).
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a type of a parameter",
    note = "parameters are `f64`, `usize`, `u64`, `bool`, `String`, `Unit` and `FilePath`, `Option<T>`, `Vec<T>`, `[T; N]`, \
            `Map<T>` and `Spanned<T>` of them, and structs and enums with `#[derive(Param)]`"
)]
pub trait Param: Sized {
    /// The accepted values in words: `a number`.
    const EXPECTS: &'static str;
    /// What it consists of. A list, a table of names or an option has the contents of its elements.
    const CONTENTS: Contents = Contents::OPAQUE;

    /// Reads the value. It adds its mistakes to the reader and returns `None`.
    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self>;

    /// Returns the accepted values in words, with the range: `a list, each a number greater than 0`.
    #[must_use]
    fn takes(bounds: Option<&Bounds>) -> String {
        bounds.map_or_else(|| Self::EXPECTS.into(), |bounds| bounds.describe(Self::EXPECTS))
    }

    /// Returns the fields of a table.
    #[must_use]
    fn fields() -> Vec<ParamSpec> {
        (Self::CONTENTS.fields)()
    }

    /// Returns the value of a parameter that has no default and is left out; `None` if it is required.
    #[must_use]
    fn when_missing() -> Option<Self> {
        None
    }

    /// Returns the value in the form of a graph file; `None` if it has no such form.
    #[must_use]
    fn written(&self) -> Option<Written> {
        None
    }
}

/// Collects the mistakes in parameters.
pub struct Reader<'a> {
    sources: &'a SourceMap,
    /// Range of the numbers in the current field.
    pub(super) bounds: Option<Bounds>,
    /// Unit of the numbers in the current field, as declared.
    unit: Option<&'static str>,
    /// The usual numbers of the current field.
    usual: Usual,
    /// The mistakes so far.
    pub mistakes: Mistakes,
    /// The warnings so far.
    pub warnings: Mistakes,
}

/// A table with the entries that are not read yet.
pub struct OpenTable {
    rest: Table,
    span: Range<usize>,
    /// Required fields that are missing, with their accepted values.
    missing: Vec<(&'static str, String)>,
}

impl<'a> Reader<'a> {
    /// Creates a reader of values from `sources`.
    #[must_use]
    pub const fn new(sources: &'a SourceMap) -> Self {
        Self { sources, bounds: None, unit: None, usual: Usual::NONE, mistakes: Vec::new(), warnings: Vec::new() }
    }

    /// Warns of times that are shorter than a `period` [s].
    pub(crate) const fn with_period(mut self, period: f64) -> Self {
        self.usual.period = period;
        self
    }

    /// Adds the mistake that the value at `span` is wrong, and returns `None`.
    pub fn bad<T>(&mut self, span: Range<usize>, message: impl Into<String>) -> Option<T> {
        self.mistakes.push(Mistake::new(Code::BadValue, At::Span(span), message));
        None
    }

    /// Adds the mistake that `value` is not of the `expected` type, and returns `None`.
    pub fn wrong_type<T>(&mut self, value: &Value, expected: &str) -> Option<T> {
        self.bad(value.span.clone(), format!("expected {expected}, found {}", value.described()))
    }

    /// Opens a table.
    pub fn table(&mut self, value: &Value) -> Option<OpenTable> {
        let rest = value.as_table().cloned().or_else(|| self.wrong_type(value, "a table"))?;
        Some(OpenTable { rest, span: value.span.clone(), missing: Vec::new() })
    }

    /// Reads one field of a table; returns `None` after a mistake.
    pub fn field<T: Param>(
        &mut self,
        table: &mut OpenTable,
        declared: &Declared,
        default: Option<fn() -> T>,
    ) -> Option<T> {
        let Declared { name, bounds, unit, .. } = *declared;
        if let Some((_, value)) = table.rest.remove(name) {
            let outer = (self.bounds, self.unit, self.usual);
            (self.bounds, self.unit) = (bounds, unit.filter(|unit| is_known(unit)));
            self.usual = self.usual.of(declared);
            let read = T::read(&value, self);
            (self.bounds, self.unit, self.usual) = outer;
            return read;
        }
        let default = default.map(|default| default()).or_else(T::when_missing);
        if default.is_none() {
            // For a list, the message names only the list.
            let is_whole = T::takes(None) == T::EXPECTS;
            let expects = if is_whole { T::takes(bounds.as_ref()) } else { T::EXPECTS.into() };
            table.missing.push((name, expects));
        }
        default
    }

    /// Reads one of the words of `T` and returns its index.
    pub fn word<T: Param>(&mut self, value: &Value) -> Option<usize> {
        let text: String = read_leaf(value, self, T::EXPECTS)?;
        let found = T::CONTENTS.words.iter().position(|(word, _)| *word == text);
        found.or_else(|| self.wrong_type(value, T::EXPECTS))
    }

    /// Reads a number and checks the range of the field.
    pub(super) fn number<T: DeserializeOwned + Copy>(
        &mut self,
        value: &Value,
        expects: &str,
        number: impl Fn(T) -> f64,
    ) -> Option<T> {
        let unit = self.unit.map_or_else(String::new, |unit| format!(" [{unit}]"));
        let expects = self.bounds.map_or_else(|| expects.to_owned(), |bounds| bounds.describe(expects)) + &unit;
        let read: T = read_leaf(value, self, &expects)?;
        let is_in_range = self.bounds.is_none_or(|bounds| bounds.contains(number(read)));
        self.warnings.extend(self.usual.find_warning(number(read), value.span.clone()));
        if is_in_range { Some(read) } else { self.wrong_type(value, &expects) }
    }

    /// Adds a mistake for every key that is left and for every missing field, except one that is misspelt.
    pub fn close(&mut self, table: OpenTable, known: &[&str]) {
        // One missing and one unknown name are one mistake.
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

    /// Resolves the path of a file that is named at `span`, relative to the file that names it, or built in.
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

/// Whether a declared unit is worth a place in a message: not the number 1, and no letter or parameter that stands for
/// another unit.
fn is_known(unit: &str) -> bool {
    let stands_for_another =
        |atom: &str| atom.starts_with('$') || (atom.len() == 1 && "ABCDEFGHIKLMOPQRSTUVWXYZ_".contains(atom));
    unit != "1" && !unit.split(['/', ' ', ',']).any(stands_for_another)
}

/// Reads a value whose type implements serde's `Deserialize`.
pub fn read_leaf<T: DeserializeOwned>(value: &Value, reader: &mut Reader<'_>, expects: &str) -> Option<T> {
    value.read().or_else(|| reader.wrong_type(value, expects))
}
