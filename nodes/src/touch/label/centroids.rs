//! The centroids of regions, and the region that is nearest to a position.

use tactflow_runtime::signal::{Grid, Region, Run};

/// Returns the first of the regions with at least `min_area` tactels and `min_force` whose centroid is nearest to
/// `position` [m].
#[must_use]
pub fn nearest(
    regions: &[Region],
    centroids: &[[f64; 2]],
    position: [f64; 2],
    min_area: usize,
    min_force: f64,
) -> Option<usize> {
    let (mut nearest, mut least) = (None, f64::INFINITY);
    for (i, (region, centroid)) in regions.iter().zip(centroids).enumerate() {
        let distance = distance_squared(*centroid, position);
        if distance < least && region.area as usize >= min_area && region.force >= min_force {
            (nearest, least) = (Some(i), distance);
        }
    }
    nearest
}

/// Returns the square of the distance between two positions [m²].
#[must_use]
pub fn distance_squared(a: [f64; 2], b: [f64; 2]) -> f64 {
    let [x, y] = [a[0] - b[0], a[1] - b[1]];
    x * x + y * y
}

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
