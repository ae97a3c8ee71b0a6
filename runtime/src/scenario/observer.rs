//! Observes a run: collects the readings of every check, and counts the ticks that break a rule of the whole run.

use serde::Serialize;

use super::measure::Reading;
use super::model::{Check, Scenario};
use super::window::{Event, ModeName, Readings, Window, WindowClock};
use crate::engine::{Engine, TaskRun};
use crate::node::ScalarId;
use crate::record::PortColumns;
use crate::signal::Freshness;

/// The value of `ends_in` for a run that ends with a `done` condition.
pub(super) const DONE: &str = "done";

/// A check that has no tick to check in a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NotChecked {
    /// Name of the check.
    pub check: String,
    /// Why there is no tick, for example because the mode of `during` was never reached.
    pub why: String,
}

/// Observes a run tick by tick.
pub(super) struct Observer<'s> {
    scenario: &'s Scenario,
    from: Option<ScalarId>,
    never_lost: Option<ScalarId>,
    /// Time 0 of all figures in the graph's clock [ns].
    zero: Option<i64>,
    checks: Vec<CheckObserver<'s>>,
    /// Number of the mode of each task in which the next tick runs.
    modes: Vec<Option<usize>>,
    /// Number of ticks in which the flag `never_lost` is not set.
    lost: u64,
    /// Number of ticks outside the mode `stays_in` after it was reached.
    away: u64,
    has_reached: bool,
}

impl<'s> Observer<'s> {
    /// Creates the observer of a run that has not begun.
    pub(super) fn new(scenario: &'s Scenario, engine: &Engine) -> Self {
        Self {
            scenario,
            from: scenario.from.as_ref().map(|(_, column)| find(engine, column)),
            never_lost: scenario.never_lost.as_ref().map(|column| find(engine, column)),
            zero: None,
            checks: scenario.checks.iter().map(|check| CheckObserver::new(check, engine)).collect(),
            modes: modes(engine),
            lost: 0,
            away: 0,
            has_reached: false,
        }
    }

    /// Observes the last tick.
    pub(super) fn observe(&mut self, engine: &Engine) {
        let before = std::mem::replace(&mut self.modes, modes(engine));
        if let Some(mode) = &self.scenario.stays_in {
            let is_in = is_in(&self.modes, mode);
            self.has_reached |= is_in;
            self.away += u64::from(self.has_reached && !is_in);
        }
        let is_set = |flag: Option<ScalarId>| flag.is_none_or(|flag| is_true(engine, flag));
        if self.zero.is_none() && is_set(self.from) {
            self.zero = Some(engine.now());
        }
        if self.zero.is_some() {
            self.lost += u64::from(!is_set(self.never_lost));
            self.checks.iter_mut().for_each(|check| check.observe(engine, &before));
        }
    }

    /// Returns why nothing can be measured, if that is so.
    pub(super) fn failure(&self) -> Option<String> {
        let (flag, _) = self.scenario.from.as_ref()?;
        self.zero.is_none().then(|| format!("`{flag}` was never set, so the figures have no time 0"))
    }

    /// Returns the checks without a tick to check, in the order of the scenario.
    pub(super) fn not_checked(&self) -> Vec<NotChecked> {
        let why = |one: &CheckObserver<'_>| Some(NotChecked { check: one.check.name.clone(), why: one.empty()? });
        self.checks.iter().filter_map(why).collect()
    }

    /// Returns every figure, in the order of the scenario's rows.
    pub(super) fn figures(&self, engine: &Engine, is_done: bool) -> Vec<Option<f64>> {
        let period = seconds(engine.period());
        let mut figures: Vec<Option<f64>> = self.checks.iter().flat_map(CheckObserver::figures).collect();
        figures.extend(self.never_lost.map(|_| Some(self.lost as f64 * period)));
        let away = self.has_reached.then_some(self.away as f64 * period);
        figures.extend(self.scenario.stays_in.as_ref().map(|_| away));
        let ends = |(name, mode): &(String, Option<ModeName>)| match mode {
            Some(mode) => is_in(&self.modes, mode),
            None => name == DONE && is_done,
        };
        figures.extend(self.scenario.ends_in.as_ref().map(|mode| Some(f64::from(u8::from(ends(mode))))));
        figures
    }
}

/// Returns the number of the mode of each task in which the next tick runs.
fn modes(engine: &Engine) -> Vec<Option<usize>> {
    engine.tasks().iter().map(TaskRun::mode_number).collect()
}

/// Returns whether a mode is one of the numbers of all tasks.
fn is_in(modes: &[Option<usize>], mode: &ModeName) -> bool {
    let (task, number) = mode.place;
    modes[task] == Some(number)
}

/// Collects the readings of one check.
struct CheckObserver<'s> {
    check: &'s Check,
    of: ScalarId,
    minus: Option<ScalarId>,
    /// The flag that ends the window.
    until: Option<ScalarId>,
    clock: WindowClock,
    readings: Readings,
}

impl<'s> CheckObserver<'s> {
    fn new(check: &'s Check, engine: &Engine) -> Self {
        let until = match &check.window.until {
            Some(Event::BecomesTrue { column, .. }) => Some(find(engine, column)),
            Some(Event::Enters(_)) | None => None,
        };
        Self {
            check,
            of: find(engine, &check.column),
            minus: check.minus.as_ref().map(|column| find(engine, column)),
            until,
            clock: WindowClock::default(),
            readings: Readings::default(),
        }
    }

    /// Observes a tick from time 0 on, which ran in the modes of those numbers.
    fn observe(&mut self, engine: &Engine, modes: &[Option<usize>]) {
        let Window { during, until } = &self.check.window;
        let is_mode = |known: &ModeName| is_in(modes, known);
        let holds = match until {
            Some(Event::Enters(known)) => Some(is_mode(known)),
            Some(Event::BecomesTrue { .. }) => {
                self.until.and_then(|flag| engine.bus().scalar(flag)).map(|flag| flag == 1.0)
            }
            None => Some(false),
        };
        let is_in_mode = during.as_ref().is_none_or(is_mode);
        let Some(place) = self.clock.tick(engine.now(), engine.period(), is_in_mode, holds) else { return };
        let read = |scalar: ScalarId| engine.bus().scalar(scalar).unwrap_or(f64::NAN);
        let value = self.check.nearest((read(self.of) - self.minus.map_or(0.0, read)) / self.check.unit);
        let is_new = engine.bus().scalar_freshness(self.of, engine.ticks()) == Freshness::New;
        self.readings.push(Reading { time: seconds(place.time), value, is_new }, place.is_entry);
    }

    /// Returns why there is no tick to check, if `during`, `until` and `after_s` leave none.
    fn empty(&self) -> Option<String> {
        let window = &self.check.window;
        let is_short = || self.check.after.is_some() && self.check.after(&self.readings).is_empty();
        window.missing(&self.clock, &self.readings).or_else(|| window.too_short().filter(|_| is_short()))
    }

    /// Returns the figures of the check. Without a tick to check, none is measured.
    fn figures(&self) -> Vec<Option<f64>> {
        if self.empty().is_some() {
            return vec![None; self.check.figures.len()];
        }
        self.check.figures(&self.readings)
    }
}

/// Returns the scalar of a column.
fn find(engine: &Engine, column: &str) -> ScalarId {
    PortColumns::find(engine.ports(), column).expect("the lookup found every column")
}

fn is_true(engine: &Engine, flag: ScalarId) -> bool {
    engine.bus().scalar(flag) == Some(1.0)
}

/// Converts nanoseconds to seconds.
pub(super) fn seconds(nanos: i64) -> f64 {
    nanos as f64 * 1e-9
}
