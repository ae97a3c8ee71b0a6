//! The nodes of a graph and their values in one mode.

use tactflow_runtime::graph::{Outline, OutlinedBlock, OutlinedMode, Setting};

/// The exits of a mode, and when it fails: each key with its value as TOML.
pub(crate) type Ends = Vec<(String, String)>;

/// The nodes, with what a mode sets.
#[derive(Clone, Copy)]
pub(crate) struct Nodes<'a> {
    outline: &'a Outline,
    mode: Option<&'a OutlinedMode>,
}

impl<'a> Nodes<'a> {
    pub(crate) const fn new(outline: &'a Outline, mode: Option<&'a OutlinedMode>) -> Self {
        Self { outline, mode }
    }

    /// Returns the node that writes a port; `None` for the port of a role.
    pub(crate) fn writer(&self, port: &str) -> Option<&'a OutlinedBlock> {
        let (name, _) = port.rsplit_once('.')?;
        self.outline.nodes.iter().find(|node| node.name == name)
    }

    /// Returns the nominal time between two ticks [s].
    pub(crate) const fn period(&self) -> f64 {
        self.outline.period_s
    }

    /// Returns the values of a node in this mode: those of its block, and over them those that the mode sets.
    pub(crate) fn values(&self, node: &'a OutlinedBlock) -> impl Iterator<Item = (&'a str, &'a Setting)> {
        let name = self.mode.and_then(|mode| mode.name.rsplit_once('.')).map_or("", |(task, _)| task);
        let local = node.name.strip_prefix(name).unwrap_or(&node.name).trim_start_matches('.');
        let prefix = format!("set.{local}.");
        let set = self.mode.iter().flat_map(|mode| &mode.settings);
        let set: Vec<(&str, &Setting)> =
            set.filter_map(|setting| Some((setting.path.strip_prefix(&*prefix)?, setting))).collect();
        let is_set = |path: &str| set.iter().any(|(own, _)| *own == path);
        let base = node.settings.iter().map(|setting| (&*setting.path, setting));
        let base: Vec<(&str, &Setting)> = base.filter(|(path, _)| !is_set(path)).collect();
        base.into_iter().chain(set)
    }

    /// Returns one value of a node in this mode.
    pub(crate) fn value(&self, node: &'a OutlinedBlock, path: &str) -> Option<&'a Setting> {
        self.values(node).find(|(own, _)| *own == path).map(|(_, setting)| setting)
    }

    /// Returns a number of a node in this mode.
    pub(crate) fn number(&self, node: &'a OutlinedBlock, path: &str) -> Option<f64> {
        self.value(node, path)?.value.read()
    }
}

/// Returns the port behind an input of a node.
pub(crate) fn source<'a>(node: &'a OutlinedBlock, input: &str) -> Option<&'a str> {
    node.wires.iter().find(|wire| wire.name == input).map(|wire| &*wire.source)
}

/// Returns the velocities of all arms: the name of each command, and the port behind it.
pub(crate) fn commands(outline: &Outline) -> impl Iterator<Item = (String, &str)> {
    let wires = outline.commands.iter().filter(|wire| wire.name.ends_with(".velocity"));
    wires.map(|wire| (wire.name.clone(), &*wire.source))
}

/// Returns the task that a port is part of, the longest name that fits; "" for the graph itself.
pub(crate) fn task_of<'a>(outline: &'a Outline, port: &str) -> &'a str {
    let is_inside = |task: &&str| port.strip_prefix(*task).is_some_and(|rest| rest.starts_with('.'));
    let names = outline.tasks.iter().map(|task| &*task.name).filter(is_inside);
    names.max_by_key(|name| name.len()).unwrap_or_default()
}

/// Returns the modes of a task, or one `None` if it has none.
pub(crate) fn modes<'a>(outline: &'a Outline, task: &'a str) -> impl Iterator<Item = Option<&'a OutlinedMode>> {
    let of = |mode: &&OutlinedMode| mode.name.rsplit_once('.').map_or("", |(task, _)| task) == task;
    let modes: Vec<_> = outline.modes.iter().filter(of).map(Some).collect();
    if modes.is_empty() { vec![None].into_iter() } else { modes.into_iter() }
}

/// Returns the exits of a mode.
pub(crate) fn ends(mode: &OutlinedMode) -> Ends {
    let settings = mode.settings.iter().filter(|setting| !setting.path.starts_with("set."));
    settings.map(|setting| (setting.path.clone(), toml(setting))).collect()
}

/// Writes a value as TOML, as it stands in the file.
pub(crate) fn toml(setting: &Setting) -> String {
    let value = setting.written.as_ref().unwrap_or(&setting.value);
    toml::Value::try_from(value).map_or_else(|error| error.to_string(), |value| value.to_string())
}
