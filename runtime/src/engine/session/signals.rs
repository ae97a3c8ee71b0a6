//! What a signal does: it ends a run by the ramp, and the process soon after, whatever hangs.

use std::io;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::Builder;
use std::time::{Duration, Instant};

use super::caught::{EXIT_INTERRUPTED, Signal, Wish, block_io_signals, exit_now, receive};

/// Time from the first signal to the end of the process, if something hangs. With the time for the message, it stays
/// below the 5 s that the documentation promises.
const MAX_END: Duration = Duration::from_millis(4500);

/// Catches the signals that end, suspend or trouble a process, for as long as it exists. The signals are received on
/// a thread of their own.
///
/// The first signal sets a flag. If the process has not ended after 5 s, it exits with code 130. A second signal ends it
/// at once, unless a run is under way: its commands ramp to zero first. A run cannot be suspended.
pub struct Interrupt {
    caught: &'static Caught,
    is_run: bool,
}

impl Interrupt {
    /// Starts to catch the signals.
    ///
    /// # Errors
    /// If the signal handlers or a thread cannot be set up.
    pub fn catch() -> io::Result<Self> {
        Self::start(false)
    }

    /// Starts to catch the signals for a run, whose ramp no signal cuts short.
    pub(crate) fn of_run() -> io::Result<Self> {
        Self::start(true)
    }

    fn start(is_run: bool) -> io::Result<Self> {
        block_io_signals()?;
        let caught = caught()?;
        let mut phase = caught.phase();
        phase.guards += 1;
        phase.runs += usize::from(is_run);
        drop(phase);
        Ok(Self { caught, is_run })
    }

    /// Whether a signal has asked to end the process.
    #[must_use]
    pub fn is_requested(&self) -> bool {
        self.flag().load(Ordering::Acquire)
    }

    /// Returns the name of the first signal that has asked to end the process.
    pub(crate) fn signal(&self) -> Option<&'static str> {
        self.caught.phase().signal
    }

    /// Returns the time since the first signal that has asked to end the process.
    #[must_use]
    pub fn since_signal(&self) -> Option<Duration> {
        self.caught.phase().signalled.map(|at| at.elapsed())
    }

    /// Returns the flag that a signal sets which asks to end the process.
    pub(crate) fn flag(&self) -> &'static AtomicBool {
        &self.caught.is_requested
    }

    /// Returns how often the process was asked to suspend itself since the last call, and refused.
    pub(crate) fn take_refused(&self) -> usize {
        self.caught.refused.swap(0, Ordering::Relaxed)
    }
}

impl Drop for Interrupt {
    fn drop(&mut self) {
        let mut phase = self.caught.phase();
        phase.guards -= 1;
        phase.runs -= usize::from(self.is_run);
        if phase.guards == 0 {
            phase.signalled = None;
            phase.signal = None;
            self.caught.is_requested.store(false, Ordering::Release);
            self.caught.changed.notify_all();
        }
    }
}

/// The signals of the process. There is one, because signals belong to the process.
struct Caught {
    phase: Mutex<Phase>,
    /// Notified when the time of the first signal changes.
    changed: Condvar,
    /// Whether a signal has asked to end the process.
    is_requested: AtomicBool,
    /// How often it was asked to suspend itself.
    refused: AtomicUsize,
}

#[derive(Default)]
struct Phase {
    /// Number of [`Interrupt`]s.
    guards: usize,
    /// Number of those that belong to a run.
    runs: usize,
    /// When the first signal came that asked to end the process, and its name.
    signalled: Option<Instant>,
    signal: Option<&'static str>,
}

/// Returns the signals of the process. The first call installs the handlers and starts the threads.
fn caught() -> io::Result<&'static Caught> {
    static CAUGHT: Mutex<Option<&'static Caught>> = Mutex::new(None);
    let mut known = CAUGHT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(caught) = *known {
        return Ok(caught);
    }
    let caught: &'static Caught = Box::leak(Box::new(Caught {
        phase: Mutex::default(),
        changed: Condvar::new(),
        is_requested: AtomicBool::new(false),
        refused: AtomicUsize::new(0),
    }));
    // It starts first: from the first signal on, there must be one.
    Builder::new().name("watchdog".into()).spawn(|| caught.watch())?;
    receive(|signal| caught.on(signal))?;
    *known = Some(caught);
    Ok(caught)
}

impl Caught {
    fn phase(&self) -> MutexGuard<'_, Phase> {
        self.phase.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Handles one signal.
    fn on(&self, signal: Signal) {
        let mut phase = self.phase();
        match signal.wish {
            Wish::Suspend if phase.runs > 0 => drop(self.refused.fetch_add(1, Ordering::Relaxed)),
            Wish::Suspend => {
                drop(phase);
                signal.do_default();
            }
            Wish::End if phase.guards == 0 => signal.do_default(),
            Wish::End if phase.signalled.is_none() => {
                phase.signalled = Some(Instant::now());
                phase.signal = Some(signal.name);
                self.is_requested.store(true, Ordering::Release);
                self.changed.notify_all();
            }
            Wish::End if phase.runs == 0 => exit_now(EXIT_INTERRUPTED),
            Wish::End => {}
        }
    }

    /// Ends the process when it has not ended by itself in time after the first signal.
    fn watch(&self) -> ! {
        let mut phase = self.phase();
        loop {
            let left = phase.signalled.map(|at| MAX_END.saturating_sub(at.elapsed()));
            phase = match left {
                None => self.changed.wait(phase).unwrap_or_else(PoisonError::into_inner),
                Some(Duration::ZERO) => {
                    let signal = phase.signal.unwrap_or("a signal");
                    drop(phase);
                    give_up(signal)
                }
                Some(left) => self.changed.wait_timeout(phase, left).unwrap_or_else(PoisonError::into_inner).0,
            };
        }
    }
}

/// Ends the process, with a message if somebody reads it.
#[allow(clippy::print_stderr, reason = "whoever else prints may be what hangs")]
fn give_up(signal: &'static str) -> ! {
    // The reader of standard error may be what hangs.
    const MESSAGE_TIME: Duration = Duration::from_millis(100);
    let say = move || {
        eprintln!("error: the process did not end within 5 s of {signal}, so it is cut off: a device may still move")
    };
    // Without a thread there is no message.
    drop(Builder::new().spawn(say));
    std::thread::sleep(MESSAGE_TIME);
    exit_now(EXIT_INTERRUPTED)
}
