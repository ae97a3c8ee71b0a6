//! The least squares of the mount: Levenberg and Marquardt on the rotation, the translation and the touched point.

use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, SMatrix, SVector, Translation3, Vector3};

use super::MountPosture;

/// Unknowns: rotation, translation and point.
const UNKNOWNS: usize = 9;
/// Maximum number of steps.
const MAX_STEPS: usize = 60;
/// Damping of the first step, as a fraction of the diagonal [1].
const FIRST_DAMPING: f64 = 1e-3;
/// Damping from which on no step is expected to help [1].
const MAX_DAMPING: f64 = 1e12;
/// Length of a step at which the solution has settled [rad, m].
const SETTLED: f64 = 1e-12;
/// Information that is added to each unknown, so that one that is not observable gets a huge variance [1].
const RIDGE: f64 = 1e-9;

type Information = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type Step = SVector<f64, UNKNOWNS>;

/// What is solved for, besides the touched point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unknown {
    /// Only the translation; the rotation is given.
    Translation,
    /// Rotation and translation.
    Pose,
}

/// The solution of a start.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub(super) mount: IsometryMatrix3<f64>,
    pub(super) point: Vector3<f64>,
    /// Sum of the squares of the residuals [m²].
    pub(super) cost: f64,
    /// Inverse of the information without noise, in the order rotation, translation, point.
    covariance: Information,
    /// Number of equations beyond the number of unknowns.
    freedom: usize,
}

impl Solution {
    /// Returns the standard deviation of each coordinate of a residual [m].
    pub(super) fn noise(&self) -> f64 {
        (self.cost / self.freedom as f64).sqrt()
    }

    /// Returns the covariance of the rotation about the axes of the pad, under a noise [m].
    pub(super) fn turn_covariance(&self, noise: f64) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(0, 0) * (noise * noise)
    }

    /// Returns the covariance of the translation along the axes of the tip, under a noise [m].
    pub(super) fn shift_covariance(&self, noise: f64) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(3, 3) * (noise * noise)
    }
}

/// A state of the iteration.
#[derive(Debug, Clone, Copy)]
struct State {
    mount: IsometryMatrix3<f64>,
    point: Vector3<f64>,
}

impl State {
    fn cost(&self, touches: &[MountPosture]) -> f64 {
        touches.iter().map(|touch| (touch.point(&self.mount) - self.point).norm_squared()).sum()
    }

    /// Returns the state after a step.
    fn moved(&self, step: &Step) -> Self {
        let rotation = self.mount.rotation * Rotation3::new(step.fixed_rows::<3>(0).into_owned());
        let translation = Translation3::from(self.mount.translation.vector + step.fixed_rows::<3>(3));
        let mount = IsometryMatrix3::from_parts(translation, rotation);
        Self { mount, point: self.point + step.fixed_rows::<3>(6) }
    }
}

/// Solves from a rotation.
pub(super) fn solve(touches: &[MountPosture], rotation: &Rotation3<f64>, unknown: Unknown) -> Solution {
    let start = IsometryMatrix3::from_parts(Translation3::identity(), *rotation);
    let points = touches.iter().map(|touch| touch.point(&start));
    let mut state = State { mount: start, point: points.sum::<Vector3<f64>>() / touches.len() as f64 };
    let (mut cost, mut damping) = (state.cost(touches), FIRST_DAMPING);
    for _ in 0..MAX_STEPS {
        let (information, gradient) = normal(touches, &state, unknown);
        let Some((next, length)) = descend(&information, &gradient, &state, damping) else { break };
        let next_cost = next.cost(touches);
        if next_cost < cost {
            (state, cost, damping) = (next, next_cost, damping * 0.1);
        } else {
            damping *= 10.0;
        }
        if length < SETTLED || damping > MAX_DAMPING {
            break;
        }
    }
    let (information, _) = normal(touches, &state, unknown);
    let covariance = (information + Information::identity() * RIDGE).try_inverse().unwrap_or(Information::identity());
    let unknowns = if unknown == Unknown::Pose { UNKNOWNS } else { UNKNOWNS - 3 };
    let freedom = (3 * touches.len()).saturating_sub(unknowns).max(1);
    Solution { mount: state.mount, point: state.point, cost, covariance, freedom }
}

/// Returns the state after a damped step, and the length of the step.
fn descend(information: &Information, gradient: &Step, state: &State, damping: f64) -> Option<(State, f64)> {
    let damped = information + Information::from_diagonal(&information.diagonal()) * damping;
    let step = -(damped + Information::identity() * RIDGE * RIDGE).cholesky()?.solve(gradient);
    Some((state.moved(&step), step.norm()))
}

/// Returns J'J and J'r. The rows and columns of a given rotation are zero.
fn normal(touches: &[MountPosture], state: &State, unknown: Unknown) -> (Information, Step) {
    let (mut information, mut gradient) = (Information::zeros(), Step::zeros());
    for touch in touches {
        let jacobian = jacobian(touch, &state.mount, unknown);
        let residual = touch.point(&state.mount) - state.point;
        information += jacobian.transpose() * jacobian;
        gradient += jacobian.transpose() * residual;
    }
    (information, gradient)
}

/// Returns the derivative of a residual: -R_i R [s_i] by a turn of the pad in its own frame, R_i by the translation, and
/// -1 by the point.
fn jacobian(touch: &MountPosture, mount: &IsometryMatrix3<f64>, unknown: Unknown) -> SMatrix<f64, 3, UNKNOWNS> {
    let mut jacobian = SMatrix::<f64, 3, UNKNOWNS>::zeros();
    let [x, y] = touch.place;
    if unknown == Unknown::Pose {
        let turned = (touch.tip.rotation * mount.rotation).matrix() * -Vector3::new(x, y, 0.0).cross_matrix();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&turned);
    }
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(touch.tip.rotation.matrix());
    jacobian.fixed_view_mut::<3, 3>(0, 6).copy_from(&-Matrix3::identity());
    jacobian
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::motion::pose::testing::any_pose;

    proptest! {
        #[test]
        fn the_jacobian_is_the_finite_difference(
            tip in any_pose(), mount in any_pose(), place in prop::array::uniform2(-0.1..0.1_f64),
            point in prop::array::uniform3(-1.0..1.0_f64),
        ) {
            const H: f64 = 1e-6;
            let touch = MountPosture { tip: tip.0, place };
            let state = State { mount: mount.0, point: point.into() };
            let jacobian = jacobian(&touch, &state.mount, Unknown::Pose);
            let residual = |step: &Step| {
                let State { mount, point } = state.moved(step);
                touch.point(&mount) - point
            };
            for i in 0..UNKNOWNS {
                let step = Step::from_fn(|k, _| if k == i { H } else { 0.0 });
                let difference = (residual(&step) - residual(&-step)) / (2.0 * H);
                prop_assert!((jacobian.column(i) - difference).norm() < 1e-8, "column {}", i);
            }
        }
    }
}
