//! The electronics of a pad with three axes: counts of 16 bits with a sign, from the force on each tactel along x, y and z.
//!
//! A tactel reads zero + sensitivity f + noise along each axis. Its zeros and its sensitivities vary over the pad.
//! Saturation below the range of 16 bits, hysteresis, creep and cross-talk between the axes are not simulated.

use tactflow_runtime::node::Param;
use tactflow_runtime::random::Random;

use super::foam::Foam;
use super::imprint::Forces;
use crate::devices::Facts;

/// Properties of the electronics of the three axes.
#[derive(Debug, Clone, Param)]
#[param(default)]
pub struct VectorElectronics {
    /// Counts per force, along every axis.
    #[param(unit = "raw/N", above = 0.0, default = 1000.0)]
    pub(crate) sensitivity: f64,
    /// Largest zero of an axis of a tactel; the zeros vary over the pad and its axes, on both sides of 0.
    #[param(unit = "raw", range = 0.0..=30000.0, default = 200.0)]
    pub(crate) zero: f64,
    /// Standard deviation of the logarithm of the tactels' sensitivities.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.02)]
    pub(crate) spread: f64,
    /// Standard deviation of the noise of each axis of a tactel.
    #[param(unit = "raw", range = 0.0.., default = 3.0)]
    pub(crate) own_noise: f64,
}

impl VectorElectronics {
    /// Returns the facts of such a pad on this foam: how `calibrate_vectors` makes forces of its counts, and the friction
    /// that `friction_margin` needs.
    pub fn facts(&self, foam: &Foam) -> Facts {
        vec![
            ("vector_gain".into(), vec![1.0 / self.sensitivity; 3].into()),
            ("friction".into(), foam.static_friction.into()),
        ]
    }
}

/// Largest count of 16 bits with a sign.
const MAX_COUNT: f64 = 32767.0;

/// The electronics of three axes.
pub struct VectorReadout {
    /// Zero and sensitivity of each axis of each tactel [raw, raw/N].
    tactels: Vec<[[f64; 2]; 3]>,
    own_noise: f64,
    noise: Random,
}

impl VectorReadout {
    /// Returns the electronics of a pad with a number of `tactels` and this `serial` number; `seed` is the seed of the
    /// noise.
    #[must_use]
    pub fn new(tactels: usize, electronics: &VectorElectronics, serial: u64, seed: u64) -> Self {
        let VectorElectronics { sensitivity, zero, spread, own_noise } = *electronics;
        let mut random = Random::new(serial, 5);
        let mut axis = |_| [random.uniform(-zero, zero), sensitivity * libm::exp(spread * random.normal())];
        let tactels = (0..tactels).map(|_| [0, 1, 2].map(&mut axis)).collect();
        Self { tactels, own_noise, noise: Random::new(seed, 6) }
    }

    /// Reads a frame of these forces into `counts`. Forces of a pad with one axis have x = y = 0.
    pub fn read(&mut self, forces: &Forces, counts: &mut [[f32; 3]]) {
        for (i, (tactel, counts)) in self.tactels.iter().zip(counts).enumerate() {
            let [x, y] = forces.drag.as_ref().map_or([0.0; 2], |[x, y]| [x[i], y[i]]);
            for (([zero, sensitivity], force), count) in tactel.iter().zip([x, y, forces.normal[i]]).zip(counts) {
                let noise = self.own_noise * self.noise.normal();
                *count = (zero + sensitivity * force + noise).round().clamp(-MAX_COUNT, MAX_COUNT) as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(electronics: &VectorElectronics, normal: f64, drag: Option<[f64; 2]>) -> Vec<[f32; 3]> {
        let mut counts = vec![[0.0; 3]; 400];
        let forces = Forces { normal: vec![normal; 400], drag: drag.map(|drag| drag.map(|force| vec![force; 400])) };
        VectorReadout::new(400, electronics, 1, 1).read(&forces, &mut counts);
        counts
    }

    #[test]
    fn counts_are_a_line_of_the_force_with_zeros_and_sensitivities_of_their_own() {
        let quiet = VectorElectronics { own_noise: 0.0, ..VectorElectronics::default() };
        let zeros = read(&quiet, 0.0, None);
        let counts = read(&quiet, 0.8, Some([0.2, -0.4]));
        for axis in 0..3 {
            let force = [0.2, -0.4, 0.8][axis];
            let gains = || zeros.iter().zip(&counts).map(|(zero, count)| f64::from(count[axis] - zero[axis]) / force);
            let mean = gains().sum::<f64>() / 400.0;
            let spread = (gains().map(|gain| (gain - mean).powi(2)).sum::<f64>() / 400.0).sqrt() / mean;
            assert!(
                (mean / 1000.0 - 1.0).abs() < 0.005 && (spread / 0.02 - 1.0).abs() < 0.15,
                "{axis}: {mean} {spread}"
            );
            assert!(zeros.iter().all(|zero| zero[axis].abs() <= 200.0) && zeros[0][axis] != zeros[1][axis]);
        }
        assert_eq!(read(&quiet, 1e9, None)[0][2], 32767.0, "16 bits");
    }

    #[test]
    fn every_axis_has_noise_of_its_own() {
        let (quiet, noisy) = (VectorElectronics { own_noise: 0.0, ..Default::default() }, VectorElectronics::default());
        let (without, with) = (read(&quiet, 0.1, None), read(&noisy, 0.1, None));
        let noise: Vec<f64> =
            with.as_flattened().iter().zip(without.as_flattened()).map(|(a, b)| f64::from(a - b)).collect();
        let variance = noise.iter().map(|noise| noise * noise).sum::<f64>() / noise.len() as f64;
        // Rounding adds a twelfth twice.
        assert!((variance / (9.0 + 1.0 / 6.0) - 1.0).abs() < 0.12, "{variance}");
    }
}
