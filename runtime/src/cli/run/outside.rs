//! What may change a run from outside: scheduled changes of parameters, and the socket.

use super::Job;
use crate::cli::shell::Shell;
#[cfg(unix)]
use crate::engine::End;
use crate::engine::{Changer, Engine, Outcome, RunOptions, ScheduledChanges};
use crate::graph::{Compiled, Request, compile};
#[cfg(unix)]
use crate::socket::{Feed, OpenedSocket, RunFacts, RunSocket, open};

/// What may change a run from outside.
pub(crate) struct Outside<'s> {
    pub(crate) changes: Option<ScheduledChanges<'s>>,
    pub(crate) socket: Option<OpenSocket>,
}

/// An open socket, and the end of its ring in the tick. It is closed when it is dropped.
pub(crate) struct OpenSocket {
    #[cfg(unix)]
    socket: RunSocket,
    #[cfg(unix)]
    feed: Feed,
}

/// What the socket needs of a graph before it runs. `None` without a socket.
#[cfg(unix)]
pub(crate) type Facts = Option<RunFacts>;
#[cfg(not(unix))]
pub(crate) type Facts = Option<()>;

impl Job {
    /// Returns what the socket states of the graph, if the run has a socket. A run in virtual time has none, because it
    /// would not come again.
    #[cfg(unix)]
    pub(crate) fn socket_facts(&self, plan: &Compiled, is_real: bool) -> Facts {
        let is_resume = |(_, word): &(f64, String)| word.to_lowercase().ends_with("resume");
        let can_resume = self.options.listen || self.options.send.iter().any(is_resume);
        (is_real && !self.options.no_socket).then(|| RunFacts::of(plan, &self.request.graph, can_resume))
    }

    #[cfg(not(unix))]
    pub(crate) fn socket_facts(&self, _: &Compiled, _: bool) -> Facts {
        None
    }
}

/// Returns what makes the changes of parameters, if there can be any.
///
/// # Errors
/// If one of the scheduled changes is refused.
pub(crate) fn changes<'s>(
    job: &Job,
    engine: &mut Engine,
    request: &Request,
    has_socket: bool,
    shell: &'s Shell,
) -> Result<Option<ScheduledChanges<'s>>, String> {
    if job.options.change.is_empty() && !has_socket {
        return Ok(None);
    }
    let catalogue = shell.catalogue();
    let changer = Changer::new(engine, request, move |request| compile(catalogue, request).map(drop))?;
    ScheduledChanges::new(changer, &job.options.change).map(Some)
}

impl<'s> Outside<'s> {
    /// Opens the socket, if the run has one. If it cannot be opened, the run goes on with a warning.
    #[cfg(unix)]
    pub(crate) fn open(
        changes: Option<ScheduledChanges<'s>>,
        facts: Facts,
        engine: &Engine,
        options: &mut RunOptions,
        shell: &Shell,
    ) -> Self {
        let Some(facts) = facts else { return Self { changes, socket: None } };
        match open(engine, facts) {
            Ok(OpenedSocket { socket, feed, requests, changes: wanted }) => {
                options.requests = Some(requests);
                let changes = changes.map(|changes| changes.with_requests(wanted));
                Self { changes, socket: Some(OpenSocket { socket, feed }) }
            }
            Err(why) => {
                shell.warning(format_args!(
                    "other processes cannot reach this run: {why}\nhelp: `--no-socket` runs without this warning"
                ));
                Self { changes, socket: None }
            }
        }
    }

    #[cfg(not(unix))]
    pub(crate) fn open(
        changes: Option<ScheduledChanges<'s>>,
        _: Facts,
        _: &Engine,
        _: &mut RunOptions,
        _: &Shell,
    ) -> Self {
        Self { changes, socket: None }
    }
}

impl OpenSocket {
    /// Passes on what others want of the last tick. It neither allocates nor waits nor calls the operating system.
    pub(crate) fn publish(&mut self, engine: &Engine) {
        #[cfg(unix)]
        self.feed.publish(engine);
        #[cfg(not(unix))]
        let _ = engine;
    }

    /// Says to others how the run has ended, and closes the socket.
    #[cfg_attr(not(unix), allow(unused_mut, reason = "there is nobody to say it to"))]
    pub(crate) fn close(mut self, outcome: &std::io::Result<Outcome>) {
        #[cfg(unix)]
        match outcome {
            Ok(outcome) => self.socket.end(outcome.end.to_string(), matches!(outcome.end, End::Fault(_))),
            Err(error) => self.socket.end(error.to_string(), true),
        }
        #[cfg(not(unix))]
        let _ = outcome;
    }
}
