//! Checks that generated motion ends.
//!
//! A generator without a gate moves the arm forever without a sample. It may run only in a mode that watches a signal,
//! or that bounds the time or the travel.

use std::collections::BTreeSet;

use super::contact::ContactPorts;
use super::endings::Endings;
use super::generators::Generators;
use crate::graph::net::Net;
use crate::graph::plan::PlannedMode;
use crate::graph::syntax::ModeBlock;
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, quoted};

/// Reports generated motion that nothing ends, in a mode or in a graph without modes.
///
/// What no task with modes contains counts as one mode.
pub(crate) fn check(
    net: &Net<'_>,
    contact: &ContactPorts,
    modes: &[PlannedMode],
    found: &Generators,
    diagnostics: &mut Diagnostics,
) {
    report_in_graph(net, &found.outside_modes(net), diagnostics);
    // An exit with a mistake may be the one that ends the motion.
    if net.flat.modes.iter().any(|mode| mode.has_any(diagnostics)) {
        return;
    }
    let generators: Vec<&[usize]> = (0..modes.len()).map(|mode| found.of(mode)).collect();
    let endings = Endings::new(net, contact, modes, &generators);
    let ended = endings.find_ended();
    let (cycling, mut reported) = (endings.find_cycling(), BTreeSet::new());
    for (i, block) in net.flat.modes.iter().enumerate().filter(|(i, _)| !generators[*i].is_empty()) {
        if !ended[i] {
            diagnostics.push(report_in_mode(net, generators[i], (block, &modes[i].name)));
        } else if let Some(cycle) = endings.find_cycle(i, &cycling).filter(|_| !reported.contains(&i)) {
            diagnostics.push(report_cycle(net, generators[i], &cycle));
            reported.extend(cycle);
        }
    }
}

/// Reports the generators of which no mode decides.
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
fn report_in_mode(net: &Net<'_>, generators: &[usize], (block, mode): (&ModeBlock, &str)) -> Diagnostic {
    let names = quoted(generators.iter().map(|node| &net.flat.nodes[*node].name));
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
    let modes = quoted(cycle.iter().map(|mode| net.flat.mode_name(*mode)));
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
