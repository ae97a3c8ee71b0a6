//! The places of the sensors of a mat.

use crate::recordings::common::text::Piece;
use crate::recordings::common::{MAX_CELLS, TextError, units};

/// The corners of the sensors that were read so far.
#[derive(Debug)]
pub(super) struct Corners {
    /// Whether the file has a block of corners.
    pub(super) is_begun: bool,
    /// Factor from the file's unit to metres.
    metres: f64,
    /// Number of lines of x and of y so far.
    lines: [usize; 2],
    /// Minimum and maximum x and y of each sensor.
    bounds: [Vec<[f64; 2]>; 2],
}

impl Default for Corners {
    fn default() -> Self {
        Self { is_begun: false, metres: 0.01, lines: [0; 2], bounds: [vec![], vec![]] }
    }
}

/// A rectangle of cells, and the cell of each sensor.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mat {
    pub(super) rows: usize,
    pub(super) cols: usize,
    /// Distance between the centres of two neighbours along x and along y [m], if there are corners.
    pub(super) pitch: Option<[f64; 2]>,
    /// Index of the cell of each sensor.
    cells: Vec<usize>,
}

/// Maximum distance of a sensor from its place in the grid, and of its size from the mean, as a fraction of the size.
const MAX_MISFIT: f64 = 0.1;

impl Corners {
    /// Reads the unit in `corner[cm]`.
    pub(super) fn unit(&mut self, line: Piece<'_>) -> Result<(), TextError> {
        let inside = line.text.split_once('[').and_then(|(_, rest)| rest.split_once(']')).map(|(inside, _)| inside);
        let metres = units::metres(inside.unwrap_or("cm"));
        self.metres = metres.ok_or_else(|| line.error("the unit of the corners must be `cm` or `mm`"))?;
        self.is_begun = true;
        Ok(())
    }

    /// Adds a line of x (0) or of y (1).
    pub(super) fn add(&mut self, axis: usize, places: &[f64]) {
        self.lines[axis] += 1;
        let bounds = &mut self.bounds[axis];
        bounds.resize(places.len(), [f64::INFINITY, f64::NEG_INFINITY]);
        for ([min, max], place) in bounds.iter_mut().zip(places) {
            *min = min.min(*place);
            *max = max.max(*place);
        }
    }

    /// Returns the rectangle that contains the sensors.
    pub(super) fn mat(&self, sensors: usize) -> Result<Mat, String> {
        if self.lines != [4, 4] {
            let [x, y] = self.lines;
            return Err(format!("a sensor has 4 corners, but there are {x} lines of x and {y} of y: it is truncated"));
        }
        let (width, lefts) = self.places(0, sensors)?;
        let (height, tops) = self.places(1, sensors)?;
        let count = |places: &[usize]| places.iter().max().map_or(0, |last| last + 1);
        let (rows, cols) = (count(&tops), count(&lefts));
        Self::check(rows, cols, sensors)?;
        let cells: Vec<usize> = tops.iter().zip(&lefts).map(|(row, col)| row * cols + col).collect();
        let mut is_taken = vec![false; rows * cols];
        if cells.iter().any(|cell| std::mem::replace(&mut is_taken[*cell], true)) {
            return Err("two sensors have the same place".into());
        }
        Ok(Mat { rows, cols, pitch: Some([width, height]), cells })
    }

    /// Returns the size of the sensors along an axis [m], and the index of each along it.
    fn places(&self, axis: usize, sensors: usize) -> Result<(f64, Vec<usize>), String> {
        let bounds = &self.bounds[axis];
        let size = bounds.iter().map(|[from, to]| to - from).sum::<f64>() / sensors as f64;
        let start = bounds.iter().map(|[from, _]| *from).fold(f64::INFINITY, f64::min);
        if !(size.is_finite() && size > 0.0) {
            return Err("the sensors have no size".into());
        }
        let index = |[from, to]: &[f64; 2]| {
            let place = (from - start) / size;
            let fits = (to - from - size).abs() <= MAX_MISFIT * size && (place - place.round()).abs() <= MAX_MISFIT;
            (fits && place <= 1e6).then_some(place.round() as usize)
        };
        let places: Option<Vec<usize>> = bounds.iter().map(index).collect();
        Ok((size * self.metres, places.ok_or("the sensors do not form rows and columns of one size")?))
    }

    /// Refuses a grid that is much larger than its sensors: even a round mat fills more than half of it.
    fn check(rows: usize, cols: usize, sensors: usize) -> Result<(), String> {
        match rows.checked_mul(cols) {
            Some(cells) if cells <= MAX_CELLS && cells <= 2 * sensors + 16 => Ok(()),
            _ => Err(format!("{sensors} sensors do not fill {rows} rows by {cols} columns")),
        }
    }
}

impl Mat {
    /// Returns a mat of sensors row by row.
    pub(super) fn row_by_row([rows, cols]: [usize; 2], sensors: usize) -> Result<Self, String> {
        if rows.checked_mul(cols) != Some(sensors) {
            return Err(format!("the file has {sensors} sensors, not those of {rows} rows by {cols} columns"));
        }
        Ok(Self { rows, cols, pitch: None, cells: (0..sensors).collect() })
    }

    /// Moves the values of all sensors to their cells, moment by moment.
    pub(super) fn place(&self, values: &[f32]) -> Vec<f32> {
        let tactels = self.rows * self.cols;
        let mut placed = vec![0.0; values.len() / self.cells.len() * tactels];
        for (frame, values) in placed.chunks_mut(tactels).zip(values.chunks(self.cells.len())) {
            for (cell, value) in self.cells.iter().zip(values) {
                frame[*cell] = *value;
            }
        }
        placed
    }

    /// Returns the cells without a sensor.
    pub(super) fn dead(&self) -> Vec<usize> {
        let mut has_sensor = vec![false; self.rows * self.cols];
        self.cells.iter().for_each(|cell| has_sensor[*cell] = true);
        (0..has_sensor.len()).filter(|cell| !has_sensor[*cell]).collect()
    }
}
