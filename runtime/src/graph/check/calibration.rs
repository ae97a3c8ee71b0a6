//! Checks that limits are in newtons, unless the bench allows raw readings.

use crate::graph::net::Net;
use crate::graph::plan::PlannedNode;
use crate::graph::syntax::ALLOW_UNCALIBRATED;
use crate::source::{Code, Diagnostics};

/// Reports nodes whose limits are in raw readings on a bench that does not allow it.
pub(crate) fn check(net: &Net<'_>, nodes: &[PlannedNode], diagnostics: &mut Diagnostics) {
    if net.flat.bench.as_ref().is_none_or(|bench| bench.allow_uncalibrated) {
        return;
    }
    for node in nodes.iter().filter(|node| node.is_uncalibrated) {
        let message = format!("`{}` limits raw readings, so nothing limits the force in newtons", node.name);
        let diagnostic = net.diagnostic_at(node.index, Code::Uncalibrated, message);
        let help = format!("calibrate the pad, or add to the top of the bench:\n{ALLOW_UNCALIBRATED} = true");
        diagnostics.push(diagnostic.help(help));
    }
}
