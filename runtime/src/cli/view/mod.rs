//! The ports that a graph shows: images, and curves over time.

pub(super) mod images;

use std::fmt::Write;

use crate::cli::text::chart::{chart, time_axis};
use crate::cli::text::number::{number, seconds};
use crate::cli::text::prose::{PageStyle, break_at_semicolons};
use crate::cli::text::series::{Series, SeriesBin};
use crate::engine::{DisplayedPort, Engine};
use crate::record::{PortColumn, PortColumns};
use crate::signal::{Shape, Unit, VectorImageShape};
use images::{ImageHistory, MIN_WIDE_PAGE};

/// Share of the run at its end for which mean and deviation are printed [1].
const TAIL: f64 = 0.2;
/// Time that the curves show while the graph runs [s].
const WINDOW: f64 = 10.0;
/// Width of the title and the numbers beside a curve [characters].
const PANEL_WIDTH: usize = 27;

/// Keeps the values of the ports that a graph shows, in bounded memory.
pub(crate) struct RunView {
    pub(crate) images: Vec<ImageHistory>,
    /// Names of the ports that have curves, as the graph file calls them.
    pub(crate) plotted: Vec<String>,
    columns: PortColumns,
    row: Vec<f64>,
    pub(crate) curves: Vec<ColumnCurve>,
    /// Times of the ticks [s], in the same bins as the curves.
    pub(crate) times: Series,
    /// Times of the last ticks [s], in the same bins as the curves of the last ticks.
    recent_times: Series,
}

/// A column of a port over time.
pub(crate) struct ColumnCurve {
    /// Name of the column; it begins with the name of the port only if several ports have curves.
    pub(crate) name: String,
    /// Full name of the column, as in a recording.
    pub(crate) column: String,
    pub(crate) unit: Unit,
    /// Over the whole run.
    pub(crate) series: Series,
    /// Over the last [`WINDOW`].
    recent: Series,
}

impl RunView {
    /// Creates a view whose curves have at most `bins` bins.
    pub(crate) fn new(engine: &Engine, bins: usize) -> Self {
        let mut images: Vec<ImageHistory> = Vec::new();
        let (mut plotted, mut ports) = (Vec::new(), Vec::new());
        for DisplayedPort { name, port, id, mark } in engine.display() {
            if let Shape::Image(shape) | Shape::VectorImage(VectorImageShape(shape)) = &port.shape {
                images.push(ImageHistory::new(name.clone(), (*id, port.shape.kind()), shape.clone(), *mark));
            } else {
                plotted.push(name.clone());
                ports.push((port.clone(), *id));
            }
        }
        let columns = PortColumns::new(&ports);
        let stride = (WINDOW / seconds(engine.period()) / bins as f64).ceil().max(1.0) as u64;
        let owners = plotted.iter().zip(&ports);
        let owners = owners.flat_map(|(name, (port, _))| vec![name; PortColumns::width(&port.shape)]);
        let curve = |(column, name): (&PortColumn, &String)| ColumnCurve {
            name: match column.part.strip_prefix('.').filter(|_| plotted.len() == 1) {
                Some(part) => part.to_owned(),
                None => format!("{name}{}", column.part),
            },
            column: column.name.clone(),
            unit: column.unit,
            series: Series::with_capacity(bins),
            recent: Series::sliding(bins, stride),
        };
        let curves = columns.list.iter().zip(owners).map(curve).collect();
        let (row, times) = (vec![f64::NAN; columns.list.len()], Series::with_capacity(bins));
        Self { images, plotted, columns, row, curves, times, recent_times: Series::sliding(bins, stride) }
    }

    /// Adds the last tick of the engine.
    pub(crate) fn add(&mut self, engine: &Engine) {
        self.times.add(seconds(engine.now()));
        self.recent_times.add(seconds(engine.now()));
        self.columns.read(engine.bus(), &mut self.row);
        for (curve, value) in self.curves.iter_mut().zip(&self.row) {
            curve.series.add(*value);
            curve.recent.add(*value);
        }
        for image in &mut self.images {
            image.add(engine);
        }
    }

    /// Returns the times of the first and the last tick [s].
    pub(crate) fn span(&self) -> Option<[f64; 2]> {
        span(&self.times)
    }

    /// Draws the images at three moments, and the curves of the whole run.
    pub(crate) fn page(&self, style: PageStyle) -> String {
        let images = self.images.iter().map(|image| image.page(style));
        images.chain(self.draw_curves(style, 6, &self.times, |curve| &curve.series)).collect::<Vec<_>>().join("\n")
    }

    /// Draws the first image at present, and then low curves of the last ten seconds; the most important part comes first.
    pub(crate) fn live(&self, style: PageStyle) -> Vec<String> {
        let image = self.images.first().map(|image| image.now(style));
        image.into_iter().chain(self.draw_curves(style, 3, &self.recent_times, |curve| &curve.recent)).collect()
    }

    /// Draws one series of each curve, at most `max_height` lines high, above an axis of its times.
    fn draw_curves(
        &self,
        style: PageStyle,
        max_height: usize,
        times: &Series,
        series: fn(&ColumnCurve) -> &Series,
    ) -> Option<String> {
        let [first, last] = span(times).filter(|_| !self.curves.is_empty())?;
        let height = match self.curves.len() {
            1 => 6,
            2 => 5,
            3 => 4,
            _ => 3,
        };
        let is_narrow = style.width < MIN_WIDE_PAGE;
        let panel = if is_narrow { 0 } else { PANEL_WIDTH };
        let width = style.width - panel;
        let tail = (last - first) * TAIL;
        let title = format!("{} over time; mean ± deviation of the last {tail:.3} s", self.plotted.join(", "));
        let mut text = break_at_semicolons(&title, style.width) + "\n";
        for (curve, value) in self.curves.iter().zip(&self.row) {
            let (ColumnCurve { name, unit, .. }, series) = (curve, series(curve));
            let lines = chart(series.bins(), width, height.min(max_height));
            let values = final_values(*value, &series.tail(TAIL));
            text.push_str(&captioned(&format!("{name} [{unit}]"), &values, &lines, is_narrow));
        }
        for line in time_axis(width, first, last).lines() {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{:panel$}{line}", "");
        }
        Some(text)
    }
}

/// Returns the first and the last time of a series of times [s].
fn span(times: &Series) -> Option<[f64; 2]> {
    Some([times.bins().first()?.low, times.bins().last()?.high])
}

/// Describes the last value, and mean and deviation at the end.
fn final_values(last: f64, tail: &SeriesBin) -> [String; 2] {
    let last = if last.is_nan() { "absent at the end".to_owned() } else { format!("last {}", number(last)) };
    let mean = match tail.is_present() {
        true => format!("mean {} ± {}", number(tail.mean), number(tail.deviation())),
        false => String::new(),
    };
    [last, mean]
}

/// Puts the title and the numbers on the left of a curve, or above it on a narrow page.
fn captioned(title: &str, values: &[String; 2], lines: &[String], is_narrow: bool) -> String {
    if is_narrow {
        let [last, mean] = values;
        let caption = format!("{title}\n  {last}\n  {mean}");
        return format!("{}\n{}\n", caption.trim_end(), lines.join("\n"));
    }
    // A long title has a line of its own.
    let (mut text, title) = match title.chars().count() < PANEL_WIDTH {
        true => (String::new(), title),
        false => (format!("{title}\n"), ""),
    };
    let panel = [title, &format!("  {}", values[0]), &format!("  {}", values[1])];
    for (line, left) in lines.iter().zip(panel.into_iter().chain(std::iter::repeat(""))) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", format!("{left:PANEL_WIDTH$}{line}").trim_end());
    }
    text
}
