//! The control law of one feature, and what it remembers.
//!
//! u = kp e + I + kd de/dt, with I the sum of ki e dt. A contact that slides too fast is braked: see `braked`. Time is
//! that between the stamps of a component's samples, so a gain means the same at 100 Hz and at 1 kHz, and one sample is
//! never integrated twice; the paper sums without dt, so its KI is ki times the period and its KD is kd over the period.
//! The integral is kept in units of the control, so a change of ki makes no jump; it runs only near the target
//! (`within`), is bounded, and does not grow outwards while the output is at its limit or grows as fast as it may. The
//! error of a line's direction is differenced modulo pi.

use tactflow_runtime::node::{Absence, Interval};
use tactflow_runtime::signal::Unit;

use super::Gains;
use super::braked::{braked, smoothed};
use crate::motion::axis::wrap_axial;
use crate::servo::integral::integrate;

/// Time of growth that a control with a `rise` has at once [s]. Noise of a feature at rest must not wait for it: it is
/// as large at 1 kHz as at 100 Hz, and a bound on each sample would make its gain smaller.
const START_S: f64 = 0.02;

/// What is remembered of one feature.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Memory {
    /// The integral's part of the control, in the feature's unit per second.
    integral: f64,
    /// Error of the last sample, in the feature's unit.
    error: f64,
    /// The last control, in the feature's unit per second.
    control: f64,
    /// Smooth rate of the error, in the feature's unit per second; zero without a brake.
    rate: f64,
    pub(super) interval: Interval,
    pub(super) absence: Absence,
}

/// The control law of one feature.
pub(super) struct Law {
    kp: f64,
    ki: f64,
    kd: f64,
    within: f64,
    bound: f64,
    limit: f64,
    rise: Option<f64>,
    brake_above: Option<f64>,
    is_axial: bool,
    /// Whether anything reads its control; otherwise it is frozen.
    pub(super) is_wanted: bool,
}

impl Law {
    pub(super) fn new(gains: &Gains, unit: Unit) -> Self {
        let Gains { kp, ki, kd, bound, rise, .. } = *gains;
        let [within, limit] = [gains.within, gains.limit].map(|bound| bound.unwrap_or(f64::INFINITY));
        // A feature without a gain rests, also while it slides.
        let brake_above = gains.brake_above.filter(|_| kp > 0.0);
        Self { kp, ki, kd, within, bound, limit, rise, brake_above, is_axial: unit.is_axial(), is_wanted: true }
    }

    /// Returns the control for an error that comes `dt` [s] after the last one. Without a time there is no slope, and
    /// neither the integral nor a control with a `rise` grows.
    pub(super) fn control(&self, error: f64, dt: Option<f64>, memory: &mut Memory) -> f64 {
        let change = error - memory.error;
        let change = if self.is_axial { wrap_axial(change) } else { change };
        let dt = dt.unwrap_or(0.0);
        let slope = if dt > 0.0 { change / dt } else { 0.0 };
        let others = self.proportional(error, slope, dt, memory) + self.kd * slope;
        let growth = if error.abs() <= self.within { self.ki * error * dt } else { 0.0 };
        // How far the control may be from zero, on the side of the last one and on the other side.
        let grown = |time: f64| self.rise.map_or(f64::INFINITY, |rise| rise * time);
        let other = grown(dt.max(START_S));
        let most = other.max(memory.control.abs() + grown(dt));
        let [most, other] = [most, other].map(|most| most.min(self.limit));
        memory.integral = integrate(memory.integral, growth, self.bound, others, most);
        memory.error = error;
        let (low, high) = if memory.control < 0.0 { (-most, other) } else { (-other, most) };
        memory.control = (others + memory.integral).clamp(low, high);
        memory.control
    }

    /// Returns the proportional part of the control, braked where the contact slides faster than it asks for.
    fn proportional(&self, error: f64, slope: f64, dt: f64, memory: &mut Memory) -> f64 {
        let control = self.kp * error;
        let Some(above) = self.brake_above else {
            memory.rate = 0.0;
            return control;
        };
        memory.rate = if dt > 0.0 { smoothed(memory.rate, slope, dt) } else { 0.0 };
        braked(control, memory.rate, above)
    }
}
