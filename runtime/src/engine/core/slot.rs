//! A device in its place: what it is handed, what it hands over, and how it is linked.

use crate::device::{Commands, Linked, Live, Samples, Stepped};

/// A device with what it is handed and what it hands over.
pub(crate) struct DeviceSlot {
    pub(crate) name: String,
    pub(crate) place: String,
    pub(crate) samples: Samples,
    pub(crate) commands: Commands,
    pub(crate) link: Link,
    /// Why it failed, if it did.
    pub(crate) failed: Option<String>,
}

/// How a device is linked to the engine.
pub(crate) enum Link {
    Stepped(Box<dyn Stepped>),
    /// A live device that has not been started yet.
    Idle(Box<dyn Live>),
    Live(Linked),
    /// A device that failed: it is not touched again.
    Gone,
}
