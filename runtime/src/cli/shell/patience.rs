//! How long the tool waits for those who read its output.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::engine::Interrupt;

/// Time in which a reader must read something at the end of a run in real time.
const MAX_IDLE: Duration = Duration::from_secs(3);
/// The same for the order of lines on two streams.
const MAX_ORDER_IDLE: Duration = Duration::from_millis(250);
/// Time of waiting after which Ctrl-C is listened to again; before, nobody notices that the tool waits.
const SHORT: Duration = Duration::from_millis(50);

/// Whether the tool waits for readers that are slower than it is.
#[derive(Clone, Default)]
pub(crate) enum Patience {
    /// As long as the process lives: nothing moves, and Ctrl-C ends the process.
    #[default]
    Endless,
    /// Until Ctrl-C: runs in virtual time.
    Interruptible(Arc<Interrupt>),
    /// Not at all during a run in real time, and for a limited time after it.
    Limited,
}

impl Patience {
    /// Whether to wait now.
    pub(crate) fn may_wait(&self) -> bool {
        match self {
            Self::Endless => true,
            Self::Interruptible(interrupt) => !interrupt.is_requested(),
            Self::Limited => false,
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
        // Ctrl-C has ended the run already, so it does not end this as well.
        let is_limited = !self.may_wait();
        let interrupt = match self {
            Self::Interruptible(interrupt) if !is_limited => Some(interrupt.clone()),
            _ => None,
        };
        Waiting { is_limited, max_idle, interrupt, since: Instant::now(), progress: 0 }
    }
}

/// Waits for a reader while it reads.
pub(crate) struct Waiting {
    /// Whether a reader that reads nothing is given up after `max_idle`.
    is_limited: bool,
    max_idle: Duration,
    interrupt: Option<Arc<Interrupt>>,
    /// Time of the last progress.
    since: Instant,
    progress: u64,
}

impl Waiting {
    /// Whether to go on waiting. `progress` counts what has been read.
    pub(crate) fn goes_on(&mut self, progress: u64) -> bool {
        if progress != self.progress {
            (self.since, self.progress) = (Instant::now(), progress);
        }
        let idle = self.since.elapsed();
        if self.is_limited && self.interrupt.is_none() && idle > SHORT {
            // Without it, the limit of the time still ends the wait.
            self.interrupt = Interrupt::catch().ok().map(Arc::new);
        }
        let is_interrupted = self.interrupt.as_ref().is_some_and(|interrupt| interrupt.is_requested());
        let is_over = self.is_limited && idle > self.max_idle;
        !is_interrupted && !is_over
    }
}
