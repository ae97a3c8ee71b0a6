//! Checks that generated motion ends.
//!
//! A generator without a gate moves the arm forever without a sample. It may run only in a mode that watches a signal,
//! or that bounds the time or the travel.

use std::collections::BTreeSet;

use crate::graph::net::{Net, Wire};
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, Producer};
use crate::graph::syntax::{ExitKind, ModeBlock};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, quoted};

/// Reports generated motion that nothing ends, in a mode or in a graph without modes.
///
/// `still` holds for each mode which nodes generate no motion. A graph without modes counts as one mode.
pub(crate) fn check(net: &Net<'_>, modes: &[PlannedMode], still: &[Vec<bool>], diagnostics: &mut Diagnostics) {
    let commands = net.commands.iter().filter(|wire| !wire.is_report);
    let driving = net.upstream(commands.filter_map(|wire| wire.source.producer.node()));
    let generators: Vec<Vec<usize>> = still.iter().map(|still| find_generators(net, &driving, still)).collect();
    if modes.is_empty() {
        report_in_graph(net, &generators.concat(), diagnostics);
        return;
    }
    // An exit with a mistake may be the one that ends the motion.
    if net.flat.modes.iter().any(|mode| mode.has_any(diagnostics)) {
        return;
    }
    let ended = find_ended(modes, &generators, net);
    for (i, block) in net.flat.modes.iter().enumerate().filter(|(i, _)| !ended[*i]) {
        diagnostics.push(report_in_mode(net, &generators[i], block));
    }
}

/// Returns the nodes that start a motion of the arm without a sample.
///
/// `driving` are the nodes upstream of a command.
fn find_generators(net: &Net<'_>, driving: &BTreeSet<usize>, is_still: &[bool]) -> Vec<usize> {
    let (mut sampled, mut still) = (BTreeSet::new(), BTreeSet::new());
    // `moved` also contains the nodes that pass on a generated motion.
    let (mut generators, mut moved) = (Vec::new(), BTreeSet::new());
    for &node in &net.order {
        let Some(spec) = net.spec(node) else { continue };
        let wires = || net.wires[node].iter().filter(|wire| !spec.inputs[wire.input].need.is_delayed);
        let is_sampled = |wire: &Wire| wire.source.producer.node().is_none_or(|source| sampled.contains(&source));
        // A wire with a mistake may be the gate.
        let given = &net.flat.nodes[node].block.wires;
        let has_mistake = given.has_invalid() || given.valid.len() != net.wires[node].len();
        if has_mistake || wires().any(is_sampled) {
            sampled.insert(node);
            continue;
        }
        let sources: Vec<usize> = wires().filter_map(|wire| wire.source.producer.node()).collect();
        let all_still = !sources.is_empty() && sources.iter().all(|source| still.contains(source));
        let gives_motion = spec.outputs.iter().any(|port| matches!(port.kind, Kind::Twist | Kind::Joints));
        if is_still[node] || all_still {
            still.insert(node);
        } else if sources.iter().any(|source| moved.contains(source)) {
            moved.insert(node);
        } else if gives_motion && driving.contains(&node) {
            moved.insert(node);
            generators.push(node);
        }
    }
    generators
}

/// Returns for each mode whether it ends its generated motion.
///
/// A mode ends its motion if it generates none, or with a bound on time or travel that ends the run or leads to a mode
/// that ends its motion, or with `on_lost` on a sensor signal.
fn find_ended(modes: &[PlannedMode], generators: &[Vec<usize>], net: &Net<'_>) -> Vec<bool> {
    let mut ended: Vec<bool> = generators.iter().map(Vec::is_empty).collect();
    // Fixed point: modes that only lead to each other in a cycle stay false.
    loop {
        let is_end = |exit: &PlannedExit| {
            let is_bound = matches!(exit.condition, Condition::Elapsed(_) | Condition::Travel(..));
            match (exit.kind, &exit.condition) {
                (ExitKind::Fail | ExitKind::Done, _) => is_bound,
                (ExitKind::Go, _) => is_bound && exit.to.is_some_and(|to| ended[to]),
                (ExitKind::OnLost, Condition::Lost(watched, _)) => is_sensed(net, watched.source.producer),
                (ExitKind::OnLost, _) => false,
            }
        };
        let next: Vec<bool> = modes.iter().zip(&ended).map(|(mode, is)| *is || mode.exits.iter().any(is_end)).collect();
        if next == ended {
            return ended;
        }
        ended = next;
    }
}

/// Returns whether a sensor is upstream of a producer: a device without commands, so not the arm.
fn is_sensed(net: &Net<'_>, producer: Producer) -> bool {
    let is_sensor = |producer: Producer| match producer {
        Producer::Role(role) => net.roles[role].is_some_and(|role| role.commands.is_empty()),
        Producer::Node(_) => false,
    };
    let upstream = net.upstream(producer.node());
    is_sensor(producer)
        || upstream.iter().any(|node| net.wires[*node].iter().any(|wire| is_sensor(wire.source.producer)))
}

/// Reports the generators of a graph without modes.
fn report_in_graph(net: &Net<'_>, generators: &[usize], diagnostics: &mut Diagnostics) {
    for node in generators {
        let key = &net.flat.nodes[*node].block.key;
        let name = &net.flat.nodes[*node].name;
        let message = format!("`{name}` moves the arm without a gate, and nothing ends the motion");
        let gate = find_gate(net, *node).map(|gate| format!("wire `{gate}` of `{name}`, or ")).unwrap_or_default();
        let help = format!("{gate}run it only in a mode that ends the motion, as with `fail = {{ after_ms = 10000 }}`");
        diagnostics.push(Diagnostic::new(Code::UngatedMotion, key.span.clone(), message).help(help));
    }
}

/// Reports the generators of a mode.
fn report_in_mode(net: &Net<'_>, generators: &[usize], block: &ModeBlock) -> Diagnostic {
    let names = quoted(generators.iter().map(|node| &net.flat.nodes[*node].name));
    let mode = &block.key.name;
    let message = format!("in mode `{mode}` the arm moves without a gate, and nothing ends the motion of {names}");
    let bound =
        "add a bound such as `fail = { after_ms = 10000, after_travel_mm = 60 }`, or `on_lost` with a sensor signal";
    let gate = generators.iter().find_map(|node| find_gate(net, *node));
    let gate = gate.map(|gate| format!(", or wire `{gate}` of {names}")).unwrap_or_default();
    let targets =
        "a `go` with such a bound counts only if its target mode also ends the motion or does not move the arm";
    let diagnostic = Diagnostic::new(Code::UngatedMotion, block.key.span.clone(), message);
    diagnostic.help(format!("{bound}{gate}; {targets}"))
}

/// Returns an unwired flag input of a node, which can gate its motion.
fn find_gate(net: &Net<'_>, node: usize) -> Option<String> {
    let inputs = net.spec(node)?.inputs.iter().enumerate();
    let is_open = |input: usize| net.wires[node].iter().all(|wire| wire.input != input);
    let mut flags = inputs.filter(|(input, port)| port.kind == Kind::Flag && is_open(*input));
    flags.next().map(|(_, port)| format!("in.{}", port.name))
}
