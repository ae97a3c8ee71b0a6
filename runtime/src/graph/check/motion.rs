//! Checks that generated motion ends.
//!
//! A generator without a gate moves the arm forever without a sample. It may run only in a mode that watches a signal,
//! or that bounds the time or the travel.

use std::collections::BTreeSet;

use super::contact::ContactPorts;
use super::endings::Endings;
use crate::graph::net::{Net, Wire};
use crate::graph::plan::PlannedMode;
use crate::graph::syntax::ModeBlock;
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
    let contact = ContactPorts::new(net);
    let usual = find_generators(net, &contact, &driving, &|node| still[node]);
    if modes.is_empty() {
        report_in_graph(net, &usual, diagnostics);
        return;
    }
    // An exit with a mistake may be the one that ends the motion.
    if net.flat.modes.iter().any(|mode| mode.has_any(diagnostics)) {
        return;
    }
    let of_mode = |changes: &BTreeSet<usize>| {
        let is_still = |node: usize| still[node] != changes.contains(&node);
        (!changes.is_empty()).then(|| find_generators(net, &contact, &driving, &is_still))
    };
    let own: Vec<Option<Vec<usize>>> = changes.iter().map(of_mode).collect();
    let generators: Vec<&[usize]> = own.iter().map(|own| own.as_ref().unwrap_or(&usual).as_slice()).collect();
    let endings = Endings::new(net, &contact, modes, &generators);
    let ended = endings.find_ended();
    let (cycling, mut reported) = (endings.find_cycling(), BTreeSet::new());
    for (i, block) in net.flat.modes.iter().enumerate().filter(|(i, _)| !generators[*i].is_empty()) {
        if !ended[i] {
            diagnostics.push(report_in_mode(net, generators[i], block));
        } else if let Some(cycle) = endings.find_cycle(i, &cycling).filter(|_| !reported.contains(&i)) {
            diagnostics.push(report_cycle(net, generators[i], &cycle));
            reported.extend(cycle);
        }
    }
}

/// Returns the nodes that start a motion of the arm without a sample.
///
/// `driving` holds which nodes are upstream of a command.
fn find_generators(
    net: &Net<'_>,
    contact: &ContactPorts,
    driving: &[bool],
    is_still: &dyn Fn(usize) -> bool,
) -> Vec<usize> {
    let nodes = net.wires.len();
    let (mut sampled, mut still) = (vec![false; nodes], vec![false; nodes]);
    // `moved` also contains the nodes that pass on a generated motion.
    let (mut generators, mut moved) = (Vec::new(), vec![false; nodes]);
    for &node in &net.order {
        let Some(spec) = net.spec(node) else { continue };
        let wires = || net.wires[node].iter().filter(|wire| !spec.inputs[wire.input].need.is_delayed);
        // A flag that nothing ties to a contact may be set forever, so it gates nothing.
        let is_gate = |wire: &Wire| net.port(wire.source).kind != Kind::Flag || contact.need(net, wire.source);
        let is_sampled =
            |wire: &Wire| is_gate(wire) && wire.source.producer.node().is_none_or(|source| sampled[source]);
        // A wire with a mistake may be the gate.
        let given = &net.flat.nodes[node].block.wires;
        let has_mistake = given.has_invalid() || given.valid.len() != net.wires[node].len();
        if has_mistake || wires().any(is_sampled) {
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

/// Reports modes that follow each other without a contact, so that the bound of none of them is reached.
fn report_cycle(net: &Net<'_>, generators: &[usize], cycle: &[usize]) -> Diagnostic {
    let blocks: Vec<&ModeBlock> = cycle.iter().map(|mode| &net.flat.modes[*mode]).collect();
    let modes = quoted(blocks.iter().map(|block| &block.key.name));
    let names = quoted(generators.iter().map(|node| &net.flat.nodes[*node].name));
    let way = match blocks.len() {
        1 => format!("mode {modes} can start again"),
        _ => format!("the modes {modes} can follow each other"),
    };
    let message = format!("{way} without a contact, and each start resets the bounds on the motion of {names}");
    let mut diagnostic = Diagnostic::new(Code::UngatedMotion, blocks[0].key.span.clone(), message);
    let others = blocks[1..].iter().map(|block| (block.key.span.clone(), "and this mode".to_owned()));
    diagnostic.notes.extend(others);
    diagnostic.help("let `fail = { after_ms = … }` come before the way back, or take that way only on a contact, as with `when = \"touch.present\"`")
}

/// Returns an unwired flag input of a node, which can gate its motion.
fn find_gate(net: &Net<'_>, node: usize) -> Option<String> {
    let inputs = net.spec(node)?.inputs.iter().enumerate();
    let is_open = |input: usize| net.wires[node].iter().all(|wire| wire.input != input);
    let mut flags = inputs.filter(|(input, port)| port.kind == Kind::Flag && is_open(*input));
    flags.next().map(|(_, port)| format!("in.{}", port.name))
}
