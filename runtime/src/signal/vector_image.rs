//! Images of a pad with three axes.

use serde::{Deserialize, Serialize};

use super::cells::Cells;
use super::image::ImageShape;

/// The shape of a vector image: that of the image of one of its axes.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct VectorImageShape(pub ImageShape);

/// A vector image: `[x, y, z]` for each tactel, row by row.
///
/// x and y are the force with which the object drags the tactel along the axes of the sensor. z is the force with which
/// the object presses the tactel, positive as in an [`Image`](super::Image).
pub type VectorImage = Cells<[f32; 3]>;
