//! The steps of a simulation: how long they may be.

use tactflow_runtime::node::Mistake;

/// Valid steps of a simulation [s].
const STEP_RANGE_S: std::ops::RangeInclusive<f64> = 1e-6..=0.002;

/// Returns the mistake in the longest step of a simulation [s], if there is one.
#[must_use]
pub fn check_step(step_s: f64) -> Option<Mistake> {
    let mistake = || Mistake::param("step_s", "the step must be from 1e-6 to 0.002 s");
    (!STEP_RANGE_S.contains(&step_s)).then(mistake)
}

/// Returns whether steps of `dt` [s] resolve a spring and a damper; `stiffness` [1/s²] and `damping` [1/s] are divided
/// by the mass.
///
/// Semi-implicit Euler is stable for dt² k + 2 dt c < 4. Half of that is left for the foam.
#[must_use]
pub fn is_resolved(stiffness: f64, damping: f64, dt: f64) -> bool {
    dt * dt * stiffness + 2.0 * dt * damping <= 2.0
}
