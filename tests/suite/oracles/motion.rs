//! The arm of the shipped graphs: it goes where its commands say, within its model's limits, and does what was wanted.

use std::fs;

use nalgebra::{IsometryMatrix3, Matrix6, Rotation3, Vector3, Vector6};
use tactflow_runtime::graph::Request;
use tactflow_runtime::signal::{Jacobian, Joints, Pose, Twist};
use tactflow_tests::workspace;

use crate::course::{get, shipped, watch};

const GRAPHS: [&str; 2] = ["finger_press.toml", "hybrid.toml"];

/// What an arm was in a tick, and what it was told.
struct Moment {
    time: f64,
    pose: IsometryMatrix3<f64>,
    jacobian: Vec<Vector6<f64>>,
    position: Vec<f64>,
    /// What the arm was told.
    command: Vec<f64>,
    /// What the inverse kinematics made of what was wanted.
    solved: Option<Vec<f64>>,
    wanted: Option<Vector6<f64>>,
}

fn moments(request: &Request) -> Vec<Moment> {
    let mut moments = Vec::new();
    watch(request, |engine| {
        let joints = |port: &str| get::<Joints>(engine, port).unwrap().0.to_vec();
        moments.push(Moment {
            time: engine.now() as f64 * 1e-9,
            pose: get::<Pose>(engine, "move.state.sensor_pose").unwrap().0,
            jacobian: get::<Jacobian>(engine, "move.state.jacobian").unwrap().0.iter().map(|twist| twist.0).collect(),
            position: joints("arm.position"),
            command: engine.commands("arm").unwrap(),
            solved: get::<Joints>(engine, "move.ik.velocity").map(|joints| joints.0.to_vec()),
            wanted: get::<Twist>(engine, "move.to_base.twist").map(|twist| twist.0),
        });
    });
    moments
}

fn moved(jacobian: &[Vector6<f64>], velocity: &[f64]) -> Vector6<f64> {
    jacobian.iter().zip(velocity).map(|(column, v)| column * *v).sum()
}

/// The spatial twist that takes one pose to another in a unit of time: the logarithm.
fn screw(from: &IsometryMatrix3<f64>, to: &IsometryMatrix3<f64>) -> Vector6<f64> {
    let motion = to * from.inverse();
    // Half of R - R^T is the axis times the sine: an angle from the cosine would drown in rounding when it is small.
    let r = motion.rotation.matrix();
    let sine = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]) / 2.0;
    let w = if sine.norm() > 0.0 { sine * (sine.norm().asin() / sine.norm()) } else { sine };
    // p = V v for a screw motion; V^-1 by its series, which a small angle ends soon.
    let p = motion.translation.vector;
    let v = p - 0.5 * w.cross(&p) + w.cross(&w.cross(&p)) / 12.0;
    Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
}

#[test]
fn the_screw_of_two_poses_takes_one_to_the_other() {
    let pose =
        IsometryMatrix3::from_parts(Vector3::new(0.3, -0.2, 0.5).into(), Rotation3::new(Vector3::new(0.3, 1.0, 0.2)));
    let turn = Rotation3::new(Vector3::new(0.0, 0.0, 0.01));
    let turned = IsometryMatrix3::from_parts(Vector3::zeros().into(), turn) * pose;
    let expected = Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.01);
    assert!((screw(&pose, &turned) - expected).norm() < 1e-12, "about the base's z, wherever the pose is");
}

#[test]
fn the_arm_is_where_its_commands_took_it() {
    for graph in GRAPHS {
        let moments = moments(&shipped(graph));
        for pair in moments.windows(2) {
            let dt = pair[1].time - pair[0].time;
            for ((q, next), v) in pair[0].position.iter().zip(&pair[1].position).zip(&pair[0].command) {
                assert!((q + v * dt - next).abs() < 1e-12, "{graph} at {} s", pair[0].time);
            }
        }
        let way = |moment: &Moment| moment.command.iter().map(|v| v.abs()).fold(0.0, f64::max);
        assert!(moments.iter().map(way).fold(0.0, f64::max) > 0.05, "{graph}: it moves");
    }
}

#[test]
fn the_pose_moves_as_the_jacobian_says() {
    for graph in GRAPHS {
        let moments = moments(&shipped(graph));
        let mut farthest = 0.0f64;
        for pair in moments.windows(2) {
            let step: Vec<f64> = pair[0].position.iter().zip(&pair[1].position).map(|(q, next)| next - q).collect();
            let size = step.iter().map(|q| q * q).sum::<f64>().sqrt();
            let found = screw(&pair[0].pose, &pair[1].pose);
            let [before, after] = [0, 1].map(|i| moved(&pair[i].jacobian, &step));
            // The derivative of this arm's Jacobian is of the order of 1, its second derivative as well.
            let (first, second) = ((found - before).norm(), (found - 0.5 * (before + after)).norm());
            assert!(first <= 2.0 * size.powi(2) + 1e-12, "{graph} at {} s: off by {first}", pair[0].time);
            assert!(second <= 2.0 * size.powi(3) + 1e-12, "{graph} at {} s: off by {second}", pair[0].time);
            farthest = farthest.max(found.norm());
        }
        assert!(farthest > 1e-4, "{graph}: it moves");
    }
}

/// `lower`, `upper` or `velocity` of each joint of the model, by eye and not by parser.
fn limits(which: &str) -> Vec<f64> {
    let text = fs::read_to_string(workspace().join("graphs/robots/lwr4p.urdf")).unwrap();
    let value = |line: &str| line.split(&format!(" {which}=\"")).nth(1)?.split('"').next()?.parse().ok();
    text.lines().filter(|line| line.contains("<limit ")).filter_map(value).collect()
}

/// The task `hybrid.toml` on the mock bench with limits that no arm reaches. They stand in the files, since `--set`
/// cannot loosen a limit.
fn without_limits() -> Request {
    const LIMITS: [(&str, &str); 8] = [
        ("linear_m_per_s", "9.0"),
        ("angular_rad_per_s", "9.0"),
        ("linear_m_per_s2", "900.0"),
        ("angular_rad_per_s2", "900.0"),
        ("joint_rad_per_s2", "900.0"),
        ("lead_rad", "3.0"),
        ("workspace_min_m", "[-9.0, -9.0, -9.0]"),
        ("workspace_max_m", "[9.0, 9.0, 9.0]"),
    ];
    let loose = |line: &str| {
        let value = LIMITS.iter().find(|(name, _)| line.starts_with(&format!("{name} = ")));
        value.map_or(line.to_owned(), |(name, value)| format!("{name} = {value}")) + "\n"
    };
    let read = |file: &str| {
        let text = fs::read_to_string(workspace().join("graphs").join(file)).unwrap();
        text.lines().map(loose).collect::<String>()
    };
    let bench = read("benches/mock.toml");
    let urdf = "urdf = \"builtin:lwr4p.urdf\"\ntip = \"lwr_7_link\"\nstart = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]";
    let bench = bench.replace("robot = \"../robots/lwr4p.toml\"", urdf) + "joint_rad_per_s2 = 900.0\nlead_rad = 3.0\n";
    let graph =
        read("hybrid.toml").replace("\"parts/", "\"builtin:parts/").replace("bench = \"benches/ball.toml\"\n", "");
    Request { bench_text: Some(bench), ..Request::text(graph) }
}

#[test]
fn no_joint_is_ever_told_to_be_faster_than_its_model_allows() {
    let [lower, upper, fastest] = ["lower", "upper", "velocity"].map(limits);
    assert_eq!((lower.len(), upper.len(), fastest.len()), (7, 7, 7));
    let hurried = [
        "modes.approach.set.reach.twist=[0, 4, 0, 0, 0, 3]",
        "modes.approach.fail.after_travel_mm=1e4",
        "devices.arm.acceleration=900.0",
        "facts.arm.clear_min_m=[-9.0, -9.0, -9.0]",
        "facts.arm.clear_max_m=[9.0, 9.0, 9.0]",
    ];
    let requests = [
        (shipped("finger_press.toml"), false),
        (shipped("hybrid.toml"), false),
        (hurried.iter().fold(without_limits(), |request, set| request.set(*set)), true),
    ];
    for (request, is_hurried) in requests {
        let mut at_the_limit = 0;
        for moment in moments(&request) {
            for joint in 0..7 {
                let (v, q) = (moment.command[joint], moment.position[joint]);
                assert!(v.abs() <= fastest[joint] * (1.0 + 1e-12), "joint {joint} at {} s: {v}", moment.time);
                assert!((lower[joint]..=upper[joint]).contains(&q), "joint {joint} at {} s: {q}", moment.time);
                at_the_limit += usize::from(v.abs() > 0.999 * fastest[joint]);
            }
        }
        assert_eq!(at_the_limit > 20, is_hurried, "{at_the_limit} commands are at a limit");
    }
}

/// A spatial twist as that of the sensor's origin along the sensor's axes.
fn at_sensor(pose: &IsometryMatrix3<f64>, twist: &Vector6<f64>) -> Vector6<f64> {
    let (v, w) = (twist.fixed_rows::<3>(0), twist.fixed_rows::<3>(3));
    let v = v + w.cross(&pose.translation.vector);
    let (v, w) = (pose.rotation.inverse() * v, pose.rotation.inverse() * w);
    Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
}

#[test]
fn the_sensor_moves_as_was_wanted_but_for_the_damping() {
    for damping in [0.05, 0.001] {
        for graph in GRAPHS {
            let request = shipped(graph).set(format!("parts.move.set.ik.damping={damping}"));
            let mut compared = 0;
            for moment in moments(&request) {
                let (Some(wanted), Some(solved)) = (moment.wanted, &moment.solved) else { continue };
                let columns = moment.jacobian.iter().map(|column| at_sensor(&moment.pose, column));
                let gram: Matrix6<f64> = columns.map(|column| column * column.transpose()).sum();
                // What a singular value s lacks of 1 is eps^4 / (s^4 + eps^2 s^2 + eps^4); the smallest lacks most.
                let (square, least) = (damping * damping, gram.symmetric_eigenvalues().min());
                let lack = square * square / (least * least + square * least + square * square);
                let wanted = at_sensor(&moment.pose, &wanted);
                let off = (at_sensor(&moment.pose, &moved(&moment.jacobian, solved)) - wanted).norm();
                // Rounding alone is left of a motion that ends.
                assert!(
                    off <= (lack + 1e-6) * wanted.norm() + 1e-15,
                    "{graph} at {} s: off by {off}, {lack}",
                    moment.time
                );
                compared += 1;
            }
            assert!(compared > 200, "{graph}: {compared} twists");
        }
    }
}
