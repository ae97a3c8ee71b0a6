//! The connected regions of a mask, as runs of tactels in its rows.
//!
//! A row is a few words of bits. Adding the lowest set bit carries through the lowest run of ones, which isolates a run
//! in four operations; runs that touch in neighbouring rows are joined by union-find. A parent is never after its
//! child, so one pass in raster order numbers the regions, and the field for the number of the region holds the parent
//! until then.

use std::ops::Range;

use tactflow_runtime::signal::{Grid, Image, Mask, Region, Run};

/// Returns whether 16 bits can number every run and every region of an array.
pub(super) fn is_countable(grid: &Grid) -> bool {
    grid.rows.max(grid.cols) <= 65535 && grid.rows * grid.cols.div_ceil(2) <= 65535
}

/// Lists the runs of a mask in raster order. `reach` is how many columns beyond its ends a run touches runs of the next
/// row: 0 if neighbours have a common edge, 1 if a common corner is enough.
///
/// Until [`number`], the `region` of each run is its parent among the runs: itself, or one before it.
pub fn trace(mask: &Mask, reach: u32, runs: &mut Vec<Run>) {
    runs.clear();
    let mut above = 0..0;
    for i in 0..mask.rows() {
        let first = runs.len();
        cut(mask.row(i), i as u16, runs);
        if !above.is_empty() {
            join(runs, above, first, reach);
        }
        above = first..runs.len();
    }
}

/// Appends the runs of a row.
fn cut(words: &[u64], row: u16, runs: &mut Vec<Run>) {
    for (k, word) in words.iter().enumerate() {
        let mut rest = *word;
        while rest != 0 {
            let low = rest & rest.wrapping_neg();
            let run = rest & !rest.wrapping_add(low);
            let start = (64 * k as u32 + low.trailing_zeros()) as u16;
            let end = start + run.count_ones() as u16;
            rest ^= run;
            match runs.last_mut() {
                // A run across the border of two words.
                Some(last) if k > 0 && last.row == row && last.end == start => last.end = end,
                _ => runs.push(Run { row, start, end, region: runs.len() as u16 }),
            }
        }
    }
}

/// Joins the runs from `first` on with the runs of the row above that they touch.
fn join(runs: &mut [Run], above: Range<usize>, first: usize, reach: u32) {
    let mut left = above.start;
    for id in first..runs.len() {
        let (start, end) = (u32::from(runs[id].start), u32::from(runs[id].end));
        while left < above.end && u32::from(runs[left].end) + reach <= start {
            left += 1;
        }
        let mut other = left;
        while other < above.end && u32::from(runs[other].start) < end + reach {
            let (a, b) = (root(runs, other), root(runs, id));
            runs[a.max(b)].region = a.min(b) as u16;
            other += 1;
        }
    }
}

/// Returns the first run of a run's tree, and halves the path to it.
fn root(runs: &mut [Run], mut id: usize) -> usize {
    loop {
        let parent = usize::from(runs[id].region);
        if parent == id {
            return id;
        }
        let grandparent = runs[parent].region;
        runs[id].region = grandparent;
        id = usize::from(grandparent);
    }
}

/// Numbers the regions in the order of their first runs, and adds up their areas and forces in raster order.
///
/// The runs are those of [`trace`]; afterwards the `region` of each is the number of its region.
pub fn number(image: &Image, runs: &mut [Run], regions: &mut Vec<Region>) {
    regions.clear();
    for id in 0..runs.len() {
        let Run { row, start, end, region: parent } = runs[id];
        if usize::from(parent) == id {
            runs[id].region = regions.len() as u16;
            regions.push(Region::default());
        } else {
            runs[id].region = runs[usize::from(parent)].region;
        }
        let values = &image.row(row.into())[usize::from(start)..usize::from(end)];
        let region = &mut regions[usize::from(runs[id].region)];
        region.area += u32::from(end - start);
        region.force += values.iter().fold(0.0, |sum, value| sum + f64::from(*value));
    }
}

/// Sets the mask to the tactels of one region.
pub fn paint(runs: &[Run], region: usize, mask: &mut Mask) {
    mask.clear();
    let stride = mask.stride();
    let words = mask.words_mut();
    for run in runs.iter().filter(|run| usize::from(run.region) == region) {
        let (start, end) = (usize::from(run.start), usize::from(run.end));
        let first = usize::from(run.row) * stride;
        let touched = &mut words[first + start / 64..first + end.div_ceil(64)];
        for (word, at) in touched.iter_mut().zip((start / 64 * 64..).step_by(64)) {
            *word |= (u64::MAX << start.saturating_sub(at)) & (u64::MAX >> (at + 64).saturating_sub(end));
        }
    }
}
