//! From a twist to joint velocities (paper section IV, eq. 4): kinematics from a robot's model, and the sink.

pub mod chain;
pub mod model;
pub mod mount;
