//! The corners of the pads of an arm.

use nalgebra::{Point3, Vector3};
use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::signal::{ImageShape, Pose};
use tactflow_runtime::source::Code;

/// The corners of the pads of an arm, each in the frame of its pad [m].
#[derive(Debug, Clone, Copy)]
pub(super) struct Pads {
    first: [Vector3<f64>; 4],
    second: Option<[Vector3<f64>; 4]>,
}

impl Pads {
    /// Creates the pads from the shapes of their images. `wired` is whether each of `second_contact`, `second_image`
    /// and `second_pose` is: a second pad needs all three.
    pub(super) fn new([first, second]: [Option<&ImageShape>; 2], wired: [bool; 3]) -> Result<Self, Mistakes> {
        let names = ["second_contact", "second_image", "second_pose"];
        let missing = names.into_iter().zip(wired).find(|(_, is_wired)| !is_wired && wired.contains(&true));
        if let Some((missing, _)) = missing {
            let message = format!("a second pad needs `{}`, and `{missing}` is not wired", names.join("`, `"));
            let mistake = Mistake::new(Code::MissingInput, At::Node, message);
            return Err(mistake.help(format!("wire `in.{missing}`, or none of the three")).into());
        }
        let first = corners(first.unwrap_or(&ImageShape::default()));
        Ok(Self { first, second: second.map(corners) })
    }

    /// Returns the corners of the second pad in the frame of the first one, from the poses of both; `None` if there is
    /// no second pad.
    pub(super) fn second(&self, pose: &Pose, second: &Pose) -> Option<[Vector3<f64>; 4]> {
        let relative = pose.0.inverse() * second.0;
        self.second.map(|corners| corners.map(|corner| (relative * Point3::from(corner)).coords))
    }

    /// Returns the corners of both pads in the frame of the first one. Those of the first pad stand in for a `second`
    /// pad that is not there.
    pub(super) fn all(&self, second: Option<&[Vector3<f64>; 4]>) -> [Vector3<f64>; 8] {
        let second = second.unwrap_or(&self.first);
        std::array::from_fn(|i| if i < 4 { self.first[i] } else { second[i - 4] })
    }
}

/// Returns the corners of a pad in its own frame [m].
#[must_use]
pub fn corners(shape: &ImageShape) -> [Vector3<f64>; 4] {
    let [x, y] = shape.half();
    [[x, y], [x, -y], [-x, y], [-x, -y]].map(|[x, y]| Vector3::new(x, y, 0.0))
}
