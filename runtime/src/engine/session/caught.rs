//! Receives the signals of the operating system on a thread of its own, whatever the other threads do.

pub use system::block_io_signals;
pub(crate) use system::{exit_now, receive};

/// A signal that the process has received.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Signal {
    /// Its name, such as `SIGINT`.
    pub(crate) name: &'static str,
    pub(crate) wish: Wish,
    #[cfg(unix)]
    number: i32,
}

/// What a signal asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wish {
    /// To end the process.
    End,
    /// To suspend the process.
    Suspend,
}

#[cfg(unix)]
mod system {
    use std::io;
    use std::thread::Builder;

    use nix::sys::signal::{SigSet, Signal as Blocked};
    use signal_hook::consts::{
        SIGALRM, SIGHUP, SIGINT, SIGIO, SIGPROF, SIGQUIT, SIGTERM, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2,
        SIGVTALRM, SIGXCPU,
    };
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::{emulate_default_handler, signal_name};

    use super::{Signal, Wish};

    const END: [i32; 11] =
        [SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGALRM, SIGUSR1, SIGUSR2, SIGXCPU, SIGVTALRM, SIGPROF, SIGIO];
    const SUSPEND: [i32; 3] = [SIGTSTP, SIGTTIN, SIGTTOU];

    /// Starts the thread that receives the signals. The handlers are installed before this returns.
    pub(crate) fn receive(on: impl Fn(Signal) + Send + 'static) -> io::Result<()> {
        let mut signals = Signals::new(END.into_iter().chain(SUSPEND))?;
        let receive = move || {
            for number in signals.forever() {
                let wish = if SUSPEND.contains(&number) { Wish::Suspend } else { Wish::End };
                on(Signal { name: signal_name(number).unwrap_or("a signal"), wish, number });
            }
        };
        Builder::new().name("signals".into()).spawn(receive).map(drop)
    }

    /// Blocks the signals that report a failed read or write, in this thread and in those that it starts: SIGTTIN and
    /// SIGTTOU of a terminal in whose background the process is, and SIGXFSZ of a file that reaches `ulimit -f`.
    ///
    /// The read or write then succeeds or returns an error. A handler does not suffice: the system would repeat the read
    /// for ever.
    ///
    /// # Errors
    /// If the operating system refuses it.
    pub fn block_io_signals() -> io::Result<()> {
        let signals: SigSet = [Blocked::SIGTTIN, Blocked::SIGTTOU, Blocked::SIGXFSZ].into_iter().collect();
        Ok(signals.thread_block()?)
    }

    impl Signal {
        /// Does what the signal does to a process that does not catch it.
        pub(crate) fn do_default(self) {
            /// What a shell adds to the number of a signal that ended a process.
            const EXIT_SIGNALLED: i32 = 128;
            if emulate_default_handler(self.number).is_err() {
                super::exit_now(EXIT_SIGNALLED + self.number);
            }
        }
    }

    /// Ends the process without waiting for any lock, buffer or thread.
    pub(crate) fn exit_now(code: i32) -> ! {
        signal_hook::low_level::exit(code)
    }
}

#[cfg(not(unix))]
mod system {
    use std::io;
    use std::thread::Builder;

    use super::{Signal, Wish};

    pub(crate) fn receive(on: impl Fn(Signal) + Send + 'static) -> io::Result<()> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let receive = move || {
            while runtime.block_on(tokio::signal::ctrl_c()).is_ok() {
                on(Signal { name: "Ctrl-C", wish: Wish::End });
            }
        };
        Builder::new().name("signals".into()).spawn(receive).map(drop)
    }

    /// Blocks nothing: such a system does not report it with signals.
    ///
    /// # Errors
    /// Never.
    pub fn block_io_signals() -> io::Result<()> {
        Ok(())
    }

    impl Signal {
        /// Does what the signal does to a process that does not catch it.
        pub(crate) fn do_default(self) {
            super::exit_now(super::EXIT_INTERRUPTED);
        }
    }

    pub(crate) fn exit_now(code: i32) -> ! {
        std::process::exit(code)
    }
}

/// Exit code of a process that a signal ended at once.
pub(crate) const EXIT_INTERRUPTED: i32 = 130;
