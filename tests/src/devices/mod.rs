//! The device that docs/writing-a-device.md builds, and one that misbehaves.

pub mod blocking;
pub mod udp_pad;

use tactflow_runtime::catalogue::Catalogue;

/// The devices.
#[must_use]
pub fn catalogue() -> Catalogue {
    Catalogue::new().device::<blocking::Blocking>().device::<udp_pad::UdpPad>()
}
