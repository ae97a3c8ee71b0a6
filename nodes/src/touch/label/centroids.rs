//! The centroids of regions.

use tactflow_runtime::signal::{Grid, Region, Run};

/// Returns a buffer for the centroids of all regions that an array can have.
#[must_use]
pub fn centroid_buffer(grid: &Grid) -> Vec<[f64; 2]> {
    vec![[0.0; 2]; grid.rows * grid.cols.div_ceil(2)]
}

/// Returns the centroid of each region, the mean position of its tactels, along x and y from the middle of the pad [m].
///
/// # Panics
/// If the buffer is shorter than the list of regions.
pub fn centroids<'b>(grid: &Grid, runs: &[Run], regions: &[Region], buffer: &'b mut [[f64; 2]]) -> &'b [[f64; 2]] {
    let centroids = &mut buffer[..regions.len()];
    centroids.fill([0.0; 2]);
    for run in runs {
        let [x, y] = &mut centroids[usize::from(run.region)];
        let (start, end) = (f64::from(run.start), f64::from(run.end));
        *x += 0.5 * (start + end - 1.0) * (end - start);
        *y += f64::from(run.row) * (end - start);
    }
    for ([x, y], region) in centroids.iter_mut().zip(regions) {
        let area = f64::from(region.area);
        *x = (*x / area - 0.5 * (grid.cols as f64 - 1.0)) * grid.pitch[0];
        *y = (*y / area - 0.5 * (grid.rows as f64 - 1.0)) * grid.pitch[1];
    }
    centroids
}
