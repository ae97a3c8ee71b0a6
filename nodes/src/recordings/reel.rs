//! Frames of one size that are being read, cell by cell.

use super::{Frame, MOST_CELLS, Window};

/// The frames so far.
#[derive(Debug, Default)]
pub(super) struct Reel {
    /// The frames that are whole.
    pub(super) frames: Vec<Frame>,
    /// The cells, those of the frame that is being read too.
    pub(super) cells: Vec<f32>,
    /// Index in a frame of the cells that do not exist.
    pub(super) dead: Vec<usize>,
}

impl Reel {
    /// Takes the next cell; `index` is its place in the frame. What is no number in the first frame does not exist, and
    /// then it is none in any.
    pub(super) fn cell(&mut self, index: usize, value: f64) -> Result<(), &'static str> {
        if self.frames.is_empty() {
            if value.is_nan() {
                self.dead.push(index);
            }
        } else if value.is_nan() != self.dead.binary_search(&index).is_ok() {
            return Err(if value.is_nan() {
                "this cell is no number, but in the first frame it was one"
            } else {
                "this cell is a number, but in the first frame it was none"
            });
        }
        let cell = if value.is_nan() { 0.0 } else { value as f32 };
        if !cell.is_finite() {
            return Err("this cell is too large");
        }
        self.cells.push(cell);
        Ok(())
    }

    /// Ends a frame of `rows` by `cols` cells.
    pub(super) fn frame(&mut self, number: u64, time: i64, rows: usize, cols: usize) {
        let window = Window::whole(rows, cols);
        let start = self.frames.len() * window.len();
        debug_assert_eq!(self.cells.len(), start + window.len(), "a frame is whole when it ends");
        self.frames.push(Frame { number, time, window, start });
    }

    /// Mean time between two frames [s], if there are times.
    pub(super) fn mean_step(&self) -> Option<f64> {
        match &*self.frames {
            [first, .., last] if last.time > first.time => {
                Some((last.time - first.time) as f64 * 1e-9 / (self.frames.len() - 1) as f64)
            }
            _ => None,
        }
    }

    /// Counts the time from the first frame.
    pub(super) fn start_at_zero(&mut self) {
        let start = self.frames.first().map_or(0, |first| first.time);
        self.frames.iter_mut().for_each(|frame| frame.time -= start);
    }

    /// Takes times from a rate where the file has none.
    pub(super) fn tick(&mut self, period: f64) {
        for (i, frame) in self.frames.iter_mut().enumerate() {
            frame.time = (i as f64 * period * 1e9).round() as i64;
        }
    }
}

/// Refuses an array that is too large.
pub(super) fn bounded(rows: usize, cols: usize) -> Result<(), String> {
    match rows.checked_mul(cols) {
        Some(0) => Err("an array has at least one row and one column".into()),
        Some(1..=MOST_CELLS) => Ok(()),
        _ => Err(format!("an array of {rows} by {cols} is more than the {MOST_CELLS} cells that are read")),
    }
}
