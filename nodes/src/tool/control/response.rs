//! The frequency response of a loop: from the error of a feature around to the measured feature.
//!
//! ```text
//! L(z) = K(z) · J c · T / (z - 1) · A(s) · exp(-s latency) · F(z),  z = exp(s T)
//! ```
//!
//! K is the `pid`, c the column behind all projectors, J the answer of the feature to the motion of the sensor, A the
//! resonance of arm and contact, and F the filters. A command is held for one period, and T / (z - 1) is the travel at
//! the samples, exact up to half of the rate of the graph if the arm is stiff. Where the bench states a measured response,
//! it counts instead of A and the latency. Not in it: limits, dry friction, hysteresis, and what one feature does to
//! another.

use nalgebra::Complex;

use super::contacts::{Answer, Contact};
use super::law::Feature;
use super::shape::{Shape, turn};

/// Part of the lowest frequency of a response below which only the gain counts [1].
const SLOW: f64 = 0.1;

/// The loop of one feature over one contact.
#[derive(Debug, Clone)]
pub(crate) struct Loop {
    pub(crate) kp: f64,
    ki: f64,
    kd: f64,
    shapes: Vec<Shape>,
    /// Speed at which the feature changes, for each unit of the control.
    pub(crate) gain: f64,
    resonance: Option<(f64, f64)>,
    latency: f64,
    pub(crate) period: f64,
    /// What was measured, as a multiple of the model, at circular frequencies from low to high [rad/s]; empty if nothing was.
    measured: Vec<(f64, Complex<f64>)>,
    /// Loops of the same measurement, or through the same motion, which add to this one.
    beside: Vec<Self>,
    /// Whether its setpoint is that of the loop beside which it stands: both have the same measurement.
    is_of_same: bool,
}

impl Loop {
    /// Returns the loop of a feature over a contact; `None` if neither the bench nor geometry says how the feature
    /// answers the motion of its column, or if a schedule multiplies the gains by what is not known.
    pub(crate) fn over(feature: &Feature, contact: &Contact) -> Option<Self> {
        let quantity = feature.quantity()?;
        let answer = contact.answer(quantity)?;
        let latency = contact.latency_s(quantity, feature.latency_s);
        let (copies, others): (Vec<&Feature>, Vec<&Feature>) =
            feature.beside.iter().partition(|other| other.is_same_control(feature));
        // The same control that moves the arm by several nodes.
        let column = std::array::from_fn(|i| feature.column[i] + copies.iter().map(|copy| copy.column[i]).sum::<f64>());
        let around = Self::new(&Feature { column, ..feature.clone() }, &answer, latency);
        let factors = feature.schedules.iter().map(|schedule| schedule.factor(contact));
        let factor = factors.product::<Option<f64>>()?;
        let mut beside = Vec::new();
        for other in others {
            let other = Feature { beside: Vec::new(), ..other.clone() };
            // One that only moves what does not change the feature adds nothing.
            let around = Self::over(&other, contact).filter(|_| answer.along(&other.column) != 0.0);
            // Of another measurement nothing may be known.
            let is_needed = answer.along(&other.column) != 0.0 && other.measured == feature.measured;
            if is_needed && around.is_none() {
                return None;
            }
            let is_of_same = other.measured == feature.measured;
            beside.extend(around.map(|around| Self { is_of_same, ..around }));
        }
        (around.gain != 0.0).then_some(Self { beside, ..around.times(factor) })
    }

    /// Returns the loop of a feature, with the latency [s].
    pub(crate) fn new(feature: &Feature, answer: &Answer, latency: f64) -> Self {
        let gain = answer.along(&feature.column);
        let Feature { kp, ki, kd, period_s: period, .. } = *feature;
        let shapes = feature.filters.iter().map(|filter| filter.shape).collect();
        let (resonance, beside) = (answer.resonance(), Vec::new());
        let (measured, is_of_same) = (Vec::new(), true);
        let around = Self { kp, ki, kd, shapes, gain, resonance, latency, period, measured, beside, is_of_same };
        let measured = answer.response.iter().map(|[hz, multiple, phase]| {
            let omega = 2.0 * std::f64::consts::PI * hz;
            (omega, turn(-phase.to_radians()) * *multiple / around.modelled(omega))
        });
        // To slower motions a contact answers by its gain.
        let slow = answer.response.first().map(|[hz, ..]| (SLOW * 2.0 * std::f64::consts::PI * hz, Complex::from(1.0)));
        Self { measured: slow.into_iter().chain(measured).collect(), ..around }
    }

    /// Returns the same loop with all gains of the controller times a factor. Those of the loops beside it stay.
    pub(crate) fn times(&self, factor: f64) -> Self {
        let [kp, ki, kd] = [self.kp, self.ki, self.kd].map(|gain| gain * factor);
        Self { kp, ki, kd, ..self.clone() }
    }

    /// Returns the same loop without the derivative of its own controller.
    pub(crate) fn without_derivative(&self) -> Self {
        Self { kd: 0.0, ..self.clone() }
    }

    /// Returns the same loop with a share of the integral gain of its own controller.
    pub(crate) fn with_integral_share(&self, share: f64) -> Self {
        Self { ki: self.ki * share, ..self.clone() }
    }

    /// Returns the number of poles at zero: the motion integrates, and so does `ki`.
    pub(crate) fn integrators(&self) -> usize {
        if self.all().all(|one| one.ki == 0.0) { 1 } else { 2 }
    }

    /// Returns the proportional gain around the loop [rad/s].
    pub(crate) fn proportional(&self) -> f64 {
        self.all().map(Self::own_proportional).sum()
    }

    /// Returns the proportional gain around the loop by its own controller, without those beside it [rad/s].
    pub(crate) fn own_proportional(&self) -> f64 {
        self.kp * self.gain
    }

    /// Returns the loop and those beside it.
    fn all(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.beside)
    }

    /// Returns whether the motion increases the error.
    pub(crate) fn is_reversed(&self) -> bool {
        [self.kp, self.ki, self.kd].iter().any(|gain| gain * self.gain < 0.0)
    }

    /// Returns the error behind a steady ramp of one unit in each second, by `kp` alone [s]. Delays do not change it,
    /// because the error is constant then.
    pub(crate) fn ramp_lag(&self) -> f64 {
        1.0 / self.proportional()
    }

    /// Returns the time constant with which an integral takes this error away [s]; `None` without one.
    pub(crate) fn integral_s(&self) -> Option<f64> {
        let integral: f64 = self.all().map(|one| one.ki * one.gain).sum();
        (integral != 0.0).then(|| self.proportional() / integral)
    }

    /// Returns L at a circular frequency [rad/s].
    pub(crate) fn open(&self, omega: f64) -> Complex<f64> {
        self.all().map(|one| one.ahead_alone(omega) * one.filters(omega)).sum()
    }

    /// Returns the response from the error to the feature itself, before its filters, at a circular frequency [rad/s].
    pub(crate) fn ahead(&self, omega: f64) -> Complex<f64> {
        self.all().filter(|one| one.is_of_same).map(|one| one.ahead_alone(omega)).sum()
    }

    /// Returns it without the loops beside it.
    fn ahead_alone(&self, omega: f64) -> Complex<f64> {
        let arm = self.modelled(omega) * between(&self.measured, omega) * self.gain;
        self.control(omega) * travel(omega, self.period) * arm
    }

    /// Returns the response of the filters.
    fn filters(&self, omega: f64) -> Complex<f64> {
        self.shapes.iter().map(|shape| shape.response(omega, self.period)).product()
    }

    /// Returns the response of arm and contact by resonance and latency, as a multiple of that to a slow motion.
    fn modelled(&self, omega: f64) -> Complex<f64> {
        resonance(omega, self.resonance) * turn(omega * self.latency)
    }

    /// Returns the response of controller, travel and filters, which a graph states.
    pub(crate) fn known(&self, omega: f64) -> Complex<f64> {
        self.control(omega) * self.filters(omega) * travel(omega, self.period)
    }

    fn control(&self, omega: f64) -> Complex<f64> {
        let change = Complex::from(1.0) - turn(omega * self.period);
        let integral = if self.ki == 0.0 { Complex::from(0.0) } else { Complex::from(self.ki * self.period) / change };
        Complex::from(self.kp) + integral + change * (self.kd / self.period)
    }
}

/// Returns a factor between the frequencies at which it is known, straight in its logarithm over that of the frequency.
fn between(known: &[(f64, Complex<f64>)], omega: f64) -> Complex<f64> {
    let above = known.partition_point(|(at, _)| *at < omega);
    let Some(low) = above.checked_sub(1).map(|i| known[i]) else {
        return known.first().map_or(Complex::from(1.0), |(_, factor)| *factor);
    };
    let Some(high) = known.get(above) else { return low.1 };
    let share = libm::log(omega / low.0) / libm::log(high.0 / low.0);
    let ratio = high.1 / low.1;
    let norm = libm::exp(libm::log(ratio.norm()) * share);
    low.1 * turn(-libm::atan2(ratio.im, ratio.re) * share) * norm
}

/// Returns the response of motion, at the samples, to a speed that is held for a period [s].
fn travel(omega: f64, period: f64) -> Complex<f64> {
    let ago = turn(omega * period);
    ago * period / (Complex::from(1.0) - ago)
}

/// Returns the response of a resonance with its circular frequency [rad/s] and damping ratio.
pub(crate) fn resonance(omega: f64, own: Option<(f64, f64)>) -> Complex<f64> {
    let Some((own, damping)) = own else { return Complex::from(1.0) };
    let ratio = omega / own;
    Complex::from(1.0) / Complex::new(1.0 - ratio * ratio, 2.0 * damping * ratio)
}

#[cfg(test)]
mod tests {
    use super::super::filters::Filter;
    use super::*;

    /// Number of steps of the arm in a period.
    const STEPS: usize = 40;

    /// Runs the loop in time, with the arm in small steps, and returns the response of the filtered feature to an error
    /// with a period of so many samples.
    fn in_time(samples: usize) -> Complex<f64> {
        let (period, own, damping) = (0.004, 30.0, 0.3);
        let angle = |tick: usize| 2.0 * std::f64::consts::PI * (tick % samples) as f64 / samples as f64;
        let share = -libm::expm1(-period / 0.1_f64);
        let (mut window, mut low, mut integral, mut last) = ([0.0; 10], 0.0, 0.0, 0.0);
        let (mut want, mut place, mut speed) = (0.0, 0.0, 0.0);
        let settled = 5000_usize.div_ceil(samples) * samples;
        let mut measured = Vec::new();
        for tick in 0..settled + 2 * samples {
            window.rotate_right(1);
            window[0] = 7.0 * place;
            low += share * (window.iter().sum::<f64>() / 10.0 - low);
            measured.push(low);
            let error = libm::sin(angle(tick));
            integral += 0.4 * error * period;
            let control = 0.5 * error + integral + 0.02 * (error - last) / period;
            last = error;
            for _ in 0..STEPS {
                let dt = period / STEPS as f64;
                want += control * dt;
                speed += (own * own * (want - place) - 2.0 * damping * own * speed) * dt;
                place += speed * dt;
            }
        }
        // The integral of a sine has a mean, so the place has a steady drift, which is taken out.
        let (before, after) = measured[settled..].split_at(samples);
        let drift = (after[0] - before[0]) / samples as f64;
        let sum = |(tick, value): (usize, &f64)| turn(angle(tick)) * (value - drift * tick as f64);
        // For an error sin, and not cos.
        after.iter().enumerate().map(sum).sum::<Complex<f64>>() * Complex::new(0.0, 2.0 / samples as f64)
    }

    #[test]
    fn a_factor_is_straight_between_its_frequencies_and_constant_beyond() {
        let known = [(1.0, Complex::new(2.0, 0.0)), (4.0, Complex::new(0.0, 8.0))];
        let at = |omega: f64| between(&known, omega);
        assert!((at(0.5) - known[0].1).norm() < 1e-12 && (at(9.0) - known[1].1).norm() < 1e-12);
        assert!((at(4.0) - known[1].1).norm() < 1e-12);
        // In the middle of the logarithms: the mean of the phases, and the geometric mean of the norms.
        let half = 0.5_f64.sqrt() * 4.0;
        assert!((at(2.0) - Complex::new(half, half)).norm() < 1e-12, "{}", at(2.0));
        assert_eq!(between(&[], 2.0), Complex::from(1.0));
    }

    #[test]
    fn a_measured_response_counts_in_place_of_resonance_and_latency() {
        let feature = Feature {
            name: "pressure".into(),
            column: [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            kp: 0.5,
            period_s: 0.004,
            ..Feature::default()
        };
        let response = vec![[0.5, 1.0, 0.0], [3.0, 1.5, -40.0]];
        let modelled = Answer { vz: Some(7.0), resonance_hz: Some(6.0), ..Answer::default() };
        let measured = Answer { response, ..modelled.clone() };
        let [modelled, measured] = [modelled, measured].map(|answer| Loop::new(&feature, &answer, 0.02));
        let at =
            |hz: f64| measured.open(2.0 * std::f64::consts::PI * hz) / measured.known(2.0 * std::f64::consts::PI * hz);
        assert!((at(0.5) - Complex::from(7.0)).norm() < 1e-9, "{}", at(0.5));
        assert!((at(3.0) - Complex::from_polar(7.0 * 1.5, -40_f64.to_radians())).norm() < 1e-9, "{}", at(3.0));
        // Beyond its frequencies it goes on as the model does, and far below them it answers by its gain.
        assert!(
            (at(0.01) - modelled.open(0.02 * std::f64::consts::PI) / modelled.known(0.02 * std::f64::consts::PI))
                .norm()
                < 1e-9
        );
        let ratio = |hz: f64| {
            let omega = 2.0 * std::f64::consts::PI * hz;
            measured.open(omega) / modelled.open(omega)
        };
        assert!((ratio(5.0) - ratio(9.0)).norm() < 1e-9 && (ratio(3.0) - ratio(5.0)).norm() < 1e-9);
    }

    #[test]
    fn the_response_is_that_of_the_loop_in_time() {
        let answer = Answer {
            vz: Some(7.0),
            resonance_hz: Some(30.0 / (2.0 * std::f64::consts::PI)),
            damping_ratio: Some(0.3),
            ..Answer::default()
        };
        let filter = |shape: Shape| Filter { node: String::new(), kind: String::new(), delay_s: 0.0, shape };
        let feature = Feature {
            name: "pressure".into(),
            column: [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            kp: 0.5,
            ki: 0.4,
            kd: 0.02,
            period_s: 0.004,
            filters: [Shape::Mean { samples: 10.0 }, Shape::LowPass { time: 0.1 }].map(filter).into(),
            ..Feature::default()
        };
        let around = Loop::new(&feature, &answer, 0.0);
        for samples in [400, 200, 100, 50, 20] {
            let omega = 2.0 * std::f64::consts::PI / (0.004 * samples as f64);
            let (open, ran) = (around.open(omega), in_time(samples));
            let ratio = ran / open;
            assert!((ratio.norm() - 1.0).abs() < 0.02 && ratio.arg().abs() < 0.02, "{omega}: {open} and {ran}");
        }
    }
}
