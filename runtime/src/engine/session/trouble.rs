//! What can go wrong in a tick.

use std::ops::Range;

use crate::engine::core::Aged;
use crate::graph::Policy;

/// A wire whose age does more than that its node goes without.
pub(crate) struct WatchedWire {
    pub(crate) aged: Aged,
    pub(crate) stale: Policy,
    /// The node it comes to; or the role, with the command.
    pub(crate) node: String,
    pub(crate) port: Option<String>,
    /// Where it is written.
    pub(crate) span: Range<usize>,
}

/// A trouble of a tick, in numbers: it is put into words only when it has to be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Trouble {
    /// The newest sample of an inlet is too old.
    Stale(usize),
    /// What came over a watched wire is too old.
    StaleWire(usize),
    /// A sample of an inlet is not finite.
    NotFinite(usize),
    /// A port is not finite.
    NotFiniteAt(usize),
    /// A runner panicked, or waits for its reset.
    Panicked(usize),
    /// A device has failed.
    Device(usize),
    /// The device of an inlet has lost its port.
    Lost(usize),
    /// The clock device is silent.
    Clock,
    /// The tick began so late [ns].
    Late(i64),
    /// The operator wanted it.
    Operator,
}

/// The message of a panic.
pub(crate) fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
