//! Checks the quantities of all wires: a port that measures one quantity does not stand for another.
//!
//! Quantities go forward only, from outputs that declare one and through nodes that pass it on. So an input that must
//! know its quantity cannot be satisfied by a guess.

use std::collections::BTreeMap;

use crate::graph::net::{Net, Wire};
use crate::graph::plan::{PortRef, Producer};
use crate::node::{NodeSpec, PortSpec};
use crate::source::{Code, Diagnostic, Diagnostics};

/// The quantity that a port carries.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Quantity {
    name: String,
    /// The port that declares it.
    from: PortRef,
}

/// The known quantities of the ports.
type Quantities = BTreeMap<PortRef, Quantity>;

/// Reports each wire whose quantity is not that of its input, and each unknown quantity where it must be known.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    let known = propagate(net);
    // Behind a wire with a mistake, nothing is known yet.
    let is_connected = !diagnostics.iter().any(|diagnostic| diagnostic.code.hides_wires());
    for (node, wires) in net.wires.iter().enumerate() {
        let mut letters: BTreeMap<char, &Quantity> = BTreeMap::new();
        for wire in wires {
            let input = net.input(node, wire);
            let has = known.get(&wire.source);
            let takes = match expected(net, input, wire, has) {
                Some(Expected::Letter(letter)) => {
                    let Some(has) = has else { continue };
                    letters.entry(letter).or_insert(has).name.clone()
                }
                Some(Expected::Name(name)) => name,
                None => continue,
            };
            if has.map_or(input.need.must_be_known && is_connected, |has| has.name != takes) {
                diagnostics.push(mismatch(net, node, wire, has, &takes));
            }
        }
    }
    for wire in &net.commands {
        let (port, has) = (net.command_port(wire), known.get(&wire.source));
        let Some(takes) = port.quantity.as_deref() else { continue };
        if let Some(has) = has.filter(|has| has.name != takes) {
            let message = describe_mismatch(net, wire.source, has, &net.command_name(wire), takes);
            diagnostics.push(wire.origin.diagnostic(Code::QuantityMismatch, message));
        }
    }
}

/// What an input expects.
enum Expected {
    /// The same as the other inputs with this letter.
    Letter(char),
    Name(String),
}

/// Returns what an input expects, or `None` if it accepts any quantity.
fn expected(net: &Net<'_>, input: &PortSpec, wire: &Wire, has: Option<&Quantity>) -> Option<Expected> {
    Some(match input.quantity.as_deref()? {
        "$wire" => {
            Expected::Name(has.filter(|has| is_sibling(net, has.from, &wire.key.name)).map(|_| wire.key.name.clone())?)
        }
        text => letter(text).map_or_else(|| Expected::Name(text.to_owned()), Expected::Letter),
    })
}

/// Whether the node of a port outputs the quantity `name` too, so that the two can be confused.
fn is_sibling(net: &Net<'_>, port: PortRef, name: &str) -> bool {
    let mut outputs = net.outputs(port.producer).unwrap_or_default().iter();
    outputs.any(|other| other.quantity.as_deref() == Some(name) && other.kind == net.port(port).kind)
}

/// Returns the variable that a quantity is, or `None` if it is a name.
fn letter(text: &str) -> Option<char> {
    text.chars().next().filter(char::is_ascii_uppercase)
}

/// Returns the quantities of all ports: those that are declared, and those that nodes pass on.
fn propagate(net: &Net<'_>) -> Quantities {
    let mut known = Quantities::new();
    for role in 0..net.roles.len() {
        declare(net, Producer::Role(role), &BTreeMap::new(), &mut known);
    }
    // A delayed wire comes from a later node, so one pass may not be enough. Each pass adds a port or is the last.
    loop {
        let before = known.len();
        for &node in &net.order {
            let letters = net.spec(node).map(|spec| letters(net, spec, node, &known)).unwrap_or_default();
            declare(net, Producer::Node(node), &letters, &mut known);
        }
        if known.len() == before {
            return known;
        }
    }
}

/// Adds the quantities of the outputs of a producer.
fn declare(net: &Net<'_>, producer: Producer, letters: &BTreeMap<char, Quantity>, known: &mut Quantities) {
    for (port, output) in net.outputs(producer).unwrap_or_default().iter().enumerate() {
        let Some(text) = output.quantity.as_deref() else { continue };
        let from = PortRef { producer, port };
        let quantity = match letter(text) {
            Some(letter) => letters.get(&letter).cloned(),
            None => Some(Quantity { name: text.to_owned(), from }),
        };
        known.extend(quantity.map(|quantity| (from, quantity)));
    }
}

/// Returns the quantities of the letters of a node. If one wire of a letter is unknown, the letter is.
fn letters(net: &Net<'_>, spec: &NodeSpec, node: usize, known: &Quantities) -> BTreeMap<char, Quantity> {
    let mut letters: BTreeMap<char, Option<Quantity>> = BTreeMap::new();
    for wire in &net.wires[node] {
        let Some(letter) = spec.inputs[wire.input].quantity.as_deref().and_then(letter) else { continue };
        let has = known.get(&wire.source).cloned();
        let bound = letters.entry(letter).or_insert_with(|| has.clone());
        *bound = bound.take().filter(|_| has.is_some());
    }
    letters.into_iter().filter_map(|(letter, quantity)| Some((letter, quantity?))).collect()
}

fn mismatch(net: &Net<'_>, node: usize, wire: &Wire, has: Option<&Quantity>, takes: &str) -> Diagnostic {
    let consumer = format!("{}.{}", net.flat.nodes[node].name, wire.key.name);
    let message = match has {
        Some(has) => describe_mismatch(net, wire.source, has, &consumer, takes),
        None => format!(
            "`{consumer}` takes the quantity `{takes}`, but nothing proves that `{}` is one",
            net.port_name(wire.source)
        ),
    };
    let place = has.map(|has| net.place(has.from.producer));
    let diagnostic = wire.origin.diagnostic(Code::QuantityMismatch, message);
    let diagnostic = match place.filter(|_| has.is_some_and(|has| has.from != wire.source)) {
        Some(place) => {
            diagnostic.note(place, format!("its quantity `{}` comes from here", has.map_or("", |has| &has.name)))
        }
        None => diagnostic,
    };
    let fits = |port: &PortSpec| port.kind == net.port(wire.source).kind && port.quantity.as_deref() == Some(takes);
    let origin = has.map(|has| has.from.producer);
    let better =
        net.find_port(wire.origin.scope, |port| fits(net.port(port)) && origin.is_none_or(|at| port.producer == at));
    let better = better.or_else(|| net.find_port(wire.origin.scope, |port| fits(net.port(port))));
    match better {
        Some(better) => diagnostic.instead(&wire.origin.word.value, better),
        None => diagnostic,
    }
}

fn describe_mismatch(net: &Net<'_>, source: PortRef, has: &Quantity, consumer: &str, takes: &str) -> String {
    format!("`{}` is the quantity `{}`, but `{consumer}` takes `{takes}`", net.port_name(source), has.name)
}
