//! `acceleration_limit`: the output moves toward the input on a straight line, as far as both accelerations allow.
//!
//! One factor scales all six components of the change. A limit that a node before it holds stays held: the set of
//! allowed motions is convex, so every point between two of its points is in it. When a limit itself moves faster than
//! the accelerations allow, the output follows it as fast as they allow.

use tactflow_runtime::node::{Describe, Limits, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Scalar, Twist};

use super::{Inputs, fraction, max_age};
use crate::motion::bounds::{approach_twist, countable};
use crate::usual::{USUAL_M_PER_S2, USUAL_RAD_PER_S2};

/// Limits the acceleration of the sensor, and brings it to rest when there is no motion to follow.
///
/// The output follows the wanted motion on a straight line, as fast as both accelerations allow. It is the last limiter
/// of a twist: a node behind it that scales the motion would make it jump again.
///
/// When the motion is absent or older than `max_age_ms`, or the runtime holds all commands, the output goes to zero in
/// the same way, and is absent once it is zero.
///
/// A generated motion never becomes too old. Neither does what remains of an absent motion: it goes to zero here.
/// What remains of an old motion keeps its age: a `joint_limit` behind it drops it as well, and brings the joints to
/// rest by their own accelerations.
///
/// ```toml
/// [nodes.acceleration_limit]
/// type = "acceleration_limit"
/// in.twist = "twist_limit.twist"
/// linear_m_per_s2 = 1.0
/// angular_rad_per_s2 = 10.0
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct AccelerationLimit {
    params: Params,
    /// Maximum age of the motion [ns].
    max_age: i64,
}

/// Parameters of `acceleration_limit`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Maximum linear acceleration.
    #[param(unit = "m/s2", above = 0.0, usual = ..=USUAL_M_PER_S2)]
    linear_m_per_s2: f64,
    /// Maximum angular acceleration.
    #[param(unit = "rad/s2", above = 0.0, usual = ..=USUAL_RAD_PER_S2)]
    angular_rad_per_s2: f64,
    /// Maximum age of the motion; five periods of the slowest device behind it if not given.
    #[param(unit = "ms", above = 0.0)]
    max_age_ms: Option<f64>,
}

/// What `acceleration_limit` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The motion that is reached.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Fraction of the wanted change that passes in this tick.
    #[port(unit = "1", frame = "_")]
    acceleration: Out<Scalar>,
}

/// What `acceleration_limit` remembers.
#[derive(State)]
pub struct State {
    /// The motion that was reached in the last tick [m/s, rad/s].
    reached: Twist,
    /// Number of ticks in which the motion was too old.
    old_ticks: u64,
    /// Its largest age in these ticks [ns].
    oldest: i64,
}

impl Node for AccelerationLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits { through: Some("twist"), holds: &["acceleration"], ..Limits::NONE };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.acceleration = fraction();
        let max_age = max_age(params.max_age_ms, setup.sample_period("twist"));
        Ok(Self { params, max_age })
    }

    fn found(&self, state: &State) -> Option<String> {
        let [oldest, most] = [state.oldest, self.max_age].map(|age| age as f64 * 1e-6);
        (state.old_ticks > 0).then(|| {
            format!(
                "the motion was too old {} times, up to {oldest:.1} ms where {most:.1} ms are allowed, and was braked meanwhile",
                state.old_ticks
            )
        })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let moving = inputs.twist.filter(|_| !tick.is_halted);
        let wanted = moving.filter(|twist| twist.stamp().age(tick.now) <= self.max_age);
        if let (Some(old), None) = (&moving, &wanted) {
            state.old_ticks += 1;
            state.oldest = state.oldest.max(old.stamp().age(tick.now));
        }
        let target = wanted.map_or_else(Twist::default, |twist| countable(&twist));
        let dt = tick.dt.min(tick.max_gap);
        let (linear, angular) = (self.params.linear_m_per_s2 * dt, self.params.angular_rad_per_s2 * dt);
        let scale = approach_twist(&mut state.reached, &target, linear, angular);
        if wanted.is_some() || state.reached != Twist::default() {
            out.twist.set(state.reached);
            out.acceleration.set(scale);
        }
    }
}
