//! Motion maths that several nodes share: plain functions on numbers and twists, without ports and without parameters.
//!
//! [`adjoint`] is a twist in another frame, [`bounds`] scales a motion until it is within bounds, [`braking`] is the speed
//! from which a stop is still possible, [`axis`] is the angle of a line, [`normal`] is the motion of a sensor along its z,
//! [`pose`] makes poses and rotation vectors, [`travel`] is the distance that a sensor has moved, and [`weight`] is the
//! wrench of a tool's weight. Steps on a straight line are in [`tactflow_runtime::signal::line`], since the engine takes
//! them too.

pub mod adjoint;
pub mod axis;
pub mod bounds;
pub mod braking;
pub mod normal;
pub mod pose;
pub mod travel;
pub mod weight;

/// The components of a twist, in their order.
pub const COMPONENTS: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];
