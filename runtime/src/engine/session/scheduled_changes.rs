//! Changes of parameters that are scheduled before the run. In virtual time they are prepared between two ticks, so that
//! every run is the same; in real time by a thread of their own, so that no tick waits for them.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use super::changer::{Changer, Walk};
use super::engine::Engine;

/// Interval at which the thread looks for work. The steps in the ring last longer.
const LOOK: Duration = Duration::from_millis(2);
/// The same while nothing changes and nothing is scheduled.
const IDLE_LOOK: Duration = Duration::from_millis(20);

/// A change that another thread requests while the graph runs in real time.
pub struct ChangeRequest {
    /// Parameters and their values, which change together.
    pub values: Vec<(String, f64)>,
    /// Takes the ways of the parameters, or why the change is refused.
    pub answer: Box<dyn FnOnce(Result<Vec<Walk>, String>) + Send>,
}

/// Changes that begin at times of the graph's clock.
pub struct ScheduledChanges<'c> {
    changer: Changer<'c>,
    /// Time [ns], parameter and value, in order of time.
    due: VecDeque<(i64, String, f64)>,
    requests: Option<Receiver<ChangeRequest>>,
}

impl<'c> ScheduledChanges<'c> {
    /// Schedules changes: time [s], parameter and value.
    ///
    /// # Errors
    /// Returns why one of them is refused.
    pub fn new(changer: Changer<'c>, changes: &[(f64, String, f64)]) -> Result<Self, String> {
        for (_, name, value) in changes {
            changer.find(name, *value)?;
        }
        let mut due: Vec<(i64, String, f64)> =
            changes.iter().map(|(at, name, value)| ((at * 1e9) as i64, name.clone(), *value)).collect();
        due.sort_by_key(|(at, ..)| *at);
        Ok(Self { changer, due: due.into(), requests: None })
    }

    /// Takes requests of other threads too. They are carried out in real time only.
    #[must_use]
    pub fn with_requests(self, requests: Receiver<ChangeRequest>) -> Self {
        Self { requests: Some(requests), ..self }
    }

    /// Begins the changes that are due at `now` [ns], and prepares steps for the next ticks.
    pub(super) fn prepare(&mut self, now: i64) {
        while let Some((_, name, value)) = self.due.pop_front_if(|(at, ..)| *at <= now) {
            if let Err(why) = self.changer.set(&name, value) {
                tracing::warn!("{why}");
            }
        }
        if let Err(why) = self.changer.prepare() {
            tracing::warn!("a change ends early: {why}");
        }
    }

    /// Returns the parameters that have not reached their values, in words; those of `engine` hold.
    #[must_use]
    pub fn unfinished(&self, engine: &Engine) -> Vec<String> {
        let values = engine.live_values().zip(self.changer.targets());
        let left = values.filter(|(live, target)| live.value.to_bits() != target.to_bits());
        left.map(|(live, target)| {
            format!("`{}` was {} at the end, on its way to {target}", live.param.name, live.value)
        })
        .collect()
    }

    /// Prepares steps until the run is over. `now` is the time of the graph [ns]. A panic ends the changes, and not the
    /// run.
    pub(super) fn work(&mut self, now: &AtomicI64, is_over: &AtomicBool) {
        if catch_unwind(AssertUnwindSafe(|| self.work_until(now, is_over))).is_err() {
            tracing::error!("no parameter changes any more: the thread that prepares changes has failed");
            // Whoever waits for an answer gets none.
            self.requests = None;
        }
    }

    fn work_until(&mut self, now: &AtomicI64, is_over: &AtomicBool) {
        while !is_over.load(Ordering::Relaxed) {
            self.prepare(now.load(Ordering::Relaxed));
            let is_idle = self.due.is_empty() && !self.changer.is_moving();
            self.wait(if is_idle { IDLE_LOOK } else { LOOK });
        }
    }

    /// Waits for a request, and carries it out. Between two requests, steps are prepared.
    fn wait(&mut self, time: Duration) {
        let Some(requests) = &self.requests else { return std::thread::sleep(time) };
        match requests.recv_timeout(time) {
            Ok(ChangeRequest { values, answer }) => answer(self.changer.set_all(&values)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => self.requests = None,
        }
    }
}
