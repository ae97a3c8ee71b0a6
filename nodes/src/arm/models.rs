//! Tests of the robot models that ship, and of the gantry of the tests: each is compared with the table that its
//! maker publishes, as a product of matrices that no URDF takes part in.

use nalgebra::{Matrix4, Rotation3, Vector3};
use tactflow_runtime::node::FilePath;
use tactflow_runtime::signal::Twist;

use super::chain::Chain;
use super::model::load;
use super::mount::Mount;

/// The constants of one joint in a table of Denavit and Hartenberg: a [m], alpha [rad] and d [m].
type Row = [f64; 3];

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// Universal Robots, "DH parameters for calculations of kinematics and dynamics": UR5e, standard convention.
const UR5E: [Row; 6] = [
    [0.0, QUARTER, 0.1625],
    [-0.425, 0.0, 0.0],
    [-0.3922, 0.0, 0.0],
    [0.0, QUARTER, 0.1333],
    [0.0, -QUARTER, 0.0997],
    [0.0, 0.0, 0.0996],
];

/// Franka Control Interface documentation, "Robot and interface specifications": Panda, modified convention (Craig).
/// The last row is the flange, which does not turn.
const PANDA: [Row; 8] = [
    [0.0, 0.0, 0.333],
    [0.0, -QUARTER, 0.0],
    [0.0, QUARTER, 0.316],
    [0.0825, QUARTER, 0.0],
    [-0.0825, -QUARTER, 0.384],
    [0.0, QUARTER, 0.0],
    [0.088, QUARTER, 0.0],
    [0.0, 0.0, 0.107],
];

fn chain(path: &str, tip: &str) -> Chain {
    let path = format!("{}/../{path}", env!("CARGO_MANIFEST_DIR"));
    load(&FilePath { path: path.into(), span: 0..0, builtin: None }, tip, &Mount::NONE).unwrap()
}

fn ur5e() -> Chain {
    chain("graphs/robots/ur5e.urdf", "tool0")
}

fn panda() -> Chain {
    chain("graphs/robots/panda.urdf", "panda_link8")
}

fn pose(chain: &Chain, q: &[f64]) -> Matrix4<f64> {
    chain.forward(q, &mut vec![Twist::default(); q.len()]).0.to_homogeneous()
}

/// Returns the matrix that turns by alpha about x and moves by a along x.
fn about_x([a, alpha, _]: Row) -> Matrix4<f64> {
    let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), alpha);
    Matrix4::new_translation(&Vector3::new(a, 0.0, 0.0)) * turn.to_homogeneous()
}

/// Returns the matrix that turns by `theta` about z and moves by d along z.
fn about_z(theta: f64, [_, _, d]: Row) -> Matrix4<f64> {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), theta);
    Matrix4::new_translation(&Vector3::new(0.0, 0.0, d)) * turn.to_homogeneous()
}

/// Returns the pose of the last frame in the standard convention: each joint turns about z, then comes the step in x.
fn standard(rows: &[Row], q: &[f64]) -> Matrix4<f64> {
    rows.iter().zip(q).fold(Matrix4::identity(), |pose, (row, q)| pose * about_z(*q, *row) * about_x(*row))
}

/// Returns the pose of the last frame in the modified convention: the step in x comes before the turn about z. A row
/// without a joint does not turn.
fn modified(rows: &[Row], q: &[f64]) -> Matrix4<f64> {
    let angles = q.iter().copied().chain(std::iter::repeat(0.0));
    rows.iter().zip(angles).fold(Matrix4::identity(), |pose, (row, q)| pose * about_x(*row) * about_z(q, *row))
}

/// Returns 100 postures that fill the ranges of the joints evenly: the multiples of square roots of primes, modulo 1.
fn postures(chain: &Chain) -> Vec<Vec<f64>> {
    const PRIMES: [f64; 7] = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0];
    let posture = |k: i32| {
        let at = |prime: f64| (f64::from(k) * prime.sqrt()).fract();
        let joints = chain.joints().iter().zip(PRIMES);
        joints.map(|(joint, prime)| joint.lower + (joint.upper - joint.lower) * at(prime)).collect()
    };
    (1..=100).map(posture).collect()
}

#[test]
fn the_ur5e_moves_as_its_table_says() {
    let ur5e = ur5e();
    for q in postures(&ur5e) {
        let off = (pose(&ur5e, &q) - standard(&UR5E, &q)).norm();
        assert!(off < 1e-12, "{off:e} at {q:?}");
    }
}

#[test]
fn the_panda_moves_as_its_table_says() {
    let panda = panda();
    for q in postures(&panda) {
        let off = (pose(&panda, &q) - modified(&PANDA, &q)).norm();
        assert!(off < 1e-12, "{off:e} at {q:?}");
    }
}

#[test]
fn postures_with_right_angles_are_where_their_links_add_up() {
    // The UR5e lies stretched along -x, and its wrist points along -y.
    let zero = pose(&ur5e(), &[0.0; 6]);
    let place = Vector3::new(-(0.425 + 0.3922), -(0.1333 + 0.0996), 0.1625 - 0.0997);
    assert!((zero.fixed_view::<3, 1>(0, 3) - place).norm() < 1e-12, "{zero}");
    assert!((zero.fixed_view::<3, 1>(0, 2) + Vector3::y()).norm() < 1e-12, "{zero}");
    // The UR5e stands upright at q2 = -90° and q4 = -90°.
    let up = pose(&ur5e(), &[0.0, -QUARTER, 0.0, -QUARTER, 0.0, 0.0]);
    let place = Vector3::new(0.0, -(0.1333 + 0.0996), 0.1625 + 0.425 + 0.3922 + 0.0997);
    assert!((up.fixed_view::<3, 1>(0, 3) - place).norm() < 1e-12, "{up}");
    // The Panda stands upright with its flange downward, 88 mm in front of its axis.
    let zero = pose(&panda(), &[0.0; 7]);
    let place = Vector3::new(0.088, 0.0, 0.333 + 0.316 + 0.384 - 0.107);
    assert!((zero.fixed_view::<3, 1>(0, 3) - place).norm() < 1e-12, "{zero}");
    assert!((zero.fixed_view::<3, 1>(0, 2) + Vector3::z()).norm() < 1e-12, "{zero}");
}

/// Universal Robots, user manual of the UR5e: ±360° and 180°/s for every joint.
#[test]
fn the_limits_of_the_ur5e_are_those_of_its_manual() {
    let names = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"];
    let ur5e = ur5e();
    assert_eq!(ur5e.joints().len(), names.len());
    for (joint, name) in ur5e.joints().iter().zip(names) {
        assert_eq!(joint.name, format!("{name}_joint"));
        assert!((joint.upper - 360f64.to_radians()).abs() < 1e-12 && joint.lower == -joint.upper, "{joint:?}");
        assert!((joint.speed - 180f64.to_radians()).abs() < 1e-12, "{joint:?}");
    }
}

/// Franka Control Interface documentation, "Limits for Panda" [rad, rad/s]. They are whole degrees, rounded to 0.0001.
#[test]
fn the_limits_of_the_panda_are_those_of_its_interface() {
    let lower = [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973];
    let upper = [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973];
    let degrees = [(-166, 166), (-101, 101), (-166, 166), (-176, -4), (-166, 166), (-1, 215), (-166, 166)];
    let speeds = [2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61];
    let panda = panda();
    assert_eq!(panda.joints().len(), 7);
    for (i, joint) in panda.joints().iter().enumerate() {
        assert_eq!(joint.name, format!("panda_joint{}", i + 1));
        assert_eq!((joint.lower, joint.upper, joint.speed), (lower[i], upper[i], speeds[i]), "{joint:?}");
        let (from, to) = (f64::from(degrees[i].0).to_radians(), f64::from(degrees[i].1).to_radians());
        assert!((joint.lower - from).abs() < 1e-4 && (joint.upper - to).abs() < 1e-4, "{joint:?}");
    }
}

#[test]
fn the_gantry_slides_along_the_base_and_then_turns() {
    let gantry = chain("tests/data/robots/gantry.urdf", "hand");
    for q in postures(&gantry) {
        let turn = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
        let turned = turn(Vector3::x_axis(), q[3]) * turn(Vector3::y_axis(), q[4]) * turn(Vector3::z_axis(), q[5]);
        let wanted = Matrix4::new_translation(&Vector3::new(q[0], q[1], q[2])) * turned.to_homogeneous();
        assert!((pose(&gantry, &q) - wanted).norm() < 1e-12, "{q:?}");
    }
    let limits: Vec<(f64, f64, f64)> = gantry.joints().iter().map(|j| (j.lower, j.upper, j.speed)).collect();
    assert_eq!(limits[..3], [(-0.4, 0.4, 0.5); 3]);
    assert_eq!(limits[3..], [(-170f64.to_radians(), 170f64.to_radians(), 2.0); 3]);
}
