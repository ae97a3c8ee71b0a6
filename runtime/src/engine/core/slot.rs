//! A device in the engine: its samples, its commands and its link.

use crate::device::{Commands, Description, Linked, Live, Samples, Stepped};

/// A device with its exchange buffers.
pub(crate) struct DeviceSlot {
    pub(crate) name: String,
    pub(crate) place: String,
    pub(crate) description: Description,
    pub(crate) samples: Samples,
    pub(crate) commands: Commands,
    pub(crate) link: DeviceLink,
    /// Why the device failed, if it has.
    pub(crate) failed: Option<String>,
}

impl DeviceSlot {
    /// Whether its commands are zero, and a live device has got them.
    pub(crate) fn rests(&self) -> bool {
        self.link.live().is_none_or(Linked::rests) && self.commands.are_zero()
    }
}

/// How a device is linked to the engine.
pub(crate) enum DeviceLink {
    /// A device that the engine steps.
    Stepped(Box<dyn Stepped>),
    /// A live device that has not been started yet.
    Idle(Box<dyn Live>),
    /// A live device that runs on its own.
    Live(Linked),
    /// A device that has failed. The engine does not call it again.
    Gone,
}

impl DeviceLink {
    /// Returns the link to a live device that has started.
    pub(crate) const fn live(&self) -> Option<&Linked> {
        match self {
            Self::Live(linked) => Some(linked),
            _ => None,
        }
    }

    /// Returns the driver of a stepped device.
    pub(crate) fn stepped(&self) -> Option<&dyn Stepped> {
        match self {
            Self::Stepped(driver) => Some(&**driver),
            _ => None,
        }
    }
}
