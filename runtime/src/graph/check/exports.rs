//! Checks that every export of a part refers to a port.

use crate::graph::net::{Net, report};
use crate::source::Diagnostics;

/// Reports each broken export, even if this graph does not use it.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    for (scope, part) in net.flat.scopes.iter().enumerate() {
        for (_, word) in part.exports.iter() {
            report(net.resolve(scope, word), diagnostics);
        }
    }
}
