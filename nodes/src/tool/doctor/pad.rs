//! The noise of a pad that nobody touches.

use tactflow_runtime::signal::{Image, ImageShape};

use super::Finding;
use super::timing::quantile;

/// Standard deviations of the noisiest tactel above its mean at which a threshold leaves it quiet.
const THRESHOLD_DEVIATIONS: f64 = 5.0;
/// Ratio of the noise of the noisiest tactel to that of the median one from which on the pad is not free.
const TOUCHED_DEVIATIONS: f64 = 20.0;
/// Number of frames from which on the noise is known.
const MIN_FRAMES: u64 = 20;
/// Maximum number of tactels that a line names.
const MAX_NAMED: usize = 5;

/// Collects the mean and the variance of each tactel (Welford's method).
#[derive(Debug, Clone)]
pub(super) struct Noise {
    shape: ImageShape,
    frames: u64,
    means: Vec<f64>,
    squares: Vec<f64>,
    /// Largest distance of a reading from the mean of its tactel until then.
    largest: f64,
}

impl Noise {
    pub(super) fn new(shape: ImageShape) -> Self {
        let tactels = shape.tactels();
        Self { shape, frames: 0, means: vec![0.0; tactels], squares: vec![0.0; tactels], largest: 0.0 }
    }

    pub(super) fn add(&mut self, image: &Image) {
        self.frames += 1;
        for ((mean, square), cell) in self.means.iter_mut().zip(&mut self.squares).zip(image.cells()) {
            let off = f64::from(*cell) - *mean;
            if self.frames > 1 {
                self.largest = self.largest.max(off.abs());
            }
            *mean += off / self.frames as f64;
            *square += off * (f64::from(*cell) - *mean);
        }
    }

    /// Returns what a tactel reads without a load, for each tactel, and the reading above it from which the tactel is
    /// pressed for certain; `None` if there are too few frames to know.
    #[cfg(feature = "drivers")]
    pub(super) fn quiet(&self) -> Option<(&[f64], f64)> {
        /// Factor of the largest reading above the mean that was seen without a load.
        const MARGIN: f64 = 2.0;
        let most = quantile(&self.deviations(), 1.0);
        (self.frames >= MIN_FRAMES).then(|| (&*self.means, (THRESHOLD_DEVIATIONS * most).max(MARGIN * self.largest)))
    }

    fn deviations(&self) -> Vec<f64> {
        let frames = self.frames.max(2);
        self.squares.iter().map(|square| (square / (frames - 1) as f64).sqrt()).collect()
    }

    /// Describes the noise of the port `name`.
    pub(super) fn describe(&self, name: &str) -> Vec<Finding> {
        let ImageShape { rows, cols, unit, .. } = &self.shape;
        let frames = self.frames;
        if frames < MIN_FRAMES {
            let text = format!(
                "{name}: {rows} by {cols} tactels, in {unit}; {frames} frames are too few to measure the noise: use \
                 `--for 30s`"
            );
            return vec![Finding::warning(text)];
        }
        let deviations = self.deviations();
        let [median, most] = [0.5, 1.0].map(|part| quantile(&deviations, part));
        let [low, high] = [0.0, 1.0].map(|part| quantile(&self.means, part));
        let quiet = self.means.iter().zip(&deviations).map(|(mean, noise)| mean + THRESHOLD_DEVIATIONS * noise);
        let quiet = quiet.fold(f64::NEG_INFINITY, f64::max);
        let text = format!(
            "{name}: {rows} by {cols} tactels, in {unit}; without a load, the means are {low:.4} to {high:.4} {unit}, the noise is {median:.4} \
             {unit} at the median tactel and {most:.4} {unit} at the noisiest ({}); a threshold of {quiet:.4} {unit} leaves \
             all of them quiet",
            self.place(deviations.iter().position(|noise| *noise == most).unwrap_or(0)),
        );
        let mut findings = vec![Finding::fine(text)];
        if median > 0.0 && most > TOUCHED_DEVIATIONS * median {
            let text = "something seems to touch the pad, or a tactel is noisy: free the pad and run this again";
            findings.push(Finding::warning(text));
        }
        let still: Vec<usize> = (0..deviations.len()).filter(|i| deviations[*i] == 0.0).collect();
        let is_quiet_pad = median == 0.0;
        if !still.is_empty() && !is_quiet_pad {
            findings.push(Finding::warning(format!(
                "{} of them never change and may be dead or stuck: {}",
                still.len(),
                self.places(&still)
            )));
        }
        findings
    }

    /// Returns the place of a tactel.
    fn place(&self, index: usize) -> String {
        format!("row {}, column {}", index / self.shape.cols, index % self.shape.cols)
    }

    fn places(&self, indices: &[usize]) -> String {
        let named: Vec<String> = indices.iter().take(MAX_NAMED).map(|i| self.place(*i)).collect();
        let rest = indices.len().saturating_sub(MAX_NAMED);
        named.join("; ") + &if rest > 0 { format!("; and {rest} more") } else { String::new() }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::Unit;

    use super::*;

    fn noise(frames: impl Iterator<Item = [f32; 4]>) -> Noise {
        let mut noise = Noise::new(ImageShape { rows: 2, cols: 2, pitch: [0.005; 2], unit: Unit::NEWTON });
        frames.for_each(|cells| noise.add(&Image::from_cells(2, &cells)));
        noise
    }

    #[test]
    fn the_noise_is_that_of_its_definition_and_a_stuck_tactel_is_found() {
        // Each value comes as often as its negative, so the deviation is the value times sqrt(n / (n - 1)).
        let sign = |i: i32| if i % 2 == 0 { 1.0 } else { -1.0 };
        let findings = noise((0..100).map(|i| [sign(i), 1.0 + 2.0 * sign(i), 3.0 * sign(i), 7.0])).describe("image");
        let text = &findings[0].text;
        let most = 3.0 * (100.0_f64 / 99.0).sqrt();
        assert!(text.contains(&format!("{most:.4} N at the noisiest (row 1, column 0)")), "{text}");
        assert!(text.contains(&format!("a threshold of {:.4} N", 5.0 * most)), "{text}");
        assert_eq!(findings[1], Finding::warning("1 of them never change and may be dead or stuck: row 1, column 1"));
    }

    #[test]
    fn few_frames_say_nothing_and_a_pad_without_noise_is_not_dead() {
        assert!(noise((0..3).map(|_| [0.0; 4])).describe("image")[0].text.contains("3 frames are too few"));
        assert_eq!(noise((0..30).map(|_| [0.0; 4])).describe("image").len(), 1);
    }
}
