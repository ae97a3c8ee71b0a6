//! The device that docs/writing-a-device.md builds.

pub mod udp_pad;

use tactflow_runtime::catalogue::Catalogue;

/// The devices.
#[must_use]
pub fn catalogue() -> Catalogue {
    Catalogue::new().device::<udp_pad::UdpPad>()
}
