//! What a task asks of the world.

use std::borrow::Cow;

use tactflow_runtime::device::RoleType;
use tactflow_runtime::node::{Need, PortSpec};
use tactflow_runtime::signal::Kind;

fn port(name: &'static str, doc: &'static str, kind: Kind, args: &'static [&'static str]) -> PortSpec {
    let args = args.iter().map(|arg| Cow::Borrowed(*arg)).collect();
    PortSpec { name: name.into(), doc: doc.into(), kind, args, need: Need::Required }
}

/// An array of tactels.
#[must_use]
pub fn tactile_pad() -> RoleType {
    RoleType {
        name: "tactile_pad".into(),
        summary: "an array of tactels that gives an image".into(),
        outputs: vec![port("image", "The newest image, in the device's unit.", Kind::Image, &["U", "self"])],
        commands: vec![],
        limits: vec![],
    }
}

/// An arm that takes joint velocities.
#[must_use]
pub fn velocity_arm() -> RoleType {
    RoleType {
        name: "velocity_arm".into(),
        summary: "an arm that takes joint velocities".into(),
        outputs: vec![
            port("position", "Measured joint positions [rad].", Kind::Joints, &["rad", "self"]),
            port("equilibrium", EQUILIBRIUM, Kind::Joints, &["rad", "self"]),
        ],
        commands: vec![port("velocity", "Joint velocities [rad/s].", Kind::Joints, &["rad/s", "self"])],
        limits: LIMITS.map(Cow::Borrowed).into(),
    }
}

const EQUILIBRIUM: &str = "Posture that the commands have moved to: where a compliant arm would be if nothing held it; \
    of a stiff arm its position [rad].";

/// What every command of an arm must have crossed, in the order in which a motion does.
const LIMITS: [&str; 10] = [
    "bumpless",
    "force",
    "peak",
    "workspace",
    "speed",
    "acceleration",
    "lead",
    "joint_position",
    "joint_speed",
    "joint_acceleration",
];
