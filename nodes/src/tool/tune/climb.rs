//! Gains that grow from run to run, compared by steps: for a feature whose response is not known.

use std::ops::RangeInclusive;

use serde::Serialize;

use super::limited::Limited;
use super::step::{MAX_OVERSHOOT, MAX_REST, Step};

/// Share of the gains of the graph with which it begins [1].
const FIRST: f64 = 0.5;
/// Ratio of the gains of two runs: 2 dB [1].
const RATIO: f64 = 1.26;
/// Smallest and largest multiple of the gains of the graph [1].
const RANGE: [f64; 2] = [0.1, 16.0];
/// Ratio of the best gains to those beside them that are tried at the end: 1 dB [1].
const BESIDE: f64 = 1.122;
/// Ratio of two gains that are the same [1].
const SAME: RangeInclusive<f64> = 0.95..=1.05;
/// Error over the steps, as a multiple of the smallest one, from which on gains are worse [1].
const WORSE: f64 = 1.05;
/// Number of larger gains after which the error must be smaller, because each step meets another friction.
const PATIENCE: usize = 3;
/// Error over the steps, as a multiple of the smallest one before, from which on it is no smaller [1].
const SMALLER: f64 = 0.95;
/// Ratio of gains that fail to those that are proposed, at least: three runs, 6 dB, less what rounding takes [1].
const MARGIN: f64 = 0.99 * RATIO * RATIO * RATIO;
/// Error over the steps, as a multiple of that of smaller gains, from which on gains fail: the feature swings [1]. A loop
/// with a latency has it with a gain margin of 2 dB, and the smallest error with 9 dB.
const SWINGS: f64 = 2.0;
/// Number of gains that may fail before one is good.
const FAILURES: usize = 4;
/// Largest overshoot of gains that are good, in the mean over the steps [1]. A loop with a latency has it with a gain
/// margin of 6 dB, and [`MAX_OVERSHOOT`] with 3 dB, so half of the gains that fail have 9 dB.
pub(super) const GOOD_OVERSHOOT: f64 = 0.3;
/// Ratio of two overshoots that are the same [1].
const SAME_OVERSHOOT: f64 = 1.2;

/// How a feature follows steps with some gains.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Rung {
    /// The gains as a multiple of those of the graph.
    #[serde(skip)]
    pub(super) factor: f64,
    pub(super) gains: [f64; 3],
    /// The steps over all contacts, those of one contact together.
    pub(super) steps: Vec<Vec<Step>>,
    /// Why no larger gains are tried, such as a mode that was left.
    pub(super) failure: Option<String>,
    /// The limit that has acted most, over the contact where it has, if it has acted much.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) limited: Option<Limited>,
}

/// How a feature follows steps over one contact.
pub(super) struct Followed {
    pub(super) object: String,
    /// The steps; `None` for one in which the feature was absent.
    pub(super) steps: Vec<Option<Step>>,
    /// Why the run has failed.
    pub(super) failure: Option<String>,
    /// The limit that has acted much.
    pub(super) limited: Option<Limited>,
}

impl Followed {
    /// Returns why no larger gains are tried.
    fn failure(&self) -> Option<String> {
        let known: Vec<&Step> = self.steps.iter().flatten().collect();
        let overshoot = known.iter().map(|step| step.overshoot).sum::<f64>() / known.len().max(1) as f64;
        let is_absent = known.len() < self.steps.len();
        let absent = || is_absent.then(|| "it is absent for a while".to_owned());
        let overshoots = || (overshoot > MAX_OVERSHOOT).then(|| format!("it overshoots by {:.0} %", 100.0 * overshoot));
        self.failure.clone().or_else(absent).or_else(overshoots)
    }
}

impl Rung {
    /// Returns the runs with some gains. They fail if the feature is absent, or if it overshoots.
    pub(super) fn new(factor: f64, gains: [f64; 3], contacts: &[Followed]) -> Self {
        let steps = contacts.iter().map(|contact| contact.steps.iter().flatten().copied().collect()).collect();
        let over = |contact: &Followed| match (contact.failure(), contacts.len()) {
            (Some(why), 2..) => Some(format!("over `{}`, {why}", contact.object)),
            (why, _) => why,
        };
        let limited = contacts.iter().filter_map(|contact| contact.limited.clone());
        let limited = limited.max_by(|a, b| a.share.total_cmp(&b.share));
        Self { factor, gains, steps, failure: contacts.iter().find_map(over), limited }
    }

    /// Returns it beside those of other gains: it fails if the error is much larger than with smaller ones.
    pub(super) fn beside(self, climbed: &[Self]) -> Self {
        let smaller =
            climbed.iter().filter(|other| other.factor < self.factor).filter_map(|other| other.error_s(climbed));
        let least = smaller.reduce(f64::min).unwrap_or(f64::INFINITY);
        let swings = self.worst(|step| step.error_s) > SWINGS * least;
        let why = || swings.then(|| "its error is more than twice that of smaller gains".to_owned());
        Self { failure: self.failure.clone().or_else(why), ..self }
    }

    /// Returns a number of the steps, as the mean over those of the worst contact.
    pub(super) fn worst(&self, of: impl Fn(&Step) -> f64) -> f64 {
        let mean = |steps: &Vec<Step>| steps.iter().map(&of).sum::<f64>() / steps.len().max(1) as f64;
        self.steps.iter().map(mean).fold(0.0, f64::max)
    }

    /// Returns whether smaller gains may be better: the feature swings, or they fail. Friction can make a contact overshoot
    /// with any gains: with half of them as much, and with a larger error.
    fn is_too_large(&self, climbed: &[Self]) -> bool {
        let [overshoot, error] = [self.worst(|step| step.overshoot), self.worst(|step| step.error_s)];
        let is_alike = |other: &Self| {
            let is_worse = other.worst(|step| step.error_s) > error;
            is_worse && SAME_OVERSHOOT * other.worst(|step| step.overshoot) >= overshoot
        };
        let mut smaller =
            climbed.iter().filter(|other| other.failure.is_none() && MARGIN * other.factor <= self.factor);
        self.failure.is_some() || overshoot > GOOD_OVERSHOOT && !smaller.any(is_alike)
    }

    fn is_good(&self, climbed: &[Self]) -> bool {
        !self.is_too_large(climbed) && self.worst(|step| step.rest) <= MAX_REST
    }

    /// Returns the error over the steps [s]; `None` if the gains are not good. If the feature does not settle, larger ones
    /// may be better.
    fn error_s(&self, climbed: &[Self]) -> Option<f64> {
        self.is_good(climbed).then(|| self.worst(|step| step.error_s))
    }
}

/// Returns the gains to try next, as a multiple of those of the graph; `None` after enough of them.
///
/// They grow until they bring no more, until they fail, or up to the largest multiple `most`. They become smaller while the
/// smallest ones are the best, or while all are too large. Then those beside the best ones are tried.
/// `climbed` are those that were tried, in this order.
pub(super) fn next(climbed: &[Rung], most: f64) -> Option<f64> {
    further(climbed, most).or_else(|| beside(climbed))
}

/// Returns gains beside the best ones that were not tried: smaller ones, or larger ones if twice as large ones were tried.
fn beside(climbed: &[Rung]) -> Option<f64> {
    let best = best(climbed)?.factor;
    let is_new = |factor: &f64| climbed.iter().all(|rung| !SAME.contains(&(rung.factor / factor)));
    let is_known = |factor: &f64| climbed.iter().any(|rung| rung.factor >= MARGIN * factor);
    let smaller = Some(best / BESIDE).filter(|factor| is_new(factor) && *factor >= RANGE[0]);
    smaller.or_else(|| Some(best * BESIDE).filter(|factor| is_new(factor) && is_known(factor)))
}

/// Returns the gains to try next that are a step larger or smaller than all that were tried.
fn further(climbed: &[Rung], most: f64) -> Option<f64> {
    let mut sorted: Vec<&Rung> = climbed.iter().collect();
    sorted.sort_by(|a, b| a.factor.total_cmp(&b.factor));
    let ([lowest, ..], Some(highest)) = (&sorted[..], sorted.last()) else {
        return (most >= RANGE[0]).then_some(FIRST.min(most));
    };
    let least = |rungs: &[&Rung]| rungs.iter().filter_map(|rung| rung.error_s(climbed)).reduce(f64::min);
    let best = least(&sorted);
    let before = least(&sorted[..sorted.len().saturating_sub(PATIENCE)]);
    let brings_more = match before.zip(best) {
        Some((before, best)) => best < SMALLER * before,
        None => best.is_some() || !highest.is_too_large(climbed) || !lowest.is_too_large(climbed),
    };
    let larger = highest.factor * RATIO;
    if highest.failure.is_none() && brings_more && larger <= most.min(RANGE[1]) {
        return Some(larger);
    }
    let smaller = lowest.factor / RATIO;
    // A light contact may be lost because its loop is too soft.
    if climbed.len() == 1 && highest.failure.is_some() && most >= 1.0 {
        return Some(1.0);
    }
    let failed = climbed.iter().filter(|rung| rung.failure.is_some()).count();
    let may_be_smaller = match self::best(climbed) {
        Some(best) => best.factor <= lowest.factor,
        None => lowest.is_good(climbed) || lowest.is_too_large(climbed) && failed < FAILURES,
    };
    (may_be_smaller && smaller >= RANGE[0]).then_some(smaller)
}

/// Returns whether larger gains than those that were tried are beyond `most`, and might have been better.
pub(super) fn is_bounded(climbed: &[Rung], most: f64) -> bool {
    let highest = climbed.iter().max_by(|a, b| a.factor.total_cmp(&b.factor));
    highest.is_some_and(|highest| highest.failure.is_none() && highest.factor * RATIO > most)
}

/// Returns the best gains: the smallest ones with which the error over the steps is as small as with any, but for 5 %.
/// Those near gains that fail do not count.
pub(super) fn best(climbed: &[Rung]) -> Option<&Rung> {
    let is_far = |rung: &&Rung| {
        let failed = climbed.iter().filter(|other| other.failure.is_some() && other.factor > rung.factor);
        failed.map(|other| other.factor).fold(f64::INFINITY, f64::min) > MARGIN * rung.factor
    };
    let counted: Vec<&Rung> = climbed.iter().filter(|rung| rung.is_good(climbed) && is_far(rung)).collect();
    let least = counted.iter().filter_map(|rung| rung.error_s(climbed)).reduce(f64::min)?;
    let good = counted.into_iter().filter(|rung| rung.error_s(climbed).is_some_and(|error| error <= WORSE * least));
    good.min_by(|a, b| a.factor.total_cmp(&b.factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(error_s: f64) -> Step {
        Step { size: 1.0, rise_s: None, overshoot: 0.1, rest: 0.0, error_s }
    }

    fn followed(step: Option<Step>) -> Followed {
        Followed { object: "ball".to_owned(), steps: vec![step; 4], failure: None, limited: None }
    }

    /// Climbs where the error over the steps, or that the gains fail, follows from the factor. Returns the factors in their
    /// order, and the best one.
    fn climb(most: f64, error: impl Fn(f64) -> Option<f64>) -> (Vec<f64>, Option<f64>) {
        climb_by(most, |factor| error(factor).map(step))
    }

    fn climb_by(most: f64, step: impl Fn(f64) -> Option<Step>) -> (Vec<f64>, Option<f64>) {
        let mut climbed = Vec::new();
        while let Some(factor) = next(&climbed, most) {
            assert!(climbed.len() < 30, "it goes on for ever: {climbed:?}");
            climbed.push(Rung::new(factor, [factor, 0.0, 0.0], &[followed(step(factor))]).beside(&climbed));
        }
        let factors = climbed.iter().map(|rung| rung.factor).collect();
        (factors, best(&climbed).map(|rung| rung.factor))
    }

    #[test]
    fn the_best_gains_are_found_from_below_and_from_above() {
        for least in [0.3, 1.0, 4.0] {
            let (tried, best) = climb(RANGE[1], |factor| Some(1.0 + (factor / least).ln().abs()));
            let best = best.unwrap();
            assert!((best / least).ln().abs() < 0.24, "{least}: {best}, of {tried:?}");
            assert!(tried.iter().all(|factor| *factor < 2.6 * least.max(0.5)), "{least}: {tried:?}");
        }
    }

    #[test]
    fn gains_that_fail_are_the_end_of_the_climb() {
        let (tried, best) = climb(RANGE[1], |factor| (factor < 0.9).then_some(1.0 / factor));
        assert_eq!(tried.iter().filter(|factor| **factor >= 0.9).count(), 1, "{tried:?}");
        assert!((0.45..0.55).contains(&best.unwrap()), "6 dB below them: {best:?}, of {tried:?}");
        let (tried, best) = climb(RANGE[1], |factor| (factor < 0.35).then_some(1.0 / factor));
        assert_eq!(tried[..2], [0.5, 1.0], "the gains of the graph");
        assert!(tried[2..].iter().all(|factor| *factor < 0.4), "{tried:?}");
        assert!((0.15..0.25).contains(&best.unwrap()), "{best:?}, of {tried:?}");
        // A loop that is too soft to hold its contact.
        let (_, best) = climb(RANGE[1], |factor| (factor > 0.9).then(|| 1.0 / factor.min(2.0)));
        assert!((1.7..2.1).contains(&best.unwrap()), "{best:?}");
        let (tried, best) = climb(RANGE[1], |_| None);
        assert_eq!((tried.len(), best), (FAILURES, None));
    }

    #[test]
    fn gains_that_swing_are_not_proposed_and_smaller_ones_are_tried() {
        let overshoots = |factor: f64| Step { overshoot: 0.3 * factor / 0.4, ..step(1.0 / factor) };
        let (tried, best) = climb_by(RANGE[1], |factor| Some(overshoots(factor)));
        let best = best.unwrap();
        assert!((0.35..0.41).contains(&best), "{best}, of {tried:?}");
        assert!(tried.iter().all(|factor| *factor < 1.05), "beyond twice the best ones they fail: {tried:?}");
    }

    #[test]
    fn an_overshoot_by_friction_is_the_same_with_smaller_gains_which_are_slower() {
        // Small gains hardly move it.
        let overshoot = |gain: f64| if gain > 1.8 { 0.65 } else { 0.36 * f64::from(u8::from(gain > 0.09)) };
        let rest = |gain: f64| if gain < 0.09 { 0.5 } else { 0.1 };
        let sticks = |gain: f64| Step { overshoot: overshoot(gain), rest: rest(gain), ..step(1.0 / gain) };
        for first in [0.2, 0.25, 0.5, 2.0, 4.0] {
            let (tried, best) = climb_by(RANGE[1], |factor| Some(sticks(first * factor)));
            let best = first * best.unwrap_or_else(|| panic!("from {first}: {tried:?}"));
            assert!((0.7..=1.05).contains(&best), "from {first}: {best}, of {tried:?}");
        }
    }

    #[test]
    fn gains_beyond_the_margins_are_not_tried() {
        assert_eq!(climb(0.0, |_| Some(1.0)), (Vec::new(), None), "a motion the wrong way");
        for most in [0.3, 1.0, 1.4] {
            let (tried, best) = climb(most, |factor| Some(1.0 / factor));
            assert!(tried.iter().all(|factor| *factor <= most), "{most}: {tried:?}");
            assert!(best.unwrap() > 0.7 * most, "{most}: {best:?}");
        }
    }

    #[test]
    fn one_run_that_is_worse_by_chance_does_not_end_it_and_a_plateau_does() {
        let dip = |factor: f64| (0.6..0.7).contains(&factor);
        let (tried, best) = climb(RANGE[1], |factor| Some(if dip(factor) { 1.8 } else { 1.0 } / factor.min(2.0)));
        assert!(best.unwrap() > 1.6, "{best:?}");
        assert!(tried.iter().all(|factor| *factor < 4.2), "{tried:?}");
    }

    #[test]
    fn gains_whose_error_is_more_than_twice_that_of_smaller_ones_fail() {
        let rung = |factor: f64, error_s: f64| Rung::new(factor, [factor; 3], &[followed(Some(step(error_s)))]);
        let climbed = [rung(0.5, 1.0), rung(1.0, 0.5)];
        assert_eq!(rung(2.0, 0.9).beside(&climbed).failure, None);
        let swings = rung(2.0, 1.1).beside(&climbed);
        assert_eq!(swings.failure.as_deref(), Some("its error is more than twice that of smaller gains"));
        assert_eq!(rung(0.25, 2.0).beside(&climbed).failure, None, "smaller gains are slower");
    }

    #[test]
    fn gains_fail_over_the_contact_that_overshoots_and_are_not_good_if_the_feature_does_not_settle() {
        let swings = Followed { object: "pen".to_owned(), ..followed(Some(Step { overshoot: 0.7, ..step(1.0) })) };
        let rung = Rung::new(1.0, [1.0; 3], &[followed(Some(step(2.0))), swings]);
        assert_eq!(rung.failure.as_deref(), Some("over `pen`, it overshoots by 70 %"));
        assert_eq!((rung.worst(|step| step.overshoot), rung.worst(|step| step.error_s)), (0.7, 2.0));
        let restless = Rung::new(1.0, [1.0; 3], &[followed(Some(Step { rest: 0.35, ..step(1.0) }))]);
        assert_eq!((restless.failure.as_deref(), restless.error_s(&[])), (None, None));
        let left =
            Followed { failure: Some("the mode `servo` was left for `press`".to_owned()), ..followed(Some(step(1.0))) };
        assert_eq!(Rung::new(1.0, [1.0; 3], &[left]).failure.as_deref(), Some("the mode `servo` was left for `press`"));
    }
}
