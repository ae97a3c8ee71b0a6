//! The device that docs/writing-a-device.md builds, a motor, and a device that misbehaves.

pub mod blocking;
pub mod udp_motor;
pub mod udp_pad;

use tactflow_runtime::catalogue::Catalogue;

/// The devices.
pub fn catalogue() -> Catalogue {
    Catalogue::new()
        .role(udp_motor::role())
        .device::<blocking::Blocking>()
        .device::<udp_motor::UdpMotor>()
        .device::<udp_pad::UdpPad>()
}
