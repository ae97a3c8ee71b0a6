//! Which limit acts while a response is measured: the sensor then moves less than its loop commands.

use serde::Serialize;
use tactflow_runtime::engine::Engine;
use tactflow_runtime::node::PortId;
use tactflow_runtime::signal::Scalar;

/// Part of the ticks from which on a limit makes a response another one [1]. Those of the fastest sines alone are less.
const MUCH: f64 = 0.2;
/// A scale that differs from one by less is no limit [1].
const ROUNDING: f64 = 1e-6;

/// A limit that has reduced the motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Limited {
    /// `node.limit`.
    pub(super) limit: String,
    /// Part of the ticks in which it did [1].
    pub(super) share: f64,
}

/// The limits of a run, with the number of ticks in which each of them has reduced the motion.
pub(super) struct Watch {
    limits: Vec<(String, PortId, usize)>,
    ticks: usize,
}

impl Watch {
    pub(super) fn new(engine: &Engine) -> Self {
        let limits = engine.limits().map(|(name, id)| (name.to_owned(), id, 0));
        Self { limits: limits.collect(), ticks: 0 }
    }

    /// Counts the last tick of the engine.
    pub(super) fn see(&mut self, engine: &Engine) {
        self.ticks += 1;
        for (_, id, count) in &mut self.limits {
            let scale = engine.bus().get::<Scalar>(*id);
            *count += usize::from(scale.is_some_and(|scale| *scale < 1.0 - ROUNDING));
        }
    }

    /// Returns the limit that has acted most, if it has acted much.
    pub(super) fn most(&self) -> Option<Limited> {
        let (limit, _, count) = self.limits.iter().max_by_key(|(_, _, count)| *count)?;
        let share = *count as f64 / self.ticks.max(1) as f64;
        (share > MUCH).then(|| Limited { limit: limit.clone(), share })
    }
}
