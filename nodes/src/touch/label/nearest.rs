//! Where regions are, and which is nearest to a place.

use tactflow_runtime::signal::{Grid, Region, Run};

/// The first of the regions that are large and strong enough whose middle is nearest to `place` [m].
#[must_use]
pub fn nearest(
    regions: &[Region],
    middles: &[[f64; 2]],
    place: [f64; 2],
    min_area: usize,
    min_force: f64,
) -> Option<usize> {
    let (mut nearest, mut least) = (None, f64::INFINITY);
    for (i, (region, middle)) in regions.iter().zip(middles).enumerate() {
        let away = away(*middle, place);
        if away < least && region.area as usize >= min_area && region.force >= min_force {
            (nearest, least) = (Some(i), away);
        }
    }
    nearest
}

/// Square of the distance between two places [m²].
#[must_use]
pub fn away(a: [f64; 2], b: [f64; 2]) -> f64 {
    let [x, y] = [a[0] - b[0], a[1] - b[1]];
    x * x + y * y
}

/// Room for the middle of every region that an array can have.
#[must_use]
pub fn middles_of(grid: &Grid) -> Vec<[f64; 2]> {
    vec![[0.0; 2]; grid.rows * grid.cols.div_ceil(2)]
}

/// The middle of each region, the mean place of its tactels, along x and y from the pad's middle [m].
pub fn middles<'m>(grid: &Grid, runs: &[Run], regions: &[Region], room: &'m mut [[f64; 2]]) -> &'m [[f64; 2]] {
    let middles = &mut room[..regions.len()];
    middles.fill([0.0; 2]);
    for run in runs {
        let [x, y] = &mut middles[usize::from(run.region)];
        let (start, end) = (f64::from(run.start), f64::from(run.end));
        *x += 0.5 * (start + end - 1.0) * (end - start);
        *y += f64::from(run.row) * (end - start);
    }
    for ([x, y], region) in middles.iter_mut().zip(regions) {
        let area = f64::from(region.area);
        *x = (*x / area - 0.5 * (grid.cols as f64 - 1.0)) * grid.pitch[0];
        *y = (*y / area - 0.5 * (grid.rows as f64 - 1.0)) * grid.pitch[1];
    }
    middles
}
