//! The variables of RTDE: their names, types and values.

use super::JOINTS;

/// What the robot knows at one time.
pub(super) struct Values {
    /// Time since the controller started [s].
    pub(super) timestamp: f64,
    /// Joint positions [rad].
    pub(super) actual_q: [f64; JOINTS],
    /// Joint velocities [rad/s].
    pub(super) actual_qd: [f64; JOINTS],
    /// Joint positions that the controller commands [rad].
    pub(super) target_q: [f64; JOINTS],
    /// Joint velocities that the controller commands [rad/s].
    pub(super) target_qd: [f64; JOINTS],
    /// Position [m] and rotation vector [rad] of the tool in the base.
    pub(super) tcp_pose: [f64; 6],
    /// Force [N] and torque [N m] at the tool, in the axes of the base.
    pub(super) tcp_force: [f64; 6],
    /// Safety mode; 1 is normal.
    pub(super) safety_mode: i32,
    /// State of the program; 2 is playing.
    pub(super) runtime_state: u32,
}

/// The value of a variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Field {
    Double(f64),
    Six([f64; 6]),
    Three([f64; 3]),
    Int(i32),
    Unsigned(u32),
    Long(u64),
}

impl Field {
    /// The name of its type on the wire.
    pub(super) fn type_name(self) -> &'static str {
        match self {
            Self::Double(_) => "DOUBLE",
            Self::Six(_) => "VECTOR6D",
            Self::Three(_) => "VECTOR3D",
            Self::Int(_) => "INT32",
            Self::Unsigned(_) => "UINT32",
            Self::Long(_) => "UINT64",
        }
    }

    /// Appends its bytes, big-endian.
    pub(super) fn write(self, out: &mut Vec<u8>) {
        let doubles = |out: &mut Vec<u8>, list: &[f64]| out.extend(list.iter().flat_map(|value| value.to_be_bytes()));
        match self {
            Self::Double(value) => doubles(out, &[value]),
            Self::Six(list) => doubles(out, &list),
            Self::Three(list) => doubles(out, &list),
            Self::Int(value) => out.extend(value.to_be_bytes()),
            Self::Unsigned(value) => out.extend(value.to_be_bytes()),
            Self::Long(value) => out.extend(value.to_be_bytes()),
        }
    }
}

impl Values {
    /// Returns the value of a variable, or `None` if there is no such variable.
    pub(super) fn get(&self, name: &str) -> Option<Field> {
        Some(match name {
            "timestamp" => Field::Double(self.timestamp),
            "actual_q" => Field::Six(self.actual_q),
            "actual_qd" => Field::Six(self.actual_qd),
            "target_q" => Field::Six(self.target_q),
            "target_qd" => Field::Six(self.target_qd),
            "actual_TCP_pose" | "target_TCP_pose" => Field::Six(self.tcp_pose),
            "actual_TCP_force" => Field::Six(self.tcp_force),
            "actual_TCP_speed" | "target_TCP_speed" | "tcp_offset" | "actual_current" | "target_current"
            | "target_moment" | "target_qdd" | "ft_raw_wrench" => Field::Six([0.0; 6]),
            "joint_temperatures" => Field::Six([30.0; 6]),
            "payload_cog" | "actual_tool_accelerometer" => Field::Three([0.0; 3]),
            "safety_mode" | "safety_status" => Field::Int(self.safety_mode),
            // Running.
            "robot_mode" => Field::Int(7),
            "runtime_state" => Field::Unsigned(self.runtime_state),
            "robot_status_bits" => Field::Unsigned(if self.runtime_state == 2 { 0b11 } else { 0b01 }),
            "safety_status_bits" => Field::Unsigned(if self.safety_mode == 1 { 1 } else { 1 << 2 }),
            "speed_scaling" | "target_speed_fraction" => Field::Double(1.0),
            "payload" | "actual_momentum" => Field::Double(0.0),
            "actual_digital_input_bits" | "actual_digital_output_bits" => Field::Long(0),
            _ => return None,
        })
    }
}
