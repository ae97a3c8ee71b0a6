//! The scalars in a value of each kind. This is the only file that lists the components of every kind.

use nalgebra::UnitQuaternion;

use super::{Arenas, Features, Flag, Joints, Kind, Pose, Scalar, Shape, Signal, Twist, Unit};

impl Shape {
    /// Returns the scalars of a value of this shape: the suffix of each name (empty for a scalar or a flag) and its
    /// unit. Images, vector images, masks, regions and Jacobians have none.
    #[must_use]
    pub fn scalars(&self) -> Vec<(String, Unit)> {
        let named =
            |names: &[&str], unit: Unit| names.iter().map(|name| ((*name).to_owned(), unit)).collect::<Vec<_>>();
        match self {
            Self::Scalar(shape) => named(&[""], shape.unit),
            Self::Flag(_) => named(&[""], Unit::ONE),
            Self::Features(shape) => {
                shape.features.iter().map(|feature| (feature.name.clone(), feature.unit)).collect()
            }
            Self::Twist(_) => {
                let linear = named(&["vx", "vy", "vz"], Unit::METRE.per_second());
                [linear, named(&["wx", "wy", "wz"], Unit::RADIAN.per_second())].concat()
            }
            Self::Pose(_) => {
                [named(&["x", "y", "z"], Unit::METRE), named(&["qx", "qy", "qz", "qw"], Unit::ONE)].concat()
            }
            Self::Joints(shape) => shape.joints.iter().map(|joint| (joint.name.clone(), shape.unit)).collect(),
            Self::Image(_) | Self::VectorImage(_) | Self::Mask(_) | Self::Regions(_) | Self::Jacobian(_) => Vec::new(),
        }
    }
}

impl Arenas {
    /// Reads the scalars of one value, from index `first` on, into the front of `row`. Returns the number of scalars
    /// read. An absent feature is NaN. Allocates nothing.
    #[inline]
    pub(crate) fn read_scalars(&self, kind: Kind, slot: u32, first: usize, row: &mut [f64]) -> usize {
        let slot = slot as usize;
        match kind {
            Kind::Scalar => write(row, first, [Scalar::arena(self)[slot]]),
            Kind::Flag => write(row, first, [f64::from(u8::from(Flag::arena(self)[slot]))]),
            Kind::Features => {
                let features = Features::arena(self)[slot].components();
                write(row, first, features.iter().map(|component| component.get().unwrap_or(f64::NAN)))
            }
            Kind::Twist => write(row, first, Twist::arena(self)[slot].0.iter().copied()),
            Kind::Pose => {
                let pose = Pose::arena(self)[slot].0;
                let quaternion = UnitQuaternion::from_rotation_matrix(&pose.rotation).coords;
                write(row, first, pose.translation.vector.iter().chain(quaternion.iter()).copied())
            }
            Kind::Joints => write(row, first, Joints::arena(self)[slot].0.iter().copied()),
            Kind::Image | Kind::VectorImage | Kind::Mask | Kind::Regions | Kind::Jacobian => 0,
        }
    }
}

#[inline]
fn write(row: &mut [f64], first: usize, values: impl IntoIterator<Item = f64>) -> usize {
    let mut count = 0;
    for (cell, value) in row.iter_mut().zip(values.into_iter().skip(first)) {
        *cell = value;
        count += 1;
    }
    count
}
