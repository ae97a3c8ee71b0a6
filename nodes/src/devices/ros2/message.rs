//! The messages of ROS 2 that the devices exchange, with the fields in the order of their definitions.

use serde::{Deserialize, Serialize};

/// A type of message.
pub(super) trait Message: Serialize + for<'de> Deserialize<'de> + Send + 'static {
    /// Its name in ROS, such as `sensor_msgs/msg/JointState`.
    const TYPE: &'static str;
}

/// Returns the name of a type on the wire of DDS: `sensor_msgs::msg::dds_::JointState_`.
pub(super) fn dds_type(ros: &str) -> String {
    match ros.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => ros.to_owned(),
    }
}

/// Returns the name of a type as ROS writes it; one that is none of ROS as it is.
pub(super) fn ros_type(dds: &str) -> String {
    match dds.strip_suffix('_').and_then(|dds| dds.split_once("::dds_::")) {
        Some((package, name)) => format!("{}/{name}", package.replace("::", "/")),
        None => dds.to_owned(),
    }
}

/// `builtin_interfaces/msg/Time` and `builtin_interfaces/msg/Duration`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Time {
    pub(super) sec: i32,
    pub(super) nanosec: u32,
}

impl Time {
    /// A time or a duration [ns].
    pub(super) fn of_nanos(nanos: i64) -> Self {
        let (sec, nanosec) = (nanos.div_euclid(1_000_000_000), nanos.rem_euclid(1_000_000_000));
        Self { sec: i32::try_from(sec).unwrap_or(i32::MAX), nanosec: nanosec as u32 }
    }

    /// Returns it in nanoseconds.
    pub(super) fn nanos(self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }
}

/// `std_msgs/msg/Header`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Header {
    pub(super) stamp: Time,
    pub(super) frame_id: String,
}

/// `sensor_msgs/msg/JointState`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct JointState {
    pub(super) header: Header,
    pub(super) name: Vec<String>,
    pub(super) position: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) effort: Vec<f64>,
}

impl Message for JointState {
    const TYPE: &'static str = "sensor_msgs/msg/JointState";
}

/// `sensor_msgs/msg/Image`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Picture {
    pub(super) header: Header,
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) encoding: String,
    pub(super) is_bigendian: u8,
    pub(super) step: u32,
    pub(super) data: Vec<u8>,
}

impl Message for Picture {
    const TYPE: &'static str = "sensor_msgs/msg/Image";
}

/// `std_msgs/msg/MultiArrayDimension`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Dimension {
    pub(super) label: String,
    pub(super) size: u32,
    pub(super) stride: u32,
}

/// `std_msgs/msg/MultiArrayLayout`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Layout {
    pub(super) dim: Vec<Dimension>,
    pub(super) data_offset: u32,
}

/// `std_msgs/msg/Float32MultiArray`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Float32MultiArray {
    pub(super) layout: Layout,
    pub(super) data: Vec<f32>,
}

impl Message for Float32MultiArray {
    const TYPE: &'static str = "std_msgs/msg/Float32MultiArray";
}

/// `std_msgs/msg/Float64MultiArray`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Float64MultiArray {
    pub(super) layout: Layout,
    pub(super) data: Vec<f64>,
}

impl Message for Float64MultiArray {
    const TYPE: &'static str = "std_msgs/msg/Float64MultiArray";
}

/// `sensor_msgs/msg/ChannelFloat32`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Channel {
    pub(super) name: String,
    pub(super) values: Vec<f32>,
}

/// `tactile_msgs/msg/TactileState`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct TactileState {
    pub(super) header: Header,
    pub(super) sensors: Vec<Channel>,
}

impl Message for TactileState {
    const TYPE: &'static str = "tactile_msgs/msg/TactileState";
}

/// `geometry_msgs/msg/WrenchStamped`: force [N], and torque [N m].
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct WrenchStamped {
    pub(super) header: Header,
    pub(super) force: [f64; 3],
    pub(super) torque: [f64; 3],
}

impl Message for WrenchStamped {
    const TYPE: &'static str = "geometry_msgs/msg/WrenchStamped";
}

/// `geometry_msgs/msg/TwistStamped`: a linear velocity [m/s], and an angular velocity [rad/s].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct TwistStamped {
    pub(super) header: Header,
    pub(super) linear: [f64; 3],
    pub(super) angular: [f64; 3],
}

impl Message for TwistStamped {
    const TYPE: &'static str = "geometry_msgs/msg/TwistStamped";
}

/// `trajectory_msgs/msg/JointTrajectory`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct JointTrajectory {
    pub(super) header: Header,
    pub(super) joint_names: Vec<String>,
    pub(super) points: Vec<Point>,
}

impl Message for JointTrajectory {
    const TYPE: &'static str = "trajectory_msgs/msg/JointTrajectory";
}

/// `trajectory_msgs/msg/JointTrajectoryPoint`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Point {
    pub(super) positions: Vec<f64>,
    pub(super) velocities: Vec<f64>,
    pub(super) accelerations: Vec<f64>,
    pub(super) effort: Vec<f64>,
    pub(super) time_from_start: Time,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_types_are_those_of_the_wire() {
        assert_eq!(dds_type(JointState::TYPE), "sensor_msgs::msg::dds_::JointState_");
        assert_eq!(ros_type("std_msgs::msg::dds_::String_"), "std_msgs/msg/String");
        assert_eq!(ros_type("ShapeType"), "ShapeType");
    }

    #[test]
    fn times_are_seconds_and_nanoseconds() {
        for nanos in [0, 1, 1_500_000_000, -1, -1_500_000_000, 1_763_866_339_123_456_789] {
            let time = Time::of_nanos(nanos);
            assert!(time.nanosec < 1_000_000_000 && time.nanos() == nanos, "{nanos}: {time:?}");
        }
    }
}
