//! An arm that a person guides, and a posture in which it is held still.

use std::path::PathBuf;

use nalgebra::IsometryMatrix3;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::Description;
use tactflow_runtime::node::FilePath;
use tactflow_runtime::signal::{Joint, Joints, Twist};
use tactflow_runtime::source::SourceMap;

use super::{BoundRole, CellPort, GuidedCell, Left};
use crate::arm::chain::Chain;
use crate::arm::model::load;
use crate::arm::mount::Mount;

/// Time over which a posture is averaged [s].
const AVERAGE_S: f64 = 0.5;
/// Number of samples that a posture needs.
const MIN_SAMPLES: u32 = 5;
/// Range of a joint above which the arm is not still [rad].
const MAX_MOTION_RAD: f64 = 0.003;

/// An arm of the cell.
pub(crate) struct GuidedArm {
    pub(crate) bound: BoundRole,
    pub(crate) position: CellPort<Joints>,
    /// From the base to the tip, without a sensor.
    chain: Chain,
}

/// A posture in which the arm was still.
#[derive(Debug, Clone)]
pub(crate) struct StillPosture {
    /// Mean position of each joint [rad; m if prismatic].
    pub(crate) joints: Vec<f64>,
    /// Pose of the tip in the base [m].
    pub(crate) tip: IsometryMatrix3<f64>,
}

impl GuidedArm {
    /// Returns the arm of the role `wanted`, or the only one that the bench binds.
    ///
    /// # Errors
    /// If there is none, or several, or if its model cannot be read.
    pub(crate) fn find(cell: &GuidedCell<'_>, wanted: Option<&str>) -> Result<Self, String> {
        let (bound, position) = cell.role::<Joints>("position", "an arm", wanted, "--arm")?;
        let description = cell.device(position).description();
        let chain = chain(cell.shell().catalogue(), description, &bound)?;
        Ok(Self { bound, position, chain })
    }

    /// Returns the joints of the model.
    pub(crate) fn joints(&self) -> &[Joint] {
        self.chain.joints()
    }

    /// Returns the pose of the tip in the base [m].
    pub(crate) fn tip(&self, joints: &[f64]) -> IsometryMatrix3<f64> {
        self.chain.forward(joints, &mut vec![Twist::default(); joints.len()]).0
    }

    /// Measures the posture for half a second. `each` is called after each look at the cell.
    ///
    /// # Errors
    /// If the dialogue ends. The inner error says why there is no still posture: the arm moves, is outside of the range
    /// of a joint, or sends nothing.
    pub(crate) fn still(
        &self,
        cell: &mut GuidedCell<'_>,
        mut each: impl FnMut(&GuidedCell<'_>),
    ) -> Result<Result<StillPosture, String>, Left> {
        let mut range = Range::new(self.chain.joints().len());
        let mut writes = cell.writes(self.position);
        cell.watch(AVERAGE_S, |cell| {
            each(cell);
            if cell.writes(self.position) > writes {
                writes = cell.writes(self.position);
                cell.read(self.position).into_iter().for_each(|joints| range.add(&joints.0));
            }
            None::<()>
        })?;
        Ok(range.mean(self.chain.joints()).map(|joints| StillPosture { tip: self.tip(&joints), joints }))
    }
}

/// Returns the chain from the base to the tip of an arm, by what its device states.
///
/// # Errors
/// If the device states no arm, or if its model cannot be read.
pub(crate) fn chain(catalogue: &Catalogue, description: &Description, bound: &BoundRole) -> Result<Chain, String> {
    let fact = |name: &str| {
        let value = description.fact_on(bound.side.as_deref(), "velocity_arm", name);
        let text = value.and_then(|value| value.as_str()).map(str::to_owned);
        text.ok_or_else(|| format!("device `{}` states no `{name}`", bound.device))
    };
    let urdf = file(catalogue, &fact("urdf")?);
    load(&urdf, &fact("tip")?, &Mount::NONE).map_err(|mistakes| {
        let why = mistakes.first().map_or("", |mistake| &mistake.message);
        format!("the model of device `{}` cannot be read: {why}", bound.device)
    })
}

/// Returns the file that a fact names; it was read before, so it exists.
fn file(catalogue: &Catalogue, path: &str) -> FilePath {
    let path = PathBuf::from(path);
    let builtin = SourceMap::with_builtin(catalogue.builtin_files()).builtin(&path).ok().flatten();
    FilePath { path, span: 0..0, builtin }
}

/// Collects the mean and the range of each joint.
struct Range {
    samples: u32,
    sums: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Range {
    fn new(joints: usize) -> Self {
        let [low, high] = [f64::INFINITY, f64::NEG_INFINITY].map(|bound| vec![bound; joints]);
        Self { samples: 0, sums: vec![0.0; joints], low, high }
    }

    fn add(&mut self, joints: &[f64]) {
        self.samples += 1;
        for (i, q) in joints.iter().enumerate() {
            self.sums[i] += q;
            self.low[i] = self.low[i].min(*q);
            self.high[i] = self.high[i].max(*q);
        }
    }

    fn mean(&self, joints: &[Joint]) -> Result<Vec<f64>, String> {
        if self.samples < MIN_SAMPLES {
            let samples = self.samples;
            return Err(format!(
                "the arm sent {samples} positions in {AVERAGE_S} s, and {MIN_SAMPLES} are needed: is it connected?"
            ));
        }
        let mean: Vec<f64> = self.sums.iter().map(|sum| sum / f64::from(self.samples)).collect();
        for (i, Joint { name, lower, upper, .. }) in joints.iter().enumerate() {
            let range = self.high[i] - self.low[i];
            if range > MAX_MOTION_RAD {
                return Err(format!("joint `{name}` moved by {range:.4} rad in {AVERAGE_S} s: hold the arm still"));
            }
            let q = mean[i];
            if !(lower..=upper).contains(&&q) {
                return Err(format!(
                    "joint `{name}` is at {q:.4} rad, outside of its range from {lower:.4} to {upper:.4} rad"
                ));
            }
        }
        Ok(mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint() -> Vec<Joint> {
        vec![Joint { name: "elbow".into(), lower: -2.0, upper: 2.0, ..Joint::default() }]
    }

    fn range(positions: impl IntoIterator<Item = f64>) -> Range {
        let mut range = Range::new(1);
        positions.into_iter().for_each(|q| range.add(&[q]));
        range
    }

    #[test]
    fn a_still_posture_is_the_mean() {
        let mean = range((0..10).map(|i| 1.0 + f64::from(i % 2) * 0.002)).mean(&joint()).expect("it is still");
        assert!((mean[0] - 1.001).abs() < 1e-12, "{mean:?}");
    }

    #[test]
    fn a_posture_that_moves_or_cannot_be_or_is_not_sent_is_refused() {
        let cases: [(Vec<f64>, &str); 3] = [
            ((0..10).map(|i| f64::from(i) * 1e-3).collect(), "joint `elbow` moved by 0.0090 rad"),
            (vec![2.1; 10], "joint `elbow` is at 2.1000 rad, outside of its range"),
            (vec![0.0; 4], "the arm sent 4 positions"),
        ];
        for (positions, text) in cases {
            let message = range(positions).mean(&joint()).expect_err(text);
            assert!(message.starts_with(text), "{message}");
        }
    }
}
