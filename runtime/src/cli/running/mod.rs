//! The commands for graphs that run in other processes of the same user: `ps`, `get`, `set`, `send`, `tare` and `watch`.

mod get;
mod ps;
mod save;
mod send;
mod set;
mod tare;
mod watch;

use std::path::{Path, PathBuf};

use super::shell::command::{Subcommand, derived};
use super::text::number::count_of;
use crate::socket::{About, Ask, Client, Following, sockets};

/// Returns the commands.
pub(super) fn commands() -> [Subcommand; 6] {
    [
        derived(ps::ps),
        derived(get::get),
        derived(set::set),
        derived(send::send),
        derived(tare::tare),
        derived(watch::watch),
    ]
}

/// Which run is meant: an argument that commands share.
#[derive(Debug, clap::Args)]
pub struct RunArg {
    /// The run, by the number of its process or the name of its graph; needed only if several graphs run
    #[arg(long, value_name = "PID|GRAPH")]
    run: Option<String>,
}

/// A run, and what it states of itself.
struct Running {
    pid: u32,
    path: PathBuf,
    /// What it states, or why it does not answer.
    about: Result<About, String>,
}

/// Returns the graphs that run.
///
/// # Errors
/// If the folder of the sockets cannot be used.
fn running() -> Result<Vec<Running>, String> {
    let found = sockets()?.into_iter();
    Ok(found
        .map(|(pid, path)| {
            let about = Client::connect(&path).and_then(|mut client| client.ask(&Ask::About {}));
            Running { pid, path, about }
        })
        .collect())
}

/// What is said when no graph runs.
const NO_RUN: &str =
    "no graph runs in real time\nhelp: start one in another terminal, for example `tactflow run GRAPH --realtime`";

/// Why no run is found.
#[derive(Debug)]
pub struct NotFound {
    /// What to print.
    pub message: String,
    /// Whether it can be found later, when it has begun.
    pub may_begin: bool,
}

/// A run in another process.
pub struct FoundRun {
    path: PathBuf,
    client: Client,
}

impl RunArg {
    /// Finds the run that is meant.
    ///
    /// # Errors
    /// If none runs, or it is not clear which one is meant.
    pub fn find(&self) -> Result<FoundRun, NotFound> {
        let failed = |message| NotFound { message, may_begin: false };
        let all = running().map_err(failed)?;
        let is_meant = |run: &&Running| self.run.as_ref().is_none_or(|name| run.is_called(name));
        let meant: Vec<&Running> = all.iter().filter(is_meant).collect();
        match meant[..] {
            // It may have ended since.
            [run] => Client::connect(&run.path)
                .map(|client| FoundRun { path: run.path.clone(), client })
                .map_err(|message| NotFound { message, may_begin: true }),
            [] => {
                let name = self.run.as_deref().unwrap_or_default();
                let others = || format!("no graph `{name}` runs\n{}", list(&all));
                let message = if all.is_empty() { NO_RUN.to_owned() } else { others() };
                Err(NotFound { message, may_begin: true })
            }
            _ => Err(failed(format!("it is not clear which run is meant\n{}", list(&meant)))),
        }
    }

    /// Connects to the run that is meant.
    ///
    /// # Errors
    /// If none runs, or it is not clear which one is meant.
    fn connect(&self) -> Result<Client, String> {
        self.find().map(|run| run.client).map_err(|error| error.message)
    }
}

impl FoundRun {
    /// Asks for its state.
    ///
    /// # Errors
    /// If it does not answer.
    pub fn about(&mut self) -> Result<About, String> {
        let about = self.client.ask(&Ask::About {});
        if about.is_err() {
            // An answer that comes too late would be taken for that of the next request.
            self.client = Client::connect(&self.path)?;
        }
        about
    }

    /// Follows the ports that names and patterns mean, with at least `period_ms` between two values of a port.
    ///
    /// # Errors
    /// If a name means no port, or the run does not answer.
    pub fn follow(&self, ports: Vec<String>, period_ms: f64) -> Result<Following, String> {
        Following::begin(&self.path, ports, period_ms)
    }
}

impl Running {
    /// Whether a name means this run: the number of its process, or its graph with or without its folder and its end.
    fn is_called(&self, name: &str) -> bool {
        let graph = self.about.as_ref().ok().map(|about| Path::new(&about.graph));
        let ends = |path: &Path| [path.file_name(), path.file_stem()].into_iter().flatten().any(|part| part == name);
        self.pid.to_string() == name || graph.is_some_and(|path| path == Path::new(name) || ends(path))
    }
}

/// Lists runs for the message that one must be chosen.
fn list<R: std::borrow::Borrow<Running>>(runs: &[R]) -> String {
    let line = |run: &R| {
        let Running { pid, about, .. } = run.borrow();
        let graph = about.as_ref().map_or("does not answer", |about| about.graph.as_str());
        format!("\n  `--run {pid}` for {graph}")
    };
    let verb = if runs.len() == 1 { "runs" } else { "run" };
    let lines: String = runs.iter().map(line).collect();
    format!("help: {} {verb}, write{lines}", count_of(runs.len(), "graph"))
}
