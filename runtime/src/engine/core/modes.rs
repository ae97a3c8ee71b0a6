//! The mode machine: evaluates the conditions of the current mode after each tick and takes the exit that holds.
//!
//! A condition on a value is evaluated only when the value is new, and `for_ms` is measured between new samples, so a
//! sensor that has stopped triggers no change. When several exits hold in one tick, `fail` comes first, then
//! `on_lost`, `done` and `go`; among `go`, the higher priority wins. Exits that could still tie are rejected at load.

use crate::graph::{Condition, ExitKind, PlannedExit, PlannedModes, PortRef, PortState, Test};
use crate::node::{Bus, PortId, ScalarId, Tick};
use crate::signal::{Freshness, Kind, Pose};

/// Shortest step that counts as travel [m]. Shorter steps are noise of the joint positions.
const MIN_STEP_M: f64 = 1e-4;
/// Number of mode changes that are kept for the summary.
const MAX_CHANGES: usize = 10_000;

/// A change of mode.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModeChange {
    /// Time of the tick that ended the previous mode [ns].
    pub time: i64,
    /// Number of that tick.
    pub tick: u64,
    /// Name of the mode that begins.
    pub mode: String,
    /// The condition that ended the previous mode; empty for the first mode of the run.
    pub reason: String,
}

/// The result of evaluating the conditions after a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Transition {
    /// The mode stays.
    Stay,
    /// Another mode has begun.
    Switched,
    /// A `done` condition holds.
    Done,
    /// A `fail` condition holds.
    Failed,
}

/// The modes of a running graph.
pub(crate) struct ModeMachine {
    modes: Vec<Mode>,
    current: usize,
    /// The mode before the current one.
    before: usize,
    /// Time at which the current mode began [ns]; `None` before the first tick.
    entered: Option<i64>,
    /// Index of the exit that was taken last.
    taken: usize,
    /// Time, tick, new mode and reason of each change.
    changes: Vec<(i64, u64, usize, ChangeReason)>,
    start: usize,
}

/// Why a mode began.
#[derive(Debug, Clone, Copy)]
enum ChangeReason {
    /// The run began.
    Start,
    /// The operator resumed after a stop.
    Resumed,
    /// The exit with the second index, of the mode with the first, was taken.
    Exit(usize, usize),
}

struct Mode {
    name: String,
    exits: Vec<Exit>,
    /// The runners that this mode changes: their indices, in this order, and the configurations that they have.
    configurations: Vec<(usize, usize)>,
}

struct Exit {
    planned: PlannedExit,
    /// What the condition reads; `None` for conditions on time or on the operator.
    input: Option<ConditionInput>,
    state: ConditionState,
}

/// The port that a condition reads.
#[derive(Debug, Clone, Copy)]
enum ConditionInput {
    /// A port whose number is not read, such as a pose or a whole feature vector.
    Port(PortId),
    /// A scalar, a flag or one feature.
    Scalar(ScalarId),
}

/// What a condition has observed since its mode began.
#[derive(Debug, Clone, Copy, Default)]
struct ConditionState {
    /// Time since which it holds [ns].
    since: Option<i64>,
    /// Time of the last sample that was true [ns].
    last_true: Option<i64>,
    /// Position at the last counted step [m].
    anchor: Option<[f64; 3]>,
    /// Distance travelled in the mode [m].
    travelled: f64,
}

impl ModeMachine {
    /// Creates the machine. `port` finds a port on the bus and its kind.
    pub(crate) fn new(planned: PlannedModes, port: impl Fn(PortRef) -> (PortId, Kind)) -> Self {
        let input = |exit: &PlannedExit| match &exit.condition {
            Condition::Port(watched, _) | Condition::Lost(watched, _) => {
                Some(ConditionInput::new(port(watched.source), watched.feature))
            }
            Condition::Travel(source, _) => Some(ConditionInput::Port(port(*source).0)),
            Condition::Elapsed(_) | Condition::Sent(_) => None,
        };
        let modes = planned.modes.into_iter().map(|mode| {
            let mut configurations = mode.configurations;
            configurations.sort_unstable();
            let mut exits: Vec<Exit> = mode
                .exits
                .into_iter()
                .map(|planned| Exit { input: input(&planned), planned, state: ConditionState::default() })
                .collect();
            exits.sort_by_key(|exit| (exit.planned.kind, std::cmp::Reverse(exit.planned.priority)));
            Mode { name: mode.name, exits, configurations }
        });
        Self {
            modes: modes.collect(),
            current: planned.start,
            before: planned.start,
            entered: None,
            taken: 0,
            changes: Vec::with_capacity(MAX_CHANGES),
            start: planned.start,
        }
    }

    /// Returns what the last switch changes: the index of each runner and the number of its configuration.
    ///
    /// A runner that only the mode before changed has its first configuration again.
    pub(crate) fn configurations(&self) -> impl Iterator<Item = (usize, usize)> {
        let [before, own] = [self.before, self.current].map(|mode| &self.modes[mode].configurations);
        let is_kept = |runner: usize| own.binary_search_by_key(&runner, |(own, _)| *own).is_ok();
        let restored = before.iter().filter(move |(runner, _)| !is_kept(*runner)).map(|(runner, _)| (*runner, 0));
        restored.chain(own.iter().copied())
    }

    /// Returns to the start mode. After a stop, the contact may have changed, so no condition keeps its state.
    pub(crate) fn restart(&mut self, tick: &Tick) {
        self.enter(self.start, ChangeReason::Resumed, tick);
    }

    /// Evaluates the conditions on the values of the tick and on the operator word `sent`.
    pub(crate) fn decide(&mut self, bus: &Bus, tick: &Tick, sent: Option<&str>) -> Transition {
        if self.entered.is_none() {
            self.enter(self.current, ChangeReason::Start, tick);
        }
        let entered = self.entered.unwrap_or(tick.now);
        let mut first = None;
        // Every condition is evaluated, since each keeps the time since which it holds.
        for (i, exit) in self.modes[self.current].exits.iter_mut().enumerate() {
            if exit.holds(bus, tick, entered, sent) && first.is_none() {
                first = Some(i);
            }
        }
        let Some(taken) = first else { return Transition::Stay };
        let exit = &self.modes[self.current].exits[taken].planned;
        self.taken = taken;
        match (exit.kind, exit.to) {
            (ExitKind::Fail, _) => Transition::Failed,
            (ExitKind::Done, _) | (_, None) => Transition::Done,
            (ExitKind::OnLost | ExitKind::Go, Some(to)) => {
                self.enter(to, ChangeReason::Exit(self.current, taken), tick);
                Transition::Switched
            }
        }
    }

    fn enter(&mut self, mode: usize, reason: ChangeReason, tick: &Tick) {
        (self.before, self.current) = (self.current, mode);
        self.entered = Some(tick.now);
        self.modes[mode].exits.iter_mut().for_each(|exit| exit.state = ConditionState::default());
        if self.changes.len() < MAX_CHANGES {
            self.changes.push((tick.now, tick.index, mode, reason));
        }
    }

    /// Returns the operator words that appear in the conditions of any mode.
    pub(crate) fn words(&self) -> impl Iterator<Item = &str> {
        let exits = self.modes.iter().flat_map(|mode| &mode.exits);
        exits.filter_map(|exit| match &exit.planned.condition {
            Condition::Sent(word) => Some(word.as_str()),
            _ => None,
        })
    }

    /// Returns the name of the current mode in the file of its task.
    pub(crate) fn name(&self) -> &str {
        own_name(&self.modes[self.current].name)
    }

    /// Returns the name of the current mode with that of its task: `left.servo`.
    pub(crate) fn full_name(&self) -> String {
        self.modes[self.current].name.clone()
    }

    /// Returns the names of all modes in the file of their task.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.modes.iter().map(|mode| own_name(&mode.name))
    }

    /// Returns the number of the current mode, from 0 in the order of the file.
    pub(crate) const fn number(&self) -> usize {
        self.current
    }

    /// Returns the condition of the exit that was taken last, and its position in the source.
    pub(crate) fn taken(&self) -> (&str, usize) {
        let exit = &self.modes[self.current].exits[self.taken].planned;
        (&exit.text, exit.span.start)
    }

    /// Returns the mode changes, the start first; at most [`MAX_CHANGES`].
    pub(crate) fn changes(&self) -> impl Iterator<Item = ModeChange> {
        self.changes.iter().map(|(time, tick, mode, reason)| ModeChange {
            time: *time,
            tick: *tick,
            mode: own_name(&self.modes[*mode].name).to_owned(),
            reason: match *reason {
                ChangeReason::Start => String::new(),
                ChangeReason::Resumed => "the operator resumed".into(),
                ChangeReason::Exit(mode, exit) => self.modes[mode].exits[exit].planned.text.clone(),
            },
        })
    }
}

/// Returns the name of a mode without that of its task.
fn own_name(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(_, name)| name)
}

impl Exit {
    /// Whether the condition holds, and has held for long enough.
    fn holds(&mut self, bus: &Bus, tick: &Tick, entered: i64, sent: Option<&str>) -> bool {
        match (&self.planned.condition, self.input) {
            (Condition::Elapsed(time), _) => tick.now - entered >= *time,
            (Condition::Sent(word), _) => sent == Some(word),
            (Condition::Travel(_, max), Some(ConditionInput::Port(pose))) => {
                self.state.travelled(bus, tick, pose) > *max
            }
            (Condition::Lost(_, after), Some(input)) => {
                let is_true = input.freshness(bus, tick) == Freshness::New && !input.is_false_flag(bus);
                if is_true {
                    self.state.last_true = Some(tick.now);
                }
                !is_true && tick.now - self.state.last_true.unwrap_or(entered) >= *after
            }
            (Condition::Port(_, test), Some(input)) => {
                self.state.test(*test, input, bus, tick) && self.state.has_lasted(tick.now, self.planned.lasts)
            }
            _ => false,
        }
    }
}

impl ConditionInput {
    const fn new((port, kind): (PortId, Kind), feature: Option<usize>) -> Self {
        match (kind, feature) {
            (Kind::Scalar | Kind::Flag, _) => Self::Scalar(ScalarId { port, kind, index: 0 }),
            (_, Some(index)) => Self::Scalar(ScalarId { port, kind, index }),
            (_, None) => Self::Port(port),
        }
    }

    fn freshness(self, bus: &Bus, tick: &Tick) -> Freshness {
        match self {
            Self::Port(port) => bus.mark(port).freshness(tick.index),
            Self::Scalar(scalar) => bus.scalar_freshness(scalar, tick.index),
        }
    }

    /// Returns the number, 1 or 0 for a flag; `None` if it is absent or not a number.
    fn value(self, bus: &Bus) -> Option<f64> {
        match self {
            Self::Port(_) => None,
            Self::Scalar(scalar) => bus.scalar(scalar),
        }
    }

    fn is_false_flag(self, bus: &Bus) -> bool {
        matches!(self, Self::Scalar(ScalarId { kind: Kind::Flag, .. })) && self.value(bus) == Some(0.0)
    }
}

impl ConditionState {
    /// Whether the test holds in this tick. Updates the time since which it holds.
    fn test(&mut self, test: Test, input: ConditionInput, bus: &Bus, tick: &Tick) -> bool {
        let (is_present, is_new) = match input.freshness(bus, tick) {
            Freshness::Absent | Freshness::Lost => (false, false),
            Freshness::Held => (true, false),
            Freshness::New => (true, true),
        };
        let holds = match test {
            Test::Is(PortState::Absent) => !is_present,
            _ if !is_present => false,
            Test::Is(PortState::New | PortState::Present) => is_new,
            // A held value neither starts nor ends the condition: the next sample decides.
            _ if !is_new => return false,
            Test::Is(state) => input.value(bus).is_some_and(|value| (value != 0.0) == (state == PortState::True)),
            Test::Between { min, max, hysteresis } => {
                let by = if self.since.is_some() { hysteresis } else { 0.0 };
                input.value(bus).is_some_and(|value| value > min - by && value < max + by)
            }
        };
        if holds {
            self.since = self.since.or(Some(tick.now));
        } else if is_new || !is_present {
            self.since = None;
        }
        holds
    }

    fn has_lasted(&self, now: i64, lasts: i64) -> bool {
        self.since.is_some_and(|since| now - since >= lasts)
    }

    /// Returns the distance that the origin of a pose has travelled in the mode [m].
    fn travelled(&mut self, bus: &Bus, tick: &Tick, pose: PortId) -> f64 {
        if bus.mark(pose).freshness(tick.index) != Freshness::New {
            return self.travelled;
        }
        let position: [f64; 3] = bus.slot::<Pose>(pose).0.translation.vector.into();
        let Some(anchor) = self.anchor else {
            self.anchor = Some(position);
            return self.travelled;
        };
        let step = anchor.iter().zip(position).map(|(a, b)| (b - a) * (b - a)).sum::<f64>().sqrt();
        if step >= MIN_STEP_M {
            (self.anchor, self.travelled) = (Some(position), self.travelled + step);
        }
        self.travelled
    }
}
