//! What is wrong with a node or a device, as far as it shows without a graph: found when the catalogue is made.

use std::borrow::Cow;

use crate::node::{NodeSpec, ParamSpec, PortSpec, declares_a_unit};
use crate::signal::Kind;

/// Panics if the declaration of a node is wrong.
pub(super) fn node(spec: &NodeSpec) {
    let name = &spec.name;
    for port in spec.inputs.iter().chain(&spec.outputs) {
        assert!(declares_a_unit(port), "`{name}.{}` declares {:?}, which is not a unit", port.name, port.args.first());
    }
    for (ports, what) in [(&spec.inputs, "inputs"), (&spec.outputs, "outputs")] {
        let double = ports.iter().enumerate().find(|(i, port)| ports[..*i].iter().any(|other| other.name == port.name));
        assert!(double.is_none(), "two {what} of `{name}` are called `{}`", double.map_or("", |(_, port)| &port.name));
    }
    let has_flag = spec.outputs.first().is_some_and(|port| port.kind == Kind::Flag);
    assert!(
        !spec.logs || has_flag,
        "the first output of `{name}` is not a flag: with `logs`, a flag that decides when to log must come first"
    );
    for port in &spec.outputs {
        for param in port.args.iter().filter_map(|arg| arg.strip_prefix('$')) {
            let is_there = spec.params.iter().any(|spec| spec.name == param);
            assert!(is_there, "`{name}.{}` names the parameter `{param}`, which `{name}` does not have", port.name);
        }
    }
    params(name, &spec.params, &mut Vec::new(), "");
    example(name, &spec.example, "nodes", &spec.params, Some(&spec.inputs));
}

/// Panics if the declaration of a device is wrong.
pub(super) fn device(name: &str, table: &[ParamSpec], text: &str) {
    params(name, table, &mut Vec::new(), "");
    example(name, text, "devices", table, None);
}

/// Checks the defaults of a table, and that a unit such as `$unit` names a parameter of it or of a table around it.
fn params(name: &str, table: &[ParamSpec], outer: &mut Vec<&'static str>, path: &str) {
    let depth = outer.len();
    outer.extend(table.iter().map(|param| param.name));
    for param in table {
        if let Some(fault) = &param.fault {
            panic!("the default of parameter `{path}{}` of `{name}` is refused: {fault}", param.name);
        }
        let units = param.unit.as_deref().unwrap_or_default().split(['/', ' ', ',']);
        if let Some(unit) = units.filter_map(|unit| unit.strip_prefix('$')).find(|unit| !outer.contains(unit)) {
            panic!(
                "the unit of parameter `{path}{}` of `{name}` is `${unit}`, but there is no parameter `{unit}`",
                param.name
            );
        }
        params(name, &param.fields, outer, &format!("{path}{}.", param.name));
    }
    outer.truncate(depth);
}

/// Checks the blocks of an example that have the type `name`: that there is one, and that it names only what exists.
fn example(name: &str, text: &str, section: &str, params: &[ParamSpec], inputs: Option<&[PortSpec]>) {
    if text.is_empty() {
        return;
    }
    let table: toml::Table =
        text.parse().unwrap_or_else(|error| panic!("the example of `{name}` is not valid TOML: {error}"));
    let blocks = table.get(section).and_then(toml::Value::as_table);
    let of_type = |block: &&toml::Value| block.get("type").and_then(toml::Value::as_str) == Some(name);
    let mut found = blocks.into_iter().flat_map(|blocks| blocks.values()).filter(of_type).peekable();
    assert!(found.peek().is_some(), "the example of `{name}` has no block in `[{section}]` with `type = \"{name}\"`");
    for block in found.filter_map(toml::Value::as_table) {
        for key in block.keys().filter(|key| *key != "type" && !(*key == "in" && inputs.is_some())) {
            let is_there = params.iter().any(|param| param.name == key);
            assert!(is_there, "the example of `{name}` sets `{key}`, which is no parameter of it");
        }
        wires(name, block, inputs.unwrap_or_default());
    }
}

fn wires(name: &str, block: &toml::Table, inputs: &[PortSpec]) {
    let is_open = inputs.iter().any(|input| input.need.is_many);
    let wired: Vec<&str> = match block.get("in").and_then(toml::Value::as_table) {
        Some(wires) => wires.keys().map(String::as_str).collect(),
        None => Vec::new(),
    };
    let strange = wired.iter().find(|wire| !is_open && !inputs.iter().any(|input| input.name == **wire));
    assert!(strange.is_none(), "the example of `{name}` wires `in.{}`, which it does not have", strange.unwrap_or(&""));
    let must = |input: &&PortSpec| input.need.must_be_wired && !wired.contains(&&*input.name);
    let missing: Option<&Cow<'static, str>> = inputs.iter().find(must).map(|input| &input.name);
    assert!(missing.is_none(), "the example of `{name}` does not wire `in.{}`", missing.map_or("", |name| name));
}
