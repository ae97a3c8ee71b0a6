//! What held the arm back: limits that reduced or stopped its motion, and modes that chatter.

use crate::cli::text::number::{number, seconds};
use crate::cli::text::table::table;
use crate::engine::{Engine, ModeChange};

/// A motion that is scaled below this counts as stopped [1].
const STOPPED_SCALE: f64 = 0.1;
/// A limit that stops the motion for less time than this is not reported [s].
const MIN_STOPPED_S: f64 = 2.0;
/// Part of the time of the last mode, and of the run, from which on a stop is reported [1].
const MIN_SHARE: [f64; 2] = [0.5, 0.2];
/// Modes chatter if they change more often than this within [`CHATTER_NS`].
const MAX_CHANGES: usize = 20;
/// Time in which changes of modes are counted [ns].
const CHATTER_NS: i64 = 5_000_000_000;

/// How much one limit reduced the motion.
struct LimitUse {
    /// `node.limit`.
    name: String,
    /// Time during which it reduced the motion [s].
    reduced: f64,
    /// Factor by which it scales the motion now [1].
    scale: f64,
    /// Smallest factor by which it scaled the motion [1].
    smallest_scale: f64,
    /// Time during which it stopped the motion in the current mode [s].
    stopped_in_mode: f64,
    /// Time during which it stopped the motion in the whole run [s].
    stopped: f64,
}

/// Watches the limits tick by tick.
pub(crate) struct LimitWatch {
    limits: Vec<LimitUse>,
    /// The warning that the arm starts where a limit stops most motions.
    start: Option<String>,
    mode: Option<usize>,
    /// Time at which the current mode began [ns].
    since: i64,
    last: Option<i64>,
}

impl LimitWatch {
    pub(crate) fn new(engine: &Engine, start: Option<String>) -> Self {
        let limit = |(name, _): (&str, f64)| LimitUse {
            name: name.to_owned(),
            reduced: 0.0,
            scale: 1.0,
            smallest_scale: 1.0,
            stopped_in_mode: 0.0,
            stopped: 0.0,
        };
        Self { limits: engine.limits().map(limit).collect(), start, mode: None, since: 0, last: None }
    }

    /// Adds the last tick of the engine.
    pub(crate) fn add(&mut self, engine: &Engine) {
        let now = engine.now();
        let dt = seconds(self.last.map_or(0, |last| now - last));
        self.last = Some(now);
        if engine.mode_number() != self.mode {
            (self.mode, self.since) = (engine.mode_number(), now);
            self.limits.iter_mut().for_each(|limit| limit.stopped_in_mode = 0.0);
        }
        for (limit, (_, scale)) in self.limits.iter_mut().zip(engine.limits()) {
            limit.scale = scale;
            if scale < 1.0 {
                limit.reduced += dt;
                limit.smallest_scale = limit.smallest_scale.min(scale);
            }
            if scale < STOPPED_SCALE {
                limit.stopped_in_mode += dt;
                limit.stopped += dt;
            }
        }
    }

    /// Returns the limits that reduce the motion now, each with its scale [1].
    pub(crate) fn acting(&self) -> impl Iterator<Item = (&str, f64)> {
        let acting = self.limits.iter().filter(|limit| limit.scale < 1.0);
        acting.map(|limit| (limit.name.as_str(), limit.scale))
    }

    /// Writes the table of the limits that reduced the motion.
    pub(crate) fn table(&self, end: i64) -> String {
        let duration = seconds(end).max(1e-9);
        let mut rows = vec![["limited by", "time", "part of run", "smallest scale"].map(String::from)];
        for limit in self.limits.iter().filter(|limit| limit.reduced > 0.0) {
            let share = format!("{:.1} %", 100.0 * limit.reduced / duration);
            rows.push([limit.name.clone(), format!("{:.3} s", limit.reduced), share, number(limit.smallest_scale)]);
        }
        match (self.limits.len(), rows.len()) {
            (0, _) => String::new(),
            (_, 1) => "no limit reduced the motion\n".into(),
            _ => table(&rows, 1, usize::MAX),
        }
    }

    /// Returns what held the arm back in the last mode, if one limit stopped it for most of the time.
    pub(crate) fn cause(&self, engine: &Engine) -> Option<String> {
        let duration = seconds(self.last? - self.since);
        let worst = self.limits.iter().max_by(|a, b| a.stopped_in_mode.total_cmp(&b.stopped_in_mode))?;
        let mode = engine.mode().map(|mode| format!(" in mode `{mode}`")).unwrap_or_default();
        let share = worst.stopped_in_mode / duration.max(1e-9);
        let start = self.start.iter().map(|start| format!("; the check warned that {start}")).collect::<String>();
        let share_text = format!("{:.0} % of the time{mode}{start}", share * 100.0);
        let text = format!("the arm was held back: `{}` stopped it for {share_text}", worst.name);
        (share >= MIN_SHARE[0] && worst.stopped_in_mode > 0.0).then_some(text)
    }

    /// Returns the warnings about limits that stopped the motion for a large part of the run.
    pub(crate) fn warnings(&self, end: i64) -> Vec<String> {
        let duration = seconds(end).max(1e-9);
        let is_long = |limit: &&LimitUse| limit.stopped >= MIN_STOPPED_S && limit.stopped / duration >= MIN_SHARE[1];
        let warning = |LimitUse { name, stopped, .. }: &LimitUse| {
            let share = 100.0 * stopped / duration;
            format!("warning: `{name}` stopped the motion for {stopped:.3} s, {share:.0} % of the run")
        };
        self.limits.iter().filter(is_long).map(warning).collect()
    }
}

/// Returns the warning about modes that change too often.
pub(crate) fn chatter(changes: &[ModeChange]) -> Option<String> {
    let is_dense = |window: &&[ModeChange]| window[MAX_CHANGES].time - window[0].time <= CHATTER_NS;
    let window = changes.windows(MAX_CHANGES + 1).find(is_dense)?;
    let mut names: Vec<&str> = window.iter().map(|change| change.mode.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let (time, from) = (seconds(window[MAX_CHANGES].time - window[0].time), seconds(window[0].time));
    let names = names.join("`, `");
    Some(format!("warning: the modes `{names}` changed {MAX_CHANGES} times within {time:.3} s, from {from:.3} s on"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changes(step_ms: i64) -> Vec<ModeChange> {
        let change = |i: i64| {
            let mode = if i % 2 == 0 { "approach" } else { "servo" };
            ModeChange { time: i * step_ms * 1_000_000, tick: 0, mode: mode.into(), reason: String::new() }
        };
        (0..30).map(change).collect()
    }

    #[test]
    fn modes_that_change_all_the_time_are_warned_of() {
        let text = chatter(&changes(100)).unwrap();
        assert_eq!(text, "warning: the modes `approach`, `servo` changed 20 times within 2.000 s, from 0.000 s on");
        assert_eq!(chatter(&changes(300)), None);
        assert_eq!(chatter(&changes(100)[..20]), None);
    }
}
