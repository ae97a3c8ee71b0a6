//! `run --svg`: the strongest image of a run beside its curves, as a still picture.

mod image;
mod layout;
mod panel;

use std::io;

use image::{draw_image, image_size};
use layout::{CHARACTER, CURVES, LINE, TOP, WIDTH};
use panel::panels;

use crate::cli::text::number::{is_flat, seconds};
use crate::cli::text::svg::{INK, PlotAxis, Svg};
use crate::cli::view::RunView;
use crate::engine::{Engine, ModeChange};
use crate::record::{OutputFile, write_whole};

/// Maximum number of bins of a curve, several for each column of pixels.
const MAX_BINS: usize = 4096;

/// Collects a still picture of a run and writes it at the end.
pub(crate) struct Still {
    title: String,
    view: RunView,
}

impl Still {
    /// Creates a picture.
    ///
    /// # Errors
    /// If the graph shows nothing.
    pub(crate) fn new(title: &str, engine: &Engine) -> Result<Self, String> {
        let view = RunView::new(engine, MAX_BINS);
        if view.images.is_empty() && view.curves.is_empty() {
            return Err(
                "`--svg` draws the ports that the graph shows: add `show = [\"node.port\"]` under [graph]".into()
            );
        }
        Ok(Self { title: title.to_owned(), view })
    }

    /// Adds the last tick of the engine.
    pub(crate) fn add(&mut self, engine: &Engine) {
        self.view.add(engine);
    }

    /// Returns the picture as a document.
    pub(crate) fn text(&self, engine: &Engine) -> String {
        draw(&self.title, &self.view, &engine.changes())
    }

    /// Writes the picture to `file`. Waits while `goes_on` returns true for the number of bytes that have been written.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn finish(self, engine: &Engine, file: OutputFile, goes_on: impl FnMut(u64) -> bool) -> io::Result<()> {
        write_whole(file, self.text(engine).into_bytes(), goes_on)
    }
}

/// Draws the picture.
fn draw(title: &str, view: &RunView, changes: &[ModeChange]) -> String {
    let panels = panels(view);
    let bottom = panels.last().map_or(TOP, |panel| panel.bottom);
    let image = view.images.first();
    let height = bottom.max(image.map_or(0.0, |image| TOP + image_size(&image.shape)[1] + LINE)) + 3.0 * LINE;
    let mut svg = Svg::new([WIDTH, height], title);
    if let Some(image) = image {
        draw_image(&mut svg, image);
    }
    let Some([from, to]) = view.span().filter(|_| !panels.is_empty()) else { return svg.finish() };
    let to = if is_flat(from, to) { from + 1.0 } else { to };
    let time = PlotAxis::linear(from, to, CURVES);
    draw_modes(&mut svg, time, changes, bottom);
    for (i, panel) in panels.iter().enumerate() {
        let is_last = i + 1 == panels.len();
        panel.draw(&mut svg, time, view.times.bins(), is_last.then_some("time [s]"));
    }
    svg.finish()
}

/// Draws a line at each change of the mode, and the names of the modes where they do not overlap.
fn draw_modes(svg: &mut Svg, time: PlotAxis, changes: &[ModeChange], bottom: f64) {
    let mut lines: Vec<f64> = Vec::new();
    let mut ends = [f64::NEG_INFINITY; 2];
    svg.group(&format!("class=\"modes\" stroke=\"{INK}\" stroke-dasharray=\"2 3\""), |svg| {
        for change in changes {
            let x = time.at(seconds(change.time));
            // Lines in one column of pixels look like one.
            if lines.last().is_none_or(|last| x - last >= 1.0) {
                lines.push(x);
                svg.put(format_args!("<path d=\"M{x:.1} {}V{bottom}\"/>", TOP - LINE));
            }
        }
    });
    for change in changes {
        let x = time.at(seconds(change.time));
        let end = x + (change.mode.chars().count() + 1) as f64 * CHARACTER;
        if let Some(row) = ends.iter().position(|taken| *taken <= x) {
            ends[row] = end;
            svg.text([x, TOP - LINE - 4.0 - LINE * 0.8 * row as f64], "start", &change.mode);
        }
    }
}
