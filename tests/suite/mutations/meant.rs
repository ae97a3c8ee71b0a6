//! Which changes of a graph somebody could have meant: another value where any value will do, another wire that fits,
//! something left out that may be.

use std::collections::BTreeMap;

use tactflow_runtime::node::{NodeSpec, ParamSpec};
use tactflow_tests::catalogue;
use toml::{Table, Value};

/// A change of the tree of values that makes another graph which is as good as the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Meant {
    /// One number is another number.
    Number,
    /// One wire comes from another port; it loaded, so kind, unit and frames fit.
    Wire,
    /// The clock is another role.
    Clock,
    /// A node is of another type that has the same ports and takes the same parameters; it loaded.
    Type,
    /// An entry of a list of tables is there once more or once less.
    Entry,
    /// A parameter or an input that may be left out is left out.
    Omitted,
    /// A parameter that may be left out is left out, and its value given to another one of the same table.
    Renamed,
}

/// Value of each leaf by its path. Lists of tables are taken apart, others are leaves.
type Leaves = BTreeMap<Vec<String>, Value>;

fn leaves(value: &Value, path: &[String], into: &mut Leaves) {
    let mut inner = |name: &str, value: &Value| leaves(value, &[path, &[name.to_owned()]].concat(), into);
    match value {
        Value::Table(table) => table.iter().for_each(|(name, value)| inner(name, value)),
        Value::Array(items) if items.iter().any(Value::is_table) => {
            items.iter().enumerate().for_each(|(i, value)| inner(&i.to_string(), value));
        }
        leaf => drop(into.insert(path.to_vec(), leaf.clone())),
    }
}

/// What was meant by the change from one text to another; nothing anybody could mean if none.
pub(super) fn could_be_meant(before: &str, after: &str) -> Option<Meant> {
    let [old, new] = [before, after].map(|text| {
        let mut into = Leaves::new();
        let table: Table = text.parse().expect("what loads is TOML");
        leaves(&Value::Table(table.clone()), &[], &mut into);
        (table, into)
    });
    let gone: Vec<&Vec<String>> = old.1.keys().filter(|path| !new.1.contains_key(*path)).collect();
    let come: Vec<&Vec<String>> = new.1.keys().filter(|path| !old.1.contains_key(*path)).collect();
    let mut changed = old.1.iter().filter_map(|(path, value)| {
        let other = new.1.get(path).filter(|other| *other != value)?;
        Some((path, value, other))
    });
    if list_of_tables(&old.0, &new.0) {
        return Some(Meant::Entry);
    }
    match (gone.as_slice(), come.as_slice(), changed.next(), changed.next()) {
        ([], [], Some((path, old, new)), None) => other_value(path, old, new),
        ([gone], [], None, _) => may_be_left_out(&old.0, gone).then_some(Meant::Omitted),
        // A fact that may be missing: `{ from = "arm.home", optional = true }`.
        ([from, optional], [], None, _) if is_fact(from, optional) => {
            may_be_left_out(&old.0, &from[..from.len() - 1]).then_some(Meant::Omitted)
        }
        ([left, ..], [], None, _) => {
            // A line of a part's overrides can set several, and what a mode does about a loss says several things.
            let is_override = gone.iter().all(|path| is_override(path) && path[..4] == left[..4]);
            let is_on_lost = gone.iter().all(|path| is_on_lost(path) && path[..3] == left[..3]);
            (is_override || is_on_lost).then_some(Meant::Omitted)
        }
        ([gone], [come], None, _) => {
            let is_beside = gone[..gone.len() - 1] == come[..come.len() - 1] && old.1[*gone] == new.1[*come];
            (is_beside && may_be_left_out(&old.0, gone)).then_some(Meant::Renamed)
        }
        _ => None,
    }
}

fn is_fact(from: &[String], optional: &[String]) -> bool {
    let ends = |path: &[String], name: &str| path.last().is_some_and(|last| last == name);
    ends(from, "from") && ends(optional, "optional") && from[..from.len() - 1] == optional[..optional.len() - 1]
}

fn other_value(path: &[String], old: &Value, new: &Value) -> Option<Meant> {
    let names: Vec<&str> = path.iter().map(String::as_str).collect();
    match (names.as_slice(), old, new) {
        (["graph", "clock"], ..) => Some(Meant::Clock),
        (["nodes", _, "type"], ..) => Some(Meant::Type),
        (
            ["nodes" | "parts", _, "in", _] | ["exports", _] | ["commands", _, _] | ["modes", _, "on_lost", "of"],
            Value::String(_),
            Value::String(_),
        ) => Some(Meant::Wire),
        _ if differ_in_one_number(old, new) => Some(Meant::Number),
        _ => None,
    }
}

fn differ_in_one_number(old: &Value, new: &Value) -> bool {
    let is_number = |value: &Value| value.is_integer() || value.is_float();
    match (old, new) {
        (Value::Array(old), Value::Array(new)) if old.len() == new.len() => {
            let mut pairs = old.iter().zip(new).filter(|(old, new)| old != new);
            let pair = pairs.next();
            pairs.next().is_none() && pair.is_some_and(|(old, new)| differ_in_one_number(old, new))
        }
        _ => is_number(old) && is_number(new),
    }
}

/// Whether all that changed is that a list of tables has an entry more or less.
fn list_of_tables(old: &Table, new: &Table) -> bool {
    old.len() == new.len()
        && old.iter().all(|(name, old)| match (old, new.get(name)) {
            (Value::Table(old), Some(Value::Table(new))) => old == new || list_of_tables(old, new),
            (Value::Array(old), Some(Value::Array(new))) => {
                old == new
                    || old.iter().all(Value::is_table)
                        && old.len().abs_diff(new.len()) == 1
                        && old.iter().all(|entry| new.contains(entry) || new.len() < old.len())
                        && new.iter().all(|entry| old.contains(entry))
            }
            (old, new) => Some(old) == new,
        })
}

fn is_override(path: &[String]) -> bool {
    path.len() > 4 && path[0] == "parts" && path[2] == "set"
}

fn is_on_lost(path: &[String]) -> bool {
    path.len() > 3 && path[0] == "modes" && path[2] == "on_lost"
}

/// Whether a graph that lacks the leaf at `path` is as good: the catalogue says so.
fn may_be_left_out(root: &Table, path: &[String]) -> bool {
    let names: Vec<&str> = path.iter().map(String::as_str).collect();
    match names.as_slice() {
        // What a part sets over its own file, that file sets as well or its node has a default for.
        ["parts", _, "set", _, ..] => true,
        // A mode is the graph with its own parameters laid over, as many as it likes.
        ["modes", _, "set", _, ..] => true,
        // What a task tells a device, and what a bench gives to scenarios, nobody has to.
        ["commands", role, report] => {
            let kind = root["roles"][*role].as_str().unwrap_or("");
            let role = catalogue().roles().iter().find(|known| known.name == kind).cloned();
            role.is_some_and(|role| role.reports.iter().any(|port| port.name == *report))
        }
        ["bind", name] => catalogue().roles().iter().any(|role| role.is_observed_as(name)),
        ["nodes", node, "in", input] => spec(root, "nodes", node).is_some_and(|spec| {
            let input = spec.inputs.iter().find(|port| port.name == *input || port.need.is_many);
            input.is_some_and(|port| !port.need.must_be_wired && !port.need.is_delayed)
        }),
        ["nodes", node, param @ ..] => spec(root, "nodes", node).is_some_and(|spec| is_optional(&spec.params, param)),
        ["devices", device, param @ ..] => {
            let kind = root["devices"][*device]["type"].as_str().unwrap_or("");
            let catalogue = catalogue();
            let found = catalogue.devices().iter().find(|device| device.name() == kind);
            found.is_some_and(|device| is_optional(&device.params(), param))
        }
        ["graph", key] => matches!(*key, "max_gap_ms" | "reset_after_ms"),
        _ => false,
    }
}

fn spec(root: &Table, section: &str, node: &str) -> Option<NodeSpec> {
    let kind = root.get(section)?.get(node)?.get("type")?.as_str()?;
    catalogue().nodes().iter().map(|node| node.spec()).find(|spec| spec.name == kind)
}

fn is_optional(params: &[ParamSpec], path: &[&str]) -> bool {
    let [name, rest @ ..] = path else { return false };
    let Some(param) = params.iter().find(|param| param.name == *name) else {
        // The keys of a map are the graph's own: names of features, or numbers of entries.
        return !rest.is_empty() && is_optional(params, rest);
    };
    param.is_optional || !rest.is_empty() && is_optional(&param.fields, rest)
}
