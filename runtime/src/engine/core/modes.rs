//! The mode machine: looks at the conditions of the present mode after each tick, and says where to go.
//!
//! A condition on a value is looked at when the value is new, and lasts from new sample to new sample: a sensor that has
//! stopped decides nothing. In one tick the sorts of exits come in their order, `fail` first; among `go` the greater
//! priority. What else could hold at once does not load.

use std::collections::BTreeMap;

use crate::graph::{Condition, ExitKind, PlannedExit, PlannedModes, PortRef, Test};
use crate::node::{Bus, PortId, Tick};
use crate::signal::{Features, Flag, Freshness, Kind, Pose, Scalar, Signal};

/// Steps of a way that count: what is less is noise of the joints' positions [m].
const LEAST_STEP: f64 = 1e-4;
/// As many changes of mode are remembered.
const MOST_CHANGES: usize = 10_000;

/// A change of mode.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// Time of the tick after which it was [ns].
    pub time: i64,
    /// Number of that tick.
    pub tick: u64,
    /// Name of the mode that begins.
    pub mode: String,
    /// What ended the one before, in words; empty for the start.
    pub why: String,
}

/// What follows from the conditions of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    Stay,
    /// Another mode has begun.
    Switched,
    /// The graph says that it is done.
    Done,
    /// The graph says that it failed.
    Failed,
}

/// The modes of a running graph.
pub(crate) struct Modes {
    modes: Vec<Mode>,
    now: usize,
    /// When the present mode began [ns]; not yet before the first tick.
    entered: Option<i64>,
    /// The exit that was taken last.
    taken: usize,
    /// Time, tick, mode that began and why.
    changes: Vec<(i64, u64, usize, Why)>,
    start: usize,
}

/// Why a mode began.
#[derive(Debug, Clone, Copy)]
enum Why {
    Start,
    /// The operator let the commands go on after a stop.
    Resumed,
    /// An exit of a mode.
    Exit(usize, usize),
}

struct Mode {
    name: String,
    exits: Vec<Exit>,
    /// For each runner that any mode changes: its place, and the configuration it has in this mode.
    configurations: Vec<(usize, usize)>,
}

struct Exit {
    planned: PlannedExit,
    look: Look,
    memory: Memory,
}

/// Where an exit looks.
#[derive(Debug, Clone, Copy)]
enum Look {
    Nowhere,
    Port(Place),
}

/// A port, or a feature of it, on the bus.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub(crate) id: PortId,
    pub(crate) kind: Kind,
    feature: Option<usize>,
}

/// What an exit remembers of the mode so far.
#[derive(Debug, Clone, Copy, Default)]
struct Memory {
    /// Since when it holds [ns].
    since: Option<i64>,
    /// When the signal last said yes [ns].
    said_yes: Option<i64>,
    /// Where the way was measured last [m], and how long it is [m].
    anchor: Option<[f64; 3]>,
    way: f64,
}

impl Modes {
    pub(crate) fn new(planned: PlannedModes, ports: &BTreeMap<PortRef, (PortId, Kind)>) -> Self {
        let mut changed: Vec<usize> =
            planned.modes.iter().flat_map(|mode| mode.configurations.iter().map(|(place, _)| *place)).collect();
        changed.sort_unstable();
        changed.dedup();
        let place = |source: &PortRef, feature| {
            let (id, kind) = ports[source];
            Look::Port(Place { id, kind, feature })
        };
        let look = |exit: &PlannedExit| match &exit.condition {
            Condition::Port(watched, _) | Condition::Lost(watched, _) => place(&watched.source, watched.feature),
            Condition::Travel(source, _) => place(source, None),
            Condition::Elapsed(_) | Condition::Sent(_) => Look::Nowhere,
        };
        let modes = planned.modes.into_iter().map(|mode| {
            let own = |place: usize| mode.configurations.iter().find(|(own, _)| *own == place).map_or(0, |(_, n)| *n);
            let configurations = changed.iter().map(|place| (*place, own(*place))).collect();
            let mut exits: Vec<Exit> = mode
                .exits
                .into_iter()
                .map(|planned| Exit { look: look(&planned), planned, memory: Memory::default() })
                .collect();
            exits.sort_by_key(|exit| (exit.planned.kind, std::cmp::Reverse(exit.planned.priority)));
            Mode { name: mode.name, exits, configurations }
        });
        Self {
            modes: modes.collect(),
            now: planned.start,
            entered: None,
            taken: 0,
            changes: Vec::with_capacity(MOST_CHANGES),
            start: planned.start,
        }
    }

    /// The configurations of the present mode, by the places of the runners.
    pub(crate) fn configurations(&self) -> &[(usize, usize)] {
        &self.modes[self.now].configurations
    }

    /// Begins at the start again: after a stop nothing is known of what the robot touches.
    pub(crate) fn restart(&mut self, tick: &Tick) {
        self.enter(self.start, Why::Resumed, tick);
    }

    /// Looks at the conditions with what the tick has left on the bus, and a word that was sent.
    pub(crate) fn decide(&mut self, bus: &Bus, tick: &Tick, sent: Option<&str>) -> Verdict {
        if self.entered.is_none() {
            self.enter(self.now, Why::Start, tick);
        }
        let entered = self.entered.unwrap_or(tick.now);
        let mut chosen = None;
        // All are looked at, so that each of them knows since when it holds.
        for (i, exit) in self.modes[self.now].exits.iter_mut().enumerate() {
            if exit.holds(bus, tick, entered, sent) && chosen.is_none() {
                chosen = Some(i);
            }
        }
        let Some(chosen) = chosen else { return Verdict::Stay };
        let exit = &self.modes[self.now].exits[chosen].planned;
        self.taken = chosen;
        match (exit.kind, exit.to) {
            (ExitKind::Fail, _) => Verdict::Failed,
            (ExitKind::Done, _) | (_, None) => Verdict::Done,
            (ExitKind::OnLost | ExitKind::Go, Some(to)) => {
                self.enter(to, Why::Exit(self.now, chosen), tick);
                Verdict::Switched
            }
        }
    }

    fn enter(&mut self, mode: usize, why: Why, tick: &Tick) {
        self.now = mode;
        self.entered = Some(tick.now);
        self.modes[mode].exits.iter_mut().for_each(|exit| exit.memory = Memory::default());
        if self.changes.len() < MOST_CHANGES {
            self.changes.push((tick.now, tick.index, mode, why));
        }
    }

    /// The words that any mode waits for.
    pub(crate) fn words(&self) -> impl Iterator<Item = &str> {
        let exits = self.modes.iter().flat_map(|mode| &mode.exits);
        exits.filter_map(|exit| match &exit.planned.condition {
            Condition::Sent(word) => Some(word.as_str()),
            _ => None,
        })
    }

    /// Name of the present mode.
    pub(crate) fn name(&self) -> &str {
        &self.modes[self.now].name
    }

    /// Number of the present mode, in the order of the file.
    pub(crate) const fn number(&self) -> usize {
        self.now
    }

    /// The exit that was taken last: its words and its place.
    pub(crate) fn taken(&self) -> (&str, usize) {
        let exit = &self.modes[self.now].exits[self.taken].planned;
        (&exit.text, exit.span.start)
    }

    /// Every change so far, the start first.
    pub(crate) fn changes(&self) -> impl Iterator<Item = Change> {
        self.changes.iter().map(|(time, tick, mode, why)| Change {
            time: *time,
            tick: *tick,
            mode: self.modes[*mode].name.clone(),
            why: match *why {
                Why::Start => String::new(),
                Why::Resumed => "the operator let it go on".into(),
                Why::Exit(mode, exit) => self.modes[mode].exits[exit].planned.text.clone(),
            },
        })
    }
}

impl Exit {
    /// Whether it holds, and has lasted.
    fn holds(&mut self, bus: &Bus, tick: &Tick, entered: i64, sent: Option<&str>) -> bool {
        match (&self.planned.condition, self.look) {
            (Condition::Elapsed(time), _) => tick.now - entered >= *time,
            (Condition::Sent(word), _) => sent == Some(word),
            (Condition::Travel(_, greatest), Look::Port(place)) => self.memory.travel(bus, tick, place.id) > *greatest,
            (Condition::Lost(_, after), Look::Port(place)) => {
                let says_yes = seen(bus, tick, place)
                    .is_some_and(|seen| seen.is_new && (place.kind != Kind::Flag || seen.value != Some(0.0)));
                if says_yes {
                    self.memory.said_yes = Some(tick.now);
                }
                !says_yes && tick.now - self.memory.said_yes.unwrap_or(entered) >= *after
            }
            (Condition::Port(_, test), Look::Port(place)) => {
                let seen = seen(bus, tick, place);
                self.memory.test(*test, seen, tick.now) && self.memory.has_lasted(tick.now, self.planned.lasts)
            }
            (_, Look::Nowhere) => false,
        }
    }
}

/// What is seen of a port in a tick, if it is there.
#[derive(Debug, Clone, Copy)]
struct Seen {
    is_new: bool,
    /// The number, or 1 and 0 for a flag.
    value: Option<f64>,
}

fn seen(bus: &Bus, tick: &Tick, Place { id, kind, feature }: Place) -> Option<Seen> {
    let slot = id.slot as usize;
    if let Some(feature) = feature {
        let component = Features::arena(&bus.arenas)[slot].components()[feature];
        let is_new = component.freshness(tick.index) == Freshness::New;
        return component.get().map(|value| Seen { is_new, value: Some(value) });
    }
    let mark = &bus.marks[id.mark as usize];
    let value = match kind {
        Kind::Scalar => Some(Scalar::arena(&bus.arenas)[slot]),
        Kind::Flag => Some(f64::from(u8::from(Flag::arena(&bus.arenas)[slot]))),
        _ => None,
    };
    mark.is_present().then(|| Seen { is_new: mark.changed_in(tick.index), value })
}

impl Memory {
    /// Whether what is asked is so; since when is remembered.
    fn test(&mut self, test: Test, seen: Option<Seen>, now: i64) -> bool {
        let Some(seen) = seen else {
            let is_absent = test == Test::Absent;
            self.since = if is_absent { self.since.or(Some(now)) } else { None };
            return is_absent;
        };
        let holds = match (test, seen.value) {
            (Test::New, _) => seen.is_new,
            (Test::Absent, _) => false,
            (Test::Present, _) => seen.is_new,
            // What is held is neither here nor there: it is waited for the next sample.
            _ if !seen.is_new => return false,
            (Test::Flag(wanted), Some(value)) => (value != 0.0) == wanted,
            (Test::Between { min, max, hysteresis }, Some(value)) => {
                let by = if self.since.is_some() { hysteresis } else { 0.0 };
                value > min - by && value < max + by
            }
            (Test::Flag(_) | Test::Between { .. }, None) => false,
        };
        match (holds, seen.is_new) {
            (true, _) => self.since = self.since.or(Some(now)),
            (false, true) => self.since = None,
            (false, false) => {}
        }
        holds
    }

    fn has_lasted(&self, now: i64, lasts: i64) -> bool {
        self.since.is_some_and(|since| now - since >= lasts)
    }

    /// The way of a pose's origin [m].
    fn travel(&mut self, bus: &Bus, tick: &Tick, id: PortId) -> f64 {
        let mark = &bus.marks[id.mark as usize];
        if mark.freshness(tick.index) != Freshness::New {
            return self.way;
        }
        let place: [f64; 3] = Pose::arena(&bus.arenas)[id.slot as usize].0.translation.vector.into();
        let Some(anchor) = self.anchor else {
            self.anchor = Some(place);
            return self.way;
        };
        let step = anchor.iter().zip(place).map(|(a, b)| (b - a) * (b - a)).sum::<f64>().sqrt();
        if step >= LEAST_STEP {
            (self.anchor, self.way) = (Some(place), self.way + step);
        }
        self.way
    }
}
