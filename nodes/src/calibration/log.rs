//! The log that a calibration is made from: frames of a pad, each with a reference force.

use tactflow_runtime::signal::Unit;

use crate::recordings::Recording;

/// A log of presses.
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Unit of the readings.
    pub unit: Unit,
    /// Reference force of each frame [N].
    pub force: Vec<f64>,
    /// Readings of all frames, frame by frame and row by row.
    pub cells: Vec<f32>,
    /// Indices of the tactels that do not exist.
    pub absent: Vec<usize>,
}

/// Maximum force of an unloaded frame, as a fraction of the maximum force.
pub const MAX_UNLOADED: f64 = 0.01;

/// Minimum number of unloaded frames for the zero of a tactel.
const MIN_UNLOADED_FRAMES: usize = 3;

impl Log {
    /// Makes a log from a recording.
    ///
    /// # Errors
    /// What is missing.
    pub fn new(recording: &Recording) -> Result<Self, String> {
        let Some(force) = recording.force.clone() else {
            let what = match recording.format {
                "mcap" => "name the port that measured it, as `--force truth.force`",
                _ => "add a column (or array) `force` [N] with one value a frame",
            };
            return Err(format!("it has no reference force: {what}"));
        };
        let shape = &recording.shape;
        let mut cells = vec![0.0; shape.tactels() * recording.frames.len()];
        for (i, image) in cells.chunks_exact_mut(shape.tactels()).enumerate() {
            recording.show(i, image);
        }
        let absent = recording.dead.clone();
        let log = Self { rows: shape.rows, cols: shape.cols, unit: shape.unit, force, cells, absent };
        log.check()?;
        Ok(log)
    }

    /// Checks whether it can be used.
    ///
    /// # Errors
    /// What is missing.
    pub fn check(&self) -> Result<(), String> {
        if let Some(i) = self.force.iter().position(|force| !force.is_finite()) {
            return Err(format!("the force of frame {} is not a finite number", i + 1));
        }
        let (max, min) = self.force.iter().fold((0.0, 0.0), |(max, min), force| (force.max(max), force.min(min)));
        if max <= 0.0 || -min > 0.5 * max {
            let range = format!("from {min} N to {max} N");
            return Err(format!(
                "its force is {range}, but a press must have a positive force: check the sign of `force`"
            ));
        }
        let unloaded = (0..self.frames()).filter(|i| self.is_unloaded(*i, max)).count();
        if unloaded < MIN_UNLOADED_FRAMES {
            let percent = 100.0 * MAX_UNLOADED;
            return Err(format!(
                "only {unloaded} of its frames are unloaded (below {percent} % of {max} N), but they define the zero of each \
                 tactel: record at least one second before the first press"
            ));
        }
        Ok(())
    }

    /// Returns the number of tactels.
    #[must_use]
    pub const fn tactels(&self) -> usize {
        self.rows * self.cols
    }

    /// Returns the number of frames.
    #[must_use]
    pub const fn frames(&self) -> usize {
        self.force.len()
    }

    /// Whether frame `i` is unloaded; `most` is the maximum force of all logs [N].
    #[must_use]
    pub fn is_unloaded(&self, i: usize, most: f64) -> bool {
        self.force[i] < MAX_UNLOADED * most
    }

    /// Returns the reading of a tactel in a frame.
    #[must_use]
    pub fn reading(&self, frame: usize, tactel: usize) -> f32 {
        self.cells[frame * self.tactels() + tactel]
    }

    /// Returns for each frame whether the force rises. A reversal of less than `step` [N] is ignored.
    #[must_use]
    pub fn is_loading(&self, step: f64) -> Vec<bool> {
        let mut is_loading = vec![true; self.frames()];
        let (mut is_rising, mut turn) = (true, 0);
        for i in 1..self.frames() {
            let change = self.force[i] - self.force[turn];
            let onward = if is_rising { change } else { -change };
            if onward >= 0.0 {
                turn = i;
            } else if onward < -step {
                // The force turned at the last extreme.
                is_rising = !is_rising;
                is_loading[turn + 1..i].fill(is_rising);
                turn = i;
            }
            is_loading[i] = is_rising;
        }
        is_loading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(force: &[f64]) -> Log {
        Log { rows: 1, cols: 1, unit: Unit::RAW, force: force.to_vec(), cells: vec![0.0; force.len()], absent: vec![] }
    }

    #[test]
    fn a_rise_ends_where_the_fall_begins_and_noise_turns_nothing() {
        let cases: [(&[f64], &str); 5] = [
            (&[0.0, 1.0, 2.0, 1.0, 0.0], "uuudd"),
            (&[0.0, 1.0, 0.9, 2.0, 1.95, 2.0, 1.0, 0.0, 0.1, 1.0], "uuuuuudduu"),
            (&[0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0], "uuuuuddu"),
            (&[2.0, 1.0, 0.0], "udd"),
            (&[0.0], "u"),
        ];
        for (force, expected) in cases {
            let shown: String = log(force).is_loading(0.3).iter().map(|up| if *up { 'u' } else { 'd' }).collect();
            assert_eq!(shown, expected, "{force:?}");
        }
    }

    #[test]
    fn the_mistake_of_a_bad_log_is_described() {
        assert_eq!(log(&[0.0, 0.0, 0.0, 1.0, 5.0, 0.0]).check(), Ok(()));
        let cases = [
            (log(&[0.0; 9]), "its force is from 0 N to 0 N"),
            (log(&[0.0, 0.0, 0.0, -5.0]), "its force is from -5 N to 0 N"),
            (log(&[0.0, 0.0, f64::NAN]), "the force of frame 3 is not a finite number"),
            (log(&[0.0, 0.0, 1.0]), "only 2 of its frames are unloaded (below 1 % of 1 N)"),
        ];
        for (log, message) in cases {
            assert!(log.check().unwrap_err().starts_with(message), "{message}: {:?}", log.check());
        }
    }
}
