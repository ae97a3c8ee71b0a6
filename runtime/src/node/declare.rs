//! The description of a parameter from its declaration and its type.

use super::bounds::Bounds;
use super::param_spec::{Declared, ParamSpec, Written};
use super::reader::{Param, Reader};
use crate::source::{SourceMap, Value};

impl ParamSpec {
    /// Returns the description of a field of type `T`.
    #[must_use]
    pub fn of<T: Param>(declared: &Declared, default: Option<fn() -> T>) -> Self {
        let Declared { name, doc, unit, bounds, is_live, is_tunable, is_from_bench, .. } = *declared;
        let written = default.and_then(|value| value().written());
        Self {
            name,
            doc: doc.into(),
            unit: unit
                .map(|unit| if unit.starts_with('$') { unit.into() } else { unit.replace('2', "²").replace('3', "³") }),
            bounds,
            words: T::CONTENTS.words,
            takes: T::takes(bounds.as_ref()),
            default: written.as_ref().map(Written::to_string),
            is_optional: default.is_some() || T::when_missing().is_some(),
            repeats: T::CONTENTS.repeats,
            fields: T::fields(),
            is_live,
            is_tunable,
            is_from_bench,
            fault: written.and_then(|written| fault::<T>(&written, bounds)),
        }
    }
}

/// Returns the message of the reader if it refuses the default.
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
    use std::path::Path;

    use crate::node::{At, Map, Mistake, Param, ParamTable, Reader, Repeats, Spanned};
    use crate::signal::Unit;
    use crate::source::{SourceMap, parse_table};

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

    /// Parameters that several tables share.
    #[derive(Debug, Clone, PartialEq, Param)]
    #[param(default)]
    struct Shared {
        /// How strong.
        #[param(unit = "N", above = 0.0, default = 2.0)]
        force: f64,
        /// Whose.
        of: Option<String>,
    }

    /// A table with those of another one.
    #[derive(Debug, Clone, PartialEq, Param)]
    struct Around {
        /// The first one.
        first: u64,
        #[param(flatten)]
        shared: Shared,
        /// The last one.
        #[param(default = 3)]
        last: u64,
    }

    fn read(text: &str) -> (Option<Around>, Vec<(String, String)>) {
        let mut sources = SourceMap::default();
        let table = parse_table(sources.add_file(Path::new("a.toml"), text)).unwrap();
        let mut reader = Reader::new(&sources);
        let read = Around::read(&table, &mut reader);
        let mistake = |mistake: &Mistake| match &mistake.at {
            At::Span(span) => (text[span.clone()].to_owned(), mistake.message.clone()),
            other => panic!("{other:?}"),
        };
        (read, reader.mistakes.iter().map(mistake).collect())
    }

    #[test]
    fn a_flat_table_is_read_described_and_written_as_if_its_fields_were_those_of_the_other() {
        let names: Vec<&str> = Around::fields().iter().map(|spec| spec.name).collect();
        assert_eq!(
            (names.as_slice(), &*Around::names()),
            (&["first", "force", "of", "last"][..], &["first", "last", "force", "of"][..])
        );
        let shared = Shared { force: 2.0, of: None };
        assert_eq!(Shared::default(), shared);
        let around = Around { first: 1, shared, last: 3 };
        assert_eq!(read("first = 1"), (Some(around.clone()), vec![]));
        assert_eq!(around.written().unwrap().to_string(), "{ first = 1, force = 2.0, last = 3 }");
        let (all, _) = read("first = 1\nforce = 4\nof = \"me\"\nlast = 5");
        let shared = Shared { force: 4.0, of: Some("me".into()) };
        assert_eq!(all, Some(Around { first: 1, shared, last: 5 }));
    }

    #[test]
    fn each_mistake_in_a_flat_table_has_its_place() {
        let (none, mistakes) = read("frist = 1\nforce = -1\nlast = \"x\"");
        assert_eq!(none, None);
        let places: Vec<&str> = mistakes.iter().map(|(place, _)| place.as_str()).collect();
        assert_eq!(places, ["frist", "-1", "\"x\""], "{mistakes:?}");
    }

    #[test]
    fn the_unit_stands_in_the_declaration() {
        let specs = Params::fields();
        let units: Vec<_> = specs.iter().map(|spec| spec.unit.as_deref()).collect();
        assert_eq!(units[..3], [Some("N"), Some("ms"), None]);
        assert_eq!(units[8], Some("rad/s"));
    }
}
