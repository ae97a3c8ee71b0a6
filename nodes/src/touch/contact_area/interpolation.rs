//! The area of a contact between the tactels: cubic convolution (R. Keys, "Cubic convolution interpolation for digital
//! image processing", 1981), compared with the threshold at four by four points a tactel.
//!
//! A tactel that lies in the region with all its neighbours counts whole. Beyond the rim of the pad the image continues
//! as it is there, so a contact that covers the pad has the area of the pad.

use tactflow_runtime::signal::{Image, Mask};

/// Points along a tactel's side at which the interpolated image is compared with the threshold.
const POINTS: usize = 4;
/// Tactels along a row that have a weight at any of those points.
const TAPS: usize = 5;

/// Weights of a tactel and its neighbours at each point along its side.
const WEIGHTS: [[f64; TAPS]; POINTS] = weights();

const fn weights() -> [[f64; TAPS]; POINTS] {
    let mut weights = [[0.0; TAPS]; POINTS];
    let mut point = 0;
    while point < POINTS {
        let place = (point as f64 + 0.5) / POINTS as f64 - 0.5;
        let mut tap = 0;
        while tap < TAPS {
            weights[point][tap] = cubic((place - (tap as f64 - 2.0)).abs());
            tap += 1;
        }
        point += 1;
    }
    weights
}

/// Returns the weight of a tactel at a distance in tactels (R. Keys 1981, a = -1/2).
const fn cubic(distance: f64) -> f64 {
    if distance < 1.0 {
        (1.5 * distance - 2.5) * distance * distance + 1.0
    } else if distance < 2.0 {
        ((-0.5 * distance + 2.5) * distance - 4.0) * distance + 2.0
    } else {
        0.0
    }
}

/// Returns the area where the interpolated image is above the threshold, in and next to the region [tactels].
pub(super) fn interpolated(image: &Image, region: &Mask, threshold: f64) -> f64 {
    let (rows, cols) = (image.rows(), image.cols());
    let [top, bottom, left, right] = bounds(region);
    let mut points = 0;
    for i in top.saturating_sub(1)..(bottom + 1).min(rows) {
        for j in left.saturating_sub(1)..(right + 1).min(cols) {
            points += match neighbours(region, i, j) {
                0 => 0,
                9 => POINTS * POINTS,
                _ => points_above(image, region, threshold, i, j),
            };
        }
    }
    points as f64 / (POINTS * POINTS) as f64
}

/// Returns the first row of the region, the row after its last, its first column, and the column after its last; the
/// ranges of an empty region are empty.
fn bounds(region: &Mask) -> [usize; 4] {
    let [mut top, mut bottom, mut left, mut right] = [usize::MAX, 0, usize::MAX, 0];
    for i in 0..region.rows() {
        for (k, word) in region.row(i).iter().enumerate().filter(|(_, word)| **word != 0) {
            (top, bottom) = (top.min(i), i + 1);
            left = left.min(64 * k + word.trailing_zeros() as usize);
            right = right.max(64 * (k + 1) - word.leading_zeros() as usize);
        }
    }
    [top, bottom, left, right]
}

/// Returns how many of a tactel and its eight neighbours are in the region. Beyond the rim of the pad the region
/// continues.
fn neighbours(region: &Mask, i: usize, j: usize) -> usize {
    let (last_row, last_col) = (region.rows() - 1, region.cols() - 1);
    let rows = [i.saturating_sub(1), i, (i + 1).min(last_row)];
    let cols = [j.saturating_sub(1), j, (j + 1).min(last_col)];
    rows.into_iter().map(|i| cols.into_iter().filter(|j| region.contains(i, *j)).count()).sum()
}

/// Returns at how many points of a tactel the interpolated image is above the threshold.
fn points_above(image: &Image, region: &Mask, threshold: f64, i: usize, j: usize) -> usize {
    let at = |k: usize, tap: usize, all: usize| (k + tap).saturating_sub(2).min(all - 1);
    // A tactel of another region does not count here: its value is cut off at the threshold.
    let value = |i: usize, j: usize| {
        let value = f64::from(image.row(i)[j]) - threshold;
        if region.contains(i, j) { value } else { value.min(0.0) }
    };
    let mut columns = [[0.0; TAPS]; POINTS];
    for tap in 0..TAPS {
        for col in 0..TAPS {
            let value = value(at(i, tap, image.rows()), at(j, col, image.cols()));
            for (column, weights) in columns.iter_mut().zip(&WEIGHTS) {
                column[col] += weights[tap] * value;
            }
        }
    }
    let dot = |a: &[f64; TAPS], b: &[f64; TAPS]| a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b);
    columns.iter().map(|column| WEIGHTS.iter().filter(|weights| dot(column, weights) > 0.0).count()).sum()
}
