//! The examples of the catalogue, put together to one graph.

use tactflow_runtime::catalogue::Catalogue;
use toml::{Table, Value};

/// A graph of all examples at once, on the scripted devices.
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
    let mocks = catalogue.devices().iter().filter(|device| device.name().starts_with("mock_"));
    for device in mocks {
        lay(&mut graph, device.example().parse().expect("it is TOML"), &device.name());
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
