//! The table on which the object rests: a horizontal plane with a normal spring and dry friction at each point that
//! touches it.
//!
//! A box touches it with its corners, and a ball with its lowest point. Each point has a spring and a damper along z,
//! and a bristle in the plane. They are so stiff that the object sinks in by 0.1 mm under its own weight.

use parry3d_f64::math::{Vec2, Vec3};

use super::body::{Body, GRAVITY_M_PER_S2};
use crate::sim::bristle::BristleShear;
use crate::sim::shape::Geometry;
use crate::sim::wrench::Wrench;

/// Depth to which the object sinks into the table under its own weight [m].
pub const SAG_M: f64 = 1e-4;
/// Damping of the object on the table, as a fraction of the critical one [1].
const DAMPING: f64 = 0.2;

/// A table, and the state of its contact with one object.
pub struct Table {
    /// Height of its top in the cell [m].
    pub(super) height: f64,
    /// Coefficient of friction between table and object [1].
    friction: f64,
    /// Points of the object that can touch the table, in its own frame, or the radius of a ball [m].
    points: ContactPoints,
    /// Spring and damper of each point [N/m, N s/m].
    spring: [f64; 2],
    /// Friction bristle of each point.
    shear: Vec<BristleShear>,
    /// Normal force on the object as of the last step [N].
    pub(super) force: f64,
}

enum ContactPoints {
    Corners([Vec3; 8]),
    Ball(f64),
}

/// Returns stiffness and damping of an object on the table, divided by its mass [1/s², 1/s].
///
/// A box that rocks on its corners is the fastest: a corner carries up to three times as much of it as of a box that
/// bounces.
#[must_use]
pub fn rates() -> [f64; 2] {
    let rate = GRAVITY_M_PER_S2 / SAG_M;
    [3.0 * rate, 3.0 * 2.0 * DAMPING * rate.sqrt()]
}

impl Table {
    /// Returns a table of a `height` [m] and a coefficient of `friction` [1] under an object.
    #[must_use]
    pub fn new(height: f64, friction: f64, body: &Body) -> Self {
        let (points, below, count) = match &body.object.shape {
            Geometry::Box(shape) => {
                let half = shape.half_extents;
                let side = |bit: usize| if bit == 0 { -1.0 } else { 1.0 };
                let corner = |i: usize| half * Vec3::new(side(i & 1), side(i & 2), side(i & 4));
                (ContactPoints::Corners(std::array::from_fn(corner)), 4.0, 8)
            }
            Geometry::Ball(shape) => (ContactPoints::Ball(shape.radius), 1.0, 1),
            _ => unreachable!("a free object is a box or a ball"),
        };
        let rate = GRAVITY_M_PER_S2 / SAG_M;
        let spring = [body.mass * rate / below, 2.0 * DAMPING * body.mass * rate.sqrt() / below];
        Self { height, friction, points, spring, shear: vec![BristleShear::default(); count], force: 0.0 }
    }

    /// Returns the place of a point that can touch the table, in the cell.
    fn place(&self, point: usize, body: &Body) -> Vec3 {
        match &self.points {
            ContactPoints::Corners(corners) => body.object.pose.transform_point(corners[point]),
            ContactPoints::Ball(radius) => body.object.pose.translation - Vec3::Z * *radius,
        }
    }

    /// Advances by `dt` [s], and returns the wrench on the object about its centre.
    pub fn step(&mut self, dt: f64, body: &Body) -> Wrench {
        let mut wrench = Wrench::default();
        self.force = 0.0;
        for point in 0..self.shear.len() {
            let place = self.place(point, body);
            let depth = self.height - place.z;
            if depth <= 0.0 {
                self.shear[point] = BristleShear::default();
                continue;
            }
            let velocity = body.object.velocity_at(place);
            let [stiffness, damping] = self.spring;
            let normal = (stiffness * depth - damping * velocity.z).max(0.0);
            let slide: Vec2 = velocity.truncate();
            let friction = self.shear[point].rub(dt, slide, self.spring, self.friction * normal);
            wrench.push(place - body.object.pose.translation, friction.extend(normal));
            self.force += normal;
        }
        wrench
    }

    /// Returns the energy of its springs and bristles [J].
    #[cfg(test)]
    pub(super) fn energy(&self, body: &Body) -> f64 {
        let energy = |point: usize| {
            let depth = (self.height - self.place(point, body).z).max(0.0);
            self.spring[0] / 2.0 * depth * depth + self.shear[point].energy(self.spring[0])
        };
        (0..self.shear.len()).map(energy).sum()
    }
}
