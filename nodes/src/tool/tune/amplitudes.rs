//! Test signals of growing amplitudes, until two of them say the same.

use tactflow_runtime::cli::Shell;

use super::Stop;
use super::experiment::{Answered, Experiment};
use super::fit::ENOUGH;
use super::limited::Limited;
use super::load::Room;
use super::play::play;
use super::spectrum::Line;
use crate::tool::control::digits::down_to_two_digits;

/// Amplitudes of a linear [m] and of an angular test signal [rad], one after the other.
const AMPLITUDES: [[f64; 4]; 2] = [[0.3e-3, 1.2e-3, 2.4e-3, 4.8e-3], [0.01, 0.02, 0.04, 0.08]];
/// Difference of two responses that agree, as the median over the frequencies [1].
const AGREES: f64 = 0.2;
/// A motion that is so many times as large as another one is larger [1].
const FURTHER: f64 = 1.3;
/// Ratio of two amplitudes of which the second one is worth a run: more than [`FURTHER`] [1].
const NOTICEABLY: f64 = 1.5;
/// Change of the response from one amplitude to the next with which the larger one counts [1].
const MAX_CHANGE: f64 = 0.5;
/// The component that presses, and lifts off.
pub(super) const PRESSES: usize = 2;
/// What the motions of all amplitudes say.
pub(super) struct Response {
    pub(super) lines: Vec<Line>,
    /// The last response as a multiple of the one before, if no two of them agree [1].
    pub(super) growth: Option<f64>,
    /// The limit that has acted most in the last of these motions, if it has acted much.
    pub(super) limited: Option<Limited>,
    /// Amplitude of the motion that lifts the pad off, if no two smaller ones agree [m].
    pub(super) lifts_off: Option<f64>,
}

/// Why a response is not known.
pub(super) struct Refusal {
    pub(super) why: String,
    pub(super) kind: Unknown,
}

/// What hides a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unknown {
    /// Noise or friction.
    Hidden,
    /// A test signal has ended the mode: smaller gains may help.
    Lost,
    /// The task has not reached the mode.
    NotReached,
}

/// Moves further and further along a component, as far as the task stays in its mode, and returns the response to the
/// largest motions that agree. Friction hides a small motion, and gives two of them the same wrong response: no larger
/// motion may have a larger one. If the last two only differ a little, the larger response counts, which has the smaller
/// margins: a contact may stiffen when it is pressed further, and press less when it is nearly left.
///
/// Also returns the play of the contact.
pub(super) fn agreed(
    experiment: &Experiment<'_>,
    component: usize,
    shell: &Shell,
) -> Result<(Result<Response, Refusal>, Option<f64>), Stop> {
    let Runs { runs, mut limited, stopped, is_absent, amplitude } = runs(experiment, component, shell)?;
    let play = play(experiment.feature, component, runs.iter().flatten());
    if let Some((lines, growth, last)) = largest(&runs) {
        // A light contact is not linear where a motion nearly lifts the pad off.
        let lifts_off = Some(amplitude).filter(|_| component == PRESSES && is_absent && growth.is_some());
        return Ok((Ok(Response { lines, growth, limited: limited[last].take(), lifts_off }), play));
    }
    let agree = (1..runs.len()).any(|i| difference(&runs[i - 1], &runs[i]) < AGREES);
    let lighter = if component < 2 { "; a lighter press has less friction" } else { "" };
    let refusal = match (agree, stopped) {
        (true, _) => Refusal {
            why: format!("friction holds the contact back: only the largest test signal moves it{lighter}"),
            kind: Unknown::Hidden,
        },
        (false, Some(refusal)) => refusal,
        (false, None) => Refusal {
            why: format!(
                "no two test signals gave the same response at {ENOUGH} frequencies that stand out of the noise{lighter}"
            ),
            kind: Unknown::Hidden,
        },
    };
    Ok((Err(refusal), play))
}

/// The runs with test signals of growing amplitudes.
struct Runs {
    runs: Vec<Vec<Line>>,
    /// The limit that has acted most in each of them, if it has acted much.
    limited: Vec<Option<Limited>>,
    /// Why there are not more.
    stopped: Option<Refusal>,
    /// Whether the feature was absent in the last one.
    is_absent: bool,
    /// The last amplitude [m] or [rad].
    amplitude: f64,
}

/// Moves further and further along a component, as far as the task stays in its mode, and as far as the limits of a force
/// leave room.
fn runs(experiment: &Experiment<'_>, component: usize, shell: &Shell) -> Result<Runs, Stop> {
    let mut found = Runs { runs: Vec::new(), limited: Vec::new(), stopped: None, is_absent: false, amplitude: 0.0 };
    let unit = if component < 3 { "m" } else { "rad" };
    let mut room: Option<Room> = None;
    for wanted in AMPLITUDES[component / 3] {
        let tight = room.as_ref().filter(|room| room.amplitude < wanted);
        let amplitude = tight.map_or(wanted, |room| down_to_two_digits(room.amplitude));
        if let Some(room) = tight.filter(|_| amplitude < NOTICEABLY * found.amplitude) {
            let why = format!(
                "a test signal of more than {} {unit} would come near the limit {}; raise it, or lower the setpoint",
                found.amplitude, room.limit
            );
            found.stopped = Some(Refusal { why, kind: Unknown::Hidden });
            break;
        }
        found.amplitude = amplitude;
        shell.say_beside(&format!("`{}`: a test signal of {amplitude} {unit}", experiment.feature.name));
        let (why, kind) = match experiment.run(component, amplitude)? {
            Answered::Lines { lines, limited, room: left } => {
                found.runs.push(lines);
                found.limited.push(limited);
                room = left;
                continue;
            }
            Answered::Nothing { why, is_absent } => {
                found.is_absent = is_absent;
                // Two smaller motions have not lost the place or the angle: this one is too large, and not the gain.
                let is_far = is_absent && component != PRESSES && found.runs.len() >= 2;
                let kind = if is_far { Unknown::Hidden } else { Unknown::Lost };
                (format!("with a test signal of {amplitude} {unit}, {why}"), kind)
            }
            Answered::NotReached(why) if found.runs.is_empty() => (why, Unknown::NotReached),
            Answered::NotReached(why) => (why, Unknown::Lost),
            Answered::Interrupted => return Err(Stop::Interrupted),
        };
        found.stopped = Some(Refusal { why, kind });
        break;
    }
    Ok(found)
}

/// Returns the response to the largest motions that agree, or to one of the last two if they differ a little: then with
/// the last one as a multiple of the one before. The number is that of the last motion that counts.
fn largest(runs: &[Vec<Line>]) -> Option<(Vec<Line>, Option<f64>, usize)> {
    let agree = (1..runs.len()).rev().find(|i| difference(&runs[i - 1], &runs[*i]) < AGREES);
    let is_loudest = |i: usize| !runs[i + 1..].iter().any(|later| loudness(&runs[i], later) > 1.0 + AGREES);
    if let Some(i) = agree.filter(|i| is_loudest(*i)) {
        return Some((Line::mean(&runs[..=i]), None, i));
    }
    let [.., before, last] = runs else { return None };
    let growth = loudness(before, last);
    let is_near = growth <= 1.0 + MAX_CHANGE && difference(before, last) <= MAX_CHANGE;
    let lines = if growth > 1.0 { last } else { before };
    is_near.then(|| (lines.clone(), Some(growth), runs.len() - 1))
}

/// Returns the median difference of two responses, over the frequencies where the second motion was larger: 0 if none was,
/// because the speed bounds both. Two responses that share too few frequencies are no evidence, and differ.
fn difference(one: &[Line], other: &[Line]) -> f64 {
    if shared(one, other) < ENOUGH {
        return f64::INFINITY;
    }
    let far = |a: &Line, b: &Line| (a.open - b.open).norm() / a.open.norm().max(b.open.norm());
    further(one, other, far).unwrap_or(0.0)
}

/// Returns the number of frequencies that stand out of the noise in two responses.
fn shared(one: &[Line], other: &[Line]) -> usize {
    one.iter().zip(other).filter(|(a, b)| a.counts() && b.counts()).count()
}

/// Returns the second response as a multiple of the first one, over the same frequencies.
fn loudness(one: &[Line], other: &[Line]) -> f64 {
    further(one, other, |a, b| b.open.norm() / a.open.norm()).unwrap_or(1.0)
}

/// Returns the median of a number of two responses, over the frequencies where the second motion was larger.
fn further(one: &[Line], other: &[Line], of: impl Fn(&Line, &Line) -> f64) -> Option<f64> {
    let larger =
        one.iter().zip(other).filter(|(a, b)| b.amplitude >= FURTHER * a.amplitude && a.counts() && b.counts());
    let mut found: Vec<f64> = larger.map(|(a, b)| of(a, b)).collect();
    found.sort_by(f64::total_cmp);
    found.get(found.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;

    /// Responses at all frequencies to motions of these amplitudes, each of this size.
    fn runs<const N: usize>(sizes: [(f64, f64); N]) -> Vec<Vec<Line>> {
        let line = |(amplitude, size): (f64, f64), i: usize| Line {
            omega: 1.0 + i as f64,
            open: Complex::new(0.0, -size),
            amplitude,
            error: 0.05,
        };
        sizes.into_iter().map(|run| (0..2 * ENOUGH).map(|i| line(run, i)).collect()).collect()
    }

    /// Returns the response that counts, the growth, and the last motion that counts.
    fn counts<const N: usize>(sizes: [(f64, f64); N]) -> Option<(f64, Option<f64>, usize)> {
        largest(&runs(sizes)).map(|(lines, growth, last)| (-lines[0].open.im, growth, last))
    }

    #[test]
    fn the_largest_motions_that_agree_count_unless_friction_has_held_them() {
        let (response, growth, last) = counts([(0.3, 0.5), (1.2, 1.0), (2.4, 1.1), (4.8, 0.6)]).unwrap();
        assert!((response - 1.1).abs() < 1e-9 && growth.is_none() && last == 2, "{response}");
        assert_eq!(counts([(0.3, 0.5), (1.2, 0.5), (2.4, 1.0)]), None, "the larger one moves it");
    }

    #[test]
    fn of_two_that_differ_a_little_the_larger_response_counts() {
        let (response, growth, last) = counts([(0.3, 0.2), (1.2, 1.0), (2.4, 1.4)]).unwrap();
        assert!((response - 1.4).abs() < 1e-9 && (growth.unwrap() - 1.4).abs() < 1e-9 && last == 2);
        let (response, growth, _) = counts([(0.3, 1.0), (1.2, 0.7)]).unwrap();
        assert!((response - 1.0).abs() < 1e-9 && (growth.unwrap() - 0.7).abs() < 1e-9);
        assert_eq!(counts([(0.3, 1.0), (1.2, 1.7)]), None);
        assert_eq!(counts([(0.3, 1.0)]), None, "one alone says nothing");
    }
}
