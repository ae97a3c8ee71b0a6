//! Which limit acts while a response is measured: the sensor then moves less than its loop commands.

use serde::Serialize;
use tactflow_runtime::engine::Engine;

/// Part of the ticks from which on a limit makes a response another one [1]. Those of the fastest sines alone are less.
const MUCH: f64 = 0.2;

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
    limits: Vec<(String, usize)>,
    ticks: usize,
}

impl Watch {
    pub(super) fn new(engine: &Engine) -> Self {
        let limits = engine.limits().map(|(name, _)| (name.to_owned(), 0));
        Self { limits: limits.collect(), ticks: 0 }
    }

    /// Counts the last tick of the engine.
    pub(super) fn see(&mut self, engine: &Engine) {
        self.ticks += 1;
        for ((_, count), (_, scale)) in self.limits.iter_mut().zip(engine.limits()) {
            *count += usize::from(scale < 1.0);
        }
    }

    /// Returns the limit that has acted most, if it has acted much.
    pub(super) fn most(&self) -> Option<Limited> {
        let (limit, count) = self.limits.iter().max_by_key(|(_, count)| *count)?;
        let share = *count as f64 / self.ticks.max(1) as f64;
        (share > MUCH).then(|| Limited { limit: limit.clone(), share })
    }
}
