//! From a twist to joint velocities (paper section IV, eq. 4): kinematics from a robot's model, and the sink.

pub mod arm_state;
pub mod capsule;
pub mod chain;
pub mod compose_poses;
pub mod contact_point;
pub mod damped;
#[cfg(test)]
mod ik_cases;
pub mod ik_sink;
pub mod inverse_pose;
pub mod joint_limits;
mod joint_names;
pub mod least_lost;
pub mod model;
#[cfg(test)]
mod models;
pub mod mount;
pub mod null_space;
pub mod static_pose;
