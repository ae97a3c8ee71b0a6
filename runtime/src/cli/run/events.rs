//! What happened in a run: modes, halts and ends of tasks.

use std::fmt::Write;

use crate::cli::text::number::seconds;
use crate::cli::text::table::table;
use crate::engine::{Engine, ModeChange, Rest, TaskEnd, TaskRun};
use crate::fault::Fault;
use crate::graph::Policy;

/// Maximum number of mode changes that are listed from the start, and from the end; also of halts.
const MAX_LISTED: usize = 20;

/// Writes the modes and the halts, one after the other, and leaves out what the graph does not have.
pub(crate) fn events(engine: &Engine, end: i64) -> String {
    let tables = engine.tasks().iter().map(|task| {
        let end = task.ended_at().unwrap_or(end);
        let table = modes(&task.changes(), end);
        if table.is_empty() || task.name().is_empty() { table } else { format!("task `{}`\n{table}", task.name()) }
    });
    tables.collect::<String>() + &halts(engine) + &changes(engine) + &ends(engine)
}

/// Lists the tasks that are parts and have ended, each with its end.
fn ends(engine: &Engine) -> String {
    let parts = engine.tasks().iter().skip(1).filter(|task| task.is_active());
    let lines = parts.map(|task| match task.end() {
        Some(TaskEnd::Done) => format!("task `{}` is done\n", task.name()),
        Some(TaskEnd::Failed(fault)) => format!("task `{}` has failed: {fault}\n", task.name()),
        None => String::new(),
    });
    let text: String = lines.collect();
    if text.is_empty() { text } else { text + "\n" }
}

/// Writes the table of the modes.
fn modes(changes: &[ModeChange], end: i64) -> String {
    if changes.is_empty() {
        return String::new();
    }
    let ends = changes.iter().skip(1).map(|change| change.time).chain([end]);
    let mut rows = vec![["mode", "from", "for", "reason"].map(String::from)];
    for (change, end) in changes.iter().zip(ends) {
        let time = |nanos: i64| format!("{:.3} s", seconds(nanos));
        rows.push([change.mode.clone(), time(change.time), time(end - change.time), change.reason.clone()]);
    }
    let omitted = rows.len().saturating_sub(2 * MAX_LISTED + 1);
    if omitted > 0 {
        rows.drain(MAX_LISTED + 1..=MAX_LISTED + omitted);
        rows.insert(MAX_LISTED + 1, [format!("({omitted} more)"), "".into(), "".into(), "".into()]);
    }
    table(&rows, 1, 3) + "\n"
}

/// Says how long a fault held the commands.
fn duration(fault: &Fault, until: Option<i64>) -> String {
    until.map_or_else(|| "until the end".into(), |until| format!("for {:.3} s", seconds(until - fault.time)))
}

/// Lists the halts of the commands, each with its fault.
fn halts(engine: &Engine) -> String {
    let mut text = String::new();
    let all = engine.tasks().iter().flat_map(|task| task.halts().iter().map(move |halt| (task.name(), halt)));
    for (task, halt) in all.take(MAX_LISTED) {
        let what = if halt.policy == Policy::Stop { "stopped" } else { "held" };
        let of = if task.is_empty() { String::new() } else { format!(" of `{task}`") };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "commands{of} {what} {}: {}", duration(&halt.fault, halt.until), halt.fault);
    }
    for Rest { role, fault, until } in engine.rests().iter().take(MAX_LISTED) {
        let _ = writeln!(text, "`{role}` stopped {}: {fault}", duration(fault, *until));
    }
    let listed: usize = engine.tasks().iter().map(|task| task.halts().len()).sum();
    let unlisted: u64 = engine.tasks().iter().map(TaskRun::unlisted_halts).sum();
    let more = listed.saturating_sub(MAX_LISTED) as u64 + unlisted;
    if more > 0 {
        let _ = writeln!(text, "commands held or stopped {more} more times");
    }
    if !text.is_empty() {
        text.push('\n');
    }
    text
}

/// Lists the changes of parameters.
fn changes(engine: &Engine) -> String {
    let names: Vec<&str> = engine.live_values().map(|live| live.param.name.as_str()).collect();
    let all = engine.value_changes();
    let mut text = String::new();
    for change in all.iter().take(MAX_LISTED) {
        let (name, at) = (names[change.param], seconds(change.time));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "`{name}` changed from {} to {} at {at:.3} s", change.from, change.to);
    }
    if all.len() > MAX_LISTED {
        let _ = writeln!(text, "parameters changed {} more times", all.len() - MAX_LISTED);
    }
    for live in engine.live_values().filter(|live| live.value.to_bits() != live.target.to_bits()) {
        let _ = writeln!(text, "`{}` was {} at the end, on its way to {}", live.param.name, live.value, live.target);
    }
    if !text.is_empty() {
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(ms: i64, mode: &str, why: &str) -> ModeChange {
        ModeChange { time: ms * 1_000_000, tick: 0, mode: mode.into(), reason: why.into() }
    }

    #[test]
    fn each_mode_has_a_time_and_a_reason() {
        let changes = [change(0, "wait", ""), change(512, "servo", "`touch.present` is set")];
        let expected = "mode      from      for  reason\n\
                        wait   0.000 s  0.512 s\n\
                        servo  0.512 s  1.488 s  `touch.present` is set\n\n";
        assert_eq!(modes(&changes, 2_000_000_000), expected);
        assert_eq!(modes(&[], 5), "");
    }

    #[test]
    fn many_changes_are_listed_from_both_ends() {
        let changes: Vec<ModeChange> = (0..1000).map(|i| change(i, &format!("m{i}"), "")).collect();
        let text = modes(&changes, 1_000_000_000);
        assert_eq!(text.lines().count(), 2 * MAX_LISTED + 3);
        assert!(text.contains("\nm19 ") && text.contains("(960 more)") && text.contains("\nm980 "), "{text}");
    }
}
