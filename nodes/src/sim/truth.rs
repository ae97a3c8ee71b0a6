//! Quantities that a simulation knows and a sensor does not, for scenarios and recordings.

use parry3d_f64::math::{Vec2, Vec3};
use tactflow_runtime::signal::ImageShape;

use super::contact::{BodyMotion, Contact};
use super::object::Object;
use super::world::World;
use crate::motion::axis::wrap_axial;

/// The ground truth at one time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Truth {
    /// Force along the pad's z, positive when it is pressed [N].
    pub force: f64,
    /// Friction force in the plane of the pad [N].
    pub tangential: f64,
    /// Largest force on a tactel of the noise-free image [N].
    pub peak: f64,
    /// Centre of pressure [m]; `None` without contact.
    pub middle: Option<Vec2>,
    /// Mean force on the tactels above the threshold [N per tactel]; `None` without contact.
    pub pressure: Option<f64>,
    /// Number of those tactels.
    pub tactels: usize,
    /// Angle of the object's line from the pad's x toward its y [rad]; `None` if there is no line under the pad.
    pub orientation: Option<f64>,
    /// Area of compressed foam [m²].
    pub area: f64,
    /// Largest indentation [m].
    pub depth: f64,
    /// Angle between the pad's z and the inward normal of the object at the contact [rad]; `None` without contact.
    pub tilt: Option<f64>,
}

impl World {
    /// Returns the ground truth now; tactels count above `threshold` [N].
    pub fn truth(&mut self, threshold: f64) -> Truth {
        self.forces();
        let Self { contact, shape, imprint, .. } = &*self;
        let forces = &imprint.forces.normal;
        let force = contact.normal();
        let pressed = || forces.iter().filter(|cell| **cell > threshold);
        let tactels = pressed().count();
        let area = shape.pitch[0] * shape.pitch[1] / (contact.fine * contact.fine) as f64;
        Truth {
            force,
            tangential: contact.friction().length(),
            peak: forces.iter().fold(0.0, |peak: f64, cell| peak.max(*cell)),
            middle: middle(contact, force),
            pressure: (tactels > 0).then(|| pressed().sum::<f64>() / tactels as f64),
            tactels,
            orientation: orientation(&self.arm.motion(), &self.objects, shape),
            area: contact.touching.len() as f64 * area,
            depth: contact.touching.iter().fold(0.0, |depth: f64, touch| depth.max(touch.depth)),
            tilt: tilt(contact, force),
        }
    }
}

fn middle(contact: &Contact, force: f64) -> Option<Vec2> {
    let sum: Vec2 = contact.touching.iter().map(|touch| contact.place(touch.point) * touch.force).sum();
    (force > 0.0).then(|| sum / force)
}

/// Returns the angle of the nearest line that passes under the pad [rad].
fn orientation(pad: &BodyMotion, objects: &[Object], shape: &ImageShape) -> Option<f64> {
    let place = pad.pose.translation;
    let lines = objects.iter().filter_map(|object| {
        let line = object.shape.line(object.pose.inverse_transform_point(place))?;
        let along = pad.pose.rotation.inverse() * (object.pose.rotation * line.along);
        Some((pad.pose.inverse_transform_point(object.pose.transform_point(line.at)), along))
    });
    let (at, along) = lines.min_by(|(a, _), (b, _)| a.length().total_cmp(&b.length()))?;
    let half = shape.half();
    let is_under = at.x.abs() < half[0] && at.y.abs() < half[1];
    (is_under && along.truncate().length_squared() > 1e-6).then(|| wrap_axial(libm::atan2(along.y, along.x)))
}

fn tilt(contact: &Contact, force: f64) -> Option<f64> {
    let normal: Vec3 = contact.touching.iter().map(|touch| touch.normal * touch.force).sum();
    let cos = -normal.normalize_or_zero().z;
    (force > 0.0).then(|| libm::acos(cos.clamp(-1.0, 1.0)))
}
