//! What the filters of a feature share: their ports, how values are averaged, and a ring of the newest samples.

mod ring;

use tactflow_runtime::node::{In, Inputs, Out, Outputs};
use tactflow_runtime::signal::Scalar;

use crate::motion::axis::{doubled, halved};

pub(super) use ring::Ring;

/// What a filter reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Any feature.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    pub(super) value: In<'a, Scalar>,
}

/// What a filter writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The filtered feature.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    pub(super) value: Out<Scalar>,
}

/// How the values of a feature are averaged: numbers as they are, axes as the unit vectors of their doubled angles.
pub(super) struct Averaging {
    is_axial: bool,
}

impl Averaging {
    /// Returns the averaging for the unit of the input, and gives the output the range of the input.
    pub(super) fn new(inputs: &InputsShapes, outputs: &mut OutputsShapes) -> Self {
        outputs.value.range = inputs.value.range;
        Self { is_axial: inputs.value.unit.is_axial() }
    }

    /// Returns the vector to average: the cosine and the sine of the doubled angle of an axis, else the value and 0.
    pub(super) fn vector(&self, value: f64) -> [f64; 2] {
        if self.is_axial { doubled(value) } else { [value, 0.0] }
    }

    /// Returns the value of a mean vector, or `None` for axes that cancel each other.
    pub(super) fn value(&self, mean: [f64; 2]) -> Option<f64> {
        if self.is_axial { halved(mean) } else { Some(mean[0]) }
    }
}
