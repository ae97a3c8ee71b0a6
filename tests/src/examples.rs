//! The examples of the catalogue, put together to one graph.

use tactflow_runtime::catalogue::Catalogue;
use toml::{Table, Value};

/// Blocks that other examples name, for as long as their own nodes and devices bring none.
const STAND_INS: &str = r#"
[roles]
pad = "tactile_pad"

[bind]
pad = "pad"

[devices.pad]
type = "mock_pad"
press = [
  { from_s = 0.05, to_s = 1.0, at = [0.010, -0.005], speed = [0.02, 0.0], force = 3.0 },
  { from_s = 1.2, to_s = 1.7, at = [0.0, 0.01], radius = 0.006, length = 0.03, angle = 0.6, force = 4.0 },
]
for_s = 2.0

[nodes.source]
type = "tactile_source"
in.image = "pad.image"

[nodes.calibrate]
type = "calibrate"
in.image = "source.image"

[nodes.binarize]
type = "binarize"
in.image = "calibrate.image"
threshold = 0.015

[nodes.label]
type = "label"
in.image = "calibrate.image"
in.mask = "binarize.mask"

[nodes.moments]
type = "moments"
in.image = "calibrate.image"
in.region = "label.region"

[nodes.smooth]
type = "smooth"
in.value = "moments.pressure"
"#;

/// A graph of all examples at once, on the stand-ins where an example is missing.
///
/// # Panics
/// If an example is no TOML, or if two of them say different things.
#[must_use]
pub fn graph_of_all(catalogue: &Catalogue) -> String {
    let mut graph: Table = "graph.clock = \"pad\"".parse().expect("it is TOML");
    let nodes = catalogue.nodes().iter().map(|node| node.spec()).map(|spec| (spec.name, spec.example));
    for (name, example) in nodes.filter(|(_, example)| !example.is_empty()) {
        let example: Table = example.parse().unwrap_or_else(|error| panic!("the example of `{name}`: {error}"));
        lay(&mut graph, example, &name);
    }
    // One arm and one pad will do: which ones is no matter to the nodes.
    let arm = catalogue.devices().iter().find(|device| device.name() == "mock_arm").expect("there is an arm");
    lay(&mut graph, arm.example().parse().expect("it is TOML"), "mock_arm");
    let stand_ins: Table = STAND_INS.parse().expect("it is TOML");
    for (section, blocks) in stand_ins {
        let Value::Table(blocks) = blocks else { continue };
        let known = graph.entry(section).or_insert_with(|| Table::new().into()).as_table_mut().expect("a table");
        for (name, block) in blocks {
            known.entry(name).or_insert(block);
        }
    }
    toml::to_string(&graph).expect("what was read can be written")
}

/// Lays a table over another; two that say different things at one place are a mistake of `whose` example.
fn lay(over: &mut Table, table: Table, whose: &str) {
    for (key, value) in table {
        match (over.get_mut(&key), value) {
            (Some(Value::Table(known)), Value::Table(table)) => lay(known, table, whose),
            (Some(known), value) => assert_eq!(*known, value, "`{key}` in the example of `{whose}`"),
            (None, value) => drop(over.insert(key, value)),
        }
    }
}
