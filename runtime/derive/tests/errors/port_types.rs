//! `#[derive(Inputs)]` and `#[derive(Outputs)]`: what the kind of a port and the list of units decide.

use tactflow_runtime::node::{In, Inputs, Many, Out, Outputs};
use tactflow_runtime::signal::{Flag, Jacobian, Pose, Scalar, Twist};

/// Inputs.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// No unit.
    #[port(frame = "A")]
    no_unit: In<'a, Scalar>,
    /// No frame, under the name of the number.
    #[port(unit = "N")]
    no_frame: Option<In<'a, f64>>,
    /// Nothing.
    nothing: Many<'a, Twist>,
    /// A unit too many.
    #[port(unit = "m/s", frame = "A")]
    too_many: In<'a, Twist>,
    /// A frame too many.
    #[port(frame = "A")]
    flag: In<'a, Flag>,
    /// No reference.
    #[port(frame = "A")]
    pose: In<'a, Pose>,
    /// A frame instead of a robot.
    #[port(frame = "A", reference = "R")]
    jacobian: In<'a, Jacobian>,
    /// A unit that there is not.
    #[port(unit = "newton", frame = "A")]
    unknown_unit: In<'a, Scalar>,
}

/// Outputs.
#[derive(Outputs)]
pub struct Outputs {
    /// A letter that no input binds.
    #[port(unit = "V/s", frame = "A")]
    unit: Out<Scalar>,
    /// A frame that no input binds.
    #[port(frame = "B")]
    frame: Out<Twist>,
}

fn main() {}
