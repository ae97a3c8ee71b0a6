//! Devices that the bench lets come back after they were lost.

use crate::device::{Description, Driver};
use crate::graph::syntax::Block;
use crate::source::{Code, Diagnostic};

/// Notes that a device may come back if its block says so. Returns the mistake of a device that cannot be lost.
pub(super) fn allow_return(block: &Block, driver: &Driver, description: &mut Description) -> Option<Diagnostic> {
    let word = block.reconnect.as_ref().filter(|word| word.value)?;
    description.may_return = true;
    if matches!(driver, Driver::Live(_) | Driver::Beside { .. }) {
        return None;
    }
    let message = format!("`{}` runs with the graph, so it cannot be lost and come back", block.key.name);
    let help = "remove `reconnect`: it is for devices that run by themselves";
    Some(Diagnostic::new(Code::BadValue, word.span.clone(), message).help(help))
}
