//! Warns of modes that lead to each other again and again: one value, noise at a bound, or short times end each of them.

use std::collections::BTreeSet;

use super::contact::ContactPorts;
use super::immediate::{Ways, stays};
use super::readings::Readings;
use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, PortRef, Producer, Test, WatchedPort};
use crate::graph::syntax::{ExitKind, PortState};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, quoted};

/// Number of modes of the longest ring that is looked for.
const MAX_RING: usize = 4;
/// A ring of modes that one value leads through chatters if it takes less than this [ns].
const OVERLAP: i64 = 500_000_000;
/// A ring of modes that only noise leads through chatters if it takes less than this [ns].
const NOISE: i64 = 250_000_000;
/// A ring of modes that end by themselves chatters if each takes at most this on average [ns].
const SHORT_MODE: i64 = 50_000_000;
/// Part of a bound that noise crosses: a smaller gap between two bounds is none [1].
const MIN_GAP: f64 = 0.03;
/// Part of a bound that is left as a gap to another bound, in the help [1].
const GAP: f64 = 0.2;

/// Warns of each ring of two to four modes that lead to each other, where a value that does not change, or one that
/// is at the bound, ends each of them.
///
/// A mode that ends as soon as it begins has its own warning. `period` is that of the graph [s].
pub(crate) fn check(
    (net, readings): (&Net<'_>, &Readings),
    contact: &ContactPorts,
    modes: &[PlannedMode],
    period: f64,
    diagnostics: &mut Diagnostics,
) {
    let period = (period * 1e9) as i64;
    let ways = Ways::new(net, modes, period);
    // An exit can lead back in several rings. One warning is enough: that about the shortest one.
    let mut marked = BTreeSet::new();
    let back = |ring: &[Step<'_>]| ring.last().map(|step| (step.from, step.exit.span.start));
    for ring in rings(modes) {
        let conditions: Vec<Condition> = ring.iter().map(|step| readings.origin(net, &step.exit.condition)).collect();
        let Some(cause) = cause(&conditions).filter(|cause| cause.is_fast(&ring, period)) else { continue };
        let is_reported = ring.iter().any(|step| ways.immediate(step.from, step.exit).is_some());
        if !is_reported && cause.stays((net, contact), &ring, &conditions) && marked.insert(back(&ring)) {
            diagnostics.push(report(modes, &ring, help(&ring, &conditions, cause, period)));
        }
    }
}

/// One mode of a ring, and the exit to the next one.
#[derive(Debug, Clone, Copy)]
struct Step<'a> {
    from: usize,
    exit: &'a PlannedExit,
}

impl Step<'_> {
    /// Returns the shortest time until the exit is taken [ns].
    const fn lasts(&self) -> i64 {
        match self.exit.condition {
            Condition::Elapsed(time) | Condition::Lost(_, time) => time,
            _ => self.exit.lasts,
        }
    }
}

/// Returns the rings of modes, the shorter ones first. Each begins with the first of its modes in the file.
fn rings(modes: &[PlannedMode]) -> Vec<Vec<Step<'_>>> {
    let mut rings = Vec::new();
    (0..modes.len()).for_each(|from| add_rings(modes, from, &mut Vec::new(), &mut rings));
    rings.sort_by_key(Vec::len);
    rings
}

/// Adds the rings that begin with a path of modes, which leads to the mode `from`.
fn add_rings<'a>(modes: &'a [PlannedMode], from: usize, path: &mut Vec<Step<'a>>, rings: &mut Vec<Vec<Step<'a>>>) {
    let first = path.first().map_or(from, |step| step.from);
    for exit in &modes[from].exits {
        let Some(to) = exit.to else { continue };
        path.push(Step { from, exit });
        if to == first && path.len() > 1 {
            rings.push(path.clone());
        } else if to > first && path.len() < MAX_RING && path.iter().all(|step| step.from != to) {
            add_rings(modes, to, path, rings);
        }
        path.pop();
    }
}

/// Why modes chatter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cause {
    /// A value is within all bounds.
    Overlap,
    /// The bounds meet: noise crosses all of them.
    Noise,
    /// The contact comes and goes.
    Contact,
    /// Modes end by themselves, and the others for a value that stays.
    Time,
}

impl Cause {
    /// Returns whether the modes of a ring follow each other faster than a value settles. The period is in [ns].
    fn is_fast(self, ring: &[Step<'_>], period: i64) -> bool {
        let time: i64 = ring.iter().map(Step::lasts).sum();
        match self {
            Self::Overlap => time < OVERLAP,
            Self::Noise => time < NOISE,
            Self::Contact => time < 2 * period,
            Self::Time => time <= ring.len() as i64 * SHORT_MODE,
        }
    }

    /// Returns whether no mode of a ring removes the cause: none changes the port that the ring watches.
    ///
    /// `origins` are its conditions on what is measured.
    fn stays(self, (net, contact): (&Net<'_>, &ContactPorts), ring: &[Step<'_>], origins: &[Condition]) -> bool {
        let is_contact = |port: PortRef| contact.need(net, port) && is_raw(net, port);
        let is_possible = self != Self::Contact || origins.iter().filter_map(Condition::port).all(is_contact);
        let mut ports = ring.iter().filter_map(|step| step.exit.condition.port());
        is_possible && ports.all(|port| ring.iter().all(|step| stays(net, ring[0].from, step.from, port)))
    }
}

/// Returns whether a flag can change with each sample. One that a node makes of other flags may be free of flicker.
fn is_raw(net: &Net<'_>, flag: PortRef) -> bool {
    let is_print = |kind: Kind| matches!(kind, Kind::Image | Kind::Mask | Kind::Regions);
    match flag.producer {
        Producer::Role(_) => true,
        Producer::Task(_) => false,
        Producer::Node(node) => net.wires[node].iter().any(|wire| is_print(net.port(wire.source).kind)),
    }
}

/// Returns why the exits of a ring with these conditions can follow each other at once: there is a value that fulfils
/// all of them, or that noise lets fulfil all of them.
fn cause(ring: &[Condition]) -> Option<Cause> {
    let is_test = |condition: &&Condition| !matches!(condition, Condition::Elapsed(_));
    let tests: Vec<&Condition> = ring.iter().filter(is_test).collect();
    let has_timeout = tests.len() < ring.len();
    match tests[..] {
        [] => Some(Cause::Time),
        [Condition::Port(_, test)] => (*test != Test::Is(PortState::New)).then_some(Cause::Time),
        [one, other] if !has_timeout && (comes_and_goes(one, other) || comes_and_goes(other, one)) => {
            Some(Cause::Contact)
        }
        _ => cause_of_bounds(&tests).map(|cause| if has_timeout { Cause::Time } else { cause }),
    }
}

/// Returns whether one condition waits for a flag, and another one for its end.
fn comes_and_goes(found: &Condition, gone: &Condition) -> bool {
    use PortState::{Absent, False, Present, True};
    let Condition::Port(port, Test::Is(True | Present)) = found else { return false };
    matches!(gone, Condition::Port(other, Test::Is(False | Absent)) | Condition::Lost(other, _) if other == port)
}

/// Returns why conditions on one number can hold together, or `None` if there is a gap between their bounds.
fn cause_of_bounds(conditions: &[&Condition]) -> Option<Cause> {
    let (first, others) = conditions.split_first()?;
    let (port, (mut low, mut high)) = range(first)?;
    for condition in others {
        let (_, (min, max)) = range(condition).filter(|(other, _)| *other == port)?;
        (low, high) = (low.max(min), high.min(max));
    }
    match low - high {
        gap if gap < 0.0 => Some(Cause::Overlap),
        gap if gap <= MIN_GAP * low.abs().max(high.abs()) => Some(Cause::Noise),
        _ => None,
    }
}

/// Returns the bounds on a number, and its port.
const fn range(condition: &Condition) -> Option<(WatchedPort, (f64, f64))> {
    match condition {
        Condition::Port(port, Test::Between { min, max, .. }) => Some((*port, (*min, *max))),
        _ => None,
    }
}

fn report(modes: &[PlannedMode], ring: &[Step<'_>], help: String) -> Diagnostic {
    let (back, steps) = ring.split_last().expect("a ring has two modes or more");
    let name = |step: &Step<'_>| modes[step.from].name.as_str();
    let ends: Vec<String> = steps.iter().map(|step| format!("`{}` ends when {}", name(step), step.exit.text)).collect();
    let message = format!(
        "{} and `{}` follow each other again and again: {}, and `{}` leads back when {}",
        quoted(steps.iter().map(name)),
        name(back),
        ends.join(", "),
        name(back),
        back.exit.text
    );
    let mut diagnostic = Diagnostic::new(Code::ChatteringModes, back.exit.span.clone(), message);
    for (step, next) in steps.iter().zip(&ring[1..]) {
        diagnostic =
            diagnostic.note(step.exit.span.clone(), format!("leads from `{}` to `{}`", name(step), name(next)));
    }
    diagnostic.help(help)
}

/// Returns what ends the chatter of a ring. The period is in [ns].
fn help(ring: &[Step<'_>], conditions: &[Condition], cause: Cause, period: i64) -> String {
    let bounds = |i: usize| range(&conditions[i]).map(|(_, bounds)| bounds);
    match (cause, ring) {
        (Cause::Time, _) => "let the modes last longer, or let one of them wait for something else".into(),
        (Cause::Contact, [.., back]) => {
            let key = if back.exit.kind == ExitKind::OnLost { "after_ms" } else { "for_ms" };
            let time_ms = (5.0 * period as f64 / 1e6).max(100.0);
            format!("let the way back wait for longer, for example `{key} = {time_ms}`")
        }
        (_, [_, back]) if is_flag(back) => {
            let bound = bounds(0).map(|(min, max)| if min.is_finite() { min } else { max });
            // Of one flag that is set and cleared, the hysteresis is the gap.
            let is_one = ring[0].exit.condition.port() == back.exit.condition.port();
            let example = bound.filter(|bound| is_one && bound.is_finite() && *bound != 0.0);
            let example = example.map(|bound| format!(", for example `hysteresis = {}`", rounded(GAP * bound.abs())));
            format!(
                "let the node that sets the flag leave a gap that is wider than the noise: `hysteresis` in a \
                 comparison{}",
                example.unwrap_or_default()
            )
        }
        (_, [_, _]) => match bounds(0).zip(bounds(1)).and_then(|(there, back)| apart(there, back)) {
            Some(bound) => format!(
                "leave a gap, so that noise does not switch back: for example {bound}. `hysteresis` leaves none: it \
                 counts within one mode"
            ),
            None => "leave a gap between the two bounds that is wider than the noise".into(),
        },
        _ => "leave a gap between two of the bounds, so that no value is within all of them".into(),
    }
}

/// Returns whether an exit waits for a flag.
const fn is_flag(step: &Step<'_>) -> bool {
    matches!(step.exit.condition, Condition::Port(_, Test::Is(_)))
}

/// Returns the bound on the way back that leaves a gap to the bounds on the way there.
fn apart((min, max): (f64, f64), (low, high): (f64, f64)) -> Option<String> {
    let gap = |bound: f64| GAP * bound.abs();
    match (low.is_finite(), high.is_finite()) {
        (false, true) if min.is_finite() && min != 0.0 => Some(format!("`below = {}`", rounded(min - gap(min)))),
        (true, false) if max.is_finite() && max != 0.0 => Some(format!("`above = {}`", rounded(max + gap(max)))),
        (true, true) if min > 0.0 && low == -high => Some(format!("`within = {}`", rounded(min - gap(min)))),
        _ => None,
    }
}

/// Rounds a bound to six decimals.
fn rounded(bound: f64) -> f64 {
    (bound * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;
    use PortState::{Absent, False, New, Present, True};

    const PORT: WatchedPort = WatchedPort { source: PortRef { producer: Producer::Node(0), port: 0 }, feature: None };
    const PERIOD: i64 = 4_000_000;

    fn exit(condition: Condition, lasts_ms: i64) -> PlannedExit {
        let (kind, text) = (ExitKind::Go, String::new());
        PlannedExit { kind, to: None, condition, lasts: lasts_ms * 1_000_000, priority: 0, text, span: 0..0 }
    }

    fn after(ms: i64) -> PlannedExit {
        exit(Condition::Elapsed(ms * 1_000_000), 0)
    }

    fn between(min: f64, max: f64, for_ms: i64) -> PlannedExit {
        exit(Condition::Port(PORT, Test::Between { min, max, hysteresis: 0.0 }), for_ms)
    }

    fn above(min: f64, for_ms: i64) -> PlannedExit {
        between(min, f64::INFINITY, for_ms)
    }

    fn below(max: f64, for_ms: i64) -> PlannedExit {
        between(f64::NEG_INFINITY, max, for_ms)
    }

    fn is(state: PortState, for_ms: i64) -> PlannedExit {
        exit(Condition::Port(PORT, Test::Is(state)), for_ms)
    }

    fn lost(after_ms: i64) -> PlannedExit {
        exit(Condition::Lost(PORT, after_ms * 1_000_000), 0)
    }

    fn chatter(exits: &[PlannedExit]) -> Option<Cause> {
        let ring: Vec<Step<'_>> = exits.iter().enumerate().map(|(from, exit)| Step { from, exit }).collect();
        let conditions: Vec<Condition> = exits.iter().map(|exit| exit.condition.clone()).collect();
        cause(&conditions).filter(|cause| cause.is_fast(&ring, PERIOD))
    }

    #[test]
    fn bounds_without_a_gap_chatter() {
        let other = WatchedPort { feature: Some(1), ..PORT };
        let elsewhere = exit(Condition::Port(other, Test::Is(False)), 0);
        let cases = [
            (vec![above(0.05, 150), below(0.06, 150)], Some(Cause::Overlap)),
            (vec![above(0.05, 250), below(0.06, 249)], Some(Cause::Overlap)),
            (vec![above(0.05, 250), below(0.06, 250)], None),
            (vec![below(0.06, 200), below(0.05, 40)], Some(Cause::Overlap)),
            (vec![between(-0.003, 0.003, 0), above(0.001, 0)], Some(Cause::Overlap)),
            (vec![above(0.2, 130), below(0.2, 119)], Some(Cause::Noise)),
            (vec![above(0.2, 130), below(0.2, 120)], None),
            (vec![above(0.0, 0), below(0.0, 0)], Some(Cause::Noise)),
            (vec![above(0.1, 0), below(0.0999, 0)], Some(Cause::Noise)),
            (vec![above(-0.0999, 0), below(-0.1, 0)], Some(Cause::Noise)),
            (vec![above(0.1, 0), below(0.0975, 0)], Some(Cause::Noise)),
            (vec![above(0.1, 0), below(0.0965, 0)], None),
            (vec![above(0.05, 0), below(0.2, 0), above(0.04, 0)], Some(Cause::Overlap)),
            (vec![above(0.05, 200), below(0.2, 200), above(0.04, 100)], None),
            (vec![above(0.05, 0), below(0.2, 0), above(0.3, 0)], None),
            (vec![above(0.05, 0), elsewhere], None),
        ];
        for (exits, cause) in cases {
            assert_eq!(chatter(&exits), cause, "{exits:?}");
        }
    }

    #[test]
    fn times_and_flags_chatter() {
        let cases = [
            (vec![after(50), after(50)], Some(Cause::Time)),
            (vec![after(52), after(50)], None),
            (vec![after(50), after(50), after(50)], Some(Cause::Time)),
            (vec![after(54), after(50), after(50)], None),
            (vec![above(0.05, 0), after(20)], Some(Cause::Time)),
            (vec![after(20), is(True, 40)], Some(Cause::Time)),
            (vec![above(0.003, 100), after(8)], None),
            (vec![is(New, 0), after(20)], None),
            (vec![lost(20), after(20)], None),
            (vec![above(0.05, 0), below(0.06, 0), after(100)], Some(Cause::Time)),
            (vec![above(0.05, 0), below(0.06, 0), after(200)], None),
            (vec![above(0.05, 0), below(0.04, 0), after(20)], None),
            (vec![is(True, 0), is(False, 4)], Some(Cause::Contact)),
            (vec![is(Absent, 0), is(Present, 4)], Some(Cause::Contact)),
            (vec![is(True, 0), lost(4)], Some(Cause::Contact)),
            (vec![is(True, 4), is(False, 4)], None),
            (vec![is(True, 40), lost(100)], None),
            (vec![is(True, 0), is(False, 0), after(4)], None),
            (vec![is(True, 0), is(True, 0)], None),
        ];
        for (exits, cause) in cases {
            assert_eq!(chatter(&exits), cause, "{exits:?}");
        }
    }

    #[test]
    fn each_ring_is_found_once() {
        let leads = |to: usize| PlannedExit { to: Some(to), ..after(4) };
        let mode = |exits: Vec<PlannedExit>| PlannedMode { name: String::new(), exits, configurations: Vec::new() };
        let found = |exits: Vec<Vec<PlannedExit>>| {
            let modes: Vec<PlannedMode> = exits.into_iter().map(mode).collect();
            let rings = rings(&modes);
            rings.iter().map(|ring| ring.iter().map(|step| step.from).collect()).collect::<Vec<Vec<usize>>>()
        };
        assert_eq!(found(vec![vec![leads(1)], vec![leads(2)], vec![leads(0)]]), [[0, 1, 2]]);
        assert_eq!(
            found(vec![vec![leads(1), leads(2)], vec![leads(2)], vec![leads(0), leads(1)]]),
            [vec![0, 2], vec![1, 2], vec![0, 1, 2]]
        );
        // Four modes that lead to each other, after one that leads to itself; and five, which are not looked for.
        let ring = |last: usize| {
            let others = (1..last).map(|from| vec![leads(from + 1)]);
            [vec![leads(0)]].into_iter().chain(others).chain([vec![leads(1)]]).collect()
        };
        assert_eq!(found(ring(4)), [[1, 2, 3, 4]]);
        assert!(found(ring(5)).is_empty());
    }
}
