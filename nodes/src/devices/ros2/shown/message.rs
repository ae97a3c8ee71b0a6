//! The messages that only others read, with the fields in the order of their definitions.

use serde::{Deserialize, Serialize};

use crate::devices::ros2::message::{Header, Message};

/// `geometry_msgs/msg/PoseStamped`: a position [m], and a quaternion with w last.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct PoseStamped {
    pub(super) header: Header,
    pub(super) position: [f64; 3],
    pub(super) orientation: [f64; 4],
}

impl Message for PoseStamped {
    const TYPE: &'static str = "geometry_msgs/msg/PoseStamped";
}

/// `geometry_msgs/msg/TransformStamped`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct TransformStamped {
    pub(super) header: Header,
    pub(super) child_frame_id: String,
    pub(super) translation: [f64; 3],
    pub(super) rotation: [f64; 4],
}

/// `tf2_msgs/msg/TFMessage`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct TfMessage {
    pub(super) transforms: Vec<TransformStamped>,
}

impl Message for TfMessage {
    const TYPE: &'static str = "tf2_msgs/msg/TFMessage";
}

/// `diagnostic_msgs/msg/KeyValue`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct KeyValue {
    pub(super) key: String,
    pub(super) value: String,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`: its level is 0 if all is well, 1 for a warning, 2 for an error, and 3 if nothing
/// is known any more.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct DiagnosticStatus {
    pub(super) level: u8,
    pub(super) name: String,
    pub(super) message: String,
    pub(super) hardware_id: String,
    pub(super) values: Vec<KeyValue>,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct DiagnosticArray {
    pub(super) header: Header,
    pub(super) status: Vec<DiagnosticStatus>,
}

impl Message for DiagnosticArray {
    const TYPE: &'static str = "diagnostic_msgs/msg/DiagnosticArray";
}
