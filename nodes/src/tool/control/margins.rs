//! How far a loop is from instability, and what it does to ramps and noise.

use std::f64::consts::PI;

use nalgebra::Complex;
use serde::Serialize;

use super::response::Loop;

/// The margins of a loop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Margins {
    /// Whether the closed loop settles.
    pub(crate) is_stable: bool,
    /// Largest frequency at which the gain around the loop is 1 [Hz].
    pub(crate) crossover_hz: Option<f64>,
    /// Smallest lag that would make the loop unstable, over all frequencies where its gain is 1 [deg].
    pub(crate) phase_deg: Option<f64>,
    /// Smallest factor on the gain that would make the loop unstable [dB]; negative if it is.
    pub(crate) gain_db: Option<f64>,
    /// Largest factor by which the loop amplifies a disturbance: the maximum of |1 / (1 + L)| [1].
    pub(crate) peak_sensitivity: f64,
    /// Lowest frequency at which the feature itself, before its filters, follows its setpoint by less than 71 % [Hz].
    pub(crate) bandwidth_hz: Option<f64>,
    /// Where the bandwidth lies if a feature follows by up to 15 % more or less than computed [Hz]: far apart where the
    /// feature follows by about 71 % over many frequencies.
    pub(crate) bandwidth_range_hz: Option<[f64; 2]>,
    /// Error of the feature for a steady motion of one unit in each second, by the proportional gain [s].
    pub(crate) ramp_lag_s: f64,
    /// Time constant with which the integral takes this error away [s]; `None` without one.
    pub(crate) integral_s: Option<f64>,
    /// Standard deviation of the feature for one of white noise in the measurement [1].
    pub(crate) noise: f64,
}

/// Share of a setpoint that is followed at the bandwidth [1].
const HALF_POWER: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Part of this share that a response may differ from the computed one [1].
const UNSURE: f64 = 0.15;
/// Ratio of the ends of a bandwidth from which on it is no number: that of a first-order loop is 1.9 [1].
const WIDE: f64 = 2.0;

impl Margins {
    /// Returns the error behind a ramp as text, and after how long an integral has taken 95 % of it away.
    pub(crate) fn ramp_lag(&self) -> String {
        let first = format!("{:.0} ms", 1e3 * self.ramp_lag_s);
        self.integral_s.map_or(first.clone(), |constant| format!("{first}, 0 after {:.1} s", 3.0 * constant))
    }

    /// Returns the bandwidth as text, where friction can make a step slower: the largest one.
    pub(crate) fn most_bandwidth(&self) -> String {
        match (self.bandwidth_hz, self.bandwidth_range_hz) {
            (Some(_), Some([low, high])) if high > WIDE * low => format!("up to {high:.1} Hz"),
            (Some(hz), _) => format!("up to {hz:.2} Hz"),
            (None, _) => "none".to_owned(),
        }
    }

    /// Returns the bandwidth as text: a range where it is no number.
    pub(crate) fn bandwidth(&self) -> String {
        match (self.bandwidth_hz, self.bandwidth_range_hz) {
            (Some(_), Some([low, high])) if high > WIDE * low => format!("{low:.1}-{high:.1} Hz"),
            (Some(hz), _) => format!("{hz:.2} Hz"),
            (None, _) => "none".to_owned(),
        }
    }
}

/// Number of frequencies of a sweep; two neighbours differ by a third of a percent.
const FREQUENCIES: usize = 4000;
/// Smallest frequency of a sweep, as a fraction of the largest one.
const SPAN: f64 = 1e-6;

/// Angle from the negative real axis of a response that is on it [rad].
const ON_AXIS: f64 = 1e-6;

/// Sweeps a loop up to half of the rate of the graph.
pub(crate) fn margins(around: &Loop) -> Margins {
    swept(around, FREQUENCIES)
}

/// Returns the margins from a fifth of the frequencies. A narrow resonance shows too small: by less than 3 dB with a
/// damping of 0.01 or more.
pub(crate) fn rough_margins(around: &Loop) -> Margins {
    swept(around, FREQUENCIES / 5)
}

fn swept(around: &Loop, frequencies: usize) -> Margins {
    let top = PI / around.period;
    let open: Vec<(f64, Complex<f64>)> = sweep(top, frequencies).map(|omega| (omega, around.open(omega))).collect();
    let followed: Vec<(f64, f64)> =
        open.iter().map(|(omega, at)| (*omega, (around.ahead(*omega) / (Complex::from(1.0) + at)).norm())).collect();
    let crossings = crossings(&open);
    let one = Complex::from(1.0);
    let is_stable = !around.is_reversed() && is_stable(&open, around.integrators());
    let phase = crossings.iter().map(|(_, at)| (PI - at.arg().abs()).to_degrees()).reduce(f64::min);
    Margins {
        is_stable,
        crossover_hz: crossings.last().map(|(omega, _)| omega / (2.0 * PI)),
        phase_deg: phase,
        gain_db: turns(&open)
            .map(|norm| -20.0 * libm::log10(norm))
            .filter(|db| !is_stable || *db > 0.0)
            .reduce(f64::min),
        peak_sensitivity: open.iter().map(|(_, at)| 1.0 / (one + at).norm()).fold(1.0, f64::max),
        bandwidth_hz: first_missed(&followed, HALF_POWER),
        bandwidth_range_hz: first_missed(&followed, HALF_POWER * (1.0 + UNSURE))
            .zip(first_missed(&followed, HALF_POWER * (1.0 - UNSURE)))
            .map(Into::into),
        ramp_lag_s: around.ramp_lag(),
        integral_s: around.integral_s(),
        noise: noise(&open, around.period),
    }
}

/// Returns the circular frequencies of a sweep, from low to high [rad/s].
fn sweep(top: f64, frequencies: usize) -> impl Iterator<Item = f64> {
    let step = -libm::log(SPAN) / (frequencies - 1) as f64;
    (0..frequencies).map(move |i| top * SPAN * libm::exp(step * i as f64))
}

/// Returns the frequencies at which the gain is 1, with the response there.
fn crossings(open: &[(f64, Complex<f64>)]) -> Vec<(f64, Complex<f64>)> {
    let crossed = open.windows(2).filter(|pair| (pair[0].1.norm() >= 1.0) != (pair[1].1.norm() >= 1.0));
    crossed.map(|pair| between(pair, |at| libm::log(at.norm()))).collect()
}

/// Returns the gains at which the response crosses the negative real axis, or ends on it at half of the rate.
fn turns(open: &[(f64, Complex<f64>)]) -> impl Iterator<Item = f64> {
    let crosses = |pair: &&[(f64, Complex<f64>)]| {
        (pair[0].1.im >= 0.0) != (pair[1].1.im >= 0.0) && pair[0].1.re < 0.0 && pair[1].1.re < 0.0
    };
    let last = open.last().map(|(_, at)| at).filter(|at| at.re < 0.0 && at.im.abs() < ON_AXIS * at.norm());
    open.windows(2).filter(crosses).map(|pair| between(pair, |at| at.im).1.norm()).chain(last.map(|at| at.norm()))
}

/// Returns where a function of the response is 0, between two neighbours.
fn between(pair: &[(f64, Complex<f64>)], of: impl Fn(Complex<f64>) -> f64) -> (f64, Complex<f64>) {
    let [(low, first), (high, second)] = [pair[0], pair[1]];
    let (a, b) = (of(first), of(second));
    let share = if a == b { 0.0 } else { a / (a - b) };
    (low + (high - low) * share, first + (second - first) * share)
}

/// Returns whether the closed loop is stable (Nyquist): the way around -1 is that of the poles at zero, and no more.
fn is_stable(open: &[(f64, Complex<f64>)], integrators: usize) -> bool {
    let one = Complex::from(1.0);
    let begin = -(integrators as f64) * PI / 2.0;
    let Some((_, first)) = open.first() else { return true };
    let first = one + first;
    // From the phase of the poles at zero to that of the first frequency, on the shorter way.
    let mut angle = begin + (first * Complex::new(libm::cos(begin), -libm::sin(begin))).arg();
    for pair in open.windows(2) {
        angle += ((one + pair[1].1) / (one + pair[0].1)).arg();
    }
    angle.abs() < PI - ON_AXIS
}

/// Returns the first frequency at which the feature follows less than so much of its setpoint, half of the rate if there is
/// none [Hz]; `None` if it hardly follows at all.
fn first_missed(followed: &[(f64, f64)], share: f64) -> Option<f64> {
    let first = followed.iter().position(|(_, at)| *at < share).unwrap_or(followed.len() - 1);
    (first > 0).then(|| followed[first].0 / (2.0 * PI))
}

/// Returns the standard deviation of the feature for white noise with one sample in each period [s].
fn noise(open: &[(f64, Complex<f64>)], period: f64) -> f64 {
    let power = |at: Complex<f64>| (at / (Complex::from(1.0) + at)).norm_sqr();
    let area = |pair: &[(f64, Complex<f64>)]| (power(pair[0].1) + power(pair[1].1)) / 2.0 * (pair[1].0 - pair[0].0);
    (open.windows(2).map(area).sum::<f64>() * period / PI).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::contacts::Answer;
    use super::super::filters::Filter;
    use super::super::law::Feature;
    use super::super::shape::Shape;
    use super::*;

    /// The loop k / s, with a period that hardly counts, a delay [s] and a resonance.
    fn integrator(kp: f64, ki: f64, delay: f64, resonance: Option<(f64, f64)>, period: f64) -> Margins {
        let feature = Feature {
            name: "x".into(),
            column: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            kp,
            ki,
            period_s: period,
            ..Feature::default()
        };
        let (hz, damping) = resonance.unzip();
        let answer = Answer { vx: Some(-1.0), resonance_hz: hz, damping_ratio: damping, ..Answer::default() };
        margins(&Loop::new(&feature, &answer, delay))
    }

    fn near(value: Option<f64>, wanted: f64, share: f64) {
        assert!(value.is_some_and(|value| (value / wanted - 1.0).abs() < share), "{value:?} and {wanted}");
    }

    #[test]
    fn an_integrator_with_a_delay_has_the_margins_of_its_closed_form() {
        let (gain, delay) = (4.0, 0.1);
        let found = integrator(gain, 0.0, delay, None, 1e-5);
        near(found.crossover_hz, gain / (2.0 * PI), 0.01);
        near(found.phase_deg, 90.0 - (gain * delay).to_degrees(), 0.01);
        near(found.gain_db, 20.0 * (PI / (2.0 * gain * delay)).log10(), 0.01);
        near(Some(found.ramp_lag_s), 1.0 / gain, 1e-9);
        for (gain, is_stable) in [(15.0, true), (15.5, true), (15.9, false), (40.0, false)] {
            assert_eq!(integrator(gain, 0.0, delay, None, 1e-5).is_stable, is_stable, "{gain}: the bound is pi / 0.2");
        }
    }

    #[test]
    fn a_sampled_integrator_has_the_margins_of_its_closed_form() {
        // L = k / (z - 1): the largest gain is 2, and the peak of |1 / (1 + L)| is 2 / (2 - k) at z = -1.
        for share in [0.5, 1.2, 1.9] {
            let found = integrator(share / 0.004, 0.0, 0.0, None, 0.004);
            near(found.gain_db, 20.0 * (2.0 / share).log10(), 1e-3);
            near(Some(found.peak_sensitivity), (2.0 / (2.0 - share)).max(1.0), 1e-3);
            assert!(found.is_stable, "{share}");
        }
        assert!(!integrator(2.1 / 0.004, 0.0, 0.0, None, 0.004).is_stable);
    }

    #[test]
    fn a_resonance_bounds_the_gain_as_routh_says() {
        let (hz, damping) = (5.0, 0.2);
        let most = 2.0 * damping * 2.0 * PI * hz;
        near(integrator(most / 4.0, 0.0, 0.0, Some((hz, damping)), 1e-5).gain_db, 20.0 * 4.0_f64.log10(), 0.01);
        assert!(integrator(0.97 * most, 0.0, 0.0, Some((hz, damping)), 1e-5).is_stable);
        assert!(!integrator(1.03 * most, 0.0, 0.0, Some((hz, damping)), 1e-5).is_stable);
    }

    #[test]
    fn two_integrators_are_stable_and_follow_a_ramp() {
        // kp / s + ki / s^2: damped with zeta = kp / (2 sqrt(ki)).
        let found = integrator(2.0, 1.0, 0.0, None, 1e-4);
        assert!(found.is_stable && found.ramp_lag_s == 0.5, "{found:?}");
        near(found.integral_s, 2.0, 1e-9);
        // |S| of s^2 / (s + 1)^2 never exceeds 1.
        assert!((found.peak_sensitivity - 1.0).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn noise_is_that_of_a_first_order_mean() {
        // x := x - a (x + n) has the variance a / (2 - a).
        let share: f64 = 0.02;
        let found = integrator(share / 0.004, 0.0, 0.0, None, 0.004);
        near(Some(found.noise), (share / (2.0 - share)).sqrt(), 0.02);
        near(found.bandwidth_hz, share / 0.004 / (2.0 * PI), 0.03);
    }

    #[test]
    fn a_bandwidth_is_that_of_the_feature_before_its_filters() {
        let (k, time) = (4.0, 0.2);
        let filter = |shape| Filter { node: String::new(), kind: String::new(), delay_s: 0.0, shape };
        let feature = Feature {
            name: "x".into(),
            column: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            kp: k,
            period_s: 1e-4,
            filters: vec![filter(Shape::LowPass { time })],
            ..Feature::default()
        };
        let answer = Answer { vx: Some(-1.0), ..Answer::default() };
        let found = margins(&Loop::new(&feature, &answer, 0.0));
        // k (1 + s T) / (T s^2 + s + k), and behind the filter k / (T s^2 + s + k).
        let passes = |hz: f64, before: bool| {
            let omega = 2.0 * PI * hz;
            let ahead = if before { (omega * time).hypot(1.0) } else { 1.0 };
            k * ahead / (k - time * omega * omega).hypot(omega)
        };
        let bandwidth = |before| (1..1000).map(|i| 0.005 * f64::from(i)).find(|hz| passes(*hz, before) < HALF_POWER);
        near(found.bandwidth_hz, bandwidth(true).unwrap(), 0.01);
        assert!(found.bandwidth_hz > bandwidth(false).map(|hz| 1.3 * hz), "{found:?}");
    }

    #[test]
    fn a_bandwidth_is_a_range_where_the_response_is_flat() {
        let plain = integrator(5.0, 0.0, 0.0, None, 0.004);
        let hz = 5.0 / (2.0 * PI);
        let [low, high] = plain.bandwidth_range_hz.unwrap();
        // |T| of a first-order loop is 1 / sqrt(1 + (f / hz)^2).
        let at = |share: f64| hz * ((0.5_f64.sqrt() * share).powi(-2) - 1.0).sqrt();
        assert!((low / at(1.15) - 1.0).abs() < 0.03 && (high / at(0.85) - 1.0).abs() < 0.03, "{low} {high}");
        assert!(plain.bandwidth().starts_with("0.8"), "{}", plain.bandwidth());
        // A resonance of the arm lifts the response again where the loop has lost it.
        let flat = integrator(3.5, 0.0, 0.0, Some((2.2, 0.3)), 0.004);
        assert_eq!(flat.bandwidth(), "0.5-2.3 Hz", "{flat:?}");
    }

    #[test]
    fn a_resonance_far_above_the_bandwidth_is_no_bandwidth() {
        let found = integrator(3.0, 0.0, 0.0, Some((6.0, 0.08)), 0.004);
        near(found.bandwidth_hz, 3.0 / (2.0 * PI), 0.1);
        assert!(found.bandwidth().starts_with("0.4"), "{}", found.bandwidth());
    }

    #[test]
    fn a_reversed_column_is_unstable() {
        assert!(!integrator(-2.0, 0.0, 0.0, None, 0.004).is_stable);
    }
}
