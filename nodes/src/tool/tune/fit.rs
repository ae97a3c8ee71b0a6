//! A gain, a resonance and a latency that explain a measured response.

use nalgebra::Complex;
use serde::Serialize;

use super::spectrum::Line;
use crate::tool::control::digits::to_three_digits;
use crate::tool::control::response::resonance;
use crate::tool::control::shape::turn;

/// How a feature answers one component of the motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Fit {
    /// Change of the feature for each metre or radian.
    pub(super) gain: f64,
    /// Resonance [Hz] and damping ratio; `None` where the answer has none up to the highest frequency.
    pub(super) resonance: Option<(f64, f64)>,
    /// Latency [s].
    pub(super) latency: f64,
    /// Root mean square of what the fit does not explain, relative to the response [1].
    pub(super) residual: f64,
    /// Number of frequencies that are explained.
    pub(super) frequencies: usize,
}

/// Largest error of a frequency that counts as it was measured, and not as the fit has it [1].
const CLEAR: f64 = 0.1;

impl Fit {
    /// Returns what was measured at the frequencies that noise hardly changes: frequency [Hz], answer as a multiple of that
    /// to a slow motion [1], and its phase [deg]. Empty if fewer than `ENOUGH` of them follow each
    /// other. `known` is what the fit was given.
    pub(super) fn response(&self, lines: &[Line], known: impl Fn(f64) -> Complex<f64>) -> Vec<[f64; 3]> {
        let clear: Vec<&Line> = lines.iter().filter(|line| line.error <= CLEAR).collect();
        let gap = clear.windows(2).position(|pair| pair[1].omega > MAX_GAP * pair[0].omega);
        let clear = &clear[..gap.map_or(clear.len(), |i| i + 1)];
        if clear.len() < ENOUGH {
            return Vec::new();
        }
        let answer = |line: &&Line| {
            let answer = line.open / known(line.omega) / self.gain;
            let hz = line.omega / (2.0 * std::f64::consts::PI);
            [to_three_digits(hz), to_three_digits(answer.norm()), answer.arg().to_degrees().round()]
        };
        clear.iter().map(answer).collect()
    }
}

/// Largest ratio of two frequencies of a response that follow each other [1].
const MAX_GAP: f64 = 4.0;
/// Smallest number of frequencies that tell a resonance from a delay.
pub(super) const ENOUGH: usize = 5;

/// Smallest resonance that is tried [rad/s].
const MIN_RESONANCE: f64 = 2.0;
/// Smallest damping ratio of an arm in contact: a sharper peak between two frequencies is a mistake of the fit [1].
const MIN_DAMPING: f64 = 0.05;

/// Part of a response that a model of one resonance leaves in any case [1].
const MODEL_ERROR: f64 = 0.1;
/// Gain around the loop, as a fraction of the largest one, below which a frequency hardly matters to the margins [1].
const FAINT: f64 = 0.1;

/// The answer at one frequency: circular frequency [rad/s], response and weight.
type Point = (f64, Complex<f64>, f64);

/// Fits the answers at all frequencies that count. `known` is the response of controller, filters and travel, with the
/// column. Returns the number of these frequencies if they are too few.
///
/// A frequency weighs more the less noise it has, the more gain the loop has there, and the further the sensor has moved:
/// friction holds back a small motion.
pub(super) fn fit(lines: &[Line], known: impl Fn(f64) -> Complex<f64>) -> Result<Fit, usize> {
    let good: Vec<&Line> = lines.iter().filter(|line| line.counts()).collect();
    if good.len() < ENOUGH {
        return Err(good.len());
    }
    let most = |of: fn(&Line) -> f64| good.iter().map(|line| of(line)).fold(0.0, f64::max);
    let (loudest, furthest) = (most(|line| line.open.norm()), most(|line| line.amplitude));
    let certain = |line: &&Line| {
        let weight = 1.0 / (line.error * line.error + MODEL_ERROR * MODEL_ERROR);
        (line.omega, line.open / known(line.omega), weight)
    };
    let equal: Vec<Point> = good.iter().map(certain).collect();
    let heard = |line: &Line| {
        let norm = line.open.norm();
        (norm / (norm + FAINT * loudest)).powi(2) * line.amplitude / furthest
    };
    let points: Vec<Point> =
        equal.iter().zip(&good).map(|(point, line)| (point.0, point.1, point.2 * heard(line))).collect();
    let ((mut chosen, mut has_resonance), (faint, is_faint)) = (choose(&points), choose(&equal));
    if is_faint && !has_resonance {
        // A resonance that matters little to the loop still says what mass moves.
        let [own, damping, _] = faint.at;
        let kept = search(&points, [Span::log(own, own, 1), Span::log(damping, damping, 1), LATENCIES]);
        if kept.error < SAME * chosen.error {
            (chosen, has_resonance) = (kept, true);
        }
    }
    let [own, damping, latency] = chosen.at;
    Ok(Fit {
        gain: chosen.gain,
        resonance: has_resonance.then_some((own / (2.0 * std::f64::consts::PI), damping)),
        latency,
        residual: chosen.error,
        frequencies: points.len(),
    })
}

/// Latencies that are tried [s].
const LATENCIES: Span = Span::new(0.0, 0.12, 121);
/// Ratio of the errors of two fits that explain the same [1].
const SAME: f64 = 1.1;

/// Returns the best fit, and whether it has a resonance: one that hardly explains more, or that lies above all
/// frequencies, is none.
fn choose(points: &[Point]) -> (Best, bool) {
    let top = points.last().map_or(1.0, |point| point.0);
    let mut best = search(
        points,
        [Span::log(MIN_RESONANCE, 2.0 * top, 24), Span::log(MIN_DAMPING, 1.5, 10), Span::new(0.0, 0.08, 9)],
    );
    for _ in 0..8 {
        let mut near = best.spans.map(|span| span.closer(9));
        near[1].low = near[1].low.max(MIN_DAMPING);
        best = search(points, near);
    }
    let plain = search(points, [Span::log(1e4, 1e4, 1), Span::log(1.0, 1.0, 1), LATENCIES]);
    let has_resonance = best.error < 0.8 * plain.error && best.at[0] < 1.5 * top;
    (if has_resonance { best } else { plain }, has_resonance)
}

/// The values of a parameter that are tried.
#[derive(Debug, Clone, Copy)]
struct Span {
    low: f64,
    high: f64,
    steps: usize,
    is_log: bool,
    /// The best of them.
    at: f64,
}

impl Span {
    const fn new(low: f64, high: f64, steps: usize) -> Self {
        Self { low, high, steps, is_log: false, at: low }
    }

    const fn log(low: f64, high: f64, steps: usize) -> Self {
        Self { low, high, steps, is_log: true, at: low }
    }

    fn values(self) -> impl Iterator<Item = f64> {
        let share = move |i: usize| if self.steps > 1 { i as f64 / (self.steps - 1) as f64 } else { 0.0 };
        (0..self.steps).map(move |i| match self.is_log {
            true => self.low * libm::pow(self.high / self.low, share(i)),
            false => self.low + (self.high - self.low) * share(i),
        })
    }

    /// Returns a third of the span around its best value.
    fn closer(self, steps: usize) -> Self {
        match self.is_log {
            true => {
                let reach = libm::pow(self.high / self.low, 1.0 / 6.0);
                Self { low: self.at / reach, high: self.at * reach, steps, ..self }
            }
            false => {
                let reach = (self.high - self.low) / 6.0;
                Self { low: (self.at - reach).max(0.0), high: self.at + reach, steps, ..self }
            }
        }
    }
}

struct Best {
    spans: [Span; 3],
    at: [f64; 3],
    gain: f64,
    error: f64,
}

/// Tries all combinations of resonance, damping and latency. The gain of each is in closed form.
fn search(points: &[Point], spans: [Span; 3]) -> Best {
    let mut best = Best { spans, at: spans.map(|span| span.low), gain: 0.0, error: f64::INFINITY };
    for own in spans[0].values() {
        for damping in spans[1].values() {
            for latency in spans[2].values() {
                let model = |omega: f64| resonance(omega, Some((own, damping))) * turn(omega * latency);
                let (gain, error) = gain(points, model);
                if error < best.error {
                    best = Best { at: [own, damping, latency], gain, error, ..best };
                }
            }
        }
    }
    best.spans.iter_mut().zip(best.at).for_each(|(span, at)| span.at = at);
    best
}

/// Returns the real gain that explains the points best, each relative to itself, and what is left.
fn gain(points: &[Point], model: impl Fn(f64) -> Complex<f64>) -> (f64, f64) {
    let (mut product, mut square, mut whole) = (0.0, 0.0, 0.0);
    let pairs: Vec<_> = points.iter().map(|(omega, response, weight)| (model(*omega) / response, weight)).collect();
    for (ratio, weight) in &pairs {
        product += *weight * ratio.re;
        square += *weight * ratio.norm_sqr();
        whole += **weight;
    }
    let gain = product / square;
    let left: f64 = pairs.iter().map(|(ratio, weight)| *weight * (ratio * gain - Complex::from(1.0)).norm_sqr()).sum();
    (gain, (left / whole).sqrt())
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::random::Random;

    use super::*;

    fn lines(gain: f64, own: Option<(f64, f64)>, latency: f64, noise: f64) -> Vec<Line> {
        let mut random = Random::new(7, 0);
        let omegas = (1..=32).map(|i| 2.0 * std::f64::consts::PI * 0.25 * f64::from(i));
        let mut line = |omega: f64| {
            let ideal = resonance(omega, own) * turn(omega * latency) * gain;
            let noisy = Complex::new(random.normal(), random.normal()) * noise * ideal.norm();
            Line { omega, open: ideal + noisy, amplitude: 1.0, error: noise }
        };
        omegas.map(&mut line).collect()
    }

    #[test]
    fn what_made_the_response_is_found_again() {
        for (gain, hz, damping, latency) in [(12.0, 5.0, 0.2, 0.008), (-3.0, 2.4, 0.35, 0.02), (0.4, 6.5, 0.6, 0.0)] {
            let circular = 2.0 * std::f64::consts::PI * hz;
            let found = fit(&lines(gain, Some((circular, damping)), latency, 0.03), |_| Complex::from(1.0)).unwrap();
            let (own, ratio) = found.resonance.unwrap();
            assert!((found.gain / gain - 1.0).abs() < 0.05, "{found:?}");
            assert!((own / hz - 1.0).abs() < 0.03 && (ratio / damping - 1.0).abs() < 0.12, "{found:?}");
            assert!((found.latency - latency).abs() < 0.003, "{found:?}");
        }
    }

    #[test]
    fn a_response_has_the_frequencies_that_noise_hardly_changes_if_they_are_enough() {
        let mut lines = lines(-2.0, None, 0.03, 0.0);
        let found = fit(&lines, |_| Complex::from(1.0)).unwrap();
        lines[3].error = 1.5 * CLEAR;
        let response = found.response(&lines, |_| Complex::from(1.0));
        assert_eq!(response.len(), lines.len() - 1);
        for [hz, multiple, phase] in &response {
            let off = (phase + 360.0 * hz * 0.03 + 180.0).rem_euclid(360.0) - 180.0;
            assert!((multiple - 1.0).abs() < 0.01 && off.abs() < 2.0, "{multiple} at {hz} Hz, {off} deg off");
        }
        lines.iter_mut().skip(ENOUGH).for_each(|line| line.error = 1.5 * CLEAR);
        assert!(found.response(&lines, |_| Complex::from(1.0)).is_empty());
    }

    #[test]
    fn a_rigid_arm_has_no_resonance() {
        let found = fit(&lines(2.0, None, 0.03, 0.02), |_| Complex::from(1.0)).unwrap();
        assert_eq!(found.resonance, None);
        assert!((found.gain - 2.0).abs() < 0.05 && (found.latency - 0.03).abs() < 0.002, "{found:?}");
    }

    #[test]
    fn noise_is_no_answer() {
        let mut lines = lines(2.0, None, 0.0, 0.0);
        lines.iter_mut().skip(ENOUGH - 1).for_each(|line| line.error = 0.5);
        assert_eq!(fit(&lines, |_| Complex::from(1.0)), Err(ENOUGH - 1));
    }
}
