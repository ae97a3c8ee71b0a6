//! The times between the ticks of a run in real time, as a histogram.

use crate::cli::text::number::count_of;
use crate::cli::text::svg::{PlotAxis, Svg};

/// Size of the picture, and the frame of the plot in it [px].
const SIZE: [f64; 2] = [720.0, 260.0];
const FRAME: [[f64; 2]; 2] = [[72.0, 20.0], [704.0, 200.0]];
/// Number of bars.
const BARS: usize = 80;

/// The times between two ticks.
#[derive(Default)]
pub(super) struct Intervals {
    last: Option<i64>,
    /// [ns]
    all: Vec<i64>,
}

impl Intervals {
    /// Adds a tick at `now` [ns].
    pub(super) fn add(&mut self, now: i64) {
        self.all.extend(self.last.replace(now).map(|last| now - last));
    }

    /// Returns the smallest interval that is not exceeded by a share of all [ms].
    fn quantile(&self, share: f64) -> f64 {
        let mut all = self.all.clone();
        all.sort_unstable();
        let index = (share * (all.len().max(1) - 1) as f64).round() as usize;
        all.get(index).map_or(0.0, |nanos| *nanos as f64 * 1e-6)
    }

    /// Describes the intervals, for a nominal `period` [ns].
    pub(super) fn caption(&self, period: i64) -> String {
        let late = self.all.iter().filter(|interval| **interval > 2 * period).count();
        format!(
            "The times between two ticks, of {:.3} ms nominally: half are below {:.3} ms, 99 % below {:.3} ms, the longest \
             is {:.3} ms; {} longer than two periods.",
            period as f64 * 1e-6,
            self.quantile(0.5),
            self.quantile(0.99),
            self.quantile(1.0),
            count_of(late, "interval")
        )
    }

    /// Draws the histogram from 0 to three periods. The last bar has all longer intervals. The heights are logarithmic.
    pub(super) fn svg(&self, period: i64) -> String {
        let most = 3.0 * period as f64 * 1e-6;
        let mut bars = [0_usize; BARS];
        for interval in &self.all {
            let bar = (*interval as f64 * 1e-6 / most * BARS as f64) as usize;
            bars[bar.min(BARS - 1)] += 1;
        }
        let highest = bars.iter().copied().max().unwrap_or(1).max(2) as f64;
        let x = PlotAxis::linear(0.0, most, [FRAME[0][0], FRAME[1][0]]);
        let y = PlotAxis::log(0.5, highest, [FRAME[1][1], FRAME[0][1]]);
        let mut svg = Svg::new(SIZE, "Times between two ticks");
        svg.axes(x, y, [Some("time between two ticks [ms]"), Some("number")]);
        for (i, count) in bars.iter().enumerate().filter(|(_, count)| **count > 0) {
            let [left, right] = [i, i + 1].map(|edge| x.at(most * edge as f64 / BARS as f64));
            let top = y.at(*count as f64);
            let (width, height) = (right - left, FRAME[1][1] - top);
            svg.put(format_args!(
                "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"#3d85c6\"/>"
            ));
        }
        svg.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_caption_has_the_quantiles_and_the_bars_have_all_intervals() {
        let mut intervals = Intervals::default();
        let mut now = 0;
        for i in 0..=1000 {
            intervals.add(now);
            now += if i % 100 == 99 { 9_000_000 } else { 4_000_000 };
        }
        let caption = intervals.caption(4_000_000);
        assert!(caption.contains("half are below 4.000 ms, 99 % below 4.000 ms, the longest is 9.000 ms"), "{caption}");
        assert!(caption.ends_with("10 intervals longer than two periods."), "{caption}");
        assert_eq!(intervals.svg(4_000_000).matches("<rect").count(), 2);
    }
}
