//! The choice of a region: the largest, the nearest to a position, or that of a rank.

use tactflow_runtime::signal::Region;

/// Returns the largest region with at least `min_area` tactels and `min_force`, the first one of equals.
#[must_use]
pub fn contact(regions: &[Region], min_area: usize, min_force: f64) -> Option<usize> {
    let mut largest = None;
    let mut area = 0;
    for (i, region) in regions.iter().enumerate() {
        if region.area > area && region.area as usize >= min_area && region.force >= min_force {
            (largest, area) = (Some(i), region.area);
        }
    }
    largest
}

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
    let (mut nearest, mut smallest) = (None, f64::INFINITY);
    for (i, (region, centroid)) in regions.iter().zip(centroids).enumerate() {
        let distance = distance_squared(*centroid, position);
        if distance < smallest && region.area as usize >= min_area && region.force >= min_force {
            (nearest, smallest) = (Some(i), distance);
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

/// Returns the entry of a `rank` from 1 in ascending order of the key, where equals keep their order.
pub fn ranked(rank: usize, entries: impl Iterator<Item = usize> + Clone, key: impl Fn(usize) -> f64) -> Option<usize> {
    let mut last: Option<(f64, usize)> = None;
    for _ in 0..rank {
        let entries = entries.clone().map(|i| (key(i), i));
        let rest = entries.filter(|entry| last.is_none_or(|last| *entry > last));
        last = Some(rest.reduce(|first, entry| if entry < first { entry } else { first })?);
    }
    last.map(|(_, i)| i)
}
