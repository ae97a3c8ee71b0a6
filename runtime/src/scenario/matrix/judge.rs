//! Judges a run with a fault: what has come of it, its numbers, and the promises that it breaks.

use serde::Serialize;

use super::attack::{Moment, Run, ramp_s};
use super::scene::{Scene, Side};
use super::table::{Fate, Phase, Row};

/// A run with a fault of one severity.
#[derive(Debug, Clone, Serialize)]
pub struct Attack {
    /// The severity, in the unit of the row.
    pub severity: f64,
    /// The entry `[[inject]]` of a scenario that repeats it.
    pub inject: String,
    /// What has come of it.
    pub fate: Fate,
    /// The named cause, if the run has halted or failed.
    pub cause: Option<String>,
    /// Largest true force from the fault on, and its bound [N]. A task without a ceiling in N has no bound.
    pub force_n: f64,
    /// See `force_n`.
    pub bound_n: Option<f64>,
    /// Time from the halt until every command is zero [s].
    pub rest_s: Option<f64>,
    /// Farthest way of a sensor after the halt [mm].
    pub way_mm: Option<f64>,
    /// The promises that are broken; none may be.
    pub broken: Vec<String>,
}

/// What a compliant arm gives way under a force at its ceiling [m]: 15 N at 3 kN/m.
const GIVE_M: f64 = 0.005;
/// How long a contact must have lasted before its end is a loss, and how long a loss takes to be seen [s]. A pad may
/// bounce for 0.5 s, which counts from when it has seen the contact for 40 ms after the last bounce. A contact that comes back later than a
/// loss takes to be seen is a new one, and may bounce again.
const HELD_S: f64 = 1.1;
const SEEN_S: f64 = 0.1;
/// How long an arm rests after a loss at least, and how fast it then searches at most [s, m/s].
const WAIT_S: f64 = 0.5;
const SEARCH_M_PER_S: f64 = 0.0052;
/// A motion that is none [m/s].
const STILL_M_PER_S: f64 = 1e-4;
/// Time at the end of a run in which a contact must be there [s].
const END_S: f64 = 0.5;
/// By how much a fault may delay a touch [s].
const DELAY_S: f64 = 1.0;

/// What was done to a run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strike<'a> {
    pub(super) row: &'a Row,
    pub(super) severity: f64,
    pub(super) phase: Phase,
    /// When [s].
    pub(super) at: f64,
}

/// Judges a run beside the one without the fault.
pub(super) fn judge(scene: &Scene, strike: Strike<'_>, [reference, run]: [&Run; 2], inject: String) -> Attack {
    let Strike { row, severity, at, .. } = strike;
    let from = run.moments.partition_point(|moment| moment.time < at);
    let (before, after) = run.moments.split_at(from);
    let halt = run.halts.iter().find(|(time, _)| *time >= at - scene.period);
    let fate = match (&run.fault, halt) {
        (Some(_), _) => Fate::Fails,
        (None, Some(_)) => Fate::Halts,
        _ if has_lost(reference, run) => Fate::Loses,
        _ => Fate::Holds,
    };
    let forces = |i: usize| after.iter().map(move |moment| moment.sides[i].force).fold(0.0, f64::max);
    let bounds = |side: &Side| side.force_n.map(|ceiling| row.bound(severity, ceiling));
    let mut broken = Vec::new();
    for (i, side) in scene.sides.iter().enumerate() {
        if let Some(bound) = bounds(side).filter(|bound| forces(i) > *bound) {
            broken.push(format!("the force on `{}` is {:.1} N, more than {bound:.1} N", side.pad, forces(i)));
        }
        broken.extend(motion(side, i, before, after));
        // The last tick with a contact may be the one before the fault.
        let from = at - 1.5 * scene.period;
        broken.extend(push_after_loss(side, i, &run.moments, [from, SEEN_S + row.delay(severity)]));
    }
    broken.extend(jerks(scene, before, after));
    let halt = halt.map(|(time, _)| *time).filter(|_| run.fault.is_none());
    let (rest_s, way_mm) = halt.map_or((None, None), |halt| rest(scene, strike, run, halt, &mut broken));
    if !run.is_at_rest {
        broken.push("a command is left standing at the end".to_owned());
    }
    let cause = run.fault.clone().or_else(|| run.halts.last().filter(|_| fate == Fate::Halts).map(|one| one.1.clone()));
    if cause.as_ref().is_some_and(String::is_empty) {
        broken.push("the run has ended without a named cause".to_owned());
    }
    let force_n = (0..scene.sides.len()).map(forces).fold(0.0, f64::max);
    let bound_n = scene.sides.iter().filter_map(bounds).reduce(f64::min);
    Attack { severity, inject, fate, cause, force_n, bound_n, rest_s, way_mm, broken }
}

/// Whether the first pad is without a contact at the end, although it has one then without the fault. One that has only
/// just begun does not count: a fault may delay a touch.
fn has_lost(reference: &Run, run: &Run) -> bool {
    let end = run.moments.last().map_or(0.0, |moment| moment.time);
    let touches = |run: &Run, before: f64| {
        let last = run.moments.last().map_or(0.0, |moment| moment.time).min(end) - before;
        let near = |moment: &&Moment| moment.time <= last && moment.time > last - END_S;
        run.moments.iter().filter(near).any(|moment| moment.sides[0].force > 0.0)
    };
    touches(reference, 0.0) && touches(reference, DELAY_S) && !touches(run, 0.0)
}

/// Returns how the commanded motion of a sensor exceeds its limits.
fn motion(side: &Side, i: usize, before: &[Moment], after: &[Moment]) -> Option<String> {
    let mut last = before.last();
    for moment in after {
        let velocity = moment.sides[i].velocity;
        if let (Some(velocity), Some(most)) = (velocity, side.speed)
            && velocity.norm() > most * (1.0 + 1e-6)
        {
            return Some(format!("`{}` is told {:.1} mm/s at {:.3} s", side.pad, velocity.norm() * 1e3, moment.time));
        }
        let pair = velocity.zip(last.and_then(|last| Some((last.sides[i].velocity?, last.time))));
        if let (Some((new, (old, time))), Some(most)) = (pair, side.acceleration) {
            let acceleration = (new - old).norm() / (moment.time - time);
            if acceleration > most * (1.0 + 1e-6) {
                return Some(format!("`{}` is told {acceleration:.2} m/s2 at {:.3} s", side.pad, moment.time));
            }
        }
        last = Some(moment);
    }
    None
}

/// Returns how a command to a joint jumps.
fn jerks(scene: &Scene, before: &[Moment], after: &[Moment]) -> Option<String> {
    let accelerations: Vec<f64> = scene.devices.iter().flat_map(|(_, list)| list.iter().copied()).collect();
    let pairs = before.last().into_iter().chain(after).zip(after.get(usize::from(before.is_empty())..)?);
    for (old, new) in pairs {
        let span = new.time - old.time;
        let steps = new.commands.iter().zip(&old.commands).zip(&accelerations);
        if let Some(((a, b), most)) = { steps }.find(|((a, b), most)| (*a - *b).abs() > *most * span * (1.0 + 1e-6)) {
            let jump = (a - b).abs() / span;
            return Some(format!("a joint is told {jump:.2} rad/s2 at {:.3} s, more than {most} rad/s2", new.time));
        }
    }
    None
}

/// Returns how a motion pushes on after the contact was lost.
fn push_after_loss(side: &Side, i: usize, moments: &[Moment], [at, seen]: [f64; 2]) -> Option<String> {
    let (mut begin, mut end): (Option<f64>, Option<f64>) = (None, None);
    for moment in moments {
        if moment.sides[i].force > 0.0 {
            let is_same = end.is_some_and(|end| moment.time - end < SEEN_S);
            begin = begin.filter(|_| is_same).or(Some(moment.time));
            end = Some(moment.time);
            continue;
        }
        let (Some(from), Some(lost)) = (begin, end) else { continue };
        let since = moment.time - lost;
        if lost - from < HELD_S || lost < at {
            continue;
        }
        let is_told = moment.commands.iter().any(|command| *command != 0.0);
        let into = moment.sides[i].velocity.filter(|_| is_told).map_or(0.0, |velocity| velocity.z);
        let most = if since < WAIT_S { STILL_M_PER_S } else { SEARCH_M_PER_S };
        if since > seen && into > most {
            return Some(format!(
                "`{}` is told {:.1} mm/s into the void, {since:.2} s after the contact was lost",
                side.pad,
                into * 1e3
            ));
        }
    }
    None
}

/// Returns how long the commands take to zero after a halt, and how far a sensor moves then [s, mm].
fn rest(
    scene: &Scene,
    Strike { row, phase, .. }: Strike<'_>,
    run: &Run,
    halt: f64,
    broken: &mut Vec<String>,
) -> (Option<f64>, Option<f64>) {
    let from = run.moments.partition_point(|moment| moment.time < halt - scene.period / 2.0);
    let after = &run.moments[from..];
    let Some(first) = run.moments.get(from.saturating_sub(1)) else { return (None, None) };
    let still = after.iter().find(|moment| moment.commands.iter().all(|command| *command == 0.0));
    let rest = still.map(|moment| moment.time - halt);
    let most = ramp_s(scene, &first.commands) + 3.0 * scene.period;
    let way = |i: usize| {
        let from = first.sides[i].place;
        after.iter().map(move |moment| (moment.sides[i].place - from).norm()).fold(0.0, f64::max)
    };
    let farthest = (0..scene.sides.len()).map(way).fold(0.0, f64::max);
    if phase == Phase::Ramping {
        if rest.is_none_or(|rest| rest > most) {
            let said = rest.map_or_else(|| "never".to_owned(), |rest| format!("after {rest:.3} s"));
            broken.push(format!("the commands rest {said} and not within {most:.3} s"));
        }
        let speed = scene.sides.iter().filter_map(|side| side.speed).fold(0.0, f64::max);
        let bound = speed * most + GIVE_M;
        // A hand or an object moves the arm as far as it moves itself.
        if speed > 0.0 && !row.is_of_world() && farthest > bound {
            let (farthest, bound) = (farthest * 1e3, bound * 1e3);
            broken.push(format!("a sensor moves {farthest:.1} mm after the stop, more than {bound:.1} mm"));
        }
    }
    (rest, Some(farthest * 1e3))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::scenario::matrix::attack::Reading;
    use crate::scenario::matrix::table::TABLE;

    const PERIOD: f64 = 0.004;

    fn scene() -> Scene {
        let side = Side {
            pad: "pad".into(),
            image: "pad.image".into(),
            cells: 256,
            force: "truth.force".into(),
            pose: None,
            twist: None,
            force_n: Some(15.0),
            speed: Some(0.05),
            acceleration: Some(2.0),
        };
        Scene { sides: vec![side], devices: vec![("arm".into(), vec![1.0])], arm: None, period: PERIOD }
    }

    /// A run of 5 s with a force and a commanded velocity along z at each time. The joint is told as much as the sensor.
    fn run(force: impl Fn(f64) -> f64, into: impl Fn(f64) -> f64) -> Run {
        let moment = |tick: u32| {
            let time = f64::from(tick) * PERIOD;
            let velocity = Some(Vector3::new(0.0, 0.0, into(time)));
            let place = Vector3::new(0.0, 0.0, into(time) * time);
            let sides = vec![Reading { force: force(time), place, axis: Vector3::z(), velocity }];
            Moment { time, sides, is_limited: false, commands: vec![into(time)] }
        };
        Run { moments: (0..1250).map(moment).collect(), is_at_rest: true, ..Run::default() }
    }

    fn broken(fault: &str, phase: Phase, run: &Run) -> Vec<String> {
        let row = TABLE.rows.iter().find(|row| row.name == fault).expect("the table has it");
        let reference = self::run(|_| 4.0, |_| 0.0);
        let strike = Strike { row, severity: row.severities[0], phase, at: 2.0 };
        judge(&scene(), strike, [&reference, run], String::new()).broken
    }

    #[test]
    fn each_promise_can_be_broken() {
        let lost = |time: f64| if time < 2.0 { 4.0 } else { 0.0 };
        let creeps =
            |speed: f64, from: f64| move |time: f64| if time < from { 0.0 } else { speed.min((time - from) * 0.9) };
        let gone = |into: &dyn Fn(f64) -> f64| broken("object gone", Phase::Steady, &run(lost, into));
        // A search that begins late enough and is slow enough breaks nothing.
        assert_eq!(gone(&creeps(0.005, 2.5)), [""; 0]);
        assert!(gone(&creeps(0.005, 2.2))[0].contains("into the void, 0.21 s after"), "it pushes too soon");
        assert!(gone(&creeps(0.02, 2.5))[0].contains("into the void"), "it searches too fast");
        let force = |most: f64| {
            broken("lost commands", Phase::Steady, &run(|time| if time > 3.0 { most } else { 4.0 }, |_| 0.0))
        };
        assert_eq!(force(20.9), [""; 0]);
        assert_eq!(force(21.1), ["the force on `pad` is 21.1 N, more than 21.0 N"]);
        let told = |into: &dyn Fn(f64) -> f64| broken("lost commands", Phase::Steady, &run(|_| 4.0, into));
        assert!(
            told(&|time| if time < 3.0 { 0.0 } else { (time - 3.0) * 0.9 })
                .iter()
                .any(|one| one.contains("mm/s at 3.0"))
        );
        let jumps = told(&|time| if time < 3.0 { 0.0 } else { 0.01 });
        assert!(jumps[0].contains("2.50 m/s2") && jumps[1].contains("2.50 rad/s2"), "{jumps:?}");
        let mut standing = run(|_| 4.0, |_| 0.0);
        standing.is_at_rest = false;
        assert_eq!(broken("lost commands", Phase::Steady, &standing), ["a command is left standing at the end"]);
        standing.halts = vec![(2.0, String::new())];
        assert!(
            broken("lost commands", Phase::Steady, &standing)
                .contains(&"the run has ended without a named cause".to_owned())
        );
    }

    #[test]
    fn a_contact_is_lost_if_it_is_missing_at_the_end_and_a_late_touch_is_no_loss() {
        let touched = |from: f64, to: f64| run(|time| f64::from(u8::from((from..to).contains(&time))), |_| 0.0);
        assert!(has_lost(&touched(1.0, 9.0), &touched(1.0, 4.0)));
        assert!(!has_lost(&touched(1.0, 9.0), &touched(1.0, 4.8)), "in the last half second");
        assert!(!has_lost(&touched(4.4, 9.0), &touched(9.0, 9.0)), "it may touch a little later");
        assert!(has_lost(&touched(3.4, 9.0), &touched(9.0, 9.0)), "not that much later");
        assert!(!has_lost(&touched(1.0, 4.0), &touched(1.0, 3.0)), "nor has it one without the fault");
    }

    #[test]
    fn a_contact_that_comes_back_is_a_new_one_and_a_flicker_is_not() {
        let judged = |touches: &dyn Fn(f64) -> bool, into: f64| {
            let creeps = |time: f64| if time < into { 0.0 } else { 0.005_f64.min((time - into) * 0.9) };
            broken("object gone", Phase::Steady, &run(|time| if touches(time) { 4.0 } else { 0.0 }, creeps))
        };
        let back_for = |seconds: f64| move |time: f64| time < 2.0 || (3.0..3.0 + seconds).contains(&time);
        assert_eq!(judged(&back_for(0.3), 3.35), [""; 0], "a short contact may bounce");
        assert!(judged(&back_for(1.2), 4.35)[0].contains("into the void, 0.1"), "one that has lasted is lost");
        let flickers = |time: f64| time < 2.0 || (2.05..2.2).contains(&time);
        assert!(judged(&flickers, 2.35)[0].contains("into the void, 0.1"), "the same contact");
    }

    #[test]
    fn after_a_stop_the_commands_rest_in_time_and_the_sensor_stays() {
        let stopped = |ramp: f64| {
            let mut run = run(|_| 4.0, |time| (0.04 - (time - 2.0).max(0.0) * 0.04 / ramp).max(0.0));
            run.halts = vec![(2.0, "the operator sent `stop`".into())];
            run
        };
        // 0.04 rad/s with 1 rad/s2 takes 40 ms.
        let rests = |ramp: f64| broken("lost commands", Phase::Ramping, &stopped(ramp));
        assert!(rests(0.045).iter().all(|one| !one.contains("rest")), "{:?}", rests(0.045));
        assert!(
            rests(0.058)[0].contains("the commands rest after 0.060 s and not within 0.052 s"),
            "{:?}",
            rests(0.058)
        );
        // The test's sensor is back at its origin at rest: 79.8 mm from where it was.
        assert!(
            rests(0.045)[0].contains("a sensor moves 79.8 mm after the stop, more than 7.6 mm"),
            "{:?}",
            rests(0.045)
        );
    }
}
