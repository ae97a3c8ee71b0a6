//! From the twist of an arm back to all that moves it.

use nalgebra::{Matrix6, Vector6};
use tactflow_runtime::graph::OutlinedBlock;
use tactflow_runtime::signal::Twist;

use super::filters::Filter;
use super::law::{Constant, Feature, Guidance, Law, feature};
use super::mount::{Mount, REST, Turn, mount, without_rest};
use super::nodes::{Nodes, source};
use super::shape::Shape;
use crate::motion::COMPONENTS;
use crate::motion::adjoint::adjoint;

/// What stands between a node and the twist of the arm.
#[derive(Debug, Clone)]
struct Passage {
    /// What the projectors, and the adjoints of poses that do not change, make of a twist.
    matrix: Matrix6<f64>,
    /// The adjoints of poses that do not change.
    turn: Option<Turn>,
    gates: Vec<String>,
    /// Switches whose selection is not known, with the number of the side.
    sides: Vec<(String, usize)>,
    delays: Vec<Filter>,
}

/// Types that pass on the motion of the features. Limits that stand among the nodes of a task are not followed: what is
/// computed from their input would not be what the arm does.
const PASSED: [&str; 4] = ["pivot", "edge_guard", "arm_damping", "bumpless"];

impl Default for Passage {
    fn default() -> Self {
        Self { matrix: Matrix6::identity(), turn: None, gates: Vec::new(), sides: Vec::new(), delays: Vec::new() }
    }
}

impl Passage {
    /// Returns what becomes of a twist.
    fn of(&self, twist: [f64; 6]) -> [f64; 6] {
        without_rest(twist, (self.matrix * Vector6::from(twist)).into())
    }

    /// Returns the way before a node that passes these components.
    fn selecting(&self, selects: impl Fn(usize) -> bool) -> Self {
        let selected = Matrix6::from_diagonal(&Vector6::from_fn(|i, _| f64::from(selects(i))));
        Self { matrix: self.matrix * selected, ..self.clone() }
    }

    /// Returns the way before a mount.
    fn turned(&self, Mount { node, pose }: &Mount) -> Self {
        let columns: [Vector6<f64>; 6] = std::array::from_fn(|i| adjoint(pose, &Twist(Vector6::ith(i, 1.0))).0);
        let (columns, before) = (Matrix6::from_columns(&columns), self.turn.as_ref().map(|turn| turn.matrix));
        let turn = Turn { node: node.clone(), matrix: before.unwrap_or_else(Matrix6::identity) * columns };
        Self { matrix: self.matrix * columns, turn: Some(turn), ..self.clone() }
    }

    /// Returns the components of the arm that a node behind it can move.
    fn moves(&self) -> [bool; 6] {
        std::array::from_fn(|i| self.matrix.row(i).iter().any(|entry| entry.abs() > REST))
    }

    /// Returns the way before a gate.
    fn gated(&self, flag: Option<&str>) -> Self {
        let mut passage = self.clone();
        passage.gates.extend(flag.map(str::to_owned));
        passage
    }

    /// Returns the way before a delay.
    fn delayed(&self, nodes: &Nodes<'_>, node: &OutlinedBlock) -> Self {
        let mut passage = self.clone();
        let (node, kind, shape) = (node.name.clone(), node.kind.text.clone(), Shape::Delay { time: nodes.period() });
        passage.delays.push(Filter { node, kind, delay_s: nodes.period(), shape });
        passage
    }

    /// Returns whether every gate and switch on the way is open, whatever the pad feels.
    fn is_open(&self, nodes: &Nodes<'_>) -> bool {
        self.sides.is_empty() && self.gates.iter().all(|gate| nodes.is_open(gate))
    }

    /// Returns whether every gate and switch on the way is open during a contact.
    fn is_open_in_contact(&self, nodes: &Nodes<'_>) -> bool {
        self.sides.is_empty() && self.gates.iter().all(|gate| nodes.is_open_in_contact(gate))
    }
}

/// Returns what the twist of a port is made of.
pub(crate) fn law(nodes: &Nodes<'_>, port: &str) -> Law {
    law_behind(nodes, port, &[])
}

/// Returns what the twist of a port is made of behind these mounts, which are in the order from the arm back.
pub(crate) fn law_behind(nodes: &Nodes<'_>, port: &str, mounts: &[Mount]) -> Law {
    let mut law = Law::default();
    let passage = mounts.iter().fold(Passage::default(), |passage, mount| passage.turned(mount));
    collect(nodes, port, &passage, &mut law, &mut Vec::new());
    law.features = merged(std::mem::take(&mut law.features));
    let alone = law.features.clone();
    for (i, feature) in law.features.iter_mut().enumerate() {
        let others = alone.iter().enumerate().filter(|(other, _)| *other != i).map(|(_, other)| other);
        feature.beside = others.filter(|other| feature.is_beside(nodes, other)).cloned().collect();
    }
    law
}

/// Adds the columns of features that reach the motion several times on the same way.
fn merged(features: Vec<Feature>) -> Vec<Feature> {
    let mut merged: Vec<Feature> = Vec::new();
    for feature in features {
        let is_copy = |other: &&mut Feature| other.id() == feature.id() && other.takes_the_way_of(&feature);
        match merged.iter_mut().find(is_copy) {
            Some(copy) => {
                copy.column.iter_mut().zip(feature.column).for_each(|(sum, entry)| *sum += entry);
                copy.way += feature.way;
            }
            None => merged.push(feature),
        }
    }
    merged
}

/// Adds what moves a twist. A port that leads back to a node of the path, through a `twist_delay`, adds nothing, and
/// neither does one behind a gate that is closed in this mode.
fn collect<'a>(nodes: &Nodes<'a>, port: &str, passage: &Passage, law: &mut Law, path: &mut Vec<&'a str>) {
    let Some(node) = nodes.writer(port).filter(|node| !path.contains(&&*node.name)) else { return };
    path.push(&node.name);
    let mut follow = |input: &str, passage: &Passage, law: &mut Law| {
        source(node, input).into_iter().for_each(|twist| collect(nodes, twist, passage, law, path));
    };
    if let Some(mount) = mount(nodes, node) {
        follow("twist", &passage.turned(&mount), law);
        path.pop();
        return;
    }
    match node.kind.text.as_str() {
        "twist_adder" => node.wires.iter().for_each(|wire| follow(&wire.name, passage, law)),
        "projector" => {
            let select: [f64; 6] =
                nodes.value(node, "select").and_then(|select| select.value.read()).unwrap_or_default();
            follow("twist", &passage.selecting(|i| select[i] != 0.0), law);
        }
        kind if PASSED.contains(&kind) => follow("twist", passage, law),
        "twist_switch" => switch(nodes, node, passage, law, path),
        "twist_gate" => {
            let flag = source(node, "gate");
            if flag.and_then(|flag| nodes.is_set(flag)) != Some(false) {
                follow("value", &passage.gated(flag), law);
            }
        }
        "twist_delay" => follow("value", &passage.delayed(nodes, node).gated(source(node, "gate")), law),
        "twist_source" => law.constants.extend(constant(nodes, node, passage)),
        "inverse_jacobian" => {
            let columns = nodes.values(node).filter_map(|(path, setting)| {
                Some((path.strip_prefix("columns.")?.to_owned(), passage.of(setting.value.read()?)))
            });
            law.features.extend(columns.map(|(name, column)| {
                let mut feature = feature(nodes, node, name, column);
                feature.gates.extend(passage.gates.iter().cloned());
                feature.filters.extend(passage.delays.iter().cloned());
                feature.sides.clone_from(&passage.sides);
                feature.turn.clone_from(&passage.turn);
                feature.way = passage.matrix;
                feature
            }));
        }
        kind => {
            let is_wired = |i: usize| kind != "compose_twist" || source(node, COMPONENTS[i]).is_some();
            let (port, passes) = (port.to_owned(), passage.selecting(is_wired).moves());
            law.guidance.push(Guidance { port, kind: kind.to_owned(), passes, is_open: passage.is_open(nodes) });
        }
    }
    path.pop();
}

/// Returns the projectors between a port and what moves the sensor.
///
/// It follows the same nodes as [`law`], with three differences: it passes gates that are closed in this mode, every
/// `adjoint` whatever its pose, and no `twist_delay`, which can close a loop.
pub(crate) fn projectors<'a>(nodes: &Nodes<'a>, port: &str) -> Vec<&'a OutlinedBlock> {
    let Some(node) = nodes.writer(port) else { return Vec::new() };
    let all = |inputs: &[&str]| -> Vec<&'a OutlinedBlock> {
        let ports = inputs.iter().filter_map(|input| source(node, input));
        ports.flat_map(|port| projectors(nodes, port)).collect()
    };
    match node.kind.text.as_str() {
        "twist_adder" => node.wires.iter().flat_map(|wire| projectors(nodes, &wire.source)).collect(),
        "twist_switch" => nodes.sides(node).flat_map(|side| projectors(nodes, side)).collect(),
        "twist_gate" => all(&["value"]),
        "projector" => [vec![node], all(&["twist"])].concat(),
        kind if kind == "adjoint" || PASSED.contains(&kind) => all(&["twist"]),
        _ => Vec::new(),
    }
}

/// Adds what moves the sides of a switch.
fn switch<'a>(nodes: &Nodes<'a>, node: &'a OutlinedBlock, passage: &Passage, law: &mut Law, path: &mut Vec<&'a str>) {
    let is_known = source(node, "select").is_some_and(|flag| nodes.is_set(flag).is_some());
    for (number, side) in nodes.sides(node).enumerate() {
        let mut passage = passage.clone();
        passage.sides.extend((!is_known).then(|| (node.name.clone(), number)));
        collect(nodes, side, &passage, law, path);
    }
}

/// Returns the constant motion of a node; `None` if it is zero, or if its gate is closed in this mode.
fn constant(nodes: &Nodes<'_>, node: &OutlinedBlock, passage: &Passage) -> Option<Constant> {
    let twist = passage.of(nodes.value(node, "twist").and_then(|twist| twist.value.read()).unwrap_or_default());
    let gate = source(node, "gate");
    if gate.and_then(|gate| nodes.is_set(gate)) == Some(false) {
        return None;
    }
    let is_open = passage.is_open(nodes) && gate.is_none_or(|gate| nodes.is_open(gate));
    let is_open_in_contact =
        passage.is_open_in_contact(nodes) && gate.is_none_or(|gate| nodes.is_open_in_contact(gate));
    let name = node.name.clone();
    twist.iter().any(|part| *part != 0.0).then_some(Constant { node: name, twist, is_open, is_open_in_contact })
}
