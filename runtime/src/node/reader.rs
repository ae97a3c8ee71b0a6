//! The contract of a parameter, and the reader that collects all mistakes of a table, each with its place.

use std::borrow::Cow;
use std::ops::Range;
use std::path::PathBuf;

use serde::de::DeserializeOwned;

use super::bounds::Bounds;
use super::file_path::FilePath;
use super::known_units::KnownUnits;
use super::mistake::{At, Mistake, Mistakes};
use super::param_spec::{Contents, Declared, ParamSpec, Written};
use super::usual::Usual;
use crate::source::{Code, suggest_name, suggest_path, suggestion};
use crate::source::{Item, Key, Meant, SourceMap, Table, Value};

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

/// A table of parameters, whose fields can stand among those of another table: `#[param(flatten)]`.
/// `#[derive(Param)]` implements it for a struct.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a table of parameters",
    note = "only a struct with `#[derive(Param)]` can be flattened"
)]
pub trait ParamTable: Param {
    /// Returns the names of its fields.
    #[must_use]
    fn names() -> Vec<&'static str>;

    /// Reads its fields out of a table, which may have others. It adds its mistakes to the reader and returns `None`.
    fn read_fields(table: &mut OpenTable, reader: &mut Reader<'_>) -> Option<Self>;
}

/// The values that were written with a unit, each as the number that was read, with its place.
pub type Measured = Vec<(Range<usize>, Item)>;

/// Collects the mistakes in parameters.
pub struct Reader<'a> {
    pub(crate) sources: &'a SourceMap,
    /// Range of the numbers in the current field.
    pub(super) bounds: Option<Bounds>,
    /// Unit of the numbers in the current field, as declared.
    pub(super) unit: Option<&'static str>,
    /// The units that the letters in declarations stand for.
    pub(super) units: KnownUnits<'a>,
    /// Name of the current entry of a table of names.
    pub(super) component: Option<Key>,
    /// Index of the current entry of a list, and the length of the list.
    pub(super) entry: Option<(usize, usize)>,
    /// The values so far that were written with a unit.
    pub measured: Measured,
    /// The files so far that parameters name.
    pub(crate) files: Vec<PathBuf>,
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
    known: Vec<&'static str>,
    /// Keys that resemble no known name.
    strange: Vec<Key>,
    /// Required fields that are missing, with their accepted values.
    missing: Vec<(&'static str, String)>,
}

impl<'a> Reader<'a> {
    /// Creates a reader of values from `sources`.
    #[must_use]
    pub const fn new(sources: &'a SourceMap) -> Self {
        Self {
            sources,
            bounds: None,
            unit: None,
            units: KnownUnits::NONE,
            component: None,
            entry: None,
            usual: Usual::NONE,
            measured: Vec::new(),
            files: Vec::new(),
            mistakes: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Sets the units that the letters in declarations stand for.
    #[must_use]
    pub fn with_units(self, units: KnownUnits<'a>) -> Self {
        Self { units, ..self }
    }

    /// Warns of times that are shorter than a `period` [s].
    pub(crate) fn with_period(mut self, period: f64) -> Self {
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

    /// Opens a table with the `known` fields. A misspelt name is a mistake; its value is read as it was meant.
    pub fn table(&mut self, value: &Value, known: &[&'static str]) -> Option<OpenTable> {
        let mut rest = value.as_table().cloned().or_else(|| self.wrong_type(value, "a table"))?;
        let mut strange = Vec::new();
        for (key, meant) in rest.correct(known) {
            match meant {
                Meant::Unknown => strange.push(key),
                meant => self.mistakes.push(unknown_key(&key).meant(&key.name, meant, known, "parameters")),
            }
        }
        Some(OpenTable { rest, span: value.span.clone(), known: known.to_vec(), strange, missing: Vec::new() })
    }

    /// Reads a table with the fields of `T`, and no others.
    pub fn fields<T: ParamTable>(&mut self, value: &Value) -> Option<T> {
        let mut table = self.table(value, &T::names())?;
        let read = T::read_fields(&mut table, self);
        self.close(table);
        read
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
            (self.bounds, self.unit, self.usual) = (bounds, unit, self.usual.of(declared));
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
        found.or_else(|| self.unknown_word(value, T::CONTENTS.words.iter().map(|(word, _)| *word), T::EXPECTS))
    }

    /// Adds the mistake that `value` is none of the `known` words, and returns `None`.
    pub(crate) fn unknown_word<'w, T>(
        &mut self,
        value: &Value,
        known: impl Iterator<Item = &'w str>,
        expected: &str,
    ) -> Option<T> {
        self.wrong_type::<T>(value, expected);
        let text = value.as_str()?;
        let meant = suggest_name(text, known)?;
        let mistake = self.mistakes.pop()?;
        self.mistakes.push(mistake.instead(text, meant));
        None
    }

    /// Reads a number, plain or with a unit, and checks the range of the field.
    pub(super) fn number<T: DeserializeOwned + Copy>(
        &mut self,
        value: &Value,
        expects: &str,
        number: impl Fn(T) -> f64,
    ) -> Option<T> {
        let unit =
            self.unit_of_entry().filter(|unit| is_known(unit)).map_or_else(String::new, |unit| format!(" [{unit}]"));
        let expects = self.bounds.map_or_else(|| expects.to_owned(), |bounds| bounds.describe(expects)) + &unit;
        let converted = self.in_declared_unit(value)?;
        let is_in_range = |read: &T| self.bounds.is_none_or(|bounds| bounds.contains(number(*read)));
        let read: Option<T> = converted.read().filter(is_in_range);
        self.warnings.extend(read.and_then(|read| self.usual.find_warning(number(read), value.span.clone())));
        match (read, converted) {
            (Some(read), Cow::Owned(converted)) => {
                self.measured.push((converted.span, converted.item));
                Some(read)
            }
            (Some(read), Cow::Borrowed(_)) => Some(read),
            (None, _) => self.wrong_number(value, &expects),
        }
    }

    /// Returns the declared unit of the current field, or of the current entry of a list with several units.
    pub(super) fn unit_of_entry(&self) -> Option<&'static str> {
        let declared = self.unit?;
        let units: Vec<&str> = declared.split(", ").collect();
        let of_entry = |(entry, count): (usize, usize)| units.get(entry * units.len() / count).copied();
        self.entry.filter(|(_, count)| count % units.len() == 0).map_or(Some(declared), of_entry)
    }

    /// Adds a mistake for every missing field. One missing and one unknown name are one mistake. In a dotted key, the unknown
    /// name must be similar: another name for it leaves the other parts as they are.
    pub fn close(&mut self, table: OpenTable) {
        let is_dotted = |key: &Key| table.rest.get(&key.name).is_some_and(|value| value.span == key.span);
        let renamed = match (table.missing.as_slice(), table.strange.as_slice()) {
            ([(missing, _)], [strange])
                if !is_dotted(strange) || suggest_name(&strange.name, [*missing].into_iter()).is_some() =>
            {
                Some(*missing)
            }
            _ => None,
        };
        for (name, expects) in table.missing.into_iter().filter(|_| renamed.is_none()) {
            let message = format!("`{name}` is missing: expected {expects}");
            self.mistakes.push(Mistake::new(Code::MissingKey, At::Span(table.span.clone()), message));
        }
        for key in table.strange {
            let mistake = unknown_key(&key);
            self.mistakes.push(match renamed {
                Some(name) => mistake.instead(&key.name, name),
                None => mistake.help(suggestion(&key.name, table.known.iter().copied(), "parameters")),
            });
        }
    }

    /// Resolves the path of a file that is named at `span`, relative to the file that names it, or built in.
    pub fn file(&mut self, text: &str, span: Range<usize>) -> Option<FilePath> {
        let path = self.sources.path(text, span.start);
        match self.sources.builtin(&path) {
            Ok(None) if !path.exists() => self.missing_file(text, path, span),
            Ok(builtin) => {
                self.files.push(path.clone());
                Some(FilePath { path, span, builtin })
            }
            Err(unknown) => {
                let mistake = Mistake::new(Code::Unreadable, At::Span(span), unknown.message);
                self.mistakes.push(match unknown.similar {
                    Some(similar) => mistake.instead(text, &similar),
                    None => mistake.help(unknown.help),
                });
                None
            }
        }
    }

    /// Adds the mistake that a file does not exist, and returns `None`.
    fn missing_file<T>(&mut self, text: &str, path: PathBuf, span: Range<usize>) -> Option<T> {
        let similar = suggest_path(self.sources.folder(span.start), text);
        let file = FilePath { path, span, builtin: None };
        let mistake = Mistake::unreadable(&file, &std::fs::metadata(&file.path).err()?);
        self.mistakes.push(match similar {
            Some(similar) => mistake.instead(text, &similar),
            None => mistake,
        });
        None
    }
}

fn unknown_key(key: &Key) -> Mistake {
    Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), format!("`{}` is not a parameter here", key.name))
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
