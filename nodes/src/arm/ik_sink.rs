//! `ik_sink`: joint velocities for a twist of the sensor (paper section IV), within the arm's limits.
//!
//! 1. Twist and Jacobian are moved from the base's origin to the sensor's, along its axes (Ad of the inverse pose,
//!    eq. 4): damping is not frame-invariant, so it is done where metres and radians mean what the task means.
//! 2. [`damped::solve`]: a damped inverse that damps only what is near-singular.
//! 3. [`null_space::project`]: motion toward a posture that leaves the sensor exactly still, if one is given.
//! 4. [`joint_limits`]: speed and position limits that keep the direction; the posture gets what the task leaves.
//!
//! It is a map and remembers nothing: no twist, no velocity. What becomes of a motion that ends is the limiters'.

use tactflow_runtime::node::{Limits, Mistake, Mistakes, Node, NonNegative, Positive, Setup, Tick};
use tactflow_runtime::signal::{Joint, JointsShape, Pose, ScalarShape, Twist, Unit};
use tactflow_runtime::{inputs, outputs, params, state};

use super::{damped, joint_limits, null_space};

params! {
    /// Singular values below this are damped [1, and m].
    damping: Positive = Positive(0.05),
    /// Posture that the arm drifts to where the sensor's motion leaves it free, one entry a joint [rad].
    live posture: Option<Vec<f64>>,
    /// How fast it drifts there [1/s].
    live posture_gain: NonNegative = NonNegative(0.5),
    /// Greatest speed toward a position limit, per distance to it; 5, or half the graph's rate if that is less [1/s].
    limit_gain: Option<Positive>,
}

inputs! {
    /// Spatial twist of the sensor in the base [m/s, rad/s].
    twist: Twist["B"],
    /// Pose of the sensor in the base.
    sensor_pose: Pose["S", "B"],
    /// Spatial Jacobian of the sensor in the base [m/s, rad/s per rad/s].
    jacobian: Jacobian["B", "R"],
    /// Joint positions with their limits [rad; m for a prismatic joint].
    joints: Joints["rad", "R"],
}

outputs! {
    /// Joint velocities [rad/s; m/s for a prismatic joint].
    velocity: Joints["rad/s", "R"],
    /// How much of the wanted twist's motion the joints' limits leave; the posture's is not counted [1].
    share: Scalar["1"],
}

state! {
    /// The Jacobian's columns at the sensor.
    columns: Vec<[f64; 6]>,
    /// Room to work in for the null space.
    rows: Vec<null_space::Row>,
    /// Motion toward the posture [rad/s].
    drift: Vec<f64>,
}

/// The sink's settings and the arm's limits.
pub struct IkSink {
    joints: Vec<Joint>,
    damping: f64,
    posture: Option<Vec<f64>>,
    posture_gain: f64,
    limit_gain: f64,
}

impl tactflow_runtime::node::Describe for IkSink {
    const NAME: &'static str = "ik_sink";
    const SUMMARY: &'static str = "moves the arm: joint velocities for a twist, within the arm's limits";
    const DOC: &'static str = "Resolved motion rate control, as in the paper's section IV. Twist and Jacobian are \
        moved to the sensor's origin, where metres and radians mean what the task means; a damped inverse damps \
        only the directions whose singular value is below `damping`, so far from a singularity the twist is met \
        exactly.\n\n\
        An arm with more than six joints is free to choose its elbow: `posture` says where it drifts, at \
        `posture_gain`, along motions that leave the sensor still. Speed and position limits of the model are \
        kept: a command that is too fast is slowed down as a whole and keeps its direction.\n\n\
        One joint at its limit stops the whole motion that needs it: `share` says how much of the twist's motion is \
        left, 1 far from every limit. Without a twist there is no velocity. How a motion begins and ends, and that \
        nothing old goes on, is up to the limiters: a `joint_limit` has to come between it and the arm.";
    const EXAMPLE: &'static str = r#"
[nodes.ik]
type = "ik_sink"
in.twist = "to_base.twist"
in.sensor_pose = "state.sensor_pose"
in.jacobian = "state.jacobian"
in.joints = "state.joints"
posture = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]   # [rad]
"#;
}

impl Node for IkSink {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits::passed("twist");

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = &setup.inputs.joints;
        let mistakes = check(&params, shape, &setup.inputs.jacobian.0, setup.period);
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        setup.outputs.velocity = shape.in_unit(Unit::RADIAN.per_second());
        setup.outputs.share = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        Ok(Self {
            joints: shape.joints.clone(),
            damping: *params.damping,
            posture: params.posture,
            posture_gain: *params.posture_gain,
            limit_gain: params.limit_gain.map_or(most_gain(setup.period).min(5.0), |gain| *gain),
        })
    }

    fn state(&self) -> State {
        let count = self.joints.len();
        State { columns: vec![[0.0; 6]; count], rows: vec![[0.0; 8]; count], drift: vec![0.0; count] }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let velocity = &mut out.velocity.write().0;
        let q = &inputs.joints.0;
        // A copy, so that it stays in registers while the columns are written.
        let pose = *inputs.sensor_pose.value();
        for (column, of_base) in state.columns.iter_mut().zip(&inputs.jacobian.0) {
            *column = at_sensor(&pose, of_base);
        }
        damped::solve(&state.columns, &at_sensor(&pose, &inputs.twist), self.damping, velocity);
        out.share.set(joint_limits::limit(&self.joints, q, self.limit_gain, velocity));
        if let Some(posture) = &self.posture {
            for ((drift, posture), q) in state.drift.iter_mut().zip(posture).zip(q) {
                *drift = self.posture_gain * (posture - q);
            }
            null_space::project(&state.columns, &mut state.rows, &mut state.drift);
            joint_limits::add_within(&self.joints, q, self.limit_gain, velocity, &state.drift);
        }
    }
}

/// A spatial twist in the base as the twist of the sensor's origin along the sensor's axes: Ad(T^-1).
#[inline]
fn at_sensor(Pose(pose): &Pose, twist: &Twist) -> [f64; 6] {
    let (p, r) = (&pose.translation.vector, pose.rotation.matrix());
    let [vx, vy, vz, wx, wy, wz] = twist.0.into();
    let v = [vx + wy * p.z - wz * p.y, vy + wz * p.x - wx * p.z, vz + wx * p.y - wy * p.x];
    let w = [wx, wy, wz];
    let turned = |a: [f64; 3], i: usize| r[(0, i)] * a[0] + r[(1, i)] * a[1] + r[(2, i)] * a[2];
    [turned(v, 0), turned(v, 1), turned(v, 2), turned(w, 0), turned(w, 1), turned(w, 2)]
}

/// Greatest gain toward a limit that leaves a margin of one tick's delay [1/s].
fn most_gain(period: f64) -> f64 {
    0.5 / period
}

fn check(params: &Params, joints: &JointsShape, columns: &JointsShape, period: f64) -> Mistakes {
    let mut mistakes = Mistakes::new();
    let names = |shape: &JointsShape| shape.joints.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
    if names(joints) != names(columns) {
        let message = format!("the Jacobian is of {:?}, but the joints are {:?}", names(columns), names(joints));
        mistakes.push(Mistake::input("jacobian", message).help("take both from one `arm_state`"));
    }
    if *params.damping < damped::MIN_DAMPING {
        let message = format!("`damping` of less than {} drowns in rounding", damped::MIN_DAMPING);
        mistakes.push(Mistake::param("damping", message));
    }
    let most = most_gain(period);
    if params.limit_gain.is_some_and(|gain| *gain > most) {
        let message = format!("a joint could cross its limit: `limit_gain` is more than {most} 1/s");
        mistakes.push(Mistake::param("limit_gain", message).help("half the rate of the graph is the most"));
    }
    let Some(posture) = &params.posture else { return mistakes };
    let count = joints.joints.len();
    if posture.len() != count {
        let message = format!("`posture` has {} entries, but the arm has {count} joints", posture.len());
        mistakes.push(Mistake::param("posture", message));
    }
    for (joint, entry) in joints.joints.iter().zip(posture) {
        if !(joint.lower..=joint.upper).contains(entry) {
            let Joint { name, lower, upper, .. } = joint;
            let message = format!("joint `{name}` cannot be at {entry}: it goes from {lower:.4} to {upper:.4}");
            mistakes.push(Mistake::param("posture", message));
        }
    }
    mistakes
}

#[cfg(test)]
mod tests;
