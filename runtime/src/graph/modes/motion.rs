//! Motion without contact: what moves the arm though no sample is behind it, and is ended by nothing.
//!
//! A generator without a gate goes on for ever. It may run in a mode that watches a signal or bounds its time or its
//! way, and nowhere else.

use std::collections::BTreeSet;

use super::super::order::Wiring;
use super::super::plan::Producer;
use super::super::wires::{Model, Wire};
use super::{Condition, ModeBlock, PlannedExit, PlannedMode, Sort};
use crate::diagnostic::{Code, Diagnostic};
use crate::signal::Kind;

/// What of a graph can move by itself.
pub(crate) struct Movers<'a> {
    model: &'a Model<'a>,
    wires: &'a [Vec<Wire>],
    order: &'a [usize],
    /// Nodes that a command follows from.
    driving: BTreeSet<usize>,
}

impl<'a> Movers<'a> {
    pub(crate) fn new(model: &'a Model<'a>, &Wiring { order, wires, commands }: &Wiring<'a>) -> Self {
        let mut open: Vec<usize> =
            commands.iter().filter(|wire| !wire.is_report).filter_map(|wire| node_of(wire.source.producer)).collect();
        let mut driving: BTreeSet<usize> = open.iter().copied().collect();
        while let Some(node) = open.pop() {
            let sources = wires[node].iter().filter_map(|wire| node_of(wire.source.producer));
            open.extend(sources.filter(|source| driving.insert(*source)).collect::<Vec<_>>());
        }
        Self { model, wires, order, driving }
    }

    /// The nodes that start a motion by themselves, given which nodes are still in a mode.
    pub(crate) fn of(&self, is_still: &dyn Fn(usize) -> bool) -> Vec<usize> {
        let (mut sampled, mut still) = (BTreeSet::new(), BTreeSet::new());
        // Those that start a motion, and all that only passes it on.
        let (mut movers, mut moved) = (Vec::new(), BTreeSet::new());
        for &node in self.order {
            let Some((_, spec)) = &self.model.nodes[node] else { continue };
            let wires = || self.wires[node].iter().filter(|wire| !spec.inputs[wire.input].need.is_delayed);
            let is_sampled = |wire: &Wire| node_of(wire.source.producer).is_none_or(|source| sampled.contains(&source));
            if wires().any(is_sampled) {
                sampled.insert(node);
                continue;
            }
            let sources: Vec<usize> = wires().filter_map(|wire| node_of(wire.source.producer)).collect();
            let all_still = !sources.is_empty() && sources.iter().all(|source| still.contains(source));
            let gives_motion = spec.outputs.iter().any(|port| matches!(port.kind, Kind::Twist | Kind::Joints));
            if is_still(node) || all_still {
                still.insert(node);
            } else if sources.iter().any(|source| moved.contains(source)) {
                moved.insert(node);
            } else if gives_motion && self.driving.contains(&node) {
                moved.insert(node);
                movers.push(node);
            }
        }
        movers
    }
}

const fn node_of(producer: Producer) -> Option<usize> {
    match producer {
        Producer::Node(node) => Some(node),
        Producer::Role(_) => None,
    }
}

/// Which modes end the motion that starts in them by itself: by a bound on time or way that ends the run or leads to a
/// mode that does not move by itself, at once or through others; or by the loss of a signal of a sensor.
pub(crate) fn ended(modes: &[PlannedMode], movers: &[Vec<usize>], model: &Model<'_>, wires: &[Vec<Wire>]) -> Vec<bool> {
    let mut ended: Vec<bool> = movers.iter().map(Vec::is_empty).collect();
    // Modes that only hand the motion on to each other in a circle are never reached.
    loop {
        let is_end = |exit: &PlannedExit| {
            let is_bound = matches!(exit.condition, Condition::Elapsed(_) | Condition::Travel(..));
            match (exit.sort, &exit.condition) {
                (Sort::Fail | Sort::Done, _) => is_bound,
                (Sort::Go, _) => is_bound && exit.to.is_some_and(|to| ended[to]),
                (Sort::OnLost, Condition::Lost(watched, _)) => senses(model, wires, watched.source.producer),
                (Sort::OnLost, _) => false,
            }
        };
        let next: Vec<bool> = modes.iter().zip(&ended).map(|(mode, is)| *is || mode.exits.iter().any(is_end)).collect();
        if next == ended {
            return ended;
        }
        ended = next;
    }
}

/// Whether something follows from a device that only gives: from a sensor, and not from the arm alone.
fn senses(model: &Model<'_>, wires: &[Vec<Wire>], producer: Producer) -> bool {
    let (mut open, mut seen) = (vec![producer], BTreeSet::new());
    while let Some(producer) = open.pop() {
        match producer {
            Producer::Role(role) if model.roles[role].is_some_and(|role| role.commands.is_empty()) => return true,
            Producer::Role(_) => {}
            Producer::Node(node) if seen.insert(node) => {
                open.extend(wires[node].iter().map(|wire| wire.source.producer))
            }
            Producer::Node(_) => {}
        }
    }
    false
}

/// Tells of motion that nothing ends: in a mode, or in a graph without modes.
pub(crate) fn ungated(model: &Model<'_>, movers: &[usize], mode: Option<&ModeBlock>, found: &mut Vec<Diagnostic>) {
    if movers.is_empty() {
        return;
    }
    let name = |node: &usize| format!("`{}`", model.flat.nodes[*node].name);
    if let Some(block) = mode {
        let names = movers.iter().map(name).collect::<Vec<_>>().join(", ");
        let mode = &block.key.name;
        let message = format!("in mode `{mode}` the arm is moved without a gate, and nothing ends it: by {names}");
        let bound = "add a bound, as `fail = { after_ms = 10000, after_travel_mm = 60 }`, or `on_lost` of a signal of \
                     the sensor";
        let diagnostic = Diagnostic::new(Code::UngatedMotion, block.key.span.clone(), message);
        let circle = "a `go` counts if it leads to a mode that stands still, or ends in one";
        found.push(diagnostic.help(format!("{bound}, or wire `in.gate` of {names}; {circle}")));
        return;
    }
    for node in movers {
        let (name, key) = (name(node), &model.flat.nodes[*node].block.key);
        let message = format!("{name} moves the arm without a gate, and nothing ends it");
        let help = format!("wire `in.gate` of {name}, or let it move only in a mode that ends");
        found.push(Diagnostic::new(Code::UngatedMotion, key.span.clone(), message).help(help));
    }
}
