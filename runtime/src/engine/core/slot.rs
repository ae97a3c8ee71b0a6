//! A device in the engine: its samples, its commands and its link.

use std::time::{Duration, Instant};

use crate::device::{Commands, Description, Linked, Live, Samples, Stepped};

/// A device with its exchange buffers.
pub(crate) struct DeviceSlot {
    pub(crate) name: String,
    pub(crate) place: String,
    pub(crate) description: Description,
    pub(crate) samples: Samples,
    pub(crate) commands: Commands,
    pub(crate) link: DeviceLink,
    /// Whether it computes beside the tick: in virtual time a tick waits for it, and in real time none does.
    pub(crate) is_beside: bool,
    /// Its driver in real time, until a run starts it.
    pub(crate) in_real_time: Option<Box<dyn Live>>,
    /// Why the device failed, if it has.
    pub(crate) failed: Option<String>,
    /// How long a driver that ends with an error waits before it is started again.
    pub(crate) pause: Duration,
    /// Number of writes in the samples when the driver was started.
    pub(crate) writes_at_start: u64,
    /// Whether its commands were set to zero between two ticks, because its driver has ended.
    pub(crate) has_rested: bool,
    /// Whether a replayed device loses its lease in this tick, and why it refused the commands, if it did.
    pub(crate) lease_lost: Option<Option<String>>,
    /// Why it refused the commands when it lost its lease last.
    pub(crate) refusal: Option<String>,
}

impl DeviceSlot {
    /// Shortest and longest time between the end of a driver and its next start.
    pub(crate) const FIRST_PAUSE: Duration = Duration::from_millis(50);
    const LONGEST_PAUSE: Duration = Duration::from_secs(2);

    /// Notes that the driver has ended with an error, and when the device is opened once more. The pause doubles up to
    /// two seconds, until a driver has written samples.
    pub(crate) fn goes_down(&mut self, why: &str) {
        let has_sampled = self.samples.writes != self.writes_at_start;
        let pause = if has_sampled { Self::FIRST_PAUSE } else { self.pause };
        self.pause = (2 * pause).min(Self::LONGEST_PAUSE);
        self.samples.lose_all(why);
        // The device has come to rest by itself, or does so now.
        self.commands.rest();
        self.has_rested = true;
        self.link = DeviceLink::Down(Instant::now() + pause);
    }

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
    /// A live device whose driver has ended with an error. It is opened once more at that time.
    Down(Instant),
    /// A device that has failed. The engine does not call it again.
    Gone,
    /// A device of a recording, and whether it was live. A replay writes its samples.
    Recorded { is_live: bool },
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
