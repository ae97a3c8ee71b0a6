//! Finds the phases of a task in a run without a fault.

use super::attack::{Moment, Run};
use super::table::Phase;

/// Speed below which the sensor is steady, and above which it slides [m/s].
const STEADY_M_PER_S: f64 = 0.002;
const SLIDING_M_PER_S: f64 = 0.003;
/// Time over which the speed of the sensor is measured [s].
const SPAN_S: f64 = 0.04;
/// Commanded speed from which the sensor moves [m/s].
const MOVING_M_PER_S: f64 = 1e-4;

/// Returns the time at which each phase is attacked [s]; a task without the phase has `None`.
pub(super) fn phases(run: &Run) -> [Option<f64>; 6] {
    let first = |is_it: &dyn Fn(&Moment) -> bool| run.moments.iter().find(|one| is_it(one)).map(|one| one.time);
    let moves = first(&|one| one.sides[0].velocity.is_some_and(|velocity| velocity.norm() > MOVING_M_PER_S));
    let touches = first(&|one| one.sides[0].force > 0.0);
    let last = run.moments.last().map_or(0.0, |moment| moment.time);
    let approach = moves.zip(touches).filter(|(moves, touches)| touches - moves >= 0.1);
    let speeds = speeds(&run.moments);
    let after = touches.map_or(f64::INFINITY, |touches| touches + 0.5);
    let stretch = |least: f64, is_it: &dyn Fn(&Moment, [f64; 2]) -> bool| {
        first_stretch(run.moments.iter().zip(&speeds).map(|(one, speed)| (one.time, is_it(one, *speed))), least)
    };
    let presses = |one: &Moment| one.sides[0].force > 0.0 && one.time > after;
    [
        approach.map(|(moves, touches)| (moves + touches) / 2.0),
        touches.map(|touches| touches + 0.1).filter(|at| *at < last),
        stretch(0.3, &|one, [all, _]| presses(one) && all < STEADY_M_PER_S),
        stretch(0.1, &|one, [_, along]| presses(one) && along > SLIDING_M_PER_S),
        stretch(0.02, &|one, _| one.is_limited),
        moves.map(|moves| touches.map_or((moves + last) / 2.0, |touches| (touches + 1.0).min(last))),
    ]
}

/// Returns for each tick how fast the first sensor has moved, and how fast along its pad [m/s].
fn speeds(moments: &[Moment]) -> Vec<[f64; 2]> {
    let mut before = 0;
    let speed = |(i, one): (usize, &Moment)| {
        while moments[before].time < one.time - SPAN_S && before < i {
            before += 1;
        }
        let span = one.time - moments[before].time;
        let way = one.sides[0].place - moments[before].sides[0].place;
        let along = way - one.sides[0].axis * way.dot(&one.sides[0].axis);
        if span > 0.0 { [way.norm() / span, along.norm() / span] } else { [0.0; 2] }
    };
    moments.iter().enumerate().map(speed).collect()
}

/// Returns a time in the first stretch of at least `least` [s]: its middle, or 0.5 s after its begin.
fn first_stretch(ticks: impl Iterator<Item = (f64, bool)>, least: f64) -> Option<f64> {
    let (mut begin, mut last): (Option<f64>, f64) = (None, 0.0);
    for (time, is_it) in ticks.chain([(f64::INFINITY, false)]) {
        if is_it {
            begin.get_or_insert(time);
        } else if let Some(from) = begin.take().filter(|from| last - from >= least) {
            return Some(from + ((last - from) / 2.0).min(0.5));
        }
        last = time;
    }
    None
}

/// Returns why a task has no such phase.
pub(super) const fn missing(phase: Phase) -> &'static str {
    match phase {
        Phase::Approach => "it has no motion of 0.1 s before a contact",
        Phase::FirstTouch => "nothing touches the pad",
        Phase::Steady => "it is never in contact at less than 2 mm/s for 0.3 s",
        Phase::Sliding => "it never slides at more than 3 mm/s for 0.1 s",
        Phase::AtALimit => "no limiter reduces its motion for 20 ms",
        Phase::Ramping => "it has no motion to stop",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_stretch_that_is_long_enough_counts() {
        let at = |text: &str, least: f64| {
            first_stretch(text.chars().enumerate().map(|(i, one)| (0.25 * i as f64, one == 'x')), least)
        };
        assert_eq!(at("..xx..xxx..xxxxxxx", 0.5), Some(1.75));
        assert_eq!(at("..xx..xxx..xxxxxxx", 1.0), Some(3.25));
        assert_eq!(at("..xx.xx", 0.5), None);
    }
}
