//! The electronics: 12 bit counts from the force on each tactel, with saturation, variation between tactels,
//! hysteresis, creep and noise.
//!
//! A tactel reads offset + a (1 - exp(-u / b)) counts, where a and b vary over the pad. u is the force with hysteresis
//! (the reading is higher while the force falls) and creep (the reading rises under a constant load). The noise of a
//! frame is a factor that all tactels share, plus independent noise of each tactel.

use tactflow_runtime::node::Param;

use tactflow_runtime::random::Random;

/// Properties of the electronics. The defaults are those of the pad of the paper, as far as its properties are known.
#[derive(Debug, Clone, Param)]
#[param(default)]
pub struct Electronics {
    /// Serial number of the hardware: the seed of the offsets and curves of its tactels.
    #[param(default = 1)]
    pub(crate) serial: u64,
    /// Range of a tactel above its offset.
    #[param(unit = "raw", above = 0.0, default = 3000.0)]
    pub(crate) range: f64,
    /// Force at which a tactel reads 63 % of its range.
    #[param(unit = "N", above = 0.0, default = 3.0)]
    pub(crate) squash: f64,
    /// Standard deviation of the logarithm of the tactels' sensitivity.
    #[param(unit = "1", range = 0.0.., default = 0.22)]
    pub(crate) spread: f64,
    /// Standard deviation of the logarithm of the change of the tactels' sensitivity since their calibration.
    #[param(unit = "1", range = 0.0.., default = 0.0)]
    pub(crate) gain_error: f64,
    /// Difference of the reading between falling and rising force, as a fraction of the force.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.06)]
    pub(crate) hysteresis: f64,
    /// Rise of the reading under a constant load, as a fraction of the force.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.03)]
    pub(crate) creep: f64,
    /// Time constant of the creep.
    #[param(unit = "s", above = 0.0, default = 15.0)]
    pub(crate) creep_s: f64,
    /// Standard deviation of the noise that all tactels share, as a fraction of the reading.
    #[param(unit = "1", range = 0.0.., default = 0.036)]
    pub(crate) common_noise: f64,
    /// Standard deviation of the independent noise of each tactel.
    #[param(unit = "raw", range = 0.0.., default = 3.0)]
    pub(crate) own_noise: f64,
}

/// Largest count of 12 bits.
pub(super) const MAX_COUNT: f64 = 4095.0;
/// Change of the force over which the hysteresis switches its branch [N].
const HYSTERESIS_FORCE: f64 = 0.15;

/// The electronics, with the state of every tactel.
pub struct Readout {
    tactels: Vec<TactelState>,
    electronics: Electronics,
    noise: Random,
}

#[derive(Debug, Clone)]
struct TactelState {
    offset: f64,
    /// Range above the offset [counts].
    range: f64,
    /// Force at 63 % of the range [N].
    squash: f64,
    force: f64,
    /// Branch of the hysteresis, from -1 (falling force) to 1 (rising force).
    branch: f64,
    /// Low-passed force that drives the creep [N].
    crept: f64,
}

impl Readout {
    /// Returns the electronics of a pad with a number of `tactels`; `seed` is the seed of the noise.
    #[must_use]
    pub fn new(tactels: usize, electronics: Electronics, seed: u64) -> Self {
        let mut random = Random::new(electronics.serial, 1);
        let mut aged = Random::new(electronics.serial, 4);
        let tactel = |_| {
            let sensitivity = libm::exp(random.normal() * electronics.spread);
            let width = libm::exp(random.normal() * electronics.spread / 4.0);
            let age = libm::exp(aged.normal() * electronics.gain_error);
            TactelState {
                offset: random.uniform(0.05, 0.10) * electronics.range,
                range: (electronics.range * sensitivity * width).min(0.88 * MAX_COUNT) * age,
                squash: electronics.squash * width,
                force: 0.0,
                branch: 0.0,
                crept: 0.0,
            }
        };
        Self { tactels: (0..tactels).map(tactel).collect(), electronics, noise: Random::new(seed, 2) }
    }

    /// Returns the electronics with the random numbers of another noise.
    #[must_use]
    pub fn with_noise(self, noise: Random) -> Self {
        Self { noise, ..self }
    }

    /// Reads a frame of these forces [N], `dt` [s] after the last frame, into `counts`.
    pub fn read(&mut self, dt: f64, forces: &[f64], counts: &mut [f32]) {
        let electronics = &self.electronics;
        let common = 1.0 + electronics.common_noise * self.noise.normal();
        let creep = 1.0 - libm::exp(-dt / electronics.creep_s);
        for ((tactel, force), count) in self.tactels.iter_mut().zip(forces).zip(counts) {
            let felt = tactel.feel(*force, creep, electronics);
            let reading = if felt > 0.0 { tactel.range * (1.0 - libm::exp(-felt / tactel.squash)) } else { 0.0 };
            let noise = electronics.own_noise * self.noise.normal();
            *count = (tactel.offset + reading * common + noise).round().clamp(0.0, MAX_COUNT) as f32;
        }
    }

    /// Returns the standard deviations that the common and the independent noise give to the mean force of `tactels`
    /// tactels, at a mean force of `pressure` [N per tactel].
    #[must_use]
    pub fn noise(&self, pressure: f64, tactels: usize) -> [f64; 2] {
        let electronics = &self.electronics;
        // The slope of the curve of a tactel of average sensitivity.
        let slope = electronics.range / electronics.squash * libm::exp(-pressure / electronics.squash);
        [electronics.common_noise * pressure, electronics.own_noise / slope / (tactels as f64).sqrt()]
    }
}

impl TactelState {
    fn feel(&mut self, force: f64, creep: f64, electronics: &Electronics) -> f64 {
        let change = force - self.force;
        if change != 0.0 {
            let toward = change.signum();
            self.branch = toward + (self.branch - toward) * libm::exp(-change.abs() / HYSTERESIS_FORCE);
            self.force = force;
        }
        self.crept += (force - self.crept) * creep;
        force * (1.0 - 0.5 * electronics.hysteresis * self.branch) + electronics.creep * self.crept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(change: impl FnOnce(&mut Electronics)) -> Readout {
        let mut electronics = Electronics {
            spread: 0.0,
            hysteresis: 0.0,
            creep: 0.0,
            common_noise: 0.0,
            own_noise: 0.0,
            ..Electronics::default()
        };
        change(&mut electronics);
        Readout::new(1, electronics, 1)
    }

    fn read(readout: &mut Readout, dt: f64, force: f64) -> f64 {
        let mut counts = [0.0];
        readout.read(dt, &[force], &mut counts);
        f64::from(counts[0])
    }

    #[test]
    fn the_curve_saturates() {
        let mut readout = one(|_| {});
        let offset = read(&mut readout, 0.004, 0.0);
        assert!((149.0..=301.0).contains(&offset), "{offset}");
        for force in [0.1, 1.0, 3.0] {
            let wanted = 3000.0 * (1.0 - (-force / 3.0f64).exp());
            assert!((read(&mut readout, 0.004, force) - offset - wanted).abs() <= 1.0, "{force}");
        }
        assert_eq!(read(&mut readout, 0.004, f64::MAX), offset + 3000.0, "the reading saturates");
    }

    #[test]
    fn hysteresis_and_creep_raise_the_reading() {
        let mut readout = one(|e| e.hysteresis = 0.1);
        for step in 0..=100 {
            read(&mut readout, 0.004, 0.02 * f64::from(step));
        }
        let up = one(|e| e.hysteresis = 0.1);
        let up = (0..=50).fold((up, 0.0), |(mut r, _), step| {
            let value = read(&mut r, 0.004, 0.02 * f64::from(step));
            (r, value)
        });
        let down = (50..100).rev().map(|step| read(&mut readout, 0.004, 0.02 * f64::from(step))).last().unwrap();
        let slope = 1000.0 * (-1.0f64 / 3.0).exp();
        assert!(((down - up.1) / slope - 0.1).abs() < 0.003, "10 % of 1 N: {}", (down - up.1) / slope);
        let mut readout = one(|e| e.creep = 0.05);
        let first = read(&mut readout, 0.004, 1.0);
        let last = (0..4000).map(|_| read(&mut readout, 0.02, 1.0)).last().unwrap();
        assert!(((last - first) / slope - 0.05).abs() < 0.003, "{}", (last - first) / slope);
    }

    #[test]
    fn the_noise_has_a_common_and_an_independent_part() {
        let electronics = Electronics { spread: 0.0, hysteresis: 0.0, creep: 0.0, ..Electronics::default() };
        let mut readout = Readout::new(256, electronics, 3);
        let frames: Vec<Vec<f32>> = (0..2000)
            .map(|_| {
                let mut counts = vec![0.0; 256];
                readout.read(0.004, &[0.1; 256], &mut counts);
                counts
            })
            .collect();
        let answer = 3000.0 * (1.0 - (-0.1f64 / 3.0).exp());
        let std = |values: &[f64]| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
        };
        let means: Vec<f64> = frames.iter().map(|f| f.iter().map(|v| f64::from(*v)).sum::<f64>() / 256.0).collect();
        assert!((std(&means) / answer / 0.036 - 1.0).abs() < 0.06, "{}", std(&means) / answer);
        let own: Vec<f64> = frames.iter().zip(&means).map(|(f, mean)| f64::from(f[7]) - mean).collect();
        assert!((std(&own) / 3.0 - 1.0).abs() < 0.06, "{}", std(&own));
    }

    #[test]
    fn sensitivities_change_by_the_gain_error_and_the_zeros_stay() {
        let read = |gain_error: f64, force: f64| {
            let electronics =
                Electronics { gain_error, common_noise: 0.0, own_noise: 0.0, creep: 0.0, ..Electronics::default() };
            let mut counts = vec![0.0; 1024];
            Readout::new(1024, electronics, 1).read(0.004, &[force; 1024], &mut counts);
            counts
        };
        let zeros = read(0.0, 0.0);
        assert_eq!(zeros, read(0.1, 0.0));
        let (before, after) = (read(0.0, 1.0), read(0.1, 1.0));
        let change = |i: usize| f64::from((after[i] - zeros[i]) / (before[i] - zeros[i])).ln();
        let square = (0..1024).map(|i| change(i) * change(i)).sum::<f64>() / 1024.0;
        assert!((square.sqrt() / 0.1 - 1.0).abs() < 0.07, "{}", square.sqrt());
    }

    #[test]
    fn the_serial_number_determines_the_offsets() {
        let counts = |serial, seed| {
            let electronics = Electronics { serial, own_noise: 0.0, ..Electronics::default() };
            let mut counts = vec![0.0; 16];
            Readout::new(16, electronics, seed).read(0.004, &[0.0; 16], &mut counts);
            counts
        };
        assert_eq!(counts(1, 1), counts(1, 2));
        assert_ne!(counts(1, 1), counts(2, 1));
    }
}
