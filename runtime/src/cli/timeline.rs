//! What happened in a run: which mode when and why, and what limited the motion for how long.

use std::fmt::Write;

use super::summary::{number, table};
use crate::engine::{Engine, ModeChange};
use crate::graph::Policy;
use crate::node::PortId;
use crate::signal::Scalar;

/// As many changes of mode are shown from the start, and from the end.
const SHOWN: usize = 20;

/// How much one limit left of the motion.
struct Limit {
    /// `node.limit`.
    name: String,
    id: PortId,
    /// How long it took something away [s].
    time: f64,
    /// The least share that it left [1].
    least: f64,
}

/// Watches the limiters tick by tick.
pub(super) struct Timeline {
    limits: Vec<Limit>,
    last: Option<i64>,
}

impl Timeline {
    pub(super) fn new(engine: &Engine) -> Self {
        let limit = |(name, id): (&str, PortId)| Limit { name: name.to_owned(), id, time: 0.0, least: 1.0 };
        Self { limits: engine.limits().map(limit).collect(), last: None }
    }

    /// Takes in the tick that the engine has just run.
    pub(super) fn add(&mut self, engine: &Engine) {
        let dt = self.last.map_or(0, |last| engine.now() - last) as f64 * 1e-9;
        self.last = Some(engine.now());
        let bus = engine.bus();
        for limit in &mut self.limits {
            let Some(&share) = bus.get::<Scalar>(limit.id) else { continue };
            // Rounding is no limit.
            if share < 1.0 - 1e-6 {
                limit.time += dt;
                limit.least = limit.least.min(share);
            }
        }
    }

    /// The modes and the halts, one after the other; nothing of what the graph does not have.
    pub(super) fn story(engine: &Engine, end: i64) -> String {
        modes(&engine.changes(), end) + &halts(engine)
    }

    /// What limited the motion.
    pub(super) fn limits(&self, end: i64) -> String {
        if self.limits.is_empty() {
            return String::new();
        }
        let acted: Vec<&Limit> = self.limits.iter().filter(|limit| limit.time > 0.0).collect();
        if acted.is_empty() {
            return "no limit touched the motion\n".into();
        }
        let whole = (end as f64 * 1e-9).max(1e-9);
        let mut rows = vec![["limited by", "for", "of the run", "least share left"].map(String::from)];
        for limit in acted {
            let share = format!("{:.1} %", 100.0 * limit.time / whole);
            rows.push([limit.name.clone(), format!("{:.3} s", limit.time), share, number(limit.least)]);
        }
        table(&rows, 1, usize::MAX)
    }
}

fn modes(changes: &[ModeChange], end: i64) -> String {
    let mut text = String::new();
    if changes.is_empty() {
        return text;
    }
    let ends = changes.iter().skip(1).map(|change| change.time).chain([end]);
    let mut rows = vec![["mode", "from", "for", "because"].map(String::from)];
    for (change, end) in changes.iter().zip(ends) {
        let seconds = |nanos: i64| format!("{:.3} s", nanos as f64 * 1e-9);
        rows.push([change.mode.clone(), seconds(change.time), seconds(end - change.time), change.reason.clone()]);
    }
    let left_out = rows.len().saturating_sub(2 * SHOWN + 1);
    if left_out > 0 {
        rows.drain(SHOWN + 1..=SHOWN + left_out);
        rows.insert(SHOWN + 1, [format!("({left_out} more)"), String::new(), String::new(), String::new()]);
    }
    // Writing to a string cannot fail.
    let _ = write!(text, "{}", table(&rows, 1, 3));
    text.push('\n');
    text
}

/// When the commands were held, and why.
fn halts(engine: &Engine) -> String {
    let mut text = String::new();
    for halt in engine.halts().iter().take(SHOWN) {
        let what = if halt.policy == Policy::Stop { "stopped" } else { "held" };
        let lasted = match halt.until {
            Some(until) => format!("for {:.3} s", (until - halt.fault.time) as f64 * 1e-9),
            None => "to the end".to_owned(),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{what} {lasted}: {}", halt.fault);
    }
    let more = engine.halts().len().saturating_sub(SHOWN) as u64 + engine.unlisted_halts();
    if more > 0 {
        let _ = writeln!(text, "held or stopped {more} more times");
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
    fn each_mode_has_its_time_and_its_reason() {
        let changes = [change(0, "wait", ""), change(512, "servo", "`touch.present` is set")];
        let expected = "mode      from      for  because\n\
                        wait   0.000 s  0.512 s\n\
                        servo  0.512 s  1.488 s  `touch.present` is set\n\n";
        assert_eq!(modes(&changes, 2_000_000_000), expected);
        assert_eq!(modes(&[], 5), "");
    }

    #[test]
    fn of_very_many_changes_the_first_and_the_last_are_shown() {
        let changes: Vec<ModeChange> = (0..1000).map(|i| change(i, &format!("m{i}"), "")).collect();
        let text = modes(&changes, 1_000_000_000);
        assert_eq!(text.lines().count(), 2 * SHOWN + 3);
        assert!(text.contains("\nm19 ") && text.contains("(960 more)") && text.contains("\nm980 "), "{text}");
    }
}
