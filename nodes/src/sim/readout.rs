//! What the electronics make of the force on each tactel: a squashed, spread, hysteretic, creeping, noisy 12 bit count.
//!
//! A tactel reads offset + a (1 - exp(-u / b)) counts, with a and b spread over the pad. u is its force, with hysteresis
//! (more is read while the force falls) and creep (it reads ever more under a load that stays). The noise of a frame
//! has a share that all tactels have in common, as a factor, and one of each tactel's own.

use tactflow_runtime::node::{NonNegative, Positive, Ratio};
use tactflow_runtime::params;

use crate::random::Random;

params! {
    Electronics:
    /// Which piece of hardware it is: the seed of its offsets and curves.
    serial: u64 = 1,
    /// Greatest answer of a tactel [counts].
    range: Positive = Positive(3000.0),
    /// Force at which a tactel has answered by 63 % of that [N].
    squash: Positive = Positive(3.0),
    /// Standard deviation of the logarithm of the tactels' sensitivity [1].
    spread: NonNegative = NonNegative(0.22),
    /// How much more is read at a force that falls than at one that rises, of the force [1].
    hysteresis: Ratio = Ratio(0.06),
    /// What the reading rises by under a load that stays, of the force [1].
    creep: Ratio = Ratio(0.03),
    /// Time that creep takes [s].
    creep_s: Positive = Positive(15.0),
    /// Standard deviation of the noise that all tactels have in common, of what is read [1].
    common_noise: NonNegative = NonNegative(0.036),
    /// Standard deviation of each tactel's own noise [counts].
    own_noise: NonNegative = NonNegative(3.0),
}

impl Electronics {
    /// The pad of the paper, as far as is known.
    pub const USUAL: Self = Self {
        serial: 1,
        range: Positive(3000.0),
        squash: Positive(3.0),
        spread: NonNegative(0.22),
        hysteresis: Ratio(0.06),
        creep: Ratio(0.03),
        creep_s: Positive(15.0),
        common_noise: NonNegative(0.036),
        own_noise: NonNegative(3.0),
    };
}

/// The largest count of 12 bits.
const TOP: f64 = 4095.0;
/// Change of the force over which hysteresis changes sides [N].
const TURN: f64 = 0.15;

/// The electronics with the state of every tactel.
pub struct Readout {
    tactels: Vec<Tactel>,
    electronics: Electronics,
    noise: Random,
}

#[derive(Debug, Clone)]
struct Tactel {
    offset: f64,
    /// Greatest answer [counts].
    range: f64,
    /// [N]
    squash: f64,
    force: f64,
    /// Side of the hysteresis, from -1 (the force falls) to 1 (it rises).
    side: f64,
    /// Force that creep has got used to [N].
    crept: f64,
}

impl Readout {
    /// A pad of so many tactels; `seed` is that of the noise.
    #[must_use]
    pub fn new(tactels: usize, electronics: Electronics, seed: u64) -> Self {
        let mut random = Random::new(electronics.serial, 1);
        let tactel = |_| {
            let sensitivity = libm::exp(random.normal() * *electronics.spread);
            let width = libm::exp(random.normal() * *electronics.spread / 4.0);
            Tactel {
                offset: random.uniform(0.05, 0.10) * *electronics.range,
                range: (*electronics.range * sensitivity * width).min(0.88 * TOP),
                squash: *electronics.squash * width,
                force: 0.0,
                side: 0.0,
                crept: 0.0,
            }
        };
        Self { tactels: (0..tactels).map(tactel).collect(), electronics, noise: Random::new(seed, 2) }
    }

    /// Reads a frame, `dt` [s] after the last, of these forces [N].
    pub fn read(&mut self, dt: f64, forces: &[f64], counts: &mut [f32]) {
        let electronics = &self.electronics;
        let common = 1.0 + *electronics.common_noise * self.noise.normal();
        let creep = 1.0 - libm::exp(-dt / *electronics.creep_s);
        for ((tactel, force), count) in self.tactels.iter_mut().zip(forces).zip(counts) {
            let felt = tactel.feel(*force, creep, electronics);
            let answer = if felt > 0.0 { tactel.range * (1.0 - libm::exp(-felt / tactel.squash)) } else { 0.0 };
            let noise = *electronics.own_noise * self.noise.normal();
            *count = (tactel.offset + answer * common + noise).round().clamp(0.0, TOP) as f32;
        }
    }
}

impl Readout {
    /// Standard deviation that both shares of the noise, the common one and the tactels' own, give the mean force of
    /// `tactels` tactels, of `pressure` on average [N per tactel].
    #[must_use]
    pub fn noise(&self, pressure: f64, tactels: usize) -> [f64; 2] {
        let electronics = &self.electronics;
        // The slope of the curve that is neither more nor less sensitive than others.
        let slope = *electronics.range / *electronics.squash * libm::exp(-pressure / *electronics.squash);
        [*electronics.common_noise * pressure, *electronics.own_noise / slope / (tactels as f64).sqrt()]
    }
}

impl Tactel {
    fn feel(&mut self, force: f64, creep: f64, electronics: &Electronics) -> f64 {
        let change = force - self.force;
        if change != 0.0 {
            let toward = change.signum();
            self.side = toward + (self.side - toward) * libm::exp(-change.abs() / TURN);
            self.force = force;
        }
        self.crept += (force - self.crept) * creep;
        force * (1.0 - 0.5 * *electronics.hysteresis * self.side) + *electronics.creep * self.crept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(change: impl FnOnce(&mut Electronics)) -> Readout {
        let mut electronics = Electronics {
            spread: NonNegative(0.0),
            hysteresis: Ratio(0.0),
            creep: Ratio(0.0),
            common_noise: NonNegative(0.0),
            own_noise: NonNegative(0.0),
            ..Electronics::USUAL
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
    fn the_curve_is_squashed() {
        let mut readout = one(|_| {});
        let offset = read(&mut readout, 0.004, 0.0);
        assert!((149.0..=301.0).contains(&offset), "{offset}");
        for force in [0.1, 1.0, 3.0] {
            let wanted = 3000.0 * (1.0 - (-force / 3.0f64).exp());
            assert!((read(&mut readout, 0.004, force) - offset - wanted).abs() <= 1.0, "{force}");
        }
        assert_eq!(read(&mut readout, 0.004, f64::MAX), offset + 3000.0, "and ends");
    }

    #[test]
    fn more_is_read_on_the_way_back_and_under_a_load_that_stays() {
        let mut readout = one(|e| e.hysteresis = Ratio(0.1));
        for step in 0..=100 {
            read(&mut readout, 0.004, 0.02 * f64::from(step));
        }
        let up = one(|e| e.hysteresis = Ratio(0.1));
        let up = (0..=50).fold((up, 0.0), |(mut r, _), step| {
            let value = read(&mut r, 0.004, 0.02 * f64::from(step));
            (r, value)
        });
        let down = (50..100).rev().map(|step| read(&mut readout, 0.004, 0.02 * f64::from(step))).last().unwrap();
        let slope = 1000.0 * (-1.0f64 / 3.0).exp();
        assert!(((down - up.1) / slope - 0.1).abs() < 0.003, "10 % of 1 N: {}", (down - up.1) / slope);
        let mut readout = one(|e| e.creep = Ratio(0.05));
        let first = read(&mut readout, 0.004, 1.0);
        let last = (0..4000).map(|_| read(&mut readout, 0.02, 1.0)).last().unwrap();
        assert!(((last - first) / slope - 0.05).abs() < 0.003, "{}", (last - first) / slope);
    }

    #[test]
    fn the_noise_has_both_shares() {
        let electronics =
            Electronics { spread: NonNegative(0.0), hysteresis: Ratio(0.0), creep: Ratio(0.0), ..Electronics::USUAL };
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
    fn a_serial_number_is_a_pad() {
        let counts = |serial, seed| {
            let electronics = Electronics { serial, own_noise: NonNegative(0.0), ..Electronics::USUAL };
            let mut counts = vec![0.0; 16];
            Readout::new(16, electronics, seed).read(0.004, &[0.0; 16], &mut counts);
            counts
        };
        assert_eq!(counts(1, 1), counts(1, 2));
        assert_ne!(counts(1, 1), counts(2, 1));
    }
}
