//! The free object: its parameters, its mass properties, and the steps that it needs.

use parry3d_f64::math::{Pose3, Rot3, Vec3};
use parry3d_f64::shape::{Ball, Cuboid};
use tactflow_runtime::node::{Mistake, Mistakes, Param};

use super::body::Body;
use super::table::{SAG_M, rates};
use crate::sim::foam::{Foam, REFERENCE_AREA};
use crate::sim::shape::Geometry;
use crate::usual::{USUAL_RAD, USUAL_REACH_M};

/// Shape of a free object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub enum CarriedShape {
    /// A box with edges along the axes of the object.
    Box,
    /// A ball.
    Ball,
}

/// Parameters of the free object.
#[derive(Debug, Clone, Param)]
pub struct CarriedParams {
    /// Shape.
    pub(super) shape: CarriedShape,
    /// Edge lengths of a box; the third one is its height.
    #[param(unit = "m", usual = ..=USUAL_REACH_M)]
    pub(super) size: Option<[f64; 3]>,
    /// Radius of a ball.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_REACH_M)]
    pub(super) radius: Option<f64>,
    /// Mass, of uniform density.
    #[param(unit = "kg", above = 0.0)]
    pub(super) mass: f64,
    /// Where its centre is above the table at the start, along x and y of the cell.
    #[param(unit = "m", usual = -USUAL_REACH_M..=USUAL_REACH_M, default = [0.0; 2])]
    pub(super) at: [f64; 2],
    /// Angle about the vertical at the start, from x toward y of the cell.
    #[param(unit = "rad", usual = -USUAL_RAD..=USUAL_RAD, default = 0.0)]
    pub(super) turn: f64,
    /// Stiffness of its surface under a tactel of 5 mm by 5 mm; rigid if not given.
    #[param(unit = "N/m", above = 0.0)]
    pub(super) stiffness: Option<f64>,
    /// Largest random offset of its position along x and y of the cell; it depends on the seed.
    #[param(unit = "m", range = 0.0.., default = 0.0)]
    pub(super) scatter: f64,
}

/// Most steps of the object in a `step_s`.
pub const MAX_SUB_STEPS: f64 = 64.0;
/// Compression of the foam up to which the steps resolve it, as a fraction of its thickness [1].
const RESOLVED_COMPRESSION: f64 = 0.5;

impl CarriedParams {
    /// Returns the object at rest on a table of a `height`, shifted by `offset` along x and y of the cell [m].
    ///
    /// # Errors
    /// If a parameter of the shape is missing, not used or not positive.
    pub fn body(&self, height: f64, offset: [f64; 2]) -> Result<Body, Mistakes> {
        let (shape, half_height, inertia) = self.solid()?;
        let place = Vec3::new(self.at[0] + offset[0], self.at[1] + offset[1], height + half_height - SAG_M);
        let (sin, cos) = libm::sincos(self.turn / 2.0);
        let pose = Pose3::from_parts(place, Rot3::from_xyzw(0.0, 0.0, sin, cos));
        let [x, y, z] = inertia.map(|radius_squared| self.mass * radius_squared);
        Ok(Body::new(shape, self.stiffness.map_or(0.0, |stiffness| 1.0 / stiffness), [self.mass, x, y, z], pose))
    }

    /// Returns the shape, half of its height [m], and its moments of inertia divided by the mass [m²].
    fn solid(&self) -> Result<(Geometry, f64, [f64; 3]), Mistakes> {
        let refuse = |message: &str| Err(Mistake::param("object", message).into());
        match (self.shape, self.size, self.radius) {
            (CarriedShape::Box, Some(size), None) => {
                if !size.iter().all(|size| *size > 0.0) {
                    return Err(Mistake::param("object.size", "each `size` must be greater than 0").into());
                }
                let square = |axis: usize| size[axis] * size[axis] / 12.0;
                let inertia = [square(1) + square(2), square(0) + square(2), square(0) + square(1)];
                let half = Vec3::from(size) / 2.0;
                Ok((Geometry::Box(Cuboid::new(half)), half.z, inertia))
            }
            (CarriedShape::Ball, None, Some(radius)) => {
                Ok((Geometry::Ball(Ball::new(radius)), radius, [0.4 * radius * radius; 3]))
            }
            (CarriedShape::Box, None, _) => refuse("a box needs `size`"),
            (CarriedShape::Box, Some(_), Some(_)) => refuse("a box does not use `radius`: remove it"),
            (CarriedShape::Ball, _, None) => refuse("a ball needs `radius`"),
            (CarriedShape::Ball, Some(_), Some(_)) => refuse("a ball does not use `size`: remove it"),
        }
    }

    /// Returns the largest area of the object that a pad of `area` can touch [m²].
    fn area(&self, area: f64) -> f64 {
        let [x, y, z] = self.size.unwrap_or_default();
        let faces = [x * y, y * z, x * z].into_iter().fold(0.0, f64::max);
        let disc = std::f64::consts::PI * self.radius.unwrap_or_default().powi(2);
        area.min(faces + disc)
    }

    /// Returns the longest step that resolves the motion of the object between two pads of an `area` [m²] and on the
    /// table, and is a part of `step_s` [s].
    ///
    /// With stiffness k [1/s²] and damping c [1/s] per mass the bound is dt² k + 2 dt c = 2, as for
    /// [`is_resolved`](crate::sim::steps::is_resolved). Both pads press with all of the area, at half of the thickness.
    ///
    /// # Errors
    /// If `step_s` has more than [`MAX_SUB_STEPS`] such steps.
    pub fn step(&self, foam: &Foam, area: f64, step_s: f64) -> Result<f64, Mistakes> {
        let tactels = 2.0 * self.area(area) / REFERENCE_AREA;
        let [table, table_damping] = rates();
        let shear_damping = foam.shear * foam.damping / foam.stiffness;
        let k = tactels * foam.slope(RESOLVED_COMPRESSION * foam.thickness).max(foam.shear) / self.mass + table;
        let c = tactels * foam.damping.max(shear_damping) / self.mass + table_damping;
        // The positive root, written without a difference of large numbers.
        let longest = 2.0 / (c + (c * c + 2.0 * k).sqrt());
        let steps = (step_s / longest).ceil();
        if steps > MAX_SUB_STEPS {
            let message = format!(
                "an object of {} kg between these pads needs {steps} steps per `step_s`, and at most {MAX_SUB_STEPS} \
                 are simulated",
                self.mass
            );
            let mistake = Mistake::param("object.mass", message);
            return Err(mistake
                .help("make the object heavier or smaller, the foam softer, or `step_s` smaller")
                .into());
        }
        Ok(step_s / steps)
    }
}
