//! Motion without contact: what moves the arm though no sample is behind it, and is ended by nothing.
//!
//! A generator without a gate goes on for ever. It may run in a mode that watches a signal or bounds its time or its
//! way, and nowhere else.

use std::collections::BTreeSet;

use crate::graph::net::{Net, Wire};
use crate::graph::plan::Producer;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode};
use crate::graph::syntax::{ModeBlock, Sort};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic};

/// What of a graph can move by itself.
pub(crate) struct Movers<'a> {
    net: &'a Net<'a>,
    /// Nodes that a command follows from.
    driving: BTreeSet<usize>,
}

impl<'a> Movers<'a> {
    pub(crate) fn new(net: &'a Net<'a>) -> Self {
        let commands = net.commands.iter().filter(|wire| !wire.is_report);
        Self { net, driving: net.upstream(commands.filter_map(|wire| wire.source.producer.node())) }
    }

    /// The nodes that start a motion by themselves, given which nodes are still in a mode.
    pub(crate) fn of(&self, is_still: &dyn Fn(usize) -> bool) -> Vec<usize> {
        let (mut sampled, mut still) = (BTreeSet::new(), BTreeSet::new());
        // Those that start a motion, and all that only passes it on.
        let (mut movers, mut moved) = (Vec::new(), BTreeSet::new());
        for &node in &self.net.order {
            let Some(spec) = self.net.spec(node) else { continue };
            let wires = || self.net.wires[node].iter().filter(|wire| !spec.inputs[wire.input].need.is_delayed);
            let is_sampled = |wire: &Wire| wire.source.producer.node().is_none_or(|source| sampled.contains(&source));
            if wires().any(is_sampled) {
                sampled.insert(node);
                continue;
            }
            let sources: Vec<usize> = wires().filter_map(|wire| wire.source.producer.node()).collect();
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

/// Which modes end the motion that starts in them by itself: by a bound on time or way that ends the run or leads to a
/// mode that does not move by itself, at once or through others; or by the loss of a signal of a sensor.
pub(crate) fn ended(modes: &[PlannedMode], movers: &[Vec<usize>], net: &Net<'_>) -> Vec<bool> {
    let mut ended: Vec<bool> = movers.iter().map(Vec::is_empty).collect();
    // Modes that only hand the motion on to each other in a cycle are never reached.
    loop {
        let is_end = |exit: &PlannedExit| {
            let is_bound = matches!(exit.condition, Condition::Elapsed(_) | Condition::Travel(..));
            match (exit.sort, &exit.condition) {
                (Sort::Fail | Sort::Done, _) => is_bound,
                (Sort::Go, _) => is_bound && exit.to.is_some_and(|to| ended[to]),
                (Sort::OnLost, Condition::Lost(watched, _)) => senses(net, watched.source.producer),
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
fn senses(net: &Net<'_>, producer: Producer) -> bool {
    let is_sensor = |producer: Producer| match producer {
        Producer::Role(role) => net.roles[role].is_some_and(|role| role.commands.is_empty()),
        Producer::Node(_) => false,
    };
    let upstream = net.upstream(producer.node());
    is_sensor(producer)
        || upstream.iter().any(|node| net.wires[*node].iter().any(|wire| is_sensor(wire.source.producer)))
}

/// Reports motion that nothing ends: in a mode, or in a graph without modes.
pub(crate) fn ungated(net: &Net<'_>, movers: &[usize], mode: Option<&ModeBlock>, found: &mut Vec<Diagnostic>) {
    if movers.is_empty() {
        return;
    }
    let name = |node: &usize| format!("`{}`", net.flat.nodes[*node].name);
    if let Some(block) = mode {
        let names = movers.iter().map(name).collect::<Vec<_>>().join(", ");
        let mode = &block.key.name;
        let message = format!("in mode `{mode}` the arm is moved without a gate, and nothing ends it: by {names}");
        let bound = "add a bound, as `fail = { after_ms = 10000, after_travel_mm = 60 }`, or `on_lost` of a signal of \
                     the sensor";
        let gate = movers.iter().find_map(|node| gate(net, *node)).map(|gate| format!(", or wire `{gate}` of {names}"));
        let cycle = "a `go` counts if it leads to a mode that stands still, or ends in one";
        let diagnostic = Diagnostic::new(Code::UngatedMotion, block.key.span.clone(), message);
        found.push(diagnostic.help(format!("{bound}{}; {cycle}", gate.unwrap_or_default())));
        return;
    }
    for node in movers {
        let (name, key) = (name(node), &net.flat.nodes[*node].block.key);
        let message = format!("{name} moves the arm without a gate, and nothing ends it");
        let gate = gate(net, *node).map(|gate| format!("wire `{gate}` of {name}, or ")).unwrap_or_default();
        let help = format!("{gate}let it move only in a mode that ends");
        found.push(Diagnostic::new(Code::UngatedMotion, key.span.clone(), message).help(help));
    }
}

/// The input of a node that can gate it: a flag that nothing is wired to.
fn gate(net: &Net<'_>, node: usize) -> Option<String> {
    let inputs = net.spec(node)?.inputs.iter().enumerate();
    let is_open = |input: usize| net.wires[node].iter().all(|wire| wire.input != input);
    let mut flags = inputs.filter(|(input, port)| port.kind == Kind::Flag && is_open(*input));
    flags.next().map(|(_, port)| format!("in.{}", port.name))
}
