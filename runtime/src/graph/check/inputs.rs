//! Checks that every required input has a wire.

use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics, Edit};

/// Reports each required input without a wire.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    for (i, node) in net.flat.nodes.iter().enumerate() {
        let Some(spec) = net.spec(i) else { continue };
        let names = spec.inputs.iter().map(|input| &*input.name);
        let lacking = node.block.wires.lacking(names.clone());
        let required = spec.inputs.iter().filter(|input| input.need.must_be_wired).map(|input| &*input.name);
        let renamed = node.block.wires.only_lacks(names, required);
        for input in spec.inputs.iter().filter(|input| input.need.must_be_wired) {
            if lacking.contains(&*input.name) && renamed != Some(&*input.name) {
                let (key, name) = (&node.block.key, &input.name);
                let message = format!("`{}` needs a wire to `in.{name}`, {}", key.name, input.kind.with_article());
                let diagnostic = Diagnostic::new(Code::MissingInput, key.span.clone(), message);
                diagnostics.push(match net.find_candidate(node.scope, Some(i), input) {
                    Some(port) => {
                        let line = format!("in.{name} = \"{port}\"");
                        diagnostic.help(format!("add `{line}`")).edit(Edit::Below(key.span.clone(), line))
                    }
                    None => diagnostic.help(format!("wire {} to it", input.kind.with_article())),
                });
            }
        }
    }
}
