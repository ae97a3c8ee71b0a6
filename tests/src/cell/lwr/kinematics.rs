//! The pose of the flange of an LWR 4+, from its published parameters of Denavit and Hartenberg.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};

use super::JOINTS;

/// Displacement along z of each joint [m].
const D: [f64; JOINTS] = [0.310, 0.0, 0.400, 0.0, 0.390, 0.0, 0.078];
/// Twist of each link about x [quarter turns].
const ALPHA: [f64; JOINTS] = [1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 0.0];

/// Returns the pose of the flange in the robot's base, from the seven joint positions [rad].
pub(super) fn flange(q: &[f64]) -> IsometryMatrix3<f64> {
    let mut pose = IsometryMatrix3::identity();
    for i in 0..JOINTS {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), q[i]);
        let twist = Rotation3::from_axis_angle(&Vector3::x_axis(), ALPHA[i] * std::f64::consts::FRAC_PI_2);
        pose *= IsometryMatrix3::from_parts(Translation3::new(0.0, 0.0, D[i]), turn * twist);
    }
    pose
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use tactflow_nodes::arm::model::load;
    use tactflow_nodes::arm::mount::Mount;
    use tactflow_runtime::node::FilePath;
    use tactflow_runtime::signal::Twist;

    use super::*;

    #[test]
    fn the_arm_stands_upright_and_bends_at_its_elbow() {
        let upright = flange(&[0.0; JOINTS]).translation.vector;
        assert!((upright - Vector3::new(0.0, 0.0, 0.310 + 0.400 + 0.390 + 0.078)).norm() < 1e-12, "{upright}");
        // The shoulder turns about -y and the elbow about y.
        for (joint, sign, turning, below) in [(1, -1.0, 0.868, 0.310), (3, 1.0, 0.468, 0.710), (5, -1.0, 0.078, 1.100)]
        {
            let mut q = [0.0; JOINTS];
            q[joint] = FRAC_PI_2;
            let bent = flange(&q).translation.vector;
            assert!((bent - Vector3::new(sign * turning, 0.0, below)).norm() < 1e-12, "{joint}: {bent}");
        }
    }

    /// The model has its shoulder at 310.5 mm.
    #[test]
    fn the_model_that_ships_is_the_same_arm() {
        let path = crate::workspace().join("graphs/robots/lwr4p.urdf");
        let chain = load(&FilePath { path, span: 0..0, builtin: None }, "lwr_7_link", &Mount::NONE).unwrap();
        for i in 0..100 {
            let q: [f64; JOINTS] = std::array::from_fn(|joint| 1.5 * f64::from(17 * i + 5 * joint as u32).sin());
            let (model, table) = (chain.forward(&q, &mut [Twist::default(); JOINTS]).0, flange(&q));
            let away = table.translation.vector - model.translation.vector;
            assert!((away - Vector3::new(0.0, 0.0, -0.0005)).norm() < 1e-9, "{away}");
            let off = (table.rotation.matrix() - model.rotation.matrix()).norm();
            assert!(off < 1e-9, "{off} at {q:?}");
        }
    }
}
