//! What is known of a parameter without a graph: for the reference, and for whoever shows a graph with its defaults.

use super::bounds::Bounds;

/// A parameter as a graph file would say it.
pub type Written = toml::Value;

/// A table of parameters as a graph file would say it; what says nothing is left out.
#[doc(hidden)]
#[must_use]
pub fn written_table<const N: usize>(fields: [(&str, Option<Written>); N]) -> Option<Written> {
    let entries = fields.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
    Some(Written::Table(entries.collect()))
}

/// What is known of a parameter without a graph.
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
    /// The words it takes, each with its meaning, if it is one of a few.
    pub words: &'static [(&'static str, &'static str)],
    /// What it takes, for a person.
    pub takes: String,
    /// Default as a graph file would say it; none if it must be given, or is nothing at all when it is left out.
    pub default: Option<String>,
    /// Whether it may be left out.
    pub is_optional: bool,
    /// How often the fields are there.
    pub repeats: Repeats,
    /// The parameters of a nested table.
    pub fields: Vec<ParamSpec>,
    /// Whether it may change while the graph runs: a mode can set it.
    pub is_live: bool,
    /// Why a graph file could not give the default; the catalogue refuses such a node.
    pub fault: Option<String>,
}

/// How often the fields of a nested table are there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repeats {
    /// Once.
    Once,
    /// Once for each name that the graph chooses.
    PerName,
    /// Once for each entry of a list.
    PerEntry,
}

/// What an author declares of a parameter, beside its type and its default.
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
    /// Whether a mode can set it.
    pub is_live: bool,
}

impl Declared {
    /// A parameter of which only the name is declared.
    #[must_use]
    pub const fn new(name: &'static str) -> Self {
        Self { name, doc: "", unit: None, bounds: None, is_live: false }
    }
}

impl ParamSpec {
    /// Its meaning with its unit, in one line.
    #[must_use]
    pub fn doc_with_unit(&self) -> String {
        let doc = self.doc.split_whitespace().collect::<Vec<_>>().join(" ");
        match &self.unit {
            Some(unit) => format!("{} [{unit}].", doc.trim_end_matches('.')),
            None => doc,
        }
    }
}
