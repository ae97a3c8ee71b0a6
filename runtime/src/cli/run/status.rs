//! What a run does now: its modes, what holds its commands, and which limits reduce its motion.

use std::fmt::Write;

use super::held::LimitWatch;
use crate::cli::text::number::seconds;
use crate::engine::{Engine, TaskRun};
use crate::graph::Policy;

/// Writes the state of a run, a line for each thing; `None` if there is nothing to say.
pub(super) fn status(engine: &Engine, limits: &LimitWatch) -> Option<String> {
    let mut text: String = engine.tasks().iter().map(|task| of_task(task, engine.now())).collect();
    for rest in engine.rests().iter().filter(|rest| rest.until.is_none()) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "`{}` stopped: {}", rest.role, rest.fault);
    }
    let acting: Vec<String> =
        limits.acting().map(|(name, scale)| format!("{name} to {:.0} %", 100.0 * scale)).collect();
    if !acting.is_empty() {
        let _ = writeln!(text, "limited by {}", acting.join(", "));
    }
    (!text.is_empty()).then_some(text)
}

/// Describes the mode of a task, and the halt that lasts.
fn of_task(task: &TaskRun, now: i64) -> String {
    let mut text = String::new();
    let of = if task.name().is_empty() { String::new() } else { format!("`{}`: ", task.name()) };
    if let (Some(change), true, None) = (task.changes().last(), task.is_active(), task.end()) {
        let _ = writeln!(text, "{of}mode {} for {:.1} s", change.mode, seconds(now - change.time));
    }
    if let Some(halt) = task.halts().last().filter(|halt| halt.until.is_none()) {
        let what = if halt.policy == Policy::Stop { "stopped until `resume`" } else { "held" };
        let _ = writeln!(text, "{of}commands {what}: {}", halt.fault);
    }
    text
}
