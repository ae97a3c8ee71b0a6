//! Poses and wrenches of the controller, in the frames of the model of the arm.
//!
//! The controller states poses in its own base. The root of a model may be turned about z against it: by 0 in a model
//! that follows the maker's table of Denavit and Hartenberg, and by π in the usual ROS description.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};

/// Returns the pose of a vector of the controller: x, y, z [m] and a rotation vector [rad].
pub(super) fn pose([x, y, z, rx, ry, rz]: [f64; 6]) -> IsometryMatrix3<f64> {
    IsometryMatrix3::from_parts(Translation3::new(x, y, z), Rotation3::new(Vector3::new(rx, ry, rz)))
}

/// Returns the rotation from the base of the controller to the root of the model.
pub(super) fn base(yaw: f64) -> Rotation3<f64> {
    Rotation3::new(Vector3::new(0.0, 0.0, yaw))
}

/// Returns the pose of the flange in the root of the model, from that of the tool centre point in the base of the
/// controller and its offset from the flange.
pub(super) fn flange(base: &Rotation3<f64>, tcp: [f64; 6], offset: [f64; 6]) -> IsometryMatrix3<f64> {
    let tcp = IsometryMatrix3::from_parts(Translation3::identity(), *base) * pose(tcp);
    tcp * pose(offset).inverse()
}

/// Returns a wrench on the tip, along the axes of the tip, from the wrench on the tool centre point along the axes of the
/// base of the controller: force [N], then torque [N m]. `tip` is the pose of the tip in the root of the model.
pub(super) fn wrench_at(
    tip: &IsometryMatrix3<f64>,
    base: &Rotation3<f64>,
    tcp: [f64; 6],
    [fx, fy, fz, tx, ty, tz]: [f64; 6],
) -> [f64; 6] {
    let force = base * Vector3::new(fx, fy, fz);
    let arm = base * Vector3::new(tcp[0], tcp[1], tcp[2]) - tip.translation.vector;
    let torque = base * Vector3::new(tx, ty, tz) + arm.cross(&force);
    let [force, torque] = [force, torque].map(|vector| tip.rotation.inverse() * vector);
    [force.x, force.y, force.z, torque.x, torque.y, torque.z]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    fn close(found: [f64; 6], wanted: [f64; 6]) {
        let off = found.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-12, "{found:?} against {wanted:?}");
    }

    #[test]
    fn the_offset_of_the_tool_and_the_turn_of_the_base_are_taken_off() {
        // The flange points along -z of the base, and the tool reaches 0.1 m out of it.
        let down = [0.4, 0.1, 0.2, PI, 0.0, 0.0];
        let found = flange(&base(0.0), down, [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
        assert!((found.translation.vector - Vector3::new(0.4, 0.1, 0.3)).norm() < 1e-12, "{found}");
        let turned = flange(&base(PI), down, [0.0; 6]);
        assert!((turned.translation.vector - Vector3::new(-0.4, -0.1, 0.2)).norm() < 1e-12, "{turned}");
        assert!((turned.rotation * Vector3::x() + Vector3::x()).norm() < 1e-12);
    }

    #[test]
    fn a_wrench_is_turned_into_the_axes_of_the_tip_and_moved_to_it() {
        // The tip is turned by 90° about z: the x of the base is its -y.
        let tip = pose([0.0, 0.0, 0.0, 0.0, 0.0, FRAC_PI_2]);
        close(wrench_at(&tip, &base(0.0), [0.0; 6], [1.0, 0.0, 3.0, 0.0, 2.0, 0.0]), [0.0, -1.0, 3.0, 2.0, 0.0, 0.0]);
        // A force along y on a point at x = 0.5 m turns about z.
        let still = pose([0.0; 6]);
        let found = wrench_at(&still, &base(0.0), [0.5, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 4.0, 0.0, 0.0, 0.0, 0.0]);
        close(found, [0.0, 4.0, 0.0, 0.0, 0.0, 2.0]);
        close(wrench_at(&still, &base(PI), [0.0; 6], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }
}
