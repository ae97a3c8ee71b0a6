//! From features to a twist of the sensor (paper section IV).

pub mod adjoint;
pub mod arm_damping;
pub mod arm_spring;
pub mod compose_twist;
pub mod deadband;
pub mod edge_guard;
pub mod feature_error;
pub mod follow_path;
pub mod follow_surface;
pub mod gain_schedule;
pub mod guidance;
pub mod hold_pose;
pub mod integral;
pub mod inverse_jacobian;
pub mod park;
pub mod pid;
pub mod pivot;
pub mod placement;
pub mod projector;
pub mod ridge_guide;
pub mod scan_guide;
pub mod stiffness_estimate;
pub mod twist_adder;
pub mod twist_source;
