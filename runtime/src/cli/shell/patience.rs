//! How long the tool waits for those who read its output.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::engine::Interrupt;

/// Time in which a reader must read something at the end of a run in real time.
const MAX_IDLE: Duration = Duration::from_secs(3);
/// The same for the order of lines on two streams.
const MAX_ORDER_IDLE: Duration = Duration::from_millis(250);
/// Time from the signal that ended a run to the end of all waits; soon after it, the process is cut off.
const MAX_AFTER_SIGNAL: Duration = Duration::from_millis(3900);
/// Time that a wait has even if it begins later than that, so that a reader who reads gets the last lines.
const MIN_WAIT: Duration = Duration::from_millis(100);

/// Whether the tool waits for readers that are slower than it is.
#[derive(Clone, Default)]
pub(crate) enum Patience {
    /// As long as the process lives: nothing moves, and Ctrl-C ends the process.
    #[default]
    Endless,
    /// Until Ctrl-C: runs in virtual time.
    Interruptible(Arc<Interrupt>),
    /// Not at all during a run in real time. After it, for a limited time or until Ctrl-C.
    Limited(Arc<Interrupt>),
    /// For a limited time after a run that a signal has ended. A second signal ends the process.
    Interrupted(Arc<Interrupt>),
}

impl Patience {
    /// Returns how long to wait once the run is over.
    pub(crate) fn after_run(&self) -> Self {
        match self {
            Self::Interruptible(interrupt) | Self::Limited(interrupt) if interrupt.is_requested() => {
                Self::Interrupted(interrupt.clone())
            }
            same => same.clone(),
        }
    }

    /// Whether to wait now.
    pub(crate) fn may_wait(&self) -> bool {
        match self {
            Self::Endless => true,
            Self::Interruptible(interrupt) => !interrupt.is_requested(),
            Self::Limited(_) | Self::Interrupted(_) => false,
        }
    }

    /// Begins to wait for the rest, when the run is over and nothing moves any more.
    pub(crate) fn begin(&self) -> Waiting {
        self.waiting(MAX_IDLE)
    }

    /// Begins to wait for the other stream, so that the lines of both keep their order on a terminal.
    pub(crate) fn begin_short(&self) -> Waiting {
        self.waiting(MAX_ORDER_IDLE)
    }

    fn waiting(&self, max_idle: Duration) -> Waiting {
        let now = Instant::now();
        let mut waiting = Waiting { max_idle: None, interrupt: None, deadline: None, since: now, progress: 0 };
        match self {
            Self::Endless => {}
            Self::Interruptible(interrupt) => waiting.interrupt = Some(interrupt.clone()),
            Self::Limited(interrupt) => {
                (waiting.max_idle, waiting.interrupt) = (Some(max_idle), Some(interrupt.clone()));
            }
            Self::Interrupted(interrupt) => {
                let left = MAX_AFTER_SIGNAL.saturating_sub(interrupt.since_signal().unwrap_or_default());
                (waiting.max_idle, waiting.deadline) = (Some(max_idle), Some(now + left.max(MIN_WAIT)));
            }
        }
        waiting
    }
}

/// Waits for a reader while it reads.
pub(crate) struct Waiting {
    /// Time after which a reader that reads nothing is given up.
    max_idle: Option<Duration>,
    /// Whose signal ends the wait.
    interrupt: Option<Arc<Interrupt>>,
    /// When the wait ends, even for a reader that reads.
    deadline: Option<Instant>,
    /// Time of the last progress.
    since: Instant,
    progress: u64,
}

impl Waiting {
    /// Whether to go on waiting. `progress` counts what has been read.
    pub(crate) fn goes_on(&mut self, progress: u64) -> bool {
        let now = Instant::now();
        if progress != self.progress {
            (self.since, self.progress) = (now, progress);
        }
        let is_interrupted = self.interrupt.as_ref().is_some_and(|interrupt| interrupt.is_requested());
        let is_idle = self.max_idle.is_some_and(|max_idle| now - self.since > max_idle);
        let is_late = self.deadline.is_some_and(|deadline| now >= deadline);
        !is_interrupted && !is_idle && !is_late
    }
}
