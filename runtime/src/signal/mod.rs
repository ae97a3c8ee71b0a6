//! The values on wires: a closed set of kinds, each with its shape, unit and frame.
//!
//! Other crates can add nodes but not kinds, so the recorder, the finite check and the bridges handle every kind in one
//! place. The shape fixes the size of a value, so every slot is allocated at load and never later.

mod bytes;
mod cells;
mod decimal;
mod features;
mod freshness;
mod image;
mod joints;
mod kind;
pub mod line;
mod mask;
mod measure;
mod regions;
mod scalars;
mod spatial;
mod unit;
mod unit_size;
mod vector_image;

pub(crate) use bytes::{ByteReader, put_text};
pub use cells::Cells;
pub use features::{Component, Feature, Features, FeaturesShape};
pub use freshness::{Freshness, Mark, Stamp};
pub use image::{Image, ImageShape};
pub use joints::{Jacobian, Joint, Joints, JointsShape};
pub use kind::{Arenas, Flag, FlagShape, JacobianShape, Kind, MaskShape, Scalar, ScalarShape, Settable, Shape, Signal};
pub use mask::{Grid, Mask};
pub use measure::{Measure, MeasureError};
pub use regions::{Region, Regions, RegionsShape, Run};
pub use spatial::{Pose, PoseShape, Twist, TwistShape};
pub use unit::{Base, Unit};
pub use unit_size::UnitSize;
pub use vector_image::{VectorImage, VectorImageShape};

/// Whether every value is finite. Checks the bits of the exponents, so that the loop vectorises.
#[inline]
pub(crate) fn all_finite(values: &[f64]) -> bool {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    const ONE: u64 = 1 << 52;
    // Only an exponent of all ones (infinity or NaN) carries into the sign bit.
    let carries = values.iter().fold(0, |carries, v| carries | ((v.to_bits() & EXPONENT) + ONE));
    carries >> 63 == 0
}
