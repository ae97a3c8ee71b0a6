//! Signals of the terminal and of the limits of the process, which would stop or end a run in the middle of a motion.

/// Blocks the signals that report a failed read or write, so that the read or write fails with an error instead.
///
/// Without this, a file that reaches `ulimit -f` ends the process, and the terminal stops a process in the background
/// that writes (`stty tostop`) or reads. Threads inherit what is blocked, so this comes before all of them.
#[cfg(unix)]
pub(crate) fn block_io_signals() {
    use nix::sys::signal::{SigSet, Signal};
    let signals: SigSet = [Signal::SIGXFSZ, Signal::SIGTTOU, Signal::SIGTTIN].into_iter().collect();
    // Without it, such a signal has its default effect; nothing else changes.
    let _ = signals.thread_block();
}

#[cfg(not(unix))]
pub(crate) fn block_io_signals() {}
