//! How well a graph has measured the object: its reported points against the true surface.

use parry3d_f64::math::{Pose3, Vec3};

use super::object::Object;
use super::shape::Shape;

/// Distance of two sampled points of the surface, seen along the sensor's z [m].
const APART: f64 = 0.005;
/// Half of the width that is looked at, about the middle of the object [m].
const HALF: f64 = 0.15;
/// Within what distance of a reported point the surface counts as covered [m].
const REACH: f64 = 0.01;
/// Least part of a normal that faces the sensor at the start: what is steeper is out of reach.
const FACING: f64 = 0.5;

/// The part of an object's surface that faces the sensor, and what of it has been touched.
pub struct Survey {
    /// In the object's frame, and whether a report came near.
    points: Vec<(Vec3, bool)>,
    covered: usize,
}

/// What a reported point is worth.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Measured {
    /// Distance from the nearest surface [m].
    pub distance: f64,
    /// Distance from the object's line in the pad's plane [m]; none if it has none.
    pub path: Option<f64>,
}

impl Survey {
    /// Of an object, seen from a sensor; none of one that has no end.
    #[must_use]
    pub fn new(object: &Object, sensor: Pose3) -> Option<Self> {
        if matches!(object.shape, Shape::Plane(_)) {
            return None;
        }
        let local = |v: Vec3| object.pose.inverse_transform_vector(sensor.rotation * v);
        let [x, y, z] = [local(Vec3::X), local(Vec3::Y), local(Vec3::Z)];
        let steps = (HALF / APART) as i32;
        let grid = (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (f64::from(i), f64::from(j))));
        let seen = grid.filter_map(|(i, j)| {
            let from = (x * i + y * j) * APART - z * 1.0;
            let hit = object.shape.cast(from, z, 2.0)?;
            (-hit.normal.dot(z) >= FACING).then(|| (from + z * hit.time, false))
        });
        let points: Vec<_> = seen.collect();
        (!points.is_empty()).then_some(Self { points, covered: 0 })
    }

    /// Takes a reported point in the base into account.
    pub fn add(&mut self, object: &Object, point: Vec3) {
        let at = object.pose.inverse_transform_point(point);
        for (place, is_covered) in self.points.iter_mut().filter(|(_, is_covered)| !is_covered) {
            if place.distance_squared(at) < REACH * REACH {
                *is_covered = true;
                self.covered += 1;
            }
        }
    }

    /// Share of the surface that is near a reported point.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        self.covered as f64 / self.points.len() as f64
    }
}

/// What a reported point in the base is worth against all objects, for a pad with this pose.
#[must_use]
pub fn measure(objects: &[Object], pad: Pose3, point: Vec3) -> Option<Measured> {
    let distance = |object: &Object| object.shape.distance(object.pose.inverse_transform_point(point));
    let distance = objects.iter().map(distance).min_by(f64::total_cmp)?;
    let across = |object: &Object| {
        let line = object.shape.line(object.pose.inverse_transform_point(point))?;
        let off = pad.inverse_transform_vector(point - object.pose.transform_point(line.at));
        Some((off.x * off.x + off.y * off.y).sqrt())
    };
    Some(Measured { distance, path: objects.iter().filter_map(across).min_by(f64::total_cmp) })
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::node::Positive;

    use super::*;
    use crate::sim::object::{Look, Thing};
    use crate::sim::testing::{ball, thing};

    fn object(thing: &Thing) -> Object {
        Object::new(thing, Pose3::IDENTITY, [0.0; 2]).unwrap()
    }

    #[test]
    fn points_are_measured_against_surface_and_line() {
        let round = [object(&ball(0.04, [0.0, 0.0, 0.05]))];
        let measured = measure(&round, Pose3::IDENTITY, Vec3::new(0.0, 0.0, 0.0085)).unwrap();
        assert!((measured.distance - 0.0015).abs() < 1e-12 && measured.path.is_none(), "{measured:?}");
        let pen = Thing { length: Some(Positive(0.1)), shape: Look::Pen, ..ball(0.04, [0.0, 0.0, 0.05]) };
        let pen = [object(&pen)];
        let measured = measure(&pen, Pose3::IDENTITY, Vec3::new(0.003, 0.02, 0.01)).unwrap();
        assert!((measured.path.unwrap() - 0.003).abs() < 1e-12, "{measured:?}");
        assert_eq!(measure(&[], Pose3::IDENTITY, Vec3::ZERO), None);
    }

    #[test]
    fn what_is_near_a_report_is_covered() {
        let round = object(&ball(0.04, [0.0, 0.0, 0.05]));
        let mut survey = Survey::new(&round, Pose3::IDENTITY).unwrap();
        assert_eq!(survey.coverage(), 0.0);
        survey.add(&round, Vec3::new(0.0, 0.0, 0.01));
        // A disc of 1 cm of a cap of the ball that is seen under 60° at most, as a disc from the sensor.
        let wanted = (0.01 / (0.04 * 3f64.sqrt() / 2.0)).powi(2);
        assert!((survey.coverage() / wanted - 1.0).abs() < 0.3, "{} {wanted}", survey.coverage());
        let once = survey.coverage();
        survey.add(&round, Vec3::new(0.0, 0.0, 0.01));
        assert_eq!(survey.coverage(), once);
        assert!(Survey::new(&object(&thing(Look::Plane, [0.0; 3])), Pose3::IDENTITY).is_none());
    }
}
