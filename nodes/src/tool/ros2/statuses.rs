//! The state of a run, as `/diagnostics` has it: a status for each task.

use std::path::Path;

use tactflow_runtime::socket::{About, RunEnd, TaskState};

use crate::devices::ros2::shown::{Level, Status};

/// The name of a graph or of one of its tasks. Tools group names at `/`, so a path has none.
fn name(graph: &str, task: &str) -> String {
    let stem =
        Path::new(graph).file_stem().map_or_else(|| graph.to_owned(), |stem| stem.to_string_lossy().into_owned());
    if task.is_empty() { format!("tactflow: {stem}") } else { format!("tactflow: {stem}: {task}") }
}

/// Returns a status for the graph, and for each of its tasks.
pub(super) fn of_run(about: &About) -> Vec<Status> {
    let status = |task: &TaskState| {
        let reason = || task.reason.clone().unwrap_or_else(|| "the commands are held".to_owned());
        let mode = task.mode.as_deref();
        let (level, message) = match task {
            TaskState { ended: true, reason: Some(reason), .. } => (Level::Error, reason.clone()),
            TaskState { ended: true, .. } => (Level::Ok, "it has ended".to_owned()),
            TaskState { halted: true, .. } => (Level::Warning, reason()),
            _ => (Level::Ok, mode.map_or_else(|| "it runs".to_owned(), |mode| format!("mode {mode}"))),
        };
        let mut values = vec![("mode", mode.unwrap_or_default().to_owned())];
        values.extend([("halts", task.halts.to_string()), ("tick", about.tick.to_string())]);
        values.extend([("time [s]", about.t.to_string()), ("pid", about.pid.to_string())]);
        Status { level, name: name(&about.graph, &task.name), message, values }
    };
    about.tasks.iter().map(status).collect()
}

/// The status of a run that does not answer.
pub(super) fn of_silence(graph: &str, why: &str) -> Status {
    Status { level: Level::Error, name: name(graph, ""), message: why.to_owned(), values: Vec::new() }
}

/// The status of a run that has ended; `None` if it has not said how.
pub(super) fn of_end(graph: &str, end: Option<&RunEnd>) -> Status {
    let (level, message) = match end {
        Some(RunEnd { reason, is_fault: false }) => (Level::Ok, format!("it has ended: {reason}")),
        Some(RunEnd { reason, is_fault: true }) => (Level::Error, format!("it has ended in a fault: {reason}")),
        None => (Level::Error, "it is gone, and has not said why".to_owned()),
    };
    Status { level, name: name(graph, ""), message, values: Vec::new() }
}

/// The status while nothing runs.
pub(super) fn of_nothing() -> Status {
    Status { level: Level::Stale, name: "tactflow".to_owned(), message: "no graph runs".to_owned(), values: Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_state_has_its_level_and_its_message() {
        let task = |mode: Option<&str>, halted, ended, reason: Option<&str>| TaskState {
            name: String::new(),
            mode: mode.map(str::to_owned),
            halted,
            ended,
            halts: 0,
            reason: reason.map(str::to_owned),
        };
        for (task, level, message) in [
            (task(Some("servo"), false, false, None), Level::Ok, "mode servo"),
            (task(None, false, false, None), Level::Ok, "it runs"),
            (task(Some("servo"), true, false, Some("`pad.image` is lost")), Level::Warning, "`pad.image` is lost"),
            (task(None, false, true, None), Level::Ok, "it has ended"),
            (task(None, true, true, Some("a fault")), Level::Error, "a fault"),
        ] {
            let graph = "graphs/hybrid.toml".to_owned();
            let about = About { pid: 7, graph, since: 0.0, t: 1.5, tick: 3, tasks: vec![task] };
            let [status] = of_run(&about).try_into().unwrap();
            assert_eq!((status.level, status.message.as_str()), (level, message));
            assert_eq!(status.name, "tactflow: hybrid");
        }
    }
}
