//! The kinds of signals that can be delayed, each with its parameters.

use tactflow_runtime::node::Param;
use tactflow_runtime::signal::{Scalar, ScalarShape, Settable, Signal, Twist, TwistShape, Unit};

/// A kind of signal that can be delayed.
pub trait Delayable: Settable + Copy {
    /// Parameters of the delay.
    type Params: Param;

    /// Returns the shape of the output, and its value while the input is absent.
    fn configure(params: Self::Params) -> (<Self as Signal>::Shape, Option<Self>);
}

/// Parameters of `delay`.
#[derive(Debug, Clone, Param)]
pub struct ScalarParams {
    /// Unit of the input.
    unit: Unit,
    /// Output while the input is absent; without it the output is absent too.
    #[param(unit = "$unit")]
    initial: Option<f64>,
}

/// Parameters of `twist_delay`.
#[derive(Debug, Clone, Param)]
pub struct TwistParams {
    /// Output while the input is absent, `[vx, vy, vz, wx, wy, wz]`; without it the output is absent too.
    #[param(unit = "m/s, rad/s")]
    initial: Option<[f64; 6]>,
}

impl Delayable for Scalar {
    type Params = ScalarParams;

    fn configure(params: ScalarParams) -> (ScalarShape, Option<Self>) {
        (ScalarShape::of(params.unit), params.initial)
    }
}

impl Delayable for Twist {
    type Params = TwistParams;

    fn configure(params: TwistParams) -> (TwistShape, Option<Self>) {
        (TwistShape, params.initial.map(|initial| Self(initial.into())))
    }
}
