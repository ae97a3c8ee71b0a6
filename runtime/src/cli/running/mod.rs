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
use crate::socket::{About, Ask, Client, sockets};

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

/// Which run is meant.
#[derive(clap::Args)]
struct RunArg {
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

impl RunArg {
    /// Connects to the run that is meant.
    ///
    /// # Errors
    /// If none runs, or it is not clear which one is meant.
    fn connect(&self) -> Result<Client, String> {
        let all = running()?;
        let is_meant = |run: &&Running| self.run.as_ref().is_none_or(|name| run.is_called(name));
        let meant: Vec<&Running> = all.iter().filter(is_meant).collect();
        match meant[..] {
            [run] => Client::connect(&run.path),
            [] if all.is_empty() => Err(NO_RUN.into()),
            [] => Err(format!("no graph `{}` runs\n{}", self.run.as_deref().unwrap_or_default(), list(&all))),
            _ => Err(format!("it is not clear which run is meant\n{}", list(&meant))),
        }
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
