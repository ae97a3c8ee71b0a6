//! The description of a parameter, for the reference and for displays of a graph with its defaults.

use super::bounds::Bounds;

/// A parameter in the form of a graph file.
pub type Written = toml::Value;

/// Returns a table of parameters in the form of a graph file, without the entries that are `None`, and with those of
/// the tables that are flat in it.
#[doc(hidden)]
#[must_use]
pub fn written_table<const N: usize, const M: usize>(
    fields: [(&str, Option<Written>); N],
    flat: [Option<Written>; M],
) -> Option<Written> {
    let own = fields.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
    let flat = flat.into_iter().flatten().filter_map(|table| table.try_into::<toml::Table>().ok());
    Some(Written::Table(own.chain(flat.flatten()).collect()))
}

/// The description of a parameter.
#[derive(Debug, Clone)]
pub struct ParamSpec {
    /// Name in the graph file.
    pub name: &'static str,
    /// Meaning.
    pub doc: String,
    /// Unit as declared; a capital letter is the unit that an input binds, `$name` the parameter `name`.
    pub unit: Option<String>,
    /// Range of the number, or of each number in it.
    pub bounds: Option<Bounds>,
    /// The words of an enum, each with its meaning.
    pub words: &'static [(&'static str, &'static str)],
    /// The accepted values in words.
    pub takes: String,
    /// Default in the form of a graph file; `None` for a required parameter and for an `Option`.
    pub default: Option<String>,
    /// Whether a graph may leave it out.
    pub is_optional: bool,
    /// How often the nested fields repeat.
    pub repeats: Repeats,
    /// The parameters of a nested table.
    pub fields: Vec<ParamSpec>,
    /// Whether a mode can set it while the graph runs.
    pub is_live: bool,
    /// Whether the section `[live]` of a graph can list it, so that it changes while the graph runs.
    pub is_tunable: bool,
    /// Whether only a fact can set it, which the bench states and the task cannot.
    pub is_from_bench: bool,
    /// Why the reader refuses the default. The catalogue does not accept such a node.
    pub fault: Option<String>,
}

/// How often the fields of a nested table repeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repeats {
    /// Once.
    Once,
    /// Once for each name in the graph.
    PerName,
    /// Once for each entry of a list.
    PerEntry,
}

/// What a parameter consists of.
#[derive(Debug, Clone, Copy)]
pub struct Contents {
    /// How often the nested fields repeat.
    pub repeats: Repeats,
    /// Whether it is a number or consists of numbers, so that it can have a range.
    pub is_number: bool,
    /// The words of an enum, each with its meaning.
    pub words: &'static [(&'static str, &'static str)],
    /// The fields of a table.
    pub fields: fn() -> Vec<ParamSpec>,
}

impl Contents {
    /// Neither a number, nor an enum, nor a table.
    pub const OPAQUE: Self = Self { repeats: Repeats::Once, is_number: false, words: &[], fields: Vec::new };
    /// A number.
    pub const NUMBER: Self = Self { is_number: true, ..Self::OPAQUE };
}

/// The declaration of a parameter without its type and its default.
#[derive(Debug, Clone, Copy)]
pub struct Declared {
    /// Name in the graph file.
    pub name: &'static str,
    /// Meaning.
    pub doc: &'static str,
    /// Unit.
    pub unit: Option<&'static str>,
    /// Range.
    pub bounds: Option<Bounds>,
    /// Range of the usual numbers. One outside of it is accepted with a warning.
    pub usual: Option<Bounds>,
    /// Whether a mode can set it.
    pub is_live: bool,
    /// Whether the section `[live]` of a graph can list it, so that it changes while the graph runs.
    pub is_tunable: bool,
    /// Whether only a fact can set it, which the bench states and the task cannot.
    pub is_from_bench: bool,
}

impl Declared {
    /// Declares only the name.
    #[must_use]
    pub const fn new(name: &'static str) -> Self {
        Self {
            name,
            doc: "",
            unit: None,
            bounds: None,
            usual: None,
            is_live: false,
            is_tunable: false,
            is_from_bench: false,
        }
    }
}

impl ParamSpec {
    /// Returns the meaning with the unit, in one line.
    #[must_use]
    pub fn doc_with_unit(&self) -> String {
        let doc = self.doc.split_whitespace().collect::<Vec<_>>().join(" ");
        match &self.unit {
            Some(unit) => format!("{} [{unit}].", doc.trim_end_matches('.')),
            None => doc,
        }
    }
}
