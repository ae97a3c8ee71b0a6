//! Poses from roll, pitch and yaw and back, and the rotation vector of a rotation.

use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, Translation3, Vector3};

/// Below this sine, an angle above a right angle is close to a half turn, where the axis is not in the difference
/// R - R' [1].
const HALF_TURN_SINE: f64 = 1e-4;

/// Below this cosine of the pitch, roll and yaw turn about the same axis [1].
const MIN_PITCH_COSINE: f64 = 1e-9;

/// Returns the pose with a translation [m] and with roll, pitch and yaw [rad]: Rz(yaw) Ry(pitch) Rx(roll), as in a
/// URDF.
#[must_use]
pub fn pose_of(xyz: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> IsometryMatrix3<f64> {
    let ((sr, cr), (sp, cp), (sy, cy)) = (libm::sincos(roll), libm::sincos(pitch), libm::sincos(yaw));
    #[rustfmt::skip]
    let rotation = Matrix3::new(
        cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,
        sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,
        -sp,     cp * sr,                cp * cr,
    );
    IsometryMatrix3::from_parts(Translation3::from(xyz), Rotation3::from_matrix_unchecked(rotation))
}

/// Returns roll, pitch and yaw of a rotation [rad], so that [`pose_of`] makes it again. With a pitch of ±pi/2 only the
/// difference or the sum of roll and yaw is determined; the yaw is then 0.
///
/// ```
/// use tactflow_nodes::motion::pose::{pose_of, rpy_of};
///
/// let rpy = rpy_of(&pose_of([0.0; 3], [0.1, -0.2, 0.3]).rotation);
/// assert!((0..3).all(|i| (rpy[i] - [0.1, -0.2, 0.3][i]).abs() < 1e-15));
/// ```
#[must_use]
pub fn rpy_of(rotation: &Rotation3<f64>) -> [f64; 3] {
    let r = rotation.matrix();
    let cosine = libm::hypot(r[(0, 0)], r[(1, 0)]);
    let yaw = if cosine > MIN_PITCH_COSINE { libm::atan2(r[(1, 0)], r[(0, 0)]) } else { 0.0 };
    // The roll that goes with this yaw, from the two columns of the rotation that are never short.
    let (sin, cos) = libm::sincos(yaw);
    let roll = libm::atan2(r[(0, 2)] * sin - r[(1, 2)] * cos, r[(1, 1)] * cos - r[(0, 1)] * sin);
    [roll, libm::atan2(-r[(2, 0)], cosine), yaw]
}

/// Returns the rotation vector of a rotation, the logarithm of its matrix: the axis, as long as the angle from 0 to pi
/// [rad].
///
/// The sine of the angle is the length of w = vee(R - R') / 2, and its cosine is (tr R - 1) / 2. Close to a half turn w
/// vanishes, and the axis is a column of R + R', which is then 2 (1 - cos) a a' + 2 cos 1, with the sign of w.
///
/// ```
/// use nalgebra::{Rotation3, Vector3};
/// use tactflow_nodes::motion::pose::rotation_vector;
///
/// let vector = Vector3::new(0.1, -0.2, 0.3);
/// assert!((rotation_vector(&Rotation3::new(vector)) - vector).norm() < 1e-15);
/// ```
#[must_use]
pub fn rotation_vector(rotation: &Rotation3<f64>) -> Vector3<f64> {
    let r = rotation.matrix();
    let w = 0.5 * Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]);
    let (sine, cosine) = (w.norm(), 0.5 * (r.trace() - 1.0));
    let angle = libm::atan2(sine, cosine);
    if cosine > 0.0 || sine > HALF_TURN_SINE {
        // For the smallest angles the sine is the angle.
        return if sine > f64::MIN_POSITIVE { w * (angle / sine) } else { w };
    }
    let outer = 0.5 * (r + r.transpose()) - Matrix3::identity() * cosine;
    let longest = (0..3).map(|i| outer.column(i).into_owned()).max_by(|a, b| a.norm().total_cmp(&b.norm()));
    let axis = longest.expect("there are three columns").normalize();
    axis * if axis.dot(&w) < 0.0 { -angle } else { angle }
}

#[cfg(test)]
pub(crate) mod testing {
    use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
    use proptest::prelude::*;
    use tactflow_runtime::signal::Pose;

    /// Any orientation, within a metre of the origin along each axis.
    pub(crate) fn any_pose() -> impl Strategy<Value = Pose> {
        ([-3.0..3.0, -3.0..3.0, -3.0..3.0], [-1.0..1.0, -1.0..1.0, -1.0..1.0]).prop_map(|(turn, place)| {
            let rotation = Rotation3::new(Vector3::from(turn));
            Pose(IsometryMatrix3::from_parts(Translation3::from(Vector3::from(place)), rotation))
        })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Unit;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn roll_pitch_and_yaw_are_rotations_about_fixed_axes(roll in -3.2..3.2, pitch in -3.2..3.2, yaw in -3.2..3.2) {
            let turn = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
            let wanted = turn(Vector3::z_axis(), yaw) * turn(Vector3::y_axis(), pitch) * turn(Vector3::x_axis(), roll);
            let got = pose_of([1.0, 2.0, 3.0], [roll, pitch, yaw]);
            prop_assert!((got.rotation.matrix() - wanted.matrix()).norm() < 1e-14);
            prop_assert_eq!(got.translation.vector, Vector3::new(1.0, 2.0, 3.0));
        }

        #[test]
        fn a_rotation_has_the_roll_pitch_and_yaw_that_make_it(
            roll in -3.2..3.2,
            pitch in prop_oneof![-3.2..3.2, Just(PI / 2.0), Just(-PI / 2.0), (PI / 2.0 - 1e-8)..(PI / 2.0 + 1e-8)],
            yaw in -3.2..3.2,
        ) {
            let rotation = pose_of([0.0; 3], [roll, pitch, yaw]).rotation;
            let made = pose_of([0.0; 3], rpy_of(&rotation)).rotation;
            prop_assert!((made.matrix() - rotation.matrix()).norm() < 1e-8, "{made} {rotation}");
        }

        #[test]
        fn the_rotation_vector_is_the_axis_times_the_angle(
            x in -1.0..1.0, y in -1.0..1.0, z in 0.1..1.0,
            angle in prop_oneof![0.0..PI, 0.0..1e-6, (PI - 1e-3)..PI, (PI - 1e-9)..PI],
        ) {
            let axis = Unit::new_normalize(Vector3::new(x, y, z));
            let found = rotation_vector(&Rotation3::from_axis_angle(&axis, angle));
            let wanted = axis.into_inner() * angle;
            // Within rounding of a half turn, both signs of the axis are right.
            let off = (found - wanted).norm().min(if PI - angle < 1e-9 { (found + wanted).norm() } else { f64::MAX });
            prop_assert!(off < 1e-9, "{found:?} against {wanted:?}");
        }
    }

    #[test]
    fn half_turns_and_no_turn_are_exact() {
        for axis in [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()] {
            let found = rotation_vector(&Rotation3::from_matrix_unchecked(
                2.0 * axis.into_inner() * axis.transpose() - Matrix3::identity(),
            ));
            assert!((found.abs() - axis.into_inner() * PI).norm() < 1e-15, "{found:?}");
        }
        assert_eq!(rotation_vector(&Rotation3::identity()), Vector3::zeros());
    }
}
