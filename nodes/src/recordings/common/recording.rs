//! A recording: frames of a pad in memory.

use tactflow_runtime::signal::ImageShape;

/// Maximum number of cells of an array.
pub const MAX_CELLS: usize = 1 << 18;

/// A recording of a pad, frame by frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Name of its format.
    pub format: &'static str,
    /// Size, pitch and unit of the whole array.
    pub shape: ImageShape,
    /// The frames, in order.
    pub frames: Vec<Frame>,
    /// The windows of all frames, one after the other, row after row.
    pub cells: Vec<f32>,
    /// Of a pad with three axes: x and y of each of those cells, which are z. Empty for a pad with one axis.
    pub drag: Vec<[f32; 2]>,
    /// Index in the whole array of each cell that does not exist, in order.
    pub dead: Vec<usize>,
    /// Maximum value that the sensor's own filter treats as noise, in the unit of the cells.
    pub threshold: Option<f64>,
    /// Nominal time between two frames [s].
    pub period: f64,
    /// Force that another sensor measured, one value a frame [N].
    pub force: Option<Vec<f64>>,
}

/// One frame of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Number in the file.
    pub number: u64,
    /// Time from the start of the recording [ns].
    pub time: i64,
    /// The part of the array that the file holds; all cells outside are 0.
    pub window: Window,
    /// Index of the first cell among the cells of the recording.
    pub start: usize,
}

/// A rectangle of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Window {
    /// First row.
    pub top: u32,
    /// First column.
    pub left: u32,
    /// Number of rows.
    pub rows: u32,
    /// Number of columns.
    pub cols: u32,
}

impl Window {
    /// Returns the window of a whole array. Its sides fit into 32 bits because the file holds its cells.
    #[must_use]
    pub fn whole(rows: usize, cols: usize) -> Self {
        let side = |count: usize| u32::try_from(count).expect("a side is not longer than its file");
        Self { top: 0, left: 0, rows: side(rows), cols: side(cols) }
    }

    /// Returns the number of cells.
    #[must_use]
    pub const fn cells(&self) -> usize {
        self.rows as usize * self.cols as usize
    }
}

impl Recording {
    /// Writes frame `index` to the cells of an image of the whole array, with zeros outside its window.
    ///
    /// # Panics
    /// If there is no such frame, or the image is smaller than the array.
    pub fn show(&self, index: usize, image: &mut [f32]) {
        let Frame { window, start, .. } = self.frames[index];
        image.fill(0.0);
        let cols = window.cols as usize;
        for row in 0..window.rows as usize {
            let to = (window.top as usize + row) * self.shape.cols + window.left as usize;
            image[to..to + cols].copy_from_slice(&self.cells[start + row * cols..][..cols]);
        }
    }

    /// Writes frame `index` of a pad with three axes to the cells of a vector image of the whole array, with zeros outside
    /// its window.
    ///
    /// # Panics
    /// If there is no such frame, the pad has one axis, or the image is smaller than the array.
    pub fn show_vectors(&self, index: usize, image: &mut [[f32; 3]]) {
        let Frame { window, start, .. } = self.frames[index];
        image.fill([0.0; 3]);
        for cell in 0..window.cells() {
            let (row, col) = (cell / window.cols as usize, cell % window.cols as usize);
            let [x, y] = self.drag[start + cell];
            let at = (window.top as usize + row) * self.shape.cols + window.left as usize + col;
            image[at] = [x, y, self.cells[start + cell]];
        }
    }

    /// Whether frames, cells, dead cells and times are consistent. Every reader guarantees this.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let ImageShape { rows, cols, pitch, .. } = self.shape;
        let mut next = 0;
        let frames_fit = self.frames.iter().all(|frame| {
            let Window { top, left, rows: high, cols: wide } = frame.window;
            let fits = top as usize + high as usize <= rows && left as usize + wide as usize <= cols;
            let follows = frame.start == next;
            next += frame.window.cells();
            fits && follows
        });
        frames_fit
            && next == self.cells.len()
            && !self.frames.is_empty()
            && self.frames.is_sorted_by_key(|frame| frame.time)
            && self.cells.iter().all(|cell| cell.is_finite())
            && (self.drag.is_empty() || self.drag.len() == next)
            && self.drag.as_flattened().iter().all(|value| value.is_finite())
            && self.dead.is_sorted_by(|a, b| a < b)
            && self.dead.last().is_none_or(|last| *last < self.shape.tactels())
            && self.period > 0.0
            && pitch.iter().all(|pitch| pitch.is_finite() && *pitch > 0.0)
            && self.force.as_ref().is_none_or(|force| force.len() == self.frames.len())
    }
}
