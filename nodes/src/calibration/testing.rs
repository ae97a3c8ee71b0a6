//! A pad with known curves and its logs: saturating, spread, hysteretic, noisy, of 12 bits, with dead tactels.

use tactflow_runtime::signal::Unit;

use super::ForceCurve;
use super::log::Log;
use tactflow_runtime::random::Random;

/// Maximum force on a tactel [N].
pub(super) const MAX_FORCE_N: f64 = 5.0;

/// Maximum reading of 12 bits.
const MAX_COUNTS: f64 = 4095.0;

/// The true characteristic of one tactel: offset + a f / (f + b).
#[derive(Debug, Clone, Copy)]
pub(super) struct Characteristic {
    pub(super) offset: f64,
    pub(super) a: f64,
    pub(super) b: f64,
    pub(super) is_dead: bool,
}

impl Characteristic {
    /// Returns the reading in the middle of the branches, without noise and quantisation.
    pub(super) fn middle(&self, force: f64) -> f64 {
        let force = force.max(0.0);
        self.offset + if self.is_dead { 0.0 } else { self.a * force / (force + self.b) }
    }

    /// Returns the reading on one of the branches.
    fn branch(&self, force: f64, is_loading: bool, hysteresis: f64) -> f64 {
        let x = (force / MAX_FORCE_N).clamp(0.0, 1.0);
        let range = self.middle(MAX_FORCE_N) - self.offset;
        let side = if is_loading { -0.5 } else { 0.5 };
        self.middle(force) + side * hysteresis * range * 4.0 * x * (1.0 - x)
    }

    /// Returns the exact force of a reading, up to the maximum: the best possible calibration.
    pub(super) fn force(&self, reading: f64) -> f64 {
        let s = (reading - self.offset).clamp(0.0, self.middle(MAX_FORCE_N) - self.offset);
        self.b * s / (self.a - s)
    }
}

/// Returns the force at the end of a curve [N].
pub(super) fn max_force(curve: &ForceCurve) -> f32 {
    match curve {
        ForceCurve::Linear { .. } => panic!("a line has no end"),
        ForceCurve::Rational { most, .. } => *most,
        ForceCurve::Piecewise { knots } => knots.last().expect("a curve has a knot")[1],
    }
}

/// A pad.
pub(super) struct Pad {
    pub(super) rows: usize,
    pub(super) cols: usize,
    pub(super) truths: Vec<Characteristic>,
    pub(super) random: Random,
    /// Standard deviation of the noise [counts].
    pub(super) noise: f64,
    /// Maximum distance of the two branches, as a fraction of the range.
    pub(super) hysteresis: f64,
    /// Whether readings fall from the maximum instead of rising from zero.
    pub(super) is_falling: bool,
}

impl Pad {
    /// Makes a pad with gains spread by a quarter, offsets of 5 to 10 % of the range, and dead tactels.
    pub(super) fn new(rows: usize, cols: usize, dead: &[usize], seed: u64) -> Self {
        let mut random = Random::new(seed, 0);
        let truth = |i: usize| {
            // A larger gain would exceed 12 bits, which has its own test.
            let a = (3400.0 * libm::exp(0.25 * random.normal())).min(5400.0);
            let b = 3.0 * libm::exp(0.15 * random.normal());
            let offset = MAX_COUNTS * (0.05 + 0.05 * random.uniform(0.0, 1.0));
            Characteristic { offset, a, b, is_dead: dead.contains(&i) }
        };
        let truths = (0..rows * cols).map(truth).collect();
        Self { rows, cols, truths, random, noise: 4.0, hysteresis: 0.1, is_falling: false }
    }

    /// Adds a frame with a force on each tactel.
    fn frame(&mut self, log: &mut Log, reference: f64, is_loading: bool, force: impl Fn(usize) -> f64) {
        // The strain gauge of the paper's bench is good to 2.5 mN.
        log.force.push(reference + 0.00125 * self.random.normal());
        for i in 0..self.truths.len() {
            let reading = self.truths[i].branch(force(i), is_loading, self.hysteresis);
            let counts = (reading + self.noise * self.random.normal()).round().clamp(0.0, MAX_COUNTS);
            log.cells.push((if self.is_falling { MAX_COUNTS - counts } else { counts }) as f32);
        }
    }

    fn log(&self) -> Log {
        let (force, cells, absent) = (vec![], vec![], vec![]);
        Log { rows: self.rows, cols: self.cols, unit: Unit::RAW, force, cells, absent }
    }

    /// A bladder that presses on all live tactels alike, `cycles` times, with `half` frames up and as many down.
    pub(super) fn uniform(&mut self, cycles: usize, half: usize) -> Log {
        let live = self.truths.iter().filter(|truth| !truth.is_dead).count() as f64;
        let mut log = self.log();
        (0..50).for_each(|_| self.frame(&mut log, 0.0, true, |_| 0.0));
        for _ in 0..cycles {
            for (force, is_loading) in cycle(half) {
                self.frame(&mut log, force * live, is_loading, |_| force);
            }
            (0..20).for_each(|_| self.frame(&mut log, 0.0, true, |_| 0.0));
        }
        log
    }

    /// Returns the log of a probe that presses one tactel after the other; neighbours get the fraction `coupling`.
    pub(super) fn probe(&mut self, cycles: usize, half: usize, coupling: f64) -> Log {
        let (cols, mut log) = (self.cols, self.log());
        for pressed in 0..self.truths.len() {
            (0..10).for_each(|_| self.frame(&mut log, 0.0, true, |_| 0.0));
            for (force, is_loading) in (0..cycles).flat_map(|_| cycle(half)) {
                let on = move |i: usize| {
                    let far = (i / cols).abs_diff(pressed / cols) + (i % cols).abs_diff(pressed % cols);
                    force * [1.0, coupling].get(far).copied().unwrap_or(0.0)
                };
                self.frame(&mut log, force, is_loading, on);
            }
        }
        log
    }
}

/// Returns the forces of a press, up and down.
fn cycle(half: usize) -> impl Iterator<Item = (f64, bool)> {
    let up = (1..=half).map(move |k| (MAX_FORCE_N * k as f64 / half as f64, true));
    let down = (0..half).rev().map(move |k| (MAX_FORCE_N * k as f64 / half as f64, false));
    up.chain(down)
}
