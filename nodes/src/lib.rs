//! The catalogue of tactflow: one node per file, the devices, and the roles they fill.
//!
//! [`touch`] turns a tactile image into features, [`servo`] turns features into a twist of the sensor, [`arm`] turns
//! the twist into joint velocities; [`devices`] are the edge.

pub mod arm;
pub mod devices;
pub mod roles;
pub mod servo;
pub mod touch;

use tactflow_runtime::catalogue::Catalogue;

/// Everything there is: one line each.
#[must_use]
pub fn catalogue() -> Catalogue {
    Catalogue::new()
        .role(roles::tactile_pad())
        .role(roles::velocity_arm())
        .node::<servo::projector::Projector>()
        .node::<arm::arm_state::ArmState>()
        .node::<arm::ik_sink::IkSink>()
        .device::<devices::mock_arm::MockArm>()
        .device::<devices::mock_pad::MockPad>()
        .device::<devices::tekscan::TekscanMovie>()
}
