//! What everybody who guides an arm states: the role `motion_guide` and its port.

use tactflow_runtime::device::{Description, Output, Samples};
use tactflow_runtime::signal::{Features, FeaturesShape, Unit};

use crate::motion::COMPONENTS;

/// The port of the role `motion_guide`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GuidePort(Output<Features>);

impl GuidePort {
    /// Adds the role `motion_guide` to a description.
    pub(crate) fn fill(description: &mut Description) -> Self {
        let [v, w] = [Unit::METRE.per_second(), Unit::RADIAN.per_second()];
        let features = COMPONENTS.into_iter().zip([v, v, v, w, w, w]);
        Self(description.fills("motion_guide").output("velocity", FeaturesShape::new(features)))
    }

    /// Writes a sample of `[vx, vy, vz, wx, wy, wz]` [m/s, rad/s].
    pub(crate) fn write(self, samples: &mut Samples, stamp: i64, sequence: u64, velocity: &[f64; 6]) {
        samples.write(self.0, stamp, sequence).fill(&velocity.map(Some));
    }
}
