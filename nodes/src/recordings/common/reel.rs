//! Collects frames of one size, cell by cell.

use super::recording::{Frame, MAX_CELLS, Window};

/// The frames that were read so far.
#[derive(Debug, Default)]
pub(crate) struct Reel {
    /// The complete frames.
    pub(crate) frames: Vec<Frame>,
    /// The cells, including those of the incomplete frame.
    pub(crate) cells: Vec<f32>,
    /// Index in a frame of the cells that do not exist.
    pub(crate) dead: Vec<usize>,
}

impl Reel {
    /// Adds the next cell; `index` is its index in the frame. A cell that is NaN in the first frame does not exist, and
    /// must be NaN in every frame.
    pub(crate) fn cell(&mut self, index: usize, value: f64) -> Result<(), &'static str> {
        if self.frames.is_empty() {
            if value.is_nan() {
                self.dead.push(index);
            }
        } else if value.is_nan() != self.dead.binary_search(&index).is_ok() {
            return Err(if value.is_nan() {
                "this cell is NaN, but it is a number in the first frame"
            } else {
                "this cell is a number, but it is NaN in the first frame"
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
    pub(crate) fn frame(&mut self, number: u64, time: i64, rows: usize, cols: usize) {
        let window = Window::whole(rows, cols);
        let start = self.frames.len() * window.len();
        debug_assert_eq!(self.cells.len(), start + window.len(), "a frame has all its cells when it ends");
        self.frames.push(Frame { number, time, window, start });
    }

    /// Returns the mean time between two frames [s], or `None` without times.
    pub(crate) fn mean_step(&self) -> Option<f64> {
        match &*self.frames {
            [first, .., last] if last.time > first.time => {
                Some((last.time - first.time) as f64 * 1e-9 / (self.frames.len() - 1) as f64)
            }
            _ => None,
        }
    }

    /// Shifts the times so that the first frame is at 0.
    pub(crate) fn start_at_zero(&mut self) {
        let start = self.frames.first().map_or(0, |first| first.time);
        self.frames.iter_mut().for_each(|frame| frame.time -= start);
    }

    /// Sets the times from the period [s], for a file without times.
    pub(crate) fn tick(&mut self, period: f64) {
        for (i, frame) in self.frames.iter_mut().enumerate() {
            frame.time = (i as f64 * period * 1e9).round() as i64;
        }
    }
}

/// Refuses an empty array and one with more than [`MAX_CELLS`] cells.
pub(crate) fn bounded(rows: usize, cols: usize) -> Result<(), String> {
    match rows.checked_mul(cols) {
        Some(0) => Err("an array needs at least one row and one column".into()),
        Some(1..=MAX_CELLS) => Ok(()),
        _ => Err(format!("an array of {rows} by {cols} has more than {MAX_CELLS} cells")),
    }
}
