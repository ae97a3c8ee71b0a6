//! The times of the samples of a port.

use super::Finding;

/// Part of the declared rate by which the measured one may differ.
const RATE_TOLERANCE: f64 = 0.1;

/// Collects when the samples of a port were measured and when they arrived.
#[derive(Debug, Clone, Default)]
pub(super) struct Timing {
    /// Time of the first arrival since the start [s].
    first: Option<f64>,
    /// Stamp of the first sample [s].
    first_stamp: f64,
    /// Stamp of the last sample [s], and how many were written until then.
    last: Option<(f64, u64)>,
    /// Number of samples after the first one.
    count: u64,
    /// Intervals between the stamps [s].
    intervals: Vec<f64>,
    /// Ages at arrival [s].
    ages: Vec<f64>,
}

impl Timing {
    /// Adds the newest sample of a port that was written `writes` times; `stamp` and `now` are in s since the start.
    pub(super) fn add(&mut self, stamp: f64, writes: u64, now: f64) {
        if self.first.is_none() {
            (self.first, self.first_stamp) = (Some(now), stamp);
        }
        self.ages.push(now - stamp);
        if let Some((last, before)) = self.last.replace((stamp, writes)) {
            let samples = writes - before;
            self.count += samples;
            // Of several samples between two looks, only the newest is known.
            self.intervals.push((stamp - last) / samples as f64);
        }
    }

    /// Returns the median age of a sample on arrival [s]; 0 without samples.
    pub(super) fn median_age(&self) -> f64 {
        if self.ages.is_empty() { 0.0 } else { quantile(&self.ages, 0.5) }
    }

    /// Describes the samples of a port with a nominal `period` [s] after `watched` seconds.
    pub(super) fn describe(&self, port: &str, period: f64, watched: f64) -> Vec<Finding> {
        let Some(first) = self.first else {
            return vec![Finding::problem(format!("{port}: no sample in {watched} s"))];
        };
        if self.count == 0 {
            return vec![Finding::problem(format!("{port}: one sample after {first:.3} s, and none after it"))];
        }
        let total: f64 = self.intervals.iter().sum();
        let mean = total / self.intervals.len() as f64;
        let spread = self.intervals.iter().map(|interval| (interval - mean).powi(2)).sum::<f64>();
        let deviation = (spread / self.intervals.len() as f64).sqrt();
        let [low, high] = [quantile(&self.intervals, 0.0), quantile(&self.intervals, 1.0)];
        let [young, old] = [quantile(&self.ages, 0.5), quantile(&self.ages, 0.99)];
        let last = self.last.map_or(self.first_stamp, |(stamp, _)| stamp);
        let (rate, declared) = (self.count as f64 / (last - self.first_stamp), 1.0 / period);
        let text = format!(
            "{port}: {} samples, the first after {:.0} ms; {rate:.1} Hz (declared {declared:.1} Hz), intervals {:.2} to \
             {:.2} ms, deviation {:.2} ms; age on arrival {:.2} ms at the median, {:.2} ms for 99 %",
            self.count + 1,
            first * 1e3,
            low * 1e3,
            high * 1e3,
            deviation * 1e3,
            young * 1e3,
            old * 1e3,
        );
        let mut findings = vec![Finding::fine(text)];
        let is_off = (rate / declared - 1.0).abs() > RATE_TOLERANCE;
        if is_off {
            findings.push(Finding::warning(format!("the rate is not the declared one: correct it, to {rate:.0} Hz")));
        }
        findings
    }
}

/// Returns a quantile of some values, which are not empty.
pub(super) fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}

#[cfg(test)]
mod tests {
    use super::super::Severity;
    use super::*;

    /// Samples every `period` seconds, measured 2 ms before they arrive.
    fn timing(period: f64, count: u64) -> Timing {
        let mut timing = Timing::default();
        (1..=count).for_each(|i| timing.add(i as f64 * period - 0.002, i, i as f64 * period));
        timing
    }

    #[test]
    fn a_steady_port_is_described() {
        let findings = timing(0.01, 101).describe("image", 0.01, 1.0);
        assert_eq!(
            findings,
            [Finding::fine(
                "image: 101 samples, the first after 10 ms; 100.0 Hz (declared 100.0 Hz), intervals 10.00 to 10.00 ms, \
                 deviation 0.00 ms; age on arrival 2.00 ms at the median, 2.00 ms for 99 %"
            )]
        );
    }

    #[test]
    fn another_rate_and_silence_are_found() {
        let findings = timing(0.02, 50).describe("image", 0.01, 1.0);
        assert_eq!(findings[1], Finding::warning("the rate is not the declared one: correct it, to 50 Hz"));
        assert_eq!(Timing::default().describe("image", 0.01, 3.0)[0].severity, Severity::Problem);
        assert_eq!(timing(0.01, 1).describe("image", 0.01, 3.0)[0].severity, Severity::Problem);
    }

    #[test]
    fn samples_between_two_looks_count() {
        let mut timing = Timing::default();
        for (at, writes) in [(0.00, 1), (0.03, 4), (0.06, 7)] {
            timing.add(at, writes, at);
        }
        let text = &timing.describe("image", 0.01, 1.0)[0].text;
        assert!(text.contains("7 samples") && text.contains("100.0 Hz (declared"), "{text}");
    }
}
