//! What a task asks of the world.

use std::borrow::Cow;

use tactflow_runtime::device::RoleType;
use tactflow_runtime::node::PortSpec;
use tactflow_runtime::signal::Kind;

/// An array of tactels.
pub fn tactile_pad() -> RoleType {
    RoleType {
        name: "tactile_pad".into(),
        summary: "an array of tactels that outputs an image".into(),
        outputs: vec![pad_image()],
        filled_as: Some("three_axis_pad".into()),
        ..RoleType::default()
    }
}

/// An array of tactels that feel how the object drags them, beside how it presses them. It has the image of a
/// [`tactile_pad`], so each task for such a pad runs on it too.
pub fn three_axis_pad() -> RoleType {
    RoleType {
        name: "three_axis_pad".into(),
        summary: "an array of tactels with three axes that outputs an image and a vector image".into(),
        outputs: vec![
            pad_image(),
            PortSpec::new("vectors", VECTORS, Kind::VectorImage, &["V", "self"]).of_quantity("three_axis_image"),
        ],
        ..RoleType::default()
    }
}

fn pad_image() -> PortSpec {
    PortSpec::new("image", "The newest image, in the device's unit.", Kind::Image, &["U", "self"])
        .of_quantity("tactile_image")
}

const VECTORS: &str = "The newest vector image, of the same frame as the image, in the device's unit.";

/// An arm that takes joint velocities.
pub fn velocity_arm() -> RoleType {
    RoleType {
        name: "velocity_arm".into(),
        summary: "an arm that is commanded with joint velocities".into(),
        outputs: vec![
            PortSpec::new("position", "Measured joint positions [rad].", Kind::Joints, &["rad", "self"])
                .of_quantity("position"),
            PortSpec::new("equilibrium", EQUILIBRIUM, Kind::Joints, &["rad", "self"]).of_quantity("equilibrium"),
            PortSpec::new("safety", SAFETY, Kind::Flag, &[]).optional(),
        ],
        commands: vec![PortSpec::new("velocity", "Joint velocities [rad/s].", Kind::Joints, &["rad/s", "self"])],
        reports: vec![PortSpec::new("contact", CONTACT, Kind::Pose, &["C", "self.base"])],
        limits: LIMITS.map(Cow::Borrowed).into(),
        ..RoleType::default()
    }
}

/// An arm without a pad, which takes joint velocities. It has the ports of a [`velocity_arm`], so each device that fills
/// that role fills this one.
pub fn bare_arm() -> RoleType {
    let arm = velocity_arm();
    RoleType {
        name: "bare_arm".into(),
        summary: "an arm without a pad that is commanded with joint velocities".into(),
        filled_as: Some(arm.name),
        limits: arm.limits.into_iter().filter(|limit| !OF_PADS.contains(&&**limit)).collect(),
        ..velocity_arm()
    }
}

/// A sensor of the force and the torque on the tool of an arm.
pub fn force_sensor() -> RoleType {
    let force = |name, doc| PortSpec::new(name, doc, Kind::Scalar, &["N", "self"]);
    let torque = |name, doc| PortSpec::new(name, doc, Kind::Scalar, &["N m", "self"]);
    RoleType {
        name: "force_sensor".into(),
        summary: "a sensor of the force and the torque on the tool of an arm".into(),
        outputs: vec![
            PortSpec::new("wrench", WRENCH, Kind::Features, &["_", "self"]).of_quantity("wrench"),
            force("fx", "Force along x of the tip [N]."),
            force("fy", "Force along y of the tip [N]."),
            force("fz", "Force along z of the tip [N]."),
            torque("tx", "Torque about x of the tip [N m]."),
            torque("ty", "Torque about y of the tip [N m]."),
            torque("tz", "Torque about z of the tip [N m]."),
        ],
        arm_limits: vec!["wrench".into()],
        joined_as: Some("force".into()),
        ..RoleType::default()
    }
}

/// Somebody who guides an arm by a velocity: a person with a joystick, or a planner.
///
/// Its output is no twist, so that no wire leads from it to an arm without a node that bounds it.
pub fn motion_guide() -> RoleType {
    RoleType {
        name: "motion_guide".into(),
        summary: "a velocity by which somebody guides an arm".into(),
        outputs: vec![PortSpec::new("velocity", GUIDED, Kind::Features, &["_", "self"]).of_quantity("guidance")],
        ..RoleType::default()
    }
}

/// The limits that need a pad: a bare arm feels no contact, so nothing could enforce them.
const OF_PADS: [&str; 3] = ["force", "peak", "blind"];

const CONTACT: &str = "Pose of the contact in the base, as the task measures it [m].";

const SAFETY: &str = "Whether the controller follows commands: no stop is active, and its mode and its speed are those \
    that the bench allows.";

const EQUILIBRIUM: &str = "Posture that the commands add up to: where a compliant arm would be if nothing held it; \
    for a stiff arm, its position [rad].";

const WRENCH: &str = "The wrench that the environment exerts on the tool, about the origin of the tip and in its axes: \
    fx, fy, fz [N], tx, ty, tz [N m]. The other ports are its components.";

const GUIDED: &str =
    "The wanted velocity, in the frame in which the task uses it: vx, vy, vz [m/s], wx, wy, wz [rad/s].";

/// Facts of the contact that a simulation knows and no sensor measures: for scenarios and the recorder. A device that
/// fills it gives all of it, and says of what does not apply that it is absent.
pub fn ground_truth() -> RoleType {
    let scalar = |name, doc, unit: &[&'static str]| PortSpec::new(name, doc, Kind::Scalar, unit);
    RoleType {
        name: "ground_truth".into(),
        summary: "true values of the contact, which only a simulation knows".into(),
        outputs: vec![
            scalar("force", "Normal force on the pad [N].", &["N"]),
            scalar("tangential", "Tangential force on the pad [N].", &["N"]),
            scalar("peak", "Greatest force on one tactel [N].", &["N"]),
            scalar("x", "Centre of pressure in the sensor's frame; absent without contact [m].", &["m"]),
            scalar("y", "Centre of pressure in the sensor's frame; absent without contact [m].", &["m"]),
            scalar("pressure", PRESSURE, &["N/tactel"]),
            scalar("orientation", ORIENTATION, &["rad mod pi"]),
            scalar("area", "Area of the contact [m²].", &["m2"]),
            scalar("depth", "Largest depth to which the object is pressed into the foam [m].", &["m"]),
            PortSpec::new("image", "The image without noise, spread and drift [N].", Kind::Image, &["N", "self"]),
            scalar("tilt", TILT, &["rad"]),
            scalar("path", PATH, &["m"]),
            scalar("distance", DISTANCE, &["m"]),
            scalar("coverage", COVERAGE, &["1"]),
            scalar("common_noise", COMMON_NOISE, &["N/tactel"]),
            scalar("own_noise", OWN_NOISE, &["N/tactel"]),
        ],
        is_observed: true,
        ..RoleType::default()
    }
}

/// Facts of a free object that a simulation knows and no sensor measures: for scenarios and the recorder. A bench binds
/// it as `object`.
pub fn true_object() -> RoleType {
    let scalar = |name, doc, unit: &[&'static str]| PortSpec::new(name, doc, Kind::Scalar, unit);
    RoleType {
        name: "true_object".into(),
        summary: "true values of an object that two pads hold, which only a simulation knows".into(),
        outputs: vec![
            scalar("x", "Centre of the object along x of the cell [m].", &["m"]),
            scalar("y", "Centre of the object along y of the cell [m].", &["m"]),
            scalar("z", "Height of the centre of the object in the cell [m].", &["m"]),
            scalar("tilt", "Angle between the object's own z and the vertical [rad].", &["rad"]),
            PortSpec::new("held", HELD, Kind::Flag, &[]),
            scalar("squeeze", "Smaller one of the normal forces of both pads on the object [N].", &["N"]),
            scalar("left_force", "Normal force on the left pad [N].", &["N"]),
            scalar("right_force", "Normal force on the right pad [N].", &["N"]),
            scalar("left_tangential", "Friction force on the left pad, in its plane [N].", &["N"]),
            scalar("right_tangential", "Friction force on the right pad, in its plane [N].", &["N"]),
            scalar("table_force", "Normal force of the table on the object [N].", &["N"]),
        ],
        is_observed: true,
        ..RoleType::default()
    }
}

const HELD: &str = "Whether both pads press on the object and the table does not bear it.";
const PRESSURE: &str = "Mean force on the tactels in contact, of the image without noise; absent without contact \
    [N/tactel].";
const ORIENTATION: &str = "Angle of the edge, pen or cable in the sensor's frame, from +x toward +y, in (-pi/2, pi/2]; \
    absent if no such line is under the pad [rad].";
const TILT: &str = "Angle between the sensor's z and the object's inward normal at the contact; absent without contact \
    [rad].";
const PATH: &str = "Distance, in the sensor's plane, of the reported contact point from the object's axis, edge or course; \
    absent if it has none [m].";
const DISTANCE: &str = "Distance of the reported contact point from the object's surface; absent without a report [m].";
const COVERAGE: &str =
    "Fraction of the surface that faces the sensor at the start within 40° and is within 1 cm of a reported point [1].";
const COMMON_NOISE: &str = "Standard deviation of the pressure due to the noise that all tactels share; absent without contact \
    [N/tactel].";
const OWN_NOISE: &str =
    "Standard deviation of the pressure due to the own noise of each tactel; absent without contact [N/tactel].";

/// What every command of an arm must have crossed, in the order in which a motion does; `wrench` if a sensor of the
/// wrench is on the arm.
const LIMITS: [&str; 12] = [
    "bumpless",
    "force",
    "peak",
    "wrench",
    "workspace",
    "blind",
    "speed",
    "acceleration",
    "lead",
    "joint_position",
    "joint_speed",
    "joint_acceleration",
];
