//! The adjoint of a pose: the twist of a motion in another frame.
//!
//! The twist of a body depends on the point at which it is taken: in the base it is the spatial twist, which matches
//! the spatial Jacobian and not the Jacobian whose rows are taken at the tip.

use nalgebra::Vector3;
use tactflow_runtime::signal::{Pose, Twist};

/// Returns the twist in B of a motion whose twist in A is `twist`, where `pose` is the pose of A in B (eq. 4).
///
/// ```
/// use nalgebra::{IsometryMatrix3, Vector3};
/// use tactflow_nodes::motion::adjoint::adjoint;
/// use tactflow_runtime::signal::{Pose, Twist};
///
/// // A pure roll of the sensor looks fast at the origin of the base.
/// let pose = Pose(IsometryMatrix3::translation(0.6, 0.0, 0.3));
/// let roll = Twist::new(Vector3::zeros(), Vector3::new(0.0, 0.3, 0.0));
/// assert!((adjoint(&pose, &roll).linear().norm() - 0.20).abs() < 0.005);
/// ```
pub fn adjoint(pose: &Pose, twist: &Twist) -> Twist {
    let rotation = pose.0.rotation.matrix();
    let angular: Vector3<f64> = rotation * twist.angular();
    Twist::new(rotation * twist.linear() + pose.0.translation.vector.cross(&angular), angular)
}

#[cfg(test)]
mod tests {
    use nalgebra::{IsometryMatrix3, Matrix4, Matrix6, Point3, Rotation3, Translation3, Vector6};
    use proptest::prelude::*;

    use super::*;

    fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
        [-size..size, -size..size, -size..size].prop_map(Vector3::from)
    }

    fn a_pose() -> impl Strategy<Value = Pose> {
        (vector(3.0), vector(1.0)).prop_map(|(turn, place)| {
            Pose(IsometryMatrix3::from_parts(Translation3::from(place), Rotation3::new(turn)))
        })
    }

    fn a_twist() -> impl Strategy<Value = Twist> {
        (vector(1.0), vector(1.0)).prop_map(|(linear, angular)| Twist::new(linear, angular))
    }

    /// The twist as a 4x4 matrix, so that exp of it is a pose.
    fn hat(twist: &Twist) -> Matrix4<f64> {
        let mut matrix = Matrix4::zeros();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&twist.angular().cross_matrix());
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&twist.linear());
        matrix
    }

    proptest! {
        #[test]
        fn the_adjoint_is_the_matrix_of_eq_4(pose in a_pose(), twist in a_twist()) {
            let rotation = pose.0.rotation.matrix();
            let mut matrix = Matrix6::zeros();
            matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
            matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation);
            matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&(pose.0.translation.vector.cross_matrix() * rotation));
            prop_assert!((adjoint(&pose, &twist).0 - matrix * twist.0).amax() < 1e-14);
        }

        #[test]
        fn adjoints_compose(first in a_pose(), second in a_pose(), twist in a_twist()) {
            let at_once = adjoint(&Pose(first.0 * second.0), &twist);
            prop_assert!((at_once.0 - adjoint(&first, &adjoint(&second, &twist)).0).amax() < 1e-13);
        }

        #[test]
        fn the_adjoint_of_the_inverse_pose_is_the_inverse(pose in a_pose(), twist in a_twist()) {
            let there_and_back = adjoint(&Pose(pose.0.inverse()), &adjoint(&pose, &twist));
            prop_assert!((there_and_back.0 - twist.0).amax() < 1e-13);
        }

        #[test]
        fn the_result_is_the_same_motion_in_the_other_frame(pose in a_pose(), twist in a_twist()) {
            let moved = pose.0.to_homogeneous() * hat(&twist).exp() * pose.0.inverse().to_homogeneous();
            prop_assert!((hat(&adjoint(&pose, &twist)).exp() - moved).amax() < 1e-12);
        }
    }

    /// A sensor on a helix, and its twist along its own axes by hand.
    fn helix(t: f64) -> (Pose, Twist) {
        let (radius, turn, climb) = (0.6, 0.8, 0.1);
        let (sin, cos) = (libm::sin(turn * t), libm::cos(turn * t));
        let place = Translation3::new(radius * cos, radius * sin, climb * t);
        let pose = Pose(IsometryMatrix3::from_parts(place, Rotation3::from_axis_angle(&Vector3::z_axis(), turn * t)));
        (pose, Twist(Vector6::new(0.0, radius * turn, climb, 0.0, 0.0, turn)))
    }

    #[test]
    fn in_the_base_it_is_the_velocity_of_the_point_at_its_origin() {
        let h = 1e-5;
        for t in [0.0, 0.7, 2.9] {
            let (pose, twist) = helix(t);
            let spatial = adjoint(&pose, &twist);
            let of_the_body = pose.0.inverse() * Point3::origin();
            let velocity = (helix(t + h).0.0 * of_the_body - helix(t - h).0.0 * of_the_body) / (2.0 * h);
            assert!((spatial.linear() - velocity).amax() < 1e-9, "{t}: {spatial:?} {velocity:?}");
            assert!((spatial.angular() - Vector3::new(0.0, 0.0, 0.8)).amax() < 1e-15);
        }
    }
}
