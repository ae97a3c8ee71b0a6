//! Checks that every required input has a wire.

use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Reports each required input without a wire.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    for (i, node) in net.flat.nodes.iter().enumerate() {
        let Some(spec) = net.spec(i) else { continue };
        let lacking = node.block.wires.lacking(spec.inputs.iter().map(|input| &*input.name));
        for input in spec.inputs.iter().filter(|input| input.need.must_be_wired) {
            if lacking.contains(&*input.name) {
                let (key, name) = (&node.block.key, &input.name);
                let message = format!("`{}` needs a wire to `in.{name}`, {}", key.name, input.kind.with_article());
                let port = net.find_candidate(node.scope, i, input);
                let help = format!("add `in.{name} = \"{}\"`", port.unwrap_or("node.port"));
                diagnostics.push(Diagnostic::new(Code::MissingInput, key.span.clone(), message).help(help));
            }
        }
    }
}
