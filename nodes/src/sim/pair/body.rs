//! A rigid body that moves freely under gravity and the forces on it.
//!
//! Momentum p and angular momentum L about the centre of mass are the state: p' = F + m g and L' = M, with the angular
//! velocity R I^-1 R^T L. Semi-implicit Euler: both momenta first, then the pose with the new velocities, so that the
//! contact springs gain no energy. While nothing touches the body its course is the exact parabola. The rotation is the
//! exponential of the angular velocity, so the attitude stays a rotation.

use parry3d_f64::math::{Pose3, Rot3, Vec3};

use crate::sim::object::Object;
use crate::sim::shape::Geometry;
use crate::sim::wrench::Wrench;

/// Standard acceleration of gravity [m/s²].
pub const GRAVITY_M_PER_S2: f64 = 9.806_65;

/// A rigid body of uniform density, whose centre of mass is the origin of its frame.
pub struct Body {
    /// Its shape, pose and velocity in the cell.
    pub(super) object: Object,
    /// Mass [kg].
    pub(super) mass: f64,
    /// Moments of inertia about its axes [kg m²].
    inertia: Vec3,
    velocity: Vec3,
    /// Angular momentum in the cell [kg m²/s].
    angular_momentum: Vec3,
}

impl Body {
    /// Returns a body of a `mass` [kg] and moments of `inertia` about its axes [kg m²], at rest at a pose in the cell.
    #[must_use]
    pub fn new(shape: Geometry, softness: f64, [mass, x, y, z]: [f64; 4], pose: Pose3) -> Self {
        let object = Object::free(shape, softness, pose);
        let inertia = Vec3::new(x, y, z);
        Self { object, mass, inertia, velocity: Vec3::ZERO, angular_momentum: Vec3::ZERO }
    }

    /// Advances by `dt` [s] under a wrench about its centre, in the cell, and under gravity.
    pub fn step(&mut self, dt: f64, load: &Wrench) {
        let before = self.velocity;
        self.velocity += (load.force / self.mass - Vec3::Z * GRAVITY_M_PER_S2) * dt;
        let is_in_flight = load.force == Vec3::ZERO;
        let travel = if is_in_flight { (before + self.velocity) / 2.0 } else { self.velocity };
        self.angular_momentum += load.moment * dt;
        let pose = self.object.pose;
        let turn = turn_by(self.spin_at(pose.rotation) * dt);
        let rotation = (turn * pose.rotation).normalize();
        let pose = Pose3::from_parts(pose.translation + travel * dt, rotation);
        self.object.place(pose, self.velocity, self.spin_at(rotation));
    }

    /// Returns the angular velocity in the cell at an attitude [rad/s].
    fn spin_at(&self, rotation: Rot3) -> Vec3 {
        rotation * (rotation.inverse() * self.angular_momentum / self.inertia)
    }

    /// Returns the angle between its own z and the vertical [rad].
    #[must_use]
    pub fn tilt(&self) -> f64 {
        libm::acos((self.object.pose.rotation * Vec3::Z).z.clamp(-1.0, 1.0))
    }

    /// Returns its kinetic energy, and its potential energy above z = 0 [J].
    #[cfg(test)]
    pub(super) fn energy(&self) -> f64 {
        let turning = self.object.spin().dot(self.angular_momentum);
        let moving = self.mass * self.velocity.length_squared();
        (moving + turning) / 2.0 + self.mass * GRAVITY_M_PER_S2 * self.object.pose.translation.z
    }
}

/// Returns the rotation about a vector by its length [rad].
fn turn_by(vector: Vec3) -> Rot3 {
    let angle = vector.length();
    let (sin, cos) = libm::sincos(angle / 2.0);
    let part = if angle > 0.0 { sin / angle } else { 0.5 };
    Rot3::from_xyzw(vector.x * part, vector.y * part, vector.z * part, cos)
}
