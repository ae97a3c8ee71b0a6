//! Seeded random numbers that are the same in every run and on every machine.

/// A generator of random numbers: splitmix64 (Steele, Lea and Flood 2014), and Marsaglia's polar method for normal
/// ones.
///
/// ```
/// use tactflow_runtime::random::Random;
///
/// let (mut first, mut second) = (Random::new(7, 0), Random::new(7, 0));
/// assert_eq!(first.uniform(-1.0, 1.0), second.uniform(-1.0, 1.0));
/// assert!(first.below(6) < 6);
/// ```
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
    /// The second of the last two normal numbers.
    spare: Option<f64>,
}

impl Random {
    /// Returns the generator number `stream` of a seed. Streams of one seed are independent.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut random = Self { state: seed ^ stream.wrapping_mul(0xD1B5_4A32_D192_ED03), spare: None };
        // The first numbers of neighbouring seeds are alike in their high bits.
        let state = random.next();
        random.state = state;
        random
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns a number from `low` to below `high`, uniformly distributed.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// Returns a whole number from 0 to below `count`, uniformly distributed.
    ///
    /// # Panics
    /// If `count` is 0.
    pub fn below(&mut self, count: usize) -> usize {
        assert!(count > 0, "no number is below 0");
        (self.next() % count as u64) as usize
    }

    /// Returns a normally distributed number of mean 0 and standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let (u, v) = (self.uniform(-1.0, 1.0), self.uniform(-1.0, 1.0));
            let s = u * u + v * v;
            if s > 0.0 && s < 1.0 {
                let scale = (-2.0 * libm::log(s) / s).sqrt();
                self.spare = Some(v * scale);
                return u * scale;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moments_are_those_of_the_distributions() {
        let mut random = Random::new(7, 1);
        let n = 100_000;
        let normal: Vec<f64> = (0..n).map(|_| random.normal()).collect();
        let moment = |k: i32| normal.iter().map(|x| x.powi(k)).sum::<f64>() / f64::from(n);
        for (k, wanted, within) in [(1, 0.0, 0.015), (2, 1.0, 0.02), (3, 0.0, 0.05), (4, 3.0, 0.15)] {
            assert!((moment(k) - wanted).abs() < within, "moment {k}: {}", moment(k));
        }
        let uniform: Vec<f64> = (0..n).map(|_| random.uniform(2.0, 4.0)).collect();
        let mean = uniform.iter().sum::<f64>() / f64::from(n);
        assert!(uniform.iter().all(|x| (2.0..4.0).contains(x)) && (mean - 3.0).abs() < 0.01, "{mean}");
    }

    #[test]
    fn every_number_below_the_count_comes_equally_often() {
        let (mut random, mut counts) = (Random::new(3, 0), [0_u32; 7]);
        (0..70_000).for_each(|_| counts[random.below(7)] += 1);
        assert!(counts.iter().all(|count| count.abs_diff(10_000) < 400), "{counts:?}");
    }

    #[test]
    fn streams_and_seeds_differ_and_repeat() {
        let first = |seed, stream| Random::new(seed, stream).uniform(0.0, 1.0).to_bits();
        assert_eq!(first(1, 1), first(1, 1));
        let all = [first(1, 1), first(1, 2), first(2, 1), first(2, 2), first(0, 0)];
        assert!((0..all.len()).all(|i| all[i + 1..].iter().all(|other| *other != all[i])));
    }
}
