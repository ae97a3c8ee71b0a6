//! The self-test: what the tactels of a pad read at rest, before anything moves.
//!
//! The frames are two halves. In each half, the lowest and the highest reading of each tactel are left out, so one frame
//! of garbage has no effect. For the means m1, m2 and the variances v1, v2 of the readings that are left, the zero is
//! (m1 + m2) / 2, the noise sqrt((v1 + v2) / 2) and the drift m2 - m1. The sums are over the difference from the
//! calibrated zero, in f64. A test that fails is repeated once, on new frames: a disturbance alone is no fault.

use tactflow_runtime::node::{Mistake, State};
use tactflow_runtime::signal::ImageShape;

use super::repair::{BadTactel, Flaw};
use crate::touch::common::halves::{Halves, upper_median};

/// Smallest number of frames of a self-test: each half keeps two readings of each tactel.
const MIN_FRAMES: usize = 8;
/// A tactel whose reading has changed at most that often measures nothing: one frame of garbage changes a reading twice.
const MAX_CHANGES_OF_A_CONSTANT: u32 = 2;
/// A tactel with that many times the noise of the pad is noisy.
const NOISY: f64 = 8.0;

/// The result of a self-test.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) enum Verdict {
    /// It has none yet.
    #[default]
    Testing,
    /// The pad can be used: it works, or it is not tested.
    Passed,
    /// More tactels are bad than may be.
    TooManyBad,
    /// One bad tactel is at a side of another.
    Adjacent([usize; 2]),
    /// The calibration is not that of the pad: so many tactels are beyond the bound, and one is the farthest.
    Unfit { count: usize, worst: (usize, f64) },
    /// The pad has passed, and later repeats its image.
    Stuck,
    /// The pad has passed, and later many readings are below their zeros by more than the bound.
    Sunk,
    /// Something touches the pad: so many tactels are above the bound, and one is the farthest.
    Touched { count: usize, worst: (usize, f64) },
}

/// When a pad passes its self-test.
pub(super) struct RestTest {
    /// Number of frames.
    pub(super) frames: usize,
    /// Largest difference of a zero from the calibrated one; `None` if the zeros are not compared.
    pub(super) bound: Option<f64>,
    /// Largest number of bad tactels.
    pub(super) max_bad: usize,
    rows: usize,
    pub(super) cols: usize,
}

/// What a self-test remembers.
#[derive(Debug, State)]
pub(super) struct Rest {
    pub(super) verdict: Verdict,
    /// The zero of each tactel: the calibrated one until the test has passed.
    pub(super) zeros: Vec<f32>,
    /// The bad tactels that were found; one more than allowed at most.
    pub(super) bad: Vec<BadTactel>,
    /// Number of bad tactels.
    pub(super) bad_count: usize,
    /// Median noise of a tactel [unit of the input].
    pub(super) noise: f64,
    /// Largest difference between a zero and the calibrated one [unit of the input].
    pub(super) shift: f64,
    /// Whether sound tactels change in most frames.
    pub(super) has_noise: bool,
    /// Number of frames so far.
    pub(super) frames: usize,
    /// Whether these are the frames of the second test, after a first one that failed.
    is_second: bool,
    tactels: Vec<Tactel>,
    /// The noise of the live tactels, for their median.
    sorted: Vec<f64>,
}

/// What a tactel has read.
#[derive(Debug, Clone, Copy, Default)]
struct Tactel {
    halves: [Tally; 2],
    last: f32,
    /// How often its reading was another one than in the frame before.
    changes: u32,
}

/// Readings of a tactel, as differences from its calibrated zero.
#[derive(Debug, Clone, Copy)]
struct Tally {
    sum: f64,
    squares: f64,
    lowest: f64,
    highest: f64,
}

impl Default for Tally {
    fn default() -> Self {
        Self { sum: 0.0, squares: 0.0, lowest: f64::INFINITY, highest: f64::NEG_INFINITY }
    }
}

impl Tally {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.squares += value * value;
        self.lowest = self.lowest.min(value);
        self.highest = self.highest.max(value);
    }

    /// Returns the mean and the variance of `count` values without the lowest and the highest one.
    fn trimmed(&self, count: usize) -> [f64; 2] {
        let left = (count - 2) as f64;
        let mean = (self.sum - self.lowest - self.highest) / left;
        let squares = self.squares - self.lowest * self.lowest - self.highest * self.highest;
        [mean, (squares / left - mean * mean).max(0.0)]
    }
}

/// What the readings of a tactel at rest amount to.
#[derive(Debug, Clone, Copy)]
struct Reading {
    /// Difference between its zero and the calibrated one.
    shift: f64,
    /// Standard deviation within a half.
    noise: f64,
    /// Difference between the means of the halves.
    drift: f64,
}

impl Rest {
    /// Returns the state without a test.
    pub(super) fn passed(zeros: &[f32]) -> Self {
        Self { verdict: Verdict::Passed, zeros: zeros.to_vec(), ..Self::default() }
    }
}

impl RestTest {
    /// Returns the test of an image of this shape, or `None` if there are no frames for it.
    pub(super) fn new(
        frames: usize,
        bound: Option<f64>,
        max_bad: Option<usize>,
        image: &ImageShape,
    ) -> Result<Option<Self>, Mistake> {
        if (1..MIN_FRAMES).contains(&frames) {
            let message = format!("a self-test needs at least {MIN_FRAMES} frames, found {frames}");
            let help = "write `rest_frames = 40`, or 0 for no self-test";
            return Err(Mistake::param("rest_frames", message).help(help));
        }
        let &ImageShape { rows, cols, .. } = image;
        // One tactel in fifty; all of them at most, as room is made for so many.
        let max_bad = max_bad.unwrap_or((rows * cols).div_ceil(50)).min(rows * cols);
        Ok((frames > 0).then_some(Self { frames, bound, max_bad, rows, cols }))
    }

    /// Returns the first state of a test, with the calibrated zeros.
    pub(super) fn begin(&self, zeros: &[f32]) -> Rest {
        Rest {
            zeros: zeros.to_vec(),
            bad: Vec::with_capacity(self.max_bad + 1),
            tactels: vec![Tactel::default(); zeros.len()],
            sorted: Vec::with_capacity(zeros.len()),
            ..Rest::default()
        }
    }

    /// Begins a new test in place, with the calibrated zeros.
    pub(super) fn restart(&self, zeros: &[f32], rest: &mut Rest) {
        rest.verdict = Verdict::Testing;
        rest.zeros.copy_from_slice(zeros);
        rest.bad.clear();
        (rest.bad_count, rest.noise, rest.shift) = (0, 0.0, 0.0);
        (rest.has_noise, rest.is_second, rest.frames) = (false, false, 0);
        rest.tactels.fill(Tactel::default());
    }

    /// Adds a frame at rest. `is_dead` are the tactels that the calibration excludes. Returns whether this was the last
    /// one, so that there is a verdict.
    pub(super) fn add(&self, cells: &[f32], is_dead: impl Fn(usize) -> bool, rest: &mut Rest) -> bool {
        let half = Halves::of(self.frames).half(rest.frames);
        for ((tactel, cell), zero) in rest.tactels.iter_mut().zip(cells).zip(&rest.zeros) {
            tactel.halves[half].add(f64::from(*cell) - f64::from(*zero));
            tactel.changes += u32::from(rest.frames > 0 && *cell != tactel.last);
            tactel.last = *cell;
        }
        rest.frames += 1;
        if rest.frames < self.frames {
            return false;
        }
        rest.verdict = self.judge(is_dead, rest);
        if rest.verdict == Verdict::Passed {
            self.tare(rest);
        } else if !rest.is_second {
            (rest.verdict, rest.is_second, rest.frames) = (Verdict::Testing, true, 0);
            rest.tactels.fill(Tactel::default());
        }
        rest.verdict != Verdict::Testing
    }

    /// Returns what the readings of tactel `i` amount to.
    fn reading(&self, i: usize, rest: &Rest) -> Reading {
        let Halves([first, second]) = Halves::of(self.frames);
        let [early, late] = &rest.tactels[i].halves;
        let ([m1, v1], [m2, v2]) = (early.trimmed(first), late.trimmed(second));
        Reading { shift: 0.5 * (m1 + m2), noise: (0.5 * (v1 + v2)).sqrt(), drift: m2 - m1 }
    }

    /// Returns the verdict on the frames, and notes what it rests on.
    fn judge(&self, is_dead: impl Fn(usize) -> bool, rest: &mut Rest) -> Verdict {
        let live = || (0..rest.tactels.len()).filter(|i| !is_dead(*i));
        let mut sorted = std::mem::take(&mut rest.sorted);
        sorted.clear();
        sorted.extend(live().map(|i| self.reading(i, rest).noise));
        let noise = upper_median(&mut sorted);
        sorted.clear();
        sorted.extend(live().map(|i| f64::from(rest.tactels[i].changes)));
        // In a pad that mostly repeats its readings, a tactel that repeats them may be sound.
        let is_telling = 2.0 * upper_median(&mut sorted) >= self.frames as f64;
        (rest.sorted, rest.has_noise) = (sorted, is_telling);
        (rest.noise, rest.shift, rest.bad_count) = (noise, 0.0, 0);
        rest.bad.clear();
        let (mut above, mut below, mut live_count, mut worst) = (0, 0, 0, (0, 0.0_f64));
        for i in (0..rest.tactels.len()).filter(|i| !is_dead(*i)) {
            live_count += 1;
            let Reading { shift, .. } = self.reading(i, rest);
            let flaw = if is_telling { self.flaw(i, rest) } else { None };
            // A constant reading says nothing about the calibration or a contact. One that changes does, even if it
            // drifts: a contact at rest drifts too.
            let is_off = self.bound.is_some_and(|bound| shift.abs() > bound);
            if is_off && !flaw.is_some_and(Flaw::is_constant) {
                (above, below) = (above + usize::from(shift > 0.0), below + usize::from(shift < 0.0));
                worst = if shift.abs() > worst.1.abs() { (i, shift) } else { worst };
            } else if let Some(flaw) = flaw {
                rest.bad_count += 1;
                if rest.bad.len() <= self.max_bad {
                    rest.bad.push(BadTactel { at: i, flaw, sides: self.sides(i, &is_dead) });
                }
            } else {
                rest.shift = rest.shift.max(shift.abs());
            }
        }
        match (above + below, self.adjacent(&rest.bad)) {
            // Nothing that presses on a pad lowers a reading, and a contact does not cover most of it.
            (count @ 1.., _) if below > 0 || 2 * above > live_count => Verdict::Unfit { count, worst },
            (count @ 1.., _) => Verdict::Touched { count, worst },
            _ if rest.bad_count > self.max_bad => Verdict::TooManyBad,
            (_, Some(pair)) => Verdict::Adjacent(pair),
            _ => Verdict::Passed,
        }
    }

    /// Returns what is wrong with a tactel, in a pad whose sound tactels have noise.
    fn flaw(&self, i: usize, rest: &Rest) -> Option<Flaw> {
        let (tactel, reading) = (&rest.tactels[i], self.reading(i, rest));
        let largest_drift = Halves::of(self.frames).largest_drift(rest.noise * rest.noise);
        if tactel.changes <= MAX_CHANGES_OF_A_CONSTANT {
            return Some(if tactel.last == 0.0 { Flaw::Dead } else { Flaw::Stuck(tactel.last) });
        }
        if reading.noise > NOISY * rest.noise {
            return Some(Flaw::Noisy(reading.noise));
        }
        (reading.drift.abs() > largest_drift).then_some(Flaw::Drifting(reading.drift))
    }

    /// Sets the zeros: those of sound tactels if the zeros are compared, and those of bad ones in any case, so that a bad
    /// tactel reads no force.
    fn tare(&self, rest: &mut Rest) {
        for i in 0..rest.tactels.len() {
            let is_bad = rest.bad.iter().any(|bad| bad.at == i);
            if is_bad || self.bound.is_some() {
                let shift = self.reading(i, rest).shift;
                rest.zeros[i] = (f64::from(rest.zeros[i]) + shift) as f32;
            }
        }
    }

    /// Returns the live tactels at the four sides of tactel `i`.
    fn sides(&self, i: usize, is_dead: impl Fn(usize) -> bool) -> [Option<u32>; 4] {
        let Self { rows, cols, .. } = *self;
        let (row, col) = (i / cols, i % cols);
        let sides = [
            (row > 0).then(|| i - cols),
            (row + 1 < rows).then(|| i + cols),
            (col > 0).then(|| i - 1),
            (col + 1 < cols).then(|| i + 1),
        ];
        sides.map(|side| side.filter(|side| !is_dead(*side)).map(|side| side as u32))
    }

    /// Returns two bad tactels of which one is at a side of the other.
    fn adjacent(&self, bad: &[BadTactel]) -> Option<[usize; 2]> {
        let is_side = |a: &BadTactel, b: &BadTactel| a.sides.contains(&Some(b.at as u32));
        bad.iter().find_map(|a| bad.iter().find(|b| is_side(a, b)).map(|b| [a.at, b.at]))
    }
}

#[cfg(test)]
mod tests;
