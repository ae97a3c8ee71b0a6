//! The housing of the pad: a hard capsule around the tool, which no tactel feels.
//!
//! The deepest of some points along its axis presses on each object, as a spring with a damper along the normal of the
//! surface. The contact has no friction.

use parry3d_f64::math::Vec3;
use tactflow_runtime::node::Param;

use super::contact::BodyMotion;
use super::object::Object;
use super::wrench::Wrench;
use crate::arm::capsule::{Capsule, Tool};
use crate::arm::mount::Mount;

/// Number of points along the axis.
const POINTS: usize = 9;
/// Damping over stiffness [s].
const DAMPING_S: f64 = 0.001;

/// The parameters of a housing.
#[derive(Debug, Clone, Param)]
pub struct HousingModel {
    /// Its shape.
    #[param(flatten)]
    capsule: Capsule,
    /// Stiffness of its contact with an object.
    #[param(unit = "N/m", range = 1.0..=1e5, default = 2e4)]
    stiffness: f64,
}

/// A housing in the frame of the pad.
pub struct Housing {
    ends: [Vec3; 2],
    radius: f64,
    stiffness: f64,
}

impl Housing {
    /// Returns the housing of a pad on that `mount`.
    #[must_use]
    pub fn new(model: &HousingModel, mount: &Mount) -> Self {
        let Tool { ends, radius } = Tool::new(Some(&model.capsule), mount);
        Self { ends: ends.map(|end| Vec3::new(end.x, end.y, end.z)), radius, stiffness: model.stiffness }
    }

    /// Adds the forces of its contacts to the wrench on the pad about its origin, and to those on the objects, in the
    /// base.
    pub(super) fn press(&self, pad: &BodyMotion, objects: &[Object], wrench: &mut Wrench, loads: &mut [Wrench]) {
        for (object, load) in objects.iter().zip(loads) {
            let touch = |i: usize| {
                let part = i as f64 / (POINTS - 1) as f64;
                let centre = pad.pose.transform_point(self.ends[0].lerp(self.ends[1], part));
                let (distance, normal) = object.shape.signed(object.pose.inverse_transform_point(centre));
                (self.radius - distance, centre, object.pose.rotation * normal)
            };
            let deepest = (0..POINTS).map(touch).max_by(|one, other| one.0.total_cmp(&other.0));
            let Some((depth, centre, normal)) = deepest.filter(|(depth, ..)| *depth > 0.0) else { continue };
            let place = centre - normal * self.radius - pad.pose.translation;
            let velocity = pad.linear + pad.angular.cross(place) - object.velocity_at(place + pad.pose.translation);
            let force = normal * (self.stiffness * (depth - DAMPING_S * velocity.dot(normal))).max(0.0);
            wrench.push(place, force);
            load.push(place, -force);
        }
    }
}

#[cfg(test)]
mod tests {
    use parry3d_f64::math::Pose3;

    use super::*;
    use crate::sim::shape::Geometry;

    #[test]
    fn the_deepest_end_presses_as_a_spring_and_turns_the_pad() {
        let model =
            HousingModel { capsule: Capsule { ends_m: [[0.0; 3], [0.1, 0.0, 0.0]], radius_m: 0.02 }, stiffness: 1e4 };
        let housing = Housing::new(&model, &Mount::NONE);
        // A plane 19 mm in front of the pad; the far end is 1 mm nearer than the other one.
        let plane = Object::free(Geometry::plane(), 0.0, Pose3::from_translation(Vec3::new(0.0, 0.0, 0.019)));
        let angle = -0.01_f64;
        let turn = parry3d_f64::math::Rot3::from_xyzw(0.0, (angle / 2.0).sin(), 0.0, (angle / 2.0).cos());
        let pose = Pose3::from_parts(Vec3::ZERO, turn);
        let still = BodyMotion { pose, linear: Vec3::ZERO, angular: Vec3::ZERO };
        let (mut wrench, mut loads) = (Wrench::default(), [Wrench::default()]);
        housing.press(&still, std::slice::from_ref(&plane), &mut wrench, &mut loads);
        let depth = 0.02 + 0.1 * 0.01_f64.sin() - 0.019;
        assert!((wrench.force - Vec3::new(0.0, 0.0, -1e4 * depth)).length() < 1e-6, "{wrench:?}");
        assert!((wrench.moment.y - 1e4 * depth * 0.1 * 0.01_f64.cos()).abs() < 1e-6, "{wrench:?}");
        assert!((loads[0].force + wrench.force).length() < 1e-12 && (loads[0].moment + wrench.moment).length() < 1e-12);
        let away = BodyMotion { linear: Vec3::new(0.0, 0.0, -5.0), ..still };
        let mut none = Wrench::default();
        housing.press(&away, &[plane], &mut none, &mut loads);
        assert_eq!(none, Wrench::default(), "a contact does not pull");
    }
}
