//! The pose of the flange of a UR5e, from the parameters of Denavit and Hartenberg that its maker states.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::JOINTS;

/// Displacement along z of each joint [m].
const D: [f64; JOINTS] = [0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996];
/// Length of each link along x [m].
const A: [f64; JOINTS] = [0.0, -0.425, -0.3922, 0.0, 0.0, 0.0];
/// Twist of each link about x [quarter turns].
const ALPHA: [f64; JOINTS] = [1.0, 0.0, 0.0, 1.0, -1.0, 0.0];

/// Returns the pose of the flange in the robot's base: its position [m] and its rotation vector [rad].
pub(super) fn tcp_pose(q: &[f64; JOINTS]) -> [f64; 6] {
    let mut pose = Isometry3::identity();
    for i in 0..JOINTS {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), q[i]);
        let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), ALPHA[i] * std::f64::consts::FRAC_PI_2);
        pose *= Isometry3::from_parts(Translation3::new(0.0, 0.0, D[i]), turn)
            * Isometry3::from_parts(Translation3::new(A[i], 0.0, 0.0), twist);
    }
    let (place, turn) = (pose.translation.vector, pose.rotation.scaled_axis());
    [place.x, place.y, place.z, turn.x, turn.y, turn.z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stretched_arm_reaches_what_its_links_add_up_to() {
        let [x, y, z, ..] = tcp_pose(&[0.0; JOINTS]);
        let expected = [-0.425 - 0.3922, -0.1333 - 0.0996, 0.1625 - 0.0997];
        for (is, expected) in [x, y, z].into_iter().zip(expected) {
            assert!((is - expected).abs() < 1e-12, "{is} {expected}");
        }
    }
}
