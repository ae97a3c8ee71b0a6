//! Ctrl-C and the other operating-system signals that end a run.

use std::io;

use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;

/// Catches Ctrl-C and SIGTERM for callers that do not use [`run`](super::run). A second signal ends the process at once.
pub struct Interrupt {
    /// Keeps the listening task alive.
    _runtime: Runtime,
    interrupted: watch::Receiver<bool>,
}

impl Interrupt {
    /// Starts to catch the signals.
    ///
    /// # Errors
    /// If the signal handlers or the tokio runtime cannot be set up.
    pub fn catch() -> io::Result<Self> {
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        let interrupted = runtime.block_on(async { interrupts() })?;
        Ok(Self { _runtime: runtime, interrupted })
    }

    /// Whether the operator has asked to end the run.
    #[must_use]
    pub fn is_requested(&self) -> bool {
        *self.interrupted.borrow()
    }
}

/// Returns a flag that becomes true at the first Ctrl-C or SIGTERM. A second signal ends the process at once.
///
/// The handlers are installed before this returns: on a busy machine the spawned task may start later.
pub(crate) fn interrupts() -> io::Result<watch::Receiver<bool>> {
    const EXIT_INTERRUPTED: i32 = 130;
    let (sender, receiver) = watch::channel(false);
    let mut signals = Signals::catch()?;
    tokio::spawn(async move {
        while signals.next().await.is_ok() {
            if sender.send_replace(true) {
                std::process::exit(EXIT_INTERRUPTED);
            }
        }
    });
    Ok(receiver)
}

#[cfg(unix)]
struct Signals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
    /// The terminal has closed.
    hangup: tokio::signal::unix::Signal,
}

#[cfg(unix)]
impl Signals {
    fn catch() -> io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hangup: signal(SignalKind::hangup())?,
        })
    }

    async fn next(&mut self) -> io::Result<()> {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            _ = self.hangup.recv() => {}
        }
        Ok(())
    }
}

#[cfg(not(unix))]
struct Signals;

#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "the same form as on unix")]
impl Signals {
    fn catch() -> io::Result<Self> {
        Ok(Self)
    }

    async fn next(&mut self) -> io::Result<()> {
        tokio::signal::ctrl_c().await
    }
}
