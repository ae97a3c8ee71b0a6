//! How late the ticks of a recorded run began: how many by how much, and the latest over time.

use crate::cli::text::figure::{LINE, curve, range};
use crate::cli::text::svg::{PlotAxis, STYLES, Svg};
use crate::engine::Engine;

/// Number of bars of the histogram for a factor of ten.
const BARS_PER_DECADE: i32 = 10;
/// Powers of ten of its ends [ms]. What is outside counts in the first or the last bar.
const DECADES: [i32; 2] = [-3, 3];
/// Width of the picture, and the left and right end of a panel [px].
const WIDTH: f64 = 760.0;
const ACROSS: [f64; 2] = [84.0, 740.0];
/// Height of a panel, and the space below it for its axis [px].
const PANEL_HEIGHT: f64 = 160.0;
const BELOW: f64 = 52.0;

/// The lateness of each tick of a run in real time.
#[derive(Default)]
pub(super) struct Lateness {
    /// Time [s] and lateness [ms] of each tick.
    ticks: Vec<[f64; 2]>,
}

impl Lateness {
    /// Adds the last tick; nothing in virtual time.
    pub(super) fn add(&mut self, engine: &Engine) {
        if let Some(began) = engine.began() {
            self.ticks.push([engine.now() as f64 * 1e-9, began.by as f64 * 1e-6]);
        }
    }

    /// Describes the distribution; `None` in virtual time.
    pub(super) fn caption(&self) -> Option<String> {
        let mut sorted: Vec<f64> = self.ticks.iter().map(|[_, by]| *by).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let at = |part: f64| sorted[(part * last as f64).round() as usize];
        let [half, most, nearly, all] = [0.5, 0.99, 0.999, 1.0].map(at);
        Some(format!(
            "How late the ticks began: {half:.3} ms at the median, {most:.3} ms at 99 %, {nearly:.3} ms at 99.9 %, and \
             {all:.3} ms at most. Above: how many ticks, by their lateness. Below: the lateness over time."
        ))
    }

    /// Draws the histogram above the lateness over time.
    pub(super) fn picture(&self) -> String {
        let mut svg = Svg::new([WIDTH, 2.0 * (LINE + PANEL_HEIGHT + BELOW)], "Lateness of the ticks");
        self.histogram(&mut svg, [LINE + PANEL_HEIGHT, LINE]);
        let top = 2.0 * LINE + PANEL_HEIGHT + BELOW;
        self.over_time(&mut svg, [top + PANEL_HEIGHT, top]);
        svg.finish()
    }

    fn histogram(&self, svg: &mut Svg, up: [f64; 2]) {
        let counts = self.counts();
        let most = counts.iter().copied().max().unwrap_or(0).max(10) as f64;
        let [low, high] = DECADES.map(|decade| libm::pow(10.0, f64::from(decade)));
        let (x, y) = (PlotAxis::log(low, high, ACROSS), PlotAxis::log(0.5, 2.0 * most, up));
        svg.axes(x, y, [Some("late by [ms]"), Some("ticks")]);
        let width = (ACROSS[1] - ACROSS[0]) / counts.len() as f64;
        svg.group(&format!("class=\"bars\" fill=\"{}\"", STYLES[0].0), |svg| {
            for (i, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
                let (left, top) = (ACROSS[0] + i as f64 * width, y.at(*count as f64));
                let height = up[0] - top;
                svg.put(format_args!(
                    "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
                ));
            }
        });
    }

    /// Counts the ticks of each bar.
    fn counts(&self) -> Vec<u64> {
        let mut counts = vec![0; ((DECADES[1] - DECADES[0]) * BARS_PER_DECADE) as usize];
        for [_, by] in &self.ticks {
            let place = (libm::log10(*by) - f64::from(DECADES[0])) * f64::from(BARS_PER_DECADE);
            // What is not late at all is at minus infinity.
            let bar = (place.max(0.0) as usize).min(counts.len() - 1);
            counts[bar] += 1;
        }
        counts
    }

    fn over_time(&self, svg: &mut Svg, up: [f64; 2]) {
        let [first, last] = [self.ticks.first(), self.ticks.last()].map(|tick| tick.map_or(0.0, |[time, _]| *time));
        let x = PlotAxis::linear(first, if last > first { last } else { first + 1.0 }, ACROSS);
        let most = range(self.ticks.iter().map(|[_, by]| *by)).map_or(1.0, |[_, high]| high);
        let y = PlotAxis::linear(0.0, most, up);
        svg.axes(x, y, [Some("time [s]"), Some("late by [ms]")]);
        curve(svg, 0, &self.ticks, [x, y]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(lateness: impl IntoIterator<Item = f64>) -> Lateness {
        Lateness { ticks: lateness.into_iter().enumerate().map(|(i, by)| [i as f64 * 0.004, by]).collect() }
    }

    #[test]
    fn a_run_in_virtual_time_has_no_lateness() {
        assert!(Lateness::default().caption().is_none());
    }

    #[test]
    fn each_tick_is_in_one_bar() {
        let counts = of([0.0, 0.0005, 0.001, 0.0013, 0.099, 0.101, 999.0, 1e6]).counts();
        let filled: Vec<(usize, u64)> = counts.into_iter().enumerate().filter(|(_, count)| *count > 0).collect();
        assert_eq!(filled, [(0, 3), (1, 1), (19, 1), (20, 1), (59, 2)]);
    }

    #[test]
    fn the_parts_are_those_of_the_sorted_ticks() {
        let caption = of((0..=1000).rev().map(|i| f64::from(i) * 0.01)).caption().unwrap();
        assert!(
            caption.contains("5.000 ms at the median, 9.900 ms at 99 %, 9.990 ms at 99.9 %, and 10.000 ms"),
            "{caption}"
        );
    }

    #[test]
    fn a_picture_has_a_bar_for_each_place_and_the_peak() {
        let svg = of([0.01, 0.01, 0.1, 20.0]).picture();
        assert_eq!(svg.matches("<rect").count(), 3, "{svg}");
        assert!(svg.contains("late by [ms]") && svg.contains("time [s]") && !svg.contains("NaN"), "{svg}");
    }
}
