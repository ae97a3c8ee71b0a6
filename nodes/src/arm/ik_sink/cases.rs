//! Random postures and twists with the answers of `ik_sink`, for `tests/oracles/ik_judge.py`.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use nalgebra::{Matrix6, Vector6};
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::node::FilePath;
use tactflow_runtime::signal::{Jacobian, JacobianShape, Joints, JointsShape, PoseShape, Twist, TwistShape, Unit};

use super::IkSink;
use crate::arm::chain::Chain;
use crate::arm::model::load;
use crate::arm::mount::Mount;
use crate::random::Random;

const CASES: usize = 30_000;
/// Length of a step of a motion [s], and their number.
const STEP: f64 = 0.02;
const STEPS: usize = 25;
/// Distance of the neighbour of each posture [rad].
const NEAR: f64 = 1e-4;
/// Largest singular value of a posture that counts as singular.
const SINGULAR: f64 = 0.05;

/// A robot that ships: the name of its model, its tip, its home [rad] and the acceleration of its joints [rad/s²].
type Robot = (&'static str, &'static str, &'static [f64], f64);

const ROBOTS: [Robot; 3] = [
    ("lwr4p", "lwr_7_link", &[0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0], 10.0),
    ("panda", "panda_link8", &[0.0, -0.1, 0.0, -2.2, 0.0, 2.1, 0.7854], 7.5),
    ("ur5e", "tool0", &[0.0, -1.7, -2.0, -1.0124, 1.5708, 0.0], 10.0),
];

struct Arm {
    chain: Chain,
    rig: NodeRig,
}

impl Arm {
    fn new(&(name, tip, home, acceleration): &Robot) -> Self {
        let path = format!("{}/../graphs/robots/{name}.urdf", env!("CARGO_MANIFEST_DIR"));
        let chain = load(&FilePath { path: path.into(), span: 0..0, builtin: None }, tip, &Mount::NONE).unwrap();
        let mut joints = JointsShape { joints: chain.joints().to_vec(), unit: Unit::RADIAN };
        joints.joints.iter_mut().for_each(|joint| joint.acceleration = acceleration);
        let wires = [
            ("twist", TwistShape.into()),
            ("sensor_pose", PoseShape::default().into()),
            ("jacobian", JacobianShape(joints.clone()).into()),
            ("joints", joints.into()),
        ];
        Self { chain, rig: NodeRig::new::<IkSink>(&format!("posture = {home:?}"), &wires).unwrap() }
    }

    /// The velocities for a twist of the sensor in its own frame.
    fn answer(&mut self, q: &[f64], twist: &[f64; 6]) -> Vec<f64> {
        let mut columns = vec![Twist::default(); q.len()];
        let pose = self.chain.forward(q, &mut columns);
        self.rig.set("twist", crate::servo::adjoint::adjoint(&pose, &Twist((*twist).into())));
        self.rig.set("sensor_pose", pose);
        self.rig.set("jacobian", Jacobian(columns.into()));
        self.rig.set("joints", Joints(q.into()));
        self.rig.step();
        self.rig.get::<Joints>("velocity").unwrap().0.to_vec()
    }

    /// The smallest singular value at the sensor.
    fn sigma(&self, q: &[f64]) -> f64 {
        let mut columns = vec![Twist::default(); q.len()];
        let pose = self.chain.forward(q, &mut columns);
        let columns = columns.iter().map(|column| Vector6::from(super::at_sensor(&pose, column)));
        let gram: Matrix6<f64> = columns.map(|column| column * column.transpose()).sum();
        gram.symmetric_eigenvalues().min().max(0.0).sqrt()
    }

    fn anywhere(&self, random: &mut Random) -> Vec<f64> {
        let within = |(lower, upper): (f64, f64)| random.uniform(lower, upper);
        self.chain.joints().iter().map(|joint| (joint.lower.max(-3.2), joint.upper.min(3.2))).map(within).collect()
    }

    /// A posture near a singularity: steepest descent of the singular value from anywhere.
    fn singular(&self, random: &mut Random) -> Vec<f64> {
        loop {
            let mut q = self.anywhere(random);
            let wanted = random.uniform(0.0, SINGULAR);
            for _ in 0..40 {
                let sigma = self.sigma(&q);
                if (sigma - wanted).abs() < 0.1 * SINGULAR && sigma < SINGULAR {
                    return q;
                }
                let slope: Vec<f64> = (0..q.len()).map(|i| self.slope(&q, i)).collect();
                let steepest = slope.iter().map(|x| x * x).sum::<f64>().max(1e-4);
                for ((q, slope), joint) in q.iter_mut().zip(slope).zip(self.chain.joints()) {
                    let change = (wanted - sigma) * slope / steepest;
                    *q = (*q + change.clamp(-0.2, 0.2)).clamp(joint.lower, joint.upper);
                }
            }
        }
    }

    fn slope(&self, q: &[f64], i: usize) -> f64 {
        let at = |change: f64| {
            let mut q = q.to_vec();
            q[i] += change;
            self.sigma(&q)
        };
        (at(1e-6) - at(-1e-6)) / 2e-6
    }

    /// A posture with one to three joints at or near a limit.
    fn at_limit(&self, random: &mut Random) -> Vec<f64> {
        let mut q = self.anywhere(random);
        for _ in 0..1 + random.below(3) {
            let i = random.below(q.len());
            let joint = &self.chain.joints()[i];
            let distance = if random.below(3) == 0 { 0.0 } else { random.uniform(0.0, 0.05) };
            q[i] = if random.below(2) == 0 { joint.lower + distance } else { joint.upper - distance };
        }
        q
    }
}

/// Up to 0.1 m/s and 0.5 rad/s; every third twist is a slide in the plane of the pad.
fn any_twist(random: &mut Random) -> [f64; 6] {
    let mut direction = || {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|_| random.normal());
        (x * x + y * y + z * z).sqrt().recip().min(1e6) * random.uniform(0.1, 1.0) * nalgebra::Vector3::new(x, y, z)
    };
    let (v, w) = (0.1 * direction(), 0.5 * direction());
    if random.below(3) == 0 { [v.x, v.y, 0.0, 0.0, 0.0, 0.0] } else { [v.x, v.y, v.z, w.x, w.y, w.z] }
}

fn write(text: &mut String, values: &[f64]) {
    values.iter().for_each(|value| write!(text, " {value:e}").unwrap());
}

// Each line is a case: robot, kind, joints, and in the order of the columns the posture, the twist, the velocities, the
// neighbour and its velocities, and, unless the kind is `ordinary`, the postures of a motion that holds the twist.
#[test]
#[ignore = "it writes the cases of a judge that is run by hand"]
fn write_the_cases_of_the_judge() {
    let mut random = Random::new(31, 0);
    let mut arms = ROBOTS.each_ref().map(Arm::new);
    let mut text = format!("{STEP} {STEPS} {NEAR}\n");
    for i in 0..CASES {
        let ((name, ..), arm) = (&ROBOTS[i % 3], &mut arms[i % 3]);
        let (kind, mut q) = match i / 3 % 6 {
            0 => ("singular", arm.singular(&mut random)),
            1 => ("limit", arm.at_limit(&mut random)),
            _ => ("ordinary", arm.anywhere(&mut random)),
        };
        let twist = any_twist(&mut random);
        write!(text, "{name} {kind} {}", q.len()).unwrap();
        write(&mut text, &q);
        write(&mut text, &twist);
        write(&mut text, &arm.answer(&q, &twist));
        let change: Vec<f64> = q.iter().map(|_| random.normal()).collect();
        let scale = NEAR / change.iter().map(|x| x * x).sum::<f64>().sqrt();
        let limits = arm.chain.joints().iter().map(|joint| (joint.lower, joint.upper));
        let near = q.iter().zip(change).zip(limits).map(|((q, x), (lower, upper))| (q + scale * x).clamp(lower, upper));
        let near: Vec<f64> = near.collect();
        write(&mut text, &near);
        write(&mut text, &arm.answer(&near, &twist));
        for _ in 0..if kind == "ordinary" { 0 } else { STEPS } {
            let velocity = arm.answer(&q, &twist);
            q.iter_mut().zip(velocity).for_each(|(q, v)| *q += STEP * v);
            write(&mut text, &q);
        }
        text.push('\n');
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/ik");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("cases.txt"), text).unwrap();
}
