//! The filters that a feature passes: their response to a frequency, and their delay.

use nalgebra::Complex;

/// A linear filter of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Shape {
    /// A first-order low-pass filter with a time constant [s].
    LowPass {
        /// Time constant [s].
        time: f64,
    },
    /// The mean of the last samples.
    Mean {
        /// Number of samples.
        samples: f64,
    },
    /// The median of the last samples, which is the middle one of a slow signal.
    Median {
        /// Number of samples.
        samples: f64,
    },
    /// The value some time ago.
    Delay {
        /// The time [s].
        time: f64,
    },
}

impl Shape {
    /// Returns whether it smooths what it passes.
    pub(crate) const fn smooths(self) -> bool {
        !matches!(self, Self::Delay { .. })
    }

    /// Returns the delay that the filter gives to a slow ramp, for samples at `period` [s]: the time constant of a
    /// low-pass, and half of a window.
    pub(crate) fn delay(self, period: f64) -> f64 {
        match self {
            Self::LowPass { time } | Self::Delay { time } => time,
            Self::Mean { samples } | Self::Median { samples } => (samples - 1.0) / 2.0 * period,
        }
    }

    /// Returns the response at a circular frequency [rad/s], for samples at `period` [s].
    pub(crate) fn response(self, omega: f64, period: f64) -> Complex<f64> {
        let one = Complex::from(1.0);
        let angle = omega * period;
        match self {
            Self::LowPass { time } => {
                let share = -libm::expm1(-period / time);
                Complex::from(share) / (one - turn(angle) * (1.0 - share))
            }
            Self::Mean { samples } => (one - turn(samples * angle)) / ((one - turn(angle)) * samples),
            Self::Median { .. } | Self::Delay { .. } => turn(omega * self.delay(period)),
        }
    }
}

/// Returns exp(-j angle).
pub(crate) fn turn(angle: f64) -> Complex<f64> {
    Complex::new(libm::cos(angle), -libm::sin(angle))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_is_the_sum_of_its_samples_and_a_low_pass_leaves_half_the_power_at_its_corner() {
        let omega = 40.0;
        let sum: Complex<f64> = (0..10).map(|k| turn(omega * 0.004 * f64::from(k))).sum();
        let mean = Shape::Mean { samples: 10.0 };
        assert!((mean.response(omega, 0.004) - sum / 10.0).norm() < 1e-12);
        let low = Shape::LowPass { time: 0.1 };
        assert!((low.response(10.0, 1e-5).norm() - 0.5_f64.sqrt()).abs() < 1e-4);
        for shape in [mean, low, Shape::Median { samples: 5.0 }, Shape::Delay { time: 0.004 }] {
            let slow = shape.response(0.1, 1e-4);
            assert!((slow.arg() + 0.1 * shape.delay(1e-4)).abs() < 1e-5, "{shape:?}");
        }
    }
}
