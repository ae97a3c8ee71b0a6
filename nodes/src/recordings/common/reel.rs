//! Collects frames, cell by cell, and makes a recording of them.

use tactflow_runtime::signal::{ImageShape, Unit};

use super::hints::Hints;
use super::recording::{Frame, MAX_CELLS, Recording, Window};
use super::refusal::{Refusal, TextError};
use super::text::Piece;

/// The frames that were read so far.
#[derive(Debug)]
pub(crate) struct Reel {
    /// The complete frames.
    pub(crate) frames: Vec<Frame>,
    /// The cells, including those of the incomplete frame.
    pub(crate) cells: Vec<f32>,
    /// x and y of each cell of a pad with three axes.
    pub(crate) drag: Vec<[f32; 2]>,
    /// Index in a frame of the cells that do not exist.
    pub(crate) dead: Vec<usize>,
    /// Number of frames with a time.
    timed: usize,
    /// Messages about a cell that stops to exist, and about one that begins to.
    changes: [&'static str; 2],
}

/// Properties that a file gives.
#[derive(Debug, Default)]
pub(crate) struct Properties {
    /// Number of rows and of columns.
    pub(crate) size: Option<[usize; 2]>,
    /// Unit of the cells, and the factor from the file's unit to it.
    pub(crate) unit: Option<(Unit, f64)>,
    /// Distance between the centres of two neighbours along x and along y [m].
    pub(crate) pitch: Option<[f64; 2]>,
    /// Nominal time between two frames [s]; without it, the mean time counts.
    pub(crate) period: Option<f64>,
    /// Maximum value that is noise, in the unit of the cells.
    pub(crate) threshold: Option<f64>,
    /// Force that another sensor measured, one value a frame [N].
    pub(crate) force: Option<Vec<f64>>,
}

impl Properties {
    /// Returns the factor from the file's unit to that of the cells.
    pub(crate) fn factor(&self) -> f64 {
        self.unit.map_or(1.0, |(_, factor)| factor)
    }
}

impl Default for Reel {
    fn default() -> Self {
        Self::new([
            "this cell is NaN, but it is a number in the first frame",
            "this cell is a number, but it is NaN in the first frame",
        ])
    }
}

impl Reel {
    /// Returns an empty reel with its messages about a cell that stops or begins to exist.
    pub(crate) const fn new(changes: [&'static str; 2]) -> Self {
        Self { frames: Vec::new(), cells: Vec::new(), drag: Vec::new(), dead: Vec::new(), timed: 0, changes }
    }

    /// Adds the next cell. A cell that is NaN in the first frame does not exist, and must be NaN in every frame.
    pub(crate) fn cell(&mut self, value: f64) -> Result<(), &'static str> {
        let index = self.cells.len() - self.start();
        if self.frames.is_empty() {
            self.dead.extend(value.is_nan().then_some(index));
        } else if value.is_nan() != self.dead.binary_search(&index).is_ok() {
            return Err(self.changes[usize::from(!value.is_nan())]);
        }
        let cell = if value.is_nan() { 0.0 } else { value as f32 };
        if !cell.is_finite() {
            return Err("this cell is too large");
        }
        self.cells.push(cell);
        Ok(())
    }

    /// Adds a row of cells.
    pub(crate) fn row<'t>(
        &mut self,
        cells: impl Iterator<Item = Piece<'t>>,
        number: impl Fn(Piece<'t>) -> Result<f64, TextError>,
    ) -> Result<(), TextError> {
        for cell in cells {
            self.cell(number(cell)?).map_err(|message| cell.error(message))?;
        }
        Ok(())
    }

    /// Returns the index of the first cell of the incomplete frame.
    fn start(&self) -> usize {
        self.frames.last().map_or(0, |last| last.start + last.window.cells())
    }

    /// Ends a frame; `time` is its time in the file [ns].
    pub(crate) fn frame(&mut self, number: u64, time: Option<i64>, window: Window) {
        let start = self.start();
        debug_assert!(self.cells.len() >= start + window.cells(), "a frame has all its cells when it ends");
        self.timed += usize::from(time.is_some());
        let time = time.unwrap_or_else(|| self.frames.last().map_or(0, |last| last.time));
        self.frames.push(Frame { number, time, window, start });
    }

    /// Checks that a frame has the number after that of the last.
    pub(crate) fn follows(&self, number: u64, at: Piece<'_>) -> Result<(), TextError> {
        match self.frames.last() {
            Some(last) if last.number.checked_add(1) != Some(number) => {
                Err(at.error(format!("frame {number} comes after frame {}", last.number)))
            }
            _ => Ok(()),
        }
    }

    /// Rounds the time of the next frame [ns], which must not be before the last.
    pub(crate) fn time(&self, nanoseconds: f64, at: Piece<'_>) -> Result<i64, TextError> {
        at.check((0.0..1e18).contains(&nanoseconds), "the frame's time is not from 0 to 1e9 s")?;
        let time = nanoseconds.round() as i64;
        at.check(self.frames.last().is_none_or(|last| last.time <= time), "the time goes back")?;
        Ok(time)
    }

    /// Whether the next frame has a time like all before it, or none like all before it.
    pub(crate) fn is_timed_alike(&self, has_time: bool) -> bool {
        self.frames.is_empty() || (self.timed > 0) == has_time
    }

    /// Returns the mean time between two frames [s], or `None` without times.
    pub(crate) fn mean_step(&self) -> Option<f64> {
        match &*self.frames {
            [first, .., last] if self.timed > 1 && last.time > first.time => {
                Some((last.time - first.time) as f64 * 1e-9 / (self.timed - 1) as f64)
            }
            _ => None,
        }
    }

    /// Forgets the times if they are rounded until two are equal.
    pub(crate) fn forget_equal_times(&mut self) {
        if !self.frames.is_sorted_by(|a, b| a.time < b.time) {
            self.timed = 0;
        }
    }

    /// Returns the recording. Its first frame is at 0; frames without times come at the nominal rate.
    pub(crate) fn finish(
        mut self,
        format: &'static str,
        found: Properties,
        hints: &Hints,
    ) -> Result<Recording, Refusal> {
        let [rows, cols] = hints.size(found.size)?;
        let period = found.period.or_else(|| self.mean_step());
        let (unit, pitch, period) = hints.complete(found.unit.map(|(unit, _)| unit), found.pitch, period)?;
        let has_times = self.timed == self.frames.len();
        let start = self.frames.first().map_or(0, |first| first.time);
        for (i, frame) in self.frames.iter_mut().enumerate() {
            frame.time = if has_times { frame.time - start } else { (i as f64 * period * 1e9).round() as i64 };
        }
        let (Self { frames, cells, drag, dead, .. }, Properties { threshold, force, .. }) = (self, found);
        let shape = ImageShape { rows, cols, pitch, unit };
        Ok(Recording { format, shape, frames, cells, drag, dead, threshold, period, force })
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
