//! Checks that generated motion ends.
//!
//! A generator without a gate moves the arm forever without a sample. It may run only in a mode that watches a signal,
//! or that bounds the time or the travel.

use std::collections::BTreeSet;

use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, Producer};
use crate::graph::syntax::{ExitKind, ModeBlock};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, quoted};

/// Reports generated motion that nothing ends, in a mode or in a graph without modes.
///
/// `still` holds which nodes generate no motion, and `changes` for each mode the nodes that differ in that.
pub(crate) fn check(
    net: &Net<'_>,
    modes: &[PlannedMode],
    still: &[bool],
    changes: &[BTreeSet<usize>],
    diagnostics: &mut Diagnostics,
) {
    let commands = net.commands.iter().filter(|wire| !wire.is_report);
    let driving = net.upstream(commands.filter_map(|wire| wire.source.producer.node()));
    let usual = find_generators(net, &driving, &|node| still[node]);
    if modes.is_empty() {
        report_in_graph(net, &usual, diagnostics);
        return;
    }
    let of_mode = |changes: &BTreeSet<usize>| {
        let is_still = |node: usize| still[node] != changes.contains(&node);
        (!changes.is_empty()).then(|| find_generators(net, &driving, &is_still))
    };
    let own: Vec<Option<Vec<usize>>> = changes.iter().map(of_mode).collect();
    let generators = |mode: usize| own[mode].as_ref().unwrap_or(&usual).as_slice();
    let ended = find_ended(modes, &generators, net);
    for (i, block) in net.flat.modes.iter().enumerate().filter(|(i, _)| !ended[*i]) {
        diagnostics.push(report_in_mode(net, generators(i), block));
    }
}

/// Returns the nodes that start a motion of the arm without a sample.
///
/// `driving` holds which nodes are upstream of a command.
fn find_generators(net: &Net<'_>, driving: &[bool], is_still: &dyn Fn(usize) -> bool) -> Vec<usize> {
    let nodes = net.wires.len();
    let (mut sampled, mut still) = (vec![false; nodes], vec![false; nodes]);
    // `moved` also contains the nodes that pass on a generated motion.
    let (mut generators, mut moved) = (Vec::new(), vec![false; nodes]);
    for &node in &net.order {
        let Some(spec) = net.spec(node) else { continue };
        let wires = || net.wires[node].iter().filter(|wire| !spec.inputs[wire.input].need.is_delayed);
        if wires().any(|wire| wire.source.producer.node().is_none_or(|source| sampled[source])) {
            sampled[node] = true;
            continue;
        }
        let sources: Vec<usize> = wires().filter_map(|wire| wire.source.producer.node()).collect();
        let all_still = !sources.is_empty() && sources.iter().all(|source| still[*source]);
        let gives_motion = spec.outputs.iter().any(|port| matches!(port.kind, Kind::Twist | Kind::Joints));
        if is_still(node) || all_still {
            still[node] = true;
        } else if sources.iter().any(|source| moved[*source]) {
            moved[node] = true;
        } else if gives_motion && driving[node] {
            moved[node] = true;
            generators.push(node);
        }
    }
    generators
}

/// Returns for each mode whether it ends its generated motion.
///
/// A mode ends its motion if it generates none, or with a bound on time or travel that ends the run or leads to a mode
/// that ends its motion, or with `on_lost` on a sensor signal.
fn find_ended<'g>(modes: &[PlannedMode], generators: &dyn Fn(usize) -> &'g [usize], net: &Net<'_>) -> Vec<bool> {
    let is_bound = |exit: &PlannedExit| matches!(exit.condition, Condition::Elapsed(_) | Condition::Travel(..));
    let sensed = find_sensed(net);
    let is_end = |exit: &PlannedExit| match (exit.kind, &exit.condition) {
        (ExitKind::Fail | ExitKind::Done, _) => is_bound(exit),
        (ExitKind::OnLost, Condition::Lost(watched, _)) => match watched.source.producer {
            Producer::Role(role) => is_sensor(net, role),
            Producer::Node(node) => sensed[node],
        },
        (ExitKind::OnLost | ExitKind::Go, _) => false,
    };
    // The modes that lead to each mode with a bound.
    let mut before = vec![Vec::new(); modes.len()];
    for (i, mode) in modes.iter().enumerate() {
        let targets = mode.exits.iter().filter(|exit| exit.kind == ExitKind::Go && is_bound(exit));
        targets.filter_map(|exit| exit.to).for_each(|to| before[to].push(i));
    }
    let ends = |i: usize, mode: &PlannedMode| generators(i).is_empty() || mode.exits.iter().any(is_end);
    let mut open: Vec<usize> = (0..modes.len()).filter(|i| ends(*i, &modes[*i])).collect();
    // Modes that only lead to each other in a cycle stay false.
    let mut ended = vec![false; modes.len()];
    while let Some(mode) = open.pop() {
        if !std::mem::replace(&mut ended[mode], true) {
            open.append(&mut before[mode]);
        }
    }
    ended
}

/// Returns whether a role is a sensor: a device without commands, so not the arm.
fn is_sensor(net: &Net<'_>, role: usize) -> bool {
    net.roles[role].is_some_and(|role| role.commands.is_empty())
}

/// Returns for each node whether a sensor is upstream of it.
fn find_sensed(net: &Net<'_>) -> Vec<bool> {
    let mut readers = vec![Vec::new(); net.wires.len()];
    let mut open = Vec::new();
    for (node, wires) in net.wires.iter().enumerate() {
        for wire in wires {
            match wire.source.producer {
                Producer::Node(source) => readers[source].push(node),
                Producer::Role(role) if is_sensor(net, role) => open.push(node),
                Producer::Role(_) => {}
            }
        }
    }
    let mut sensed = vec![false; net.wires.len()];
    while let Some(node) = open.pop() {
        if !std::mem::replace(&mut sensed[node], true) {
            open.append(&mut readers[node]);
        }
    }
    sensed
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
