//! Evaluation of reported contact points against the true surface of an object.

use parry3d_f64::math::{Pose3, Vec3};

use super::object::Object;
use super::shape::Geometry;

/// Distance between sampled points of the surface, seen along the sensor's z [m].
const SPACING: f64 = 0.005;
/// Half of the width of the sampled area, around the centre of the object [m].
const HALF_WIDTH: f64 = 0.15;
/// Distance from a reported point within which the surface counts as covered [m].
const COVER_RADIUS: f64 = 0.01;
/// Smallest component of a normal toward the sensor at the start, the cosine of 40°; a steeper surface is not sampled [1].
const MIN_FACING: f64 = 0.766_044;

/// The part of an object's surface that faces the sensor within 40°, and how much of it has been touched.
pub struct Survey {
    /// Points in the frame of the object, and whether each is covered.
    points: Vec<(Vec3, bool)>,
    covered: usize,
}

/// The errors of a reported point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Measured {
    /// Distance to the nearest surface [m].
    pub distance: f64,
    /// Distance to the nearest line of an object, in the plane of the pad [m]; `None` if no object has a line.
    pub path: Option<f64>,
}

impl Survey {
    /// Returns a survey of an object seen from a `sensor`, or `None` for a plane, which is infinite.
    #[must_use]
    pub fn new(object: &Object, sensor: Pose3) -> Option<Self> {
        if matches!(object.shape, Geometry::Plane(_)) {
            return None;
        }
        let local = |v: Vec3| object.pose.inverse_transform_vector(sensor.rotation * v);
        let [x, y, z] = [local(Vec3::X), local(Vec3::Y), local(Vec3::Z)];
        let steps = (HALF_WIDTH / SPACING) as i32;
        let grid = (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (f64::from(i), f64::from(j))));
        let seen = grid.filter_map(|(i, j)| {
            let from = (x * i + y * j) * SPACING - z * 1.0;
            let hit = object.shape.cast(from, z, 2.0)?;
            (-hit.normal.dot(z) >= MIN_FACING).then(|| (from + z * hit.time, false))
        });
        let points: Vec<_> = seen.collect();
        (!points.is_empty()).then_some(Self { points, covered: 0 })
    }

    /// Marks the surface near a reported `point` in the base as covered.
    pub fn add(&mut self, object: &Object, point: Vec3) {
        let at = object.pose.inverse_transform_point(point);
        for (place, is_covered) in self.points.iter_mut().filter(|(_, is_covered)| !is_covered) {
            if place.distance_squared(at) < COVER_RADIUS * COVER_RADIUS {
                *is_covered = true;
                self.covered += 1;
            }
        }
    }

    /// Returns the fraction of the surface that is near a reported point, from 0 to 1.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        self.covered as f64 / self.points.len() as f64
    }
}

/// Returns the errors of a reported `point` in the base with respect to all objects, or `None` if there are none.
#[must_use]
pub fn measure(objects: &[Object], pad: Pose3, point: Vec3) -> Option<Measured> {
    let distance = |object: &Object| object.shape.distance(object.pose.inverse_transform_point(point));
    let distance = objects.iter().map(distance).min_by(f64::total_cmp)?;
    let across = |object: &Object| {
        let line = object.shape.line(object.pose.inverse_transform_point(point))?;
        let off = pad.inverse_transform_vector(point - object.pose.transform_point(line.at));
        Some(off.truncate().length())
    };
    Some(Measured { distance, path: objects.iter().filter_map(across).min_by(f64::total_cmp) })
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::sim::object::{ObjectParams, ShapeKind};
    use crate::sim::testing::{ball, thing};

    fn object(thing: &ObjectParams) -> Object {
        Object::new(thing, Pose3::IDENTITY, [0.0; 2]).unwrap()
    }

    #[test]
    fn a_point_has_a_distance_to_the_surface_and_to_the_line() {
        let round = [object(&ball(0.04, [0.0, 0.0, 0.05]))];
        let measured = measure(&round, Pose3::IDENTITY, Vec3::new(0.0, 0.0, 0.0085)).unwrap();
        assert!((measured.distance - 0.0015).abs() < 1e-12 && measured.path.is_none(), "{measured:?}");
        let pen = ObjectParams { length: Some(0.1), shape: ShapeKind::Pen, ..ball(0.04, [0.0, 0.0, 0.05]) };
        let pen = [object(&pen)];
        let measured = measure(&pen, Pose3::IDENTITY, Vec3::new(0.003, 0.02, 0.01)).unwrap();
        assert!((measured.path.unwrap() - 0.003).abs() < 1e-12, "{measured:?}");
        assert_eq!(measure(&[], Pose3::IDENTITY, Vec3::ZERO), None);
    }

    #[test]
    fn the_surface_near_a_reported_point_is_covered() {
        let round = object(&ball(0.04, [0.0, 0.0, 0.05]));
        let mut survey = Survey::new(&round, Pose3::IDENTITY).unwrap();
        assert_eq!(survey.coverage(), 0.0);
        let point = Vec3::new(0.0025, 0.0025, 0.0102);
        survey.add(&round, point);
        // A disc of 1 cm of the cap with normals within 40° of the sensor's axis, which is a disc for the sensor.
        let wanted = (0.01 / (0.04 * 0.642_788_f64)).powi(2);
        assert!((survey.coverage() / wanted - 1.0).abs() < 0.3, "{} {wanted}", survey.coverage());
        let once = survey.coverage();
        survey.add(&round, point);
        assert_eq!(survey.coverage(), once);
        assert!(Survey::new(&object(&thing(ShapeKind::Plane, [0.0; 3])), Pose3::IDENTITY).is_none());
    }
}
