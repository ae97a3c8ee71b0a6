//! The nodes of a graph and their values in one mode.

use std::collections::{BTreeMap, BTreeSet};

use tactflow_runtime::graph::{Outline, OutlinedBlock, OutlinedMode, OutlinedPort, Setting};

/// The exits of a mode, and when it fails: each key with its value as TOML.
pub(crate) type Ends = Vec<(String, String)>;

/// The nodes and modes of a graph, by name.
pub(crate) struct Index<'a> {
    outline: &'a Outline,
    nodes: BTreeMap<&'a str, &'a OutlinedBlock>,
    tasks: BTreeSet<&'a str>,
    /// The modes of each task; that of the graph itself is "".
    modes: BTreeMap<&'a str, Vec<&'a OutlinedMode>>,
}

impl<'a> Index<'a> {
    pub(crate) fn new(outline: &'a Outline) -> Self {
        let mut modes = BTreeMap::<&str, Vec<&OutlinedMode>>::new();
        for mode in &outline.modes {
            modes.entry(task(mode)).or_default().push(mode);
        }
        Self {
            outline,
            nodes: outline.nodes.iter().map(|node| (&*node.name, node)).collect(),
            tasks: outline.tasks.iter().map(|task| &*task.name).collect(),
            modes,
        }
    }

    /// Returns the outline of the graph.
    pub(crate) const fn outline(&self) -> &'a Outline {
        self.outline
    }

    /// Returns the task that a port is part of, the longest name that fits; "" for the graph itself.
    pub(crate) fn task_of(&self, port: &str) -> &'a str {
        let ends = port.rmatch_indices('.').map(|(end, _)| &port[..end]);
        ends.filter_map(|name| self.tasks.get(name)).next().copied().unwrap_or_default()
    }

    /// Returns the modes of a task, or one `None` if it has none.
    pub(crate) fn modes(&self, task: &str) -> Vec<Option<&'a OutlinedMode>> {
        self.modes.get(task).map_or_else(|| vec![None], |modes| modes.iter().copied().map(Some).collect())
    }
}

/// The nodes, with what a mode sets.
#[derive(Clone, Copy)]
pub(crate) struct Nodes<'a> {
    index: &'a Index<'a>,
    mode: Option<&'a OutlinedMode>,
}

impl<'a> Nodes<'a> {
    pub(crate) const fn new(index: &'a Index<'a>, mode: Option<&'a OutlinedMode>) -> Self {
        Self { index, mode }
    }

    /// Returns the node that writes a port; `None` for the port of a role.
    pub(crate) fn writer(&self, port: &str) -> Option<&'a OutlinedBlock> {
        self.node(port.rsplit_once('.')?.0)
    }

    /// Returns what the outline says of a port; `None` for the port of a role.
    pub(crate) fn output(&self, port: &str) -> Option<&'a OutlinedPort> {
        self.writer(port)?.outputs.iter().find(|output| output.name == port)
    }

    /// Returns the node with a name.
    pub(crate) fn node(&self, name: &str) -> Option<&'a OutlinedBlock> {
        self.index.nodes.get(name).copied()
    }

    /// Returns the nodes that a port depends on.
    pub(crate) fn upstream(&self, port: &str) -> Vec<&'a OutlinedBlock> {
        let mut open: Vec<&OutlinedBlock> = self.writer(port).into_iter().collect();
        let (mut seen, mut found) = (BTreeSet::new(), Vec::new());
        while let Some(node) = open.pop() {
            if seen.insert(&*node.name) {
                found.push(node);
                open.extend(node.wires.iter().filter_map(|wire| self.writer(&wire.source)));
            }
        }
        found
    }

    /// Returns whether a flag is set in this mode, if it is the flag of a mode of the same task, or made of such flags.
    pub(crate) fn is_set(&self, flag: &str) -> Option<bool> {
        if let Some(node) = self.writer(flag) {
            let mut flags = node.wires.iter().map(|wire| self.is_set(&wire.source));
            return match node.kind.text.as_str() {
                "not" => opposite(flags.next()?),
                "any" => any(flags),
                "all" => all(flags),
                _ => None,
            };
        }
        let mode = self.index.outline.modes.iter().find(|mode| flag == mode_flag(&mode.name))?;
        // Another task can be in any of its modes.
        let own = self.mode.filter(|own| task(own) == task(mode))?;
        Some(own.name == mode.name)
    }

    /// Returns whether a gate behind a flag is open whatever the sensor feels: the flag is set in this mode.
    pub(crate) fn is_open(&self, flag: &str) -> bool {
        self.is_set(flag) == Some(true)
    }

    /// Returns whether a gate behind a flag is open during a contact: the flag is set in this mode, or by the contact.
    pub(crate) fn is_open_in_contact(&self, flag: &str) -> bool {
        self.is_open(flag) || flag.ends_with(".present")
    }

    /// Returns the ports that a switch passes in this mode.
    pub(crate) fn sides(&self, switch: &'a OutlinedBlock) -> impl Iterator<Item = &'a str> {
        let set = source(switch, "select").and_then(|flag| self.is_set(flag));
        let sides = [("on", true), ("off", false)].into_iter().filter(move |(_, on)| set.is_none_or(|set| set == *on));
        sides.filter_map(|(side, _)| source(switch, side))
    }

    /// Returns the nominal time between two ticks [s].
    pub(crate) const fn period(&self) -> f64 {
        self.index.outline.period_s
    }

    /// Returns the values of a node in this mode: those of its block, and over them those that the mode sets.
    pub(crate) fn values(&self, node: &'a OutlinedBlock) -> impl Iterator<Item = (&'a str, &'a Setting)> {
        let name = self.mode.map_or("", task);
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

/// Returns the task of a mode; "" for that of the graph itself.
fn task(mode: &OutlinedMode) -> &str {
    mode.name.rsplit_once('.').map_or("", |(task, _)| task)
}

/// Returns whether one of several flags is set, as far as they are known.
fn any(flags: impl Iterator<Item = Option<bool>>) -> Option<bool> {
    let mut found = Some(false);
    for is_set in flags {
        match is_set {
            Some(true) => return Some(true),
            Some(false) => {}
            None => found = None,
        }
    }
    found
}

/// Returns whether all of several flags are set, as far as they are known.
fn all(flags: impl Iterator<Item = Option<bool>>) -> Option<bool> {
    opposite(any(flags.map(opposite)))
}

fn opposite(flag: Option<bool>) -> Option<bool> {
    flag.map(|is_set| !is_set)
}

/// Returns the port that is set in a mode: `modes.NAME`, and `TASK.modes.NAME` in a task that is a part.
pub(crate) fn mode_flag(name: &str) -> String {
    match name.rsplit_once('.') {
        Some((task, name)) => format!("{task}.modes.{name}"),
        None => format!("modes.{name}"),
    }
}

/// Returns the port behind an input of a node.
pub(crate) fn source<'a>(node: &'a OutlinedBlock, input: &str) -> Option<&'a str> {
    node.wires.iter().find(|wire| wire.name == input).map(|wire| &*wire.source)
}

/// The velocity of an arm.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Command<'a> {
    /// Name of the role of the arm.
    pub(crate) arm: &'a str,
    /// The port behind the command.
    pub(crate) port: &'a str,
}

/// Returns the velocities of all arms.
pub(crate) fn commands(outline: &Outline) -> impl Iterator<Item = Command<'_>> {
    let wires = outline.commands.iter();
    wires.filter_map(|wire| Some(Command { arm: wire.name.strip_suffix(".velocity")?, port: &wire.source }))
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

#[cfg(test)]
mod tests {
    use tactflow_runtime::graph::{Request, compile};

    use super::*;

    #[test]
    fn the_mode_of_another_task_is_not_known() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/carry.toml");
        let compiled = compile(&crate::catalogue(), &Request::file(path));
        let compiled = compiled.unwrap_or_else(|report| panic!("{}", report.render(false)));
        let index = Index::new(compiled.outline());
        let modes = index.modes("left");
        let mode = modes.iter().flatten().find(|mode| mode.name == "left.hold").unwrap();
        let nodes = Nodes::new(&index, Some(mode));
        let flags = ["left.modes.hold", "left.modes.press", "right.modes.hold", "right.modes.press"];
        assert_eq!(flags.map(|flag| nodes.is_set(flag)), [Some(true), Some(false), None, None]);
    }

    #[test]
    fn what_is_made_of_flags_is_known_in_each_order() {
        let cases = [
            ([Some(true), None], Some(true), None),
            ([Some(false), None], None, Some(false)),
            ([Some(true), Some(false)], Some(true), Some(false)),
            ([Some(true), Some(true)], Some(true), Some(true)),
            ([None, None], None, None),
        ];
        for (flags, is_any, is_all) in cases {
            for flags in [flags, [flags[1], flags[0]]] {
                let found = (any(flags.into_iter()), all(flags.into_iter()));
                assert_eq!(found, (is_any, is_all), "{flags:?}");
            }
        }
    }
}
