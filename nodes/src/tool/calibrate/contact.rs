//! The one place at which a pad is pressed.

use tactflow_runtime::signal::{Image, ImageShape, Mask};

use crate::touch::label::{number, trace};
use crate::touch::moments::Weighing;

/// Standard deviations of a tactel above its unloaded mean from which on it is pressed.
const MIN_DEVIATIONS: f64 = 5.0;
/// Part of the strongest tactel from which on another one belongs to the contact.
const MIN_PART: f64 = 0.1;
/// Number of rows and columns from which on a contact at the edge is refused.
const MIN_EDGE: usize = 4;

/// What a pad reads without a load.
pub(super) struct Unloaded {
    pub(super) shape: ImageShape,
    /// Mean of each tactel, row by row.
    pub(super) means: Vec<f64>,
    /// Standard deviation of each tactel.
    pub(super) deviations: Vec<f64>,
}

/// The centre of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contact {
    /// Centre of gravity along x and y from the middle of the pad, as the node `moments` computes it [m].
    pub(super) place: [f64; 2],
    /// Number of its tactels.
    pub(super) tactels: usize,
}

impl Unloaded {
    /// Returns the contact in an image that was averaged as the unloaded one, row by row.
    ///
    /// # Errors
    /// If nothing is pressed, if the pad is pressed at several places, or at its edge.
    pub(super) fn contact(&self, means: &[f64]) -> Result<Contact, String> {
        let load: Vec<f64> = means.iter().zip(&self.means).map(|(loaded, unloaded)| loaded - unloaded).collect();
        let noise = self.deviations.iter().copied().fold(0.0, f64::max);
        let (strongest, peak) = load.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0));
        if peak <= 0.0 || peak < MIN_DEVIATIONS * noise {
            return Err("nothing is pressed: let the point press a little more".into());
        }
        let threshold = (MIN_PART * peak).max(MIN_DEVIATIONS * noise);
        let ImageShape { rows, cols, .. } = self.shape;
        let mut mask = Mask::empty(rows, cols);
        (0..load.len()).filter(|i| load[*i] >= threshold).for_each(|i| mask.insert(i / cols, i % cols));
        let cells: Vec<f32> = load.iter().map(|load| *load as f32).collect();
        let image = Image::from_cells(cols, &cells);
        let (mut runs, mut regions) = (Vec::new(), Vec::new());
        trace(&mask, 1, &mut runs);
        number(&image, &mut runs, &mut regions);
        if regions.len() != 1 {
            let count = regions.len();
            return Err(format!("the pad is pressed at {count} places: touch the point with one place only"));
        }
        let is_at_end = |index: usize, count: usize| count >= MIN_EDGE && (index == 0 || index + 1 == count);
        if is_at_end(strongest / cols, rows) || is_at_end(strongest % cols, cols) {
            return Err(
                "the contact is at the edge of the pad, so its centre is unknown: touch it further inside".into()
            );
        }
        // With the excess, a tactel at the rim of the contact enters with nothing.
        let sums = Weighing::Excess(threshold).add_up(&image, &mask);
        let place = sums.centre(&self.shape).ok_or("nothing is pressed: let the point press a little more")?;
        Ok(Contact { place, tactels: mask.count() })
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::Unit;

    use super::*;

    const ROWS: usize = 8;
    const COLS: usize = 10;

    fn pad(noise: f64) -> Unloaded {
        let shape = ImageShape { rows: ROWS, cols: COLS, pitch: [0.004, 0.005], unit: Unit::RAW };
        Unloaded { shape, means: vec![20.0; ROWS * COLS], deviations: vec![noise; ROWS * COLS] }
    }

    /// The readings under prints that fade as a Gaussian around rows and columns.
    fn pressed(prints: &[[f64; 2]]) -> Vec<f64> {
        let load = |i: usize| -> f64 {
            let (row, col) = ((i / COLS) as f64, (i % COLS) as f64);
            prints.iter().map(|[r, c]| 100.0 * libm::exp(-((row - r).powi(2) + (col - c).powi(2)) / 2.0)).sum()
        };
        (0..ROWS * COLS).map(|i| 20.0 + load(i)).collect()
    }

    #[test]
    fn the_centre_of_a_print_is_found() {
        for [row, col] in [[3.0, 4.0], [2.3, 5.6], [4.5, 3.5]] {
            let found = pad(0.5).contact(&pressed(&[[row, col]])).expect("one print");
            let wanted = [(col - 4.5) * 0.004, (row - 3.5) * 0.005];
            let off = (0..2).map(|i| (found.place[i] - wanted[i]).abs()).fold(0.0, f64::max);
            assert!(off < 0.0003 && found.tactels > 5, "{found:?} {wanted:?}");
        }
    }

    #[test]
    fn no_print_two_prints_and_one_at_the_edge_are_refused() {
        let cases: [(&[[f64; 2]], f64, &str); 4] = [
            (&[], 0.5, "nothing is pressed"),
            (&[[3.0, 4.0]], 30.0, "nothing is pressed"),
            (&[[1.5, 1.5], [6.0, 8.0]], 0.5, "the pad is pressed at 2 places"),
            (&[[0.0, 4.0]], 0.5, "the contact is at the edge"),
        ];
        for (prints, noise, text) in cases {
            let message = pad(noise).contact(&pressed(prints)).expect_err(text);
            assert!(message.starts_with(text), "{message}");
        }
    }
}
