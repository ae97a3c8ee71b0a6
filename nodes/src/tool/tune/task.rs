//! The task that is tuned: the graph itself, or a part that cannot run without the graph.
//!
//! Several parts may use one file. They are tuned as one: each setting and the test signal reach all of them, so two arms
//! that hold an object between them press at the same time.

use std::collections::BTreeSet;
use std::path::PathBuf;

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Outline, OutlinedBlock, OutlinedWire, Request};

use crate::tool::control::nodes::mode_flag;

/// A task of a graph.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Task {
    /// Its name and a dot; "" for the graph itself.
    prefix: String,
    /// The file of the part; `None` for the graph itself.
    file: Option<PathBuf>,
}

impl Task {
    /// Returns the part with this name, whose file is known.
    pub(super) fn part(name: &str, file: PathBuf) -> Self {
        Self { prefix: format!("{name}."), file: Some(file) }
    }

    /// Returns all parts with the file of this one.
    pub(super) fn alike(&self, outline: &Outline) -> Vec<Self> {
        let is_of = |node: &OutlinedBlock, task: &str| node.name.rsplit_once('.').is_some_and(|(it, _)| it == task);
        let is_here = |node: &OutlinedBlock| self.file.as_ref().is_some_and(|file| **file == *node.place.file);
        let names = outline.tasks.iter().map(|task| &task.name);
        let alike = names.filter(|name| outline.nodes.iter().any(|node| is_of(node, name) && is_here(node)));
        alike.map(|name| Self { prefix: format!("{name}."), file: self.file.clone() }).collect()
    }

    /// Returns the file of the part; `None` for the graph itself.
    pub(super) const fn file(&self) -> Option<&PathBuf> {
        self.file.as_ref()
    }

    /// Returns an outline as its own file would have it: with the names that stand there, and without what is not in it,
    /// except for the nodes that read the flags of its modes.
    pub(super) fn outline(&self, outline: &Outline) -> Outline {
        let mut own = outline.clone();
        if self.file.is_none() {
            return own;
        }
        let flags = mode_flag(&self.port(""));
        let reads_mode = |node: &OutlinedBlock| node.wires.iter().any(|wire| wire.source.starts_with(&flags));
        let nodes: BTreeSet<&str> = outline.nodes.iter().map(|node| &*node.name).collect();
        own.nodes.retain_mut(|node| {
            let is_own = self.rename(&mut node.name);
            is_own || reads_mode(node)
        });
        own.nodes.iter_mut().for_each(|node| self.names(node, &nodes));
        own.modes.retain_mut(|mode| self.strip(&mut mode.name));
        own.tasks.retain_mut(|task| self.strip(&mut task.name));
        own.live.retain_mut(|range| self.strip(&mut range.name));
        own.commands.retain_mut(|wire| self.strip(&mut wire.source));
        own
    }

    /// Gives the ports of a node the names of the file. `nodes` are those of the graph.
    fn names(&self, node: &mut OutlinedBlock, nodes: &BTreeSet<&str>) {
        let sources = node.wires.iter_mut().map(|OutlinedWire { source, .. }| source);
        let outputs = node.outputs.iter_mut().map(|output| &mut output.name);
        for name in sources.chain(outputs) {
            let is_of_node = name.rsplit_once('.').is_some_and(|(node, _)| nodes.contains(node));
            // Ports of roles have the same names everywhere.
            if is_of_node {
                self.rename(name)
            } else {
                self.strip(name)
            };
        }
    }

    /// Gives what is in the task its name there, and marks what is not by a dot, with which no name of a file begins.
    /// Returns whether it is in the task.
    fn rename(&self, name: &mut String) -> bool {
        let is_own = self.strip(name);
        if !is_own {
            name.insert(0, '.');
        }
        is_own
    }

    /// Takes the name of the task away from a name in it. Returns whether it is in it.
    fn strip(&self, name: &mut String) -> bool {
        let own = name.strip_prefix(&self.prefix).map(str::to_owned);
        own.map(|own| *name = own).is_some()
    }

    /// Returns a request with these settings of the task too.
    pub(super) fn with(&self, request: &Request, settings: impl IntoIterator<Item = String>) -> Request {
        let mut request = request.clone();
        match &self.file {
            None => request.set.extend(settings),
            Some(file) => request.part_set.extend(settings.into_iter().map(|set| (file.clone(), set))),
        }
        request
    }

    /// Returns the name that a port of the task has in the graph.
    pub(super) fn port(&self, name: &str) -> String {
        format!("{}{name}", self.prefix)
    }

    /// Returns the mode in which the task is now.
    pub(super) fn mode<'e>(&self, engine: &'e Engine) -> Option<&'e str> {
        let name = self.prefix.trim_end_matches('.');
        engine.tasks().iter().find(|task| task.name() == name)?.mode()
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::graph::compile;

    use super::*;

    #[test]
    fn a_part_has_the_names_of_its_file_and_a_setting_reaches_all_parts_with_it() {
        let graphs = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs");
        let (catalogue, request) = (crate::catalogue(), Request::file(format!("{graphs}/carry.toml")));
        let load = |request: &Request| {
            compile(&catalogue, request).unwrap_or_else(|it| panic!("{}", it.render(false))).outline().clone()
        };
        let task = Task::part("left", format!("{graphs}/parts/carry_side.toml").into());
        let whole = load(&task.with(&request, ["nodes.pid.gains.force.kp=0.7".to_owned()]));
        let own = task.outline(&whole);
        let kp = |outline: &Outline, name: &str| {
            let node = outline.nodes.iter().find(|node| node.name == name).unwrap();
            let kp = node.settings.iter().find(|setting| setting.path == "gains.force.kp").unwrap();
            kp.value.read::<f64>().unwrap()
        };
        assert_eq!([kp(&whole, "left.pid"), kp(&whole, "right.pid"), kp(&own, "pid")], [0.7; 3]);
        let modes: Vec<&str> = own.modes.iter().map(|mode| &*mode.name).collect();
        assert_eq!(modes, ["approach", "wait", "press", "ready", "lift", "hold"]);
        let commands: Vec<&str> = own.commands.iter().map(|wire| &*wire.source).collect();
        assert_eq!(commands, ["move.joints.velocity"]);
        let readers = own.nodes.iter().filter(|node| node.wires.iter().any(|wire| wire.source == "modes.hold"));
        assert_eq!(readers.map(|node| &*node.name).collect::<Vec<_>>(), [".left_carries"]);
        let sum = own.nodes.iter().find(|node| node.name == "sum").unwrap();
        assert_eq!((&*sum.wires[0].source, &*sum.outputs[0].name), ("projector.twist", "sum.twist"));
        assert_eq!(task.port("sum.twist"), "left.sum.twist");
    }
}
