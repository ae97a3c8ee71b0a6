//! What travels on a wire: a closed set of kinds, each with its shape, its unit and its frame.
//!
//! Own crates add nodes, not kinds; so the recorder, the finite check and the bridges have one place each. The size of
//! a value is fixed once its shape is known, so every slot is allocated at load and none after it.

mod features;
mod freshness;
mod image;
mod joints;
mod kind;
pub mod line;
mod mask;
mod regions;
mod scalars;
mod spatial;
mod unit;

pub use features::{Component, Feature, Features, FeaturesShape};
pub use freshness::{Freshness, Mark, Stamp};
pub use image::{Image, ImageShape};
pub use joints::{Jacobian, Joint, Joints, JointsShape};
pub use kind::{Arenas, Flag, FlagShape, JacobianShape, Kind, MaskShape, Scalar, ScalarShape, Settable, Shape, Signal};
pub use mask::{Grid, Mask};
pub use regions::{Region, Regions, RegionsShape, Run};
pub use spatial::{Pose, PoseShape, Twist, TwistShape};
pub use unit::{Base, Unit};

/// Whether no bit pattern of `values` is an infinity or NaN: bits and no float sums, so that it vectorises.
#[inline]
pub(crate) fn all_finite(values: &[f64]) -> bool {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    const ONE: u64 = 1 << 52;
    // An exponent of ones, and no other, carries into the sign.
    let carries = values.iter().fold(0, |carries, v| carries | ((v.to_bits() & EXPONENT) + ONE));
    carries >> 63 == 0
}
