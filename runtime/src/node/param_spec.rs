//! What is known of a parameter without a graph: for the reference, and for whoever shows a graph with its defaults.

use super::{Bounds, Param, Reader};
use crate::source::{SourceMap, Value};

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
    /// The description of a field of type `T`.
    #[must_use]
    pub fn of<T: Param>(declared: &Declared, default: Option<fn() -> T>) -> Self {
        let Declared { name, doc, unit, bounds, is_live } = *declared;
        let written = default.and_then(|value| value().written());
        Self {
            name,
            doc: doc.into(),
            unit: unit
                .map(|unit| if unit.starts_with('$') { unit.into() } else { unit.replace('2', "²").replace('3', "³") }),
            bounds,
            words: T::WORDS,
            takes: T::takes(bounds.as_ref()),
            default: written.as_ref().map(Written::to_string),
            is_optional: default.is_some() || T::when_missing().is_some(),
            repeats: T::REPEATS,
            fields: T::fields(),
            is_live,
            fault: written.and_then(|written| fault::<T>(&written, bounds)),
        }
    }

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

/// What the reader says of a default.
fn fault<T: Param>(written: &Written, bounds: Option<Bounds>) -> Option<String> {
    let mut sources = SourceMap::default();
    sources.add("default", "", "");
    let mut reader = Reader::new(&sources);
    reader.bounds = bounds;
    T::read(&Value::from_toml(written, &(0..0)), &mut reader);
    reader.mistakes.into_iter().next().map(|mistake| mistake.message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::{Map, Spanned};
    use crate::signal::Unit;

    /// A choice between words.
    #[derive(Debug, Clone, Param)]
    enum Choice {
        /// The last one.
        LastSeen,
    }

    /// A table.
    #[derive(Debug, Clone, Param)]
    struct Inner {
        /// A place.
        #[param(unit = "m", default = [0.0; 3])]
        xyz: [f64; 3],
        /// A name.
        of: Option<Spanned<String>>,
    }

    /// Parameters of every sort.
    #[derive(Debug, Clone, Param)]
    struct Params {
        /// Must be given.
        #[param(unit = "N")]
        force: f64,
        /// A time.
        #[param(unit = "ms", range = 0.0.., default = 20.0)]
        time_ms: f64,
        /// A name.
        #[param(default = "base")]
        base: String,
        /// A unit.
        #[param(default = Unit::NEWTON.per_tactel())]
        unit: Unit,
        /// A word.
        #[param(default = Choice::LastSeen)]
        choose: Choice,
        /// A table.
        #[param(default = Inner { xyz: [0.0, 0.0, 1e-3], of: None })]
        mount: Inner,
        /// A list of tables.
        #[param(default = vec![])]
        press: Vec<Inner>,
        /// A table for each name.
        gains: Map<Inner>,
        /// May be left out.
        #[param(unit = "rad/s")]
        speed: Option<f64>,
    }

    #[test]
    fn a_default_reads_as_in_a_graph_file() {
        let specs = Params::fields();
        let defaults: Vec<_> =
            specs.iter().map(|spec| (spec.name, spec.default.as_deref(), spec.is_optional)).collect();
        let expected = [
            ("force", None, false),
            ("time_ms", Some("20.0"), true),
            ("base", Some("\"base\""), true),
            ("unit", Some("\"N/tactel\""), true),
            ("choose", Some("\"last_seen\""), true),
            ("mount", Some("{ xyz = [0.0, 0.0, 0.001] }"), true),
            ("press", Some("[]"), true),
            ("gains", None, false),
            ("speed", None, true),
        ];
        assert_eq!(defaults, expected);
        let repeats = |name| specs.iter().find(|spec| spec.name == name).map(|spec| spec.repeats);
        assert_eq!(repeats("mount"), Some(Repeats::Once));
        assert_eq!(repeats("press"), Some(Repeats::PerEntry));
        assert_eq!(repeats("gains"), Some(Repeats::PerName));
    }

    #[test]
    fn the_unit_stands_in_the_declaration() {
        let specs = Params::fields();
        let units: Vec<_> = specs.iter().map(|spec| spec.unit.as_deref()).collect();
        assert_eq!(units[..3], [Some("N"), Some("ms"), None]);
        assert_eq!(units[8], Some("rad/s"));
    }
}
