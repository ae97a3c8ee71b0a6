//! `twist_limit`: one factor scales all six components, so the direction of the motion stays.

use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Scalar, Twist};

use super::fraction;
use crate::motion::bounds::scale_twist;
use crate::usual::{USUAL_M_PER_S, USUAL_RAD_PER_S};

/// Limits the speed of the sensor and keeps the direction of its motion.
///
/// One factor scales the whole twist until its linear and its angular part are within their limits. The limits apply to
/// the sensor's origin along the sensor's axes, so the node comes before the change of frame. In the base the same
/// numbers would mean something else: a pure roll of a sensor that is far away looks fast there.
///
/// ```toml
/// [nodes.twist_limit]
/// type = "twist_limit"
/// in.twist = "blind_limit.twist"
/// linear_m_per_s = 0.05
/// angular_rad_per_s = 0.8
/// ```
#[derive(Describe)]
pub struct TwistLimit {
    params: Params,
}

/// Parameters of `twist_limit`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Maximum speed of the sensor's origin.
    #[param(unit = "m/s", above = 0.0, usual = ..=USUAL_M_PER_S)]
    linear_m_per_s: f64,
    /// Maximum speed of the sensor's rotation.
    #[param(unit = "rad/s", above = 0.0, usual = ..=USUAL_RAD_PER_S)]
    angular_rad_per_s: f64,
}

/// What `twist_limit` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Twist of the sensor's origin, in the sensor's frame.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
}

/// What `twist_limit` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion, slowed down.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Fraction of the motion that passes.
    #[port(unit = "1", frame = "_")]
    speed: Out<Scalar>,
}

impl Node for TwistLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const LIMITS: Limits =
        Limits { through: Some("twist"), holds: &["speed"], breaks: &["acceleration"], ..Limits::NONE };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.speed = fraction();
        Ok(Self { params })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let scale = scale_twist(&inputs.twist, self.params.linear_m_per_s, self.params.angular_rad_per_s);
        out.twist.set(Twist(inputs.twist.0 * scale));
        out.speed.set(scale);
    }
}
