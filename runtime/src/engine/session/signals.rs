//! Ctrl-C and the other operating-system signals that end a run.

use std::io;

use tokio::runtime::{Builder, Runtime};
#[cfg(unix)]
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

/// Catches Ctrl-C and SIGTERM for callers that do not use [`run`](super::run). A second signal ends the process at
/// once.
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
/// The handlers are installed before this returns: on a busy machine the spawned tasks may start later.
pub(crate) fn interrupts() -> io::Result<watch::Receiver<bool>> {
    let (sender, receiver) = watch::channel(false);
    #[cfg(unix)]
    for kind in [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()] {
        let (mut signal, sender) = (signal(kind)?, sender.clone());
        tokio::spawn(async move {
            while signal.recv().await.is_some() {
                interrupt(&sender);
            }
        });
    }
    #[cfg(not(unix))]
    tokio::spawn(async move {
        while tokio::signal::ctrl_c().await.is_ok() {
            interrupt(&sender);
        }
    });
    Ok(receiver)
}

/// Handles one signal.
fn interrupt(sender: &watch::Sender<bool>) {
    const EXIT_INTERRUPTED: i32 = 130;
    if sender.send_replace(true) {
        std::process::exit(EXIT_INTERRUPTED);
    }
}
