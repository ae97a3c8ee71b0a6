//! Checks that delayed inputs read from nodes.

use crate::graph::net::{Net, Wire};
use crate::source::{Code, Diagnostics};

/// Reports each delayed input that reads from a role, or from the mode of a task.
///
/// Both are updated before every node, so its value of the previous tick is gone when a node steps.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    for (node, wires) in net.wires.iter().enumerate() {
        let is_wrong = |wire: &&Wire| net.input(node, wire).need.is_delayed && wire.source.producer.node().is_none();
        for wire in wires.iter().filter(is_wrong) {
            let (name, key) = (&net.flat.nodes[node].name, &wire.key.name);
            let message = format!("`{name}.{key}` reads the value of the previous tick, which only a node keeps");
            diagnostics.push(wire.origin.diagnostic(Code::Loop, message).help("wire it to the output of a node"));
        }
    }
}
