//! `ps`: the graphs that run.

use std::time::{SystemTime, UNIX_EPOCH};

use super::{NO_RUN, Running, running};
use crate::cli::shell::command::OutputFormat;
use crate::cli::shell::{FAULTED, Shell};
use crate::cli::text::table::table;
use crate::socket::{About, TaskState};

/// List the graphs that run in real time
#[derive(clap::Parser)]
#[command(
    name = "ps",
    after_help = "Only the runs of the same user are listed, and no run in virtual time or with `--no-socket`."
)]
pub(super) struct PsArgs {
    /// Output format
    #[arg(long, value_enum, default_value_t = OutputFormat::Text, value_name = "FORMAT")]
    format: OutputFormat,
}

pub(super) fn ps(args: PsArgs, shell: &Shell) -> Result<u8, u8> {
    let runs = running().map_err(|message| shell.refuse(message))?;
    for Running { pid, about, .. } in &runs {
        if let Err(why) = about {
            shell.warning(format_args!("process {pid} does not answer: {why}"));
        }
    }
    let answered: Vec<&About> = runs.iter().filter_map(|run| run.about.as_ref().ok()).collect();
    if args.format == OutputFormat::Json {
        shell.say_json(&answered);
    } else if runs.is_empty() {
        shell.say(NO_RUN);
    } else if !answered.is_empty() {
        shell.say(text(&answered).trim_end());
    }
    Ok(if answered.len() == runs.len() { 0 } else { FAULTED })
}

fn text(runs: &[&About]) -> String {
    let mut rows = vec![["PID", "graph", "mode", "since", "commands"].map(String::from)];
    for about in runs {
        let mut tasks = about.tasks.iter();
        let (pid, graph) = (about.pid.to_string(), about.graph.clone());
        let first = tasks.next();
        let mode = first.and_then(|task| task.mode.clone()).unwrap_or_else(|| "-".into());
        rows.push([pid, graph, mode, ago(about.since), first.map(state).unwrap_or_default().into()]);
        for task in tasks.filter(|task| task.mode.is_some()) {
            let name = format!("  task {}", task.name);
            rows.push(["".into(), name, task.mode.clone().unwrap_or_default(), "".into(), state(task).into()]);
        }
    }
    table(&rows, 0, 1)
}

/// What the commands of a task do.
const fn state(task: &TaskState) -> &'static str {
    match (task.ended, task.halted) {
        (true, _) => "ended",
        (_, true) => "halted",
        _ => "active",
    }
}

/// Says how long ago a time [s since 1970] is.
fn ago(since: f64) -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |now| now.as_secs_f64());
    let seconds = (now - since).max(0.0);
    match seconds {
        _ if seconds < 120.0 => format!("{seconds:.0} s ago"),
        _ if seconds < 7200.0 => format!("{:.0} min ago", seconds / 60.0),
        _ => format!("{:.0} h ago", seconds / 3600.0),
    }
}
