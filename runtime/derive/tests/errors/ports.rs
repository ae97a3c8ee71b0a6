//! `#[derive(Inputs)]` and `#[derive(Outputs)]`: what needs no types.

use tactflow_runtime::node::{In, Inputs, Many, Out, Outputs};
use tactflow_runtime::signal::{Flag, Pose, Scalar, Twist};

/// Inputs.
#[derive(Inputs)]
pub struct Inputs<'a> {
    #[port(unit = "N", frame = "A")]
    no_docs: In<'a, Scalar>,
    /// A bare signal.
    #[port(unit = "N", frame = "A")]
    bare: Scalar,
    /// An output.
    #[port(unit = "N", frame = "A")]
    output: Out<Scalar>,
    /// A word that is not known.
    #[port(unit = "N", fraem = "A")]
    unknown: In<'a, Scalar>,
    /// Optional, but without a value there is none.
    #[port(optional)]
    optional: In<'a, Flag>,
    /// Delayed, but there is no value in the first tick.
    #[port(delayed)]
    delayed: In<'a, Flag>,
    /// Any number is optional.
    #[port(frame = "A", optional)]
    many: Many<'a, Twist>,
    /// Delayed and sampled.
    #[port(delayed, sampled)]
    both: Option<In<'a, Flag>>,
    /// Optional twice.
    #[port(optional, present_if_wired)]
    twice: Option<In<'a, Flag>>,
    /// A frame that is none.
    #[port(frame = "Base frame")]
    frame: In<'a, Twist>,
    /// A pose of nothing.
    #[port(frame = "_", reference = "B")]
    nothing: In<'a, Pose>,
}

/// Outputs.
#[derive(Outputs)]
pub struct Outputs<'a> {
    no_docs: Out<Flag>,
    /// An input.
    input: In<'a, Flag>,
    /// A word of inputs.
    #[port(sampled)]
    sampled: Out<Flag>,
}

/// No names.
#[derive(Outputs)]
pub struct Tuple(Out<Flag>);

/// No struct.
#[derive(Inputs)]
pub enum NoStruct {}

fn main() {}
