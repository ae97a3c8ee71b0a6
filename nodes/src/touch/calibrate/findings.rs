//! What a self-test has found, and how it is said.

use super::repair::{BadTactel, Flaw};
use super::rest::{Rest, RestTest, Verdict};

/// Largest number of tactels that a message lists.
const MAX_LISTED: usize = 8;

/// Describes what a test has found. Readings are in `unit`.
pub(super) fn describe(test: &RestTest, unit: &str, rest: &Rest) -> String {
    let &RestTest { frames, bound, max_bad, .. } = test;
    let bound = bound.unwrap_or(f64::INFINITY);
    let bad = || list(test, unit, rest);
    let off = |(tactel, shift): (usize, f64)| format!("{} by {shift:.4} {unit}", place(tactel, test));
    match rest.verdict {
        Verdict::Testing => format!("self-test: {} of {frames} frames so far", rest.frames),
        Verdict::Passed => {
            let (noise, shift, count) = (rest.noise, rest.shift, rest.bad_count);
            let bad = if count == 0 { "no bad tactel".to_owned() } else { format!("{count} bad: {}", bad()) };
            format!("self-test: noise {noise:.4} {unit}, zeros off by at most {shift:.4} {unit}, {bad}")
        }
        Verdict::Stuck => {
            "the pad repeats its image bit for bit in new frames, although it had noise in the self-test: \
             it is stuck; start the sensor again"
                .to_owned()
        }
        Verdict::Sunk => format!(
            "more than a quarter of the readings have sunk below their zeros, by more than {bound} {unit}, so forces read \
             too small; lift the pad off, and start again for new zeros"
        ),
        Verdict::TooManyBad => {
            let count = rest.bad_count;
            format!(
                "{}, but at most {max_bad} may be: {}; free the pad if something touches it, or repair it",
                are(count, "bad"),
                bad()
            )
        }
        Verdict::Adjacent(pair) => {
            let [a, b] = pair.map(|tactel| place(tactel, test));
            format!("the bad tactels {a} and {b} are side by side, so a contact there is not felt; repair the pad")
        }
        Verdict::Unfit { count, worst } => format!(
            "the calibration does not fit the pad: at rest, {} than {bound} {unit} off the zero, the farthest is \
             {}; name the calibration of this pad, or calibrate it again",
            are(count, "more"),
            off(worst)
        ),
        Verdict::Touched { count, worst } => format!(
            "something touches the pad: before any motion, {} than {bound} {unit} above the zero, the \
             farthest is {}; free the pad and start again, or calibrate it again if nothing touches it",
            are(count, "more"),
            off(worst)
        ),
    }
}

/// Says that so many tactels are something.
fn are(count: usize, what: &str) -> String {
    if count == 1 { format!("1 tactel is {what}") } else { format!("{count} tactels are {what}") }
}

/// Lists the bad tactels.
fn list(test: &RestTest, unit: &str, rest: &Rest) -> String {
    let one = |bad: &BadTactel| {
        let place = place(bad.at, test);
        match bad.flaw {
            Flaw::Dead => format!("{place} is dead"),
            Flaw::Stuck(reading) => format!("{place} is stuck at {reading} {unit}"),
            Flaw::Noisy(noise) => format!("{place} has a noise of {noise:.4} {unit}"),
            Flaw::Drifting(drift) => format!("{place} drifts by {drift:.4} {unit} in {} frames", test.frames / 2),
        }
    };
    let mut text = rest.bad.iter().take(MAX_LISTED).map(one).collect::<Vec<_>>().join(", ");
    let more = rest.bad_count - rest.bad.len().min(MAX_LISTED);
    if more > 0 {
        text += &format!(", and {more} more");
    }
    text
}

/// Returns the row and the column of a tactel, from 0.
fn place(tactel: usize, test: &RestTest) -> String {
    format!("[{}, {}]", tactel / test.cols, tactel % test.cols)
}
