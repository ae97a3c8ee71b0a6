//! The device that docs/writing-a-device.md builds, and a motor.

pub mod udp_motor;
pub mod udp_pad;

use tactflow_runtime::catalogue::Catalogue;

/// The devices.
#[must_use]
pub fn catalogue() -> Catalogue {
    Catalogue::new().role(udp_motor::role()).device::<udp_pad::UdpPad>().device::<udp_motor::UdpMotor>()
}
