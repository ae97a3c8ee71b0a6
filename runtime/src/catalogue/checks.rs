//! Checks of a declaration that need no graph. The catalogue makes them when a node or a device is added.

use crate::node::{NodeSpec, ParamSpec, PortSpec, declares_a_unit};
use crate::signal::Kind;

/// Returns everything that is wrong with the declaration of a node.
pub(super) fn node(spec: &NodeSpec) -> Vec<String> {
    let name = &spec.name;
    let mut wrong = Vec::new();
    for port in spec.inputs.iter().chain(&spec.outputs).filter(|port| !declares_a_unit(port)) {
        let unit = port.args.first().map_or("", |unit| unit);
        wrong.push(format!("`{name}.{}` declares `{unit}`, which is not a unit", port.name));
    }
    for (ports, what) in [(&spec.inputs, "inputs"), (&spec.outputs, "outputs")] {
        let is_double = |(i, port): &(usize, &PortSpec)| ports[..*i].iter().any(|other| other.name == port.name);
        for (_, port) in ports.iter().enumerate().filter(is_double) {
            wrong.push(format!("two {what} of `{name}` are called `{}`", port.name));
        }
    }
    let has_flag = spec.outputs.first().is_some_and(|port| port.kind == Kind::Flag);
    if spec.logs && !has_flag {
        wrong.push(format!("`{name}` logs, so its first output must be a flag"));
    }
    for port in &spec.outputs {
        for param in port.args.iter().filter_map(|arg| arg.strip_prefix('$')) {
            if !spec.params.iter().any(|spec| spec.name == param) {
                wrong.push(format!("`{name}.{}` uses `${param}`, but there is no parameter `{param}`", port.name));
            }
        }
    }
    params(name, &spec.params, &mut Vec::new(), "", &mut wrong);
    example(name, &spec.example, "nodes", &spec.params, Some(&spec.inputs), &mut wrong);
    wrong
}

/// Returns everything that is wrong with the declaration of a device.
pub(super) fn device(name: &str, table: &[ParamSpec], text: &str) -> Vec<String> {
    let mut wrong = Vec::new();
    params(name, table, &mut Vec::new(), "", &mut wrong);
    example(name, text, "devices", table, None, &mut wrong);
    wrong
}

/// Checks the defaults of a table, and that a unit such as `$unit` names a parameter of it or of a table around it.
fn params(name: &str, table: &[ParamSpec], outer: &mut Vec<&'static str>, path: &str, wrong: &mut Vec<String>) {
    let depth = outer.len();
    outer.extend(table.iter().map(|param| param.name));
    for param in table {
        let this = format!("parameter `{path}{}` of `{name}`", param.name);
        if let Some(fault) = &param.fault {
            wrong.push(format!("the default of {this} is refused: {fault}"));
        }
        let units = param.unit.as_deref().unwrap_or_default().split(['/', ' ', ',']);
        for unit in units.filter_map(|unit| unit.strip_prefix('$')).filter(|unit| !outer.contains(unit)) {
            wrong.push(format!("the unit of {this} is `${unit}`, but there is no parameter `{unit}`"));
        }
        params(name, &param.fields, outer, &format!("{path}{}.", param.name), wrong);
    }
    outer.truncate(depth);
}

/// Checks the blocks of an example that have the type `name`: that there is one, and that its keys exist.
fn example(
    name: &str,
    text: &str,
    section: &str,
    params: &[ParamSpec],
    inputs: Option<&[PortSpec]>,
    wrong: &mut Vec<String>,
) {
    if text.is_empty() {
        return;
    }
    let table: toml::Table = match text.parse() {
        Ok(table) => table,
        Err(error) => return wrong.push(format!("the example of `{name}` is not valid TOML: {error}")),
    };
    let blocks = table.get(section).and_then(toml::Value::as_table);
    let of_type = |block: &&toml::Value| block.get("type").and_then(toml::Value::as_str) == Some(name);
    let mut found = blocks.into_iter().flat_map(|blocks| blocks.values()).filter(of_type).peekable();
    if found.peek().is_none() {
        wrong.push(format!("the example of `{name}` has no block in `[{section}]` with `type = \"{name}\"`"));
    }
    for block in found.filter_map(toml::Value::as_table) {
        // A device may take its parameters from a file.
        let is_file = |key: &str| inputs.is_none() && matches!(key, "robot" | "sensor");
        let is_known = |key: &str| key == "type" || (key == "in" && inputs.is_some()) || is_file(key);
        for key in block.keys().filter(|key| !is_known(key)) {
            if !params.iter().any(|param| param.name == key) {
                wrong.push(format!("the example of `{name}` sets `{key}`, which is not a parameter of it"));
            }
        }
        wires(name, block, inputs.unwrap_or_default(), wrong);
    }
}

fn wires(name: &str, block: &toml::Table, inputs: &[PortSpec], wrong: &mut Vec<String>) {
    let is_open = inputs.iter().any(|input| input.need.is_many);
    let wires = block.get("in").and_then(toml::Value::as_table);
    let wired: Vec<&str> = wires.into_iter().flat_map(toml::Table::keys).map(String::as_str).collect();
    for wire in wired.iter().filter(|wire| !is_open && !inputs.iter().any(|input| input.name == **wire)) {
        wrong.push(format!("the example of `{name}` wires `in.{wire}`, which is not an input of it"));
    }
    for input in inputs.iter().filter(|input| input.need.must_be_wired && !wired.contains(&&*input.name)) {
        wrong.push(format!("the example of `{name}` does not wire `in.{}`", input.name));
    }
}
