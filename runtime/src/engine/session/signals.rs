//! Ctrl-C and the other signals that end a run.

use std::io;

use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;

/// The operator's wish to end what runs, for those who run without [`run`]: from here on Ctrl-C and SIGTERM are caught. A
/// second one ends the process at once.
pub struct Interrupt {
    /// What listens for them lives in it.
    _runtime: Runtime,
    interrupted: watch::Receiver<bool>,
}

impl Interrupt {
    /// Catches them.
    ///
    /// # Errors
    /// If the operating system gives no runtime for signals.
    pub fn catch() -> io::Result<Self> {
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        let interrupted = runtime.block_on(async { interrupts() })?;
        Ok(Self { _runtime: runtime, interrupted })
    }

    /// Whether the operator wants the end.
    #[must_use]
    pub fn is_requested(&self) -> bool {
        *self.interrupted.borrow()
    }
}

/// Becomes true at the first Ctrl-C or SIGTERM; a second one ends the process at once.
///
/// They are caught from here on, and not only once the task has begun: on a busy machine that may take a while.
pub(crate) fn interrupts() -> io::Result<watch::Receiver<bool>> {
    const INTERRUPTED: i32 = 130;
    let (sender, receiver) = watch::channel(false);
    let mut signals = Signals::catch()?;
    tokio::spawn(async move {
        while signals.next().await.is_ok() {
            if sender.send_replace(true) {
                std::process::exit(INTERRUPTED);
            }
        }
    });
    Ok(receiver)
}

#[cfg(unix)]
struct Signals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
    /// The terminal is gone.
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
