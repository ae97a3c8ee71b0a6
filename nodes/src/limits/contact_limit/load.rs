//! The load on a pad: its sum and its peak, and where they are.

use tactflow_runtime::signal::{Image, ImageShape};

/// The load on the pad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PadLoad {
    /// Sum of the tactels [unit of the image].
    pub sum: f64,
    /// Centre of gravity of the tactels [m].
    pub centre: [f64; 2],
    /// Value of the highest tactel [unit of the image].
    pub peak: f64,
    /// Position of the highest tactel [m].
    pub place: [f64; 2],
}

/// Returns the load of an image; its sum is NaN if a tactel is.
///
/// The positions are computed only if the sum and the peak are at least those in `from`, and are 0 otherwise.
#[must_use]
pub fn load(shape: &ImageShape, image: &Image, from: [f64; 2]) -> PadLoad {
    let (sum, peak) = weigh(image.cells());
    let mut load = PadLoad { sum, peak, ..PadLoad::default() };
    let rows = || image.cells().chunks(shape.cols).enumerate();
    if sum >= from[0] && sum > 0.0 {
        let mut moments = [0.0; 2];
        for (i, row) in rows() {
            let (mut force, mut moment) = (0.0, 0.0);
            for (j, cell) in row.iter().enumerate() {
                let value = pressed(*cell);
                force += value;
                moment += value * shape.x(j as f64);
            }
            moments = [moments[0] + moment, moments[1] + force * shape.y(i as f64)];
        }
        load.centre = moments.map(|moment| moment / sum);
    }
    if peak >= from[1] && peak > 0.0 {
        let highest = |(i, row): (usize, &[f32])| Some((i, row.iter().position(|cell| f64::from(*cell) == peak)?));
        let place = rows().find_map(highest).map(|(i, j)| [shape.x(j as f64), shape.y(i as f64)]);
        load.place = place.unwrap_or_default();
    }
    load
}

/// Returns the load of a tactel, 0 if it is negative. Unlike `max`, it keeps a NaN.
fn pressed(cell: f32) -> f64 {
    f64::from(if cell < 0.0 { 0.0 } else { cell })
}

/// Returns the sum and the maximum of the tactels, in eight lanes and a fixed order: the same bits on every machine.
fn weigh(cells: &[f32]) -> (f64, f64) {
    let (mut sums, mut peaks) = ([0.0_f64; 8], [0.0_f32; 8]);
    let mut add = |lane: usize, cell: f32| {
        sums[lane] += pressed(cell);
        peaks[lane] = if cell > peaks[lane] { cell } else { peaks[lane] };
    };
    let (chunks, rest) = cells.as_chunks::<8>();
    for chunk in chunks {
        for (lane, cell) in chunk.iter().enumerate() {
            add(lane, *cell);
        }
    }
    for (lane, cell) in rest.iter().enumerate() {
        add(lane, *cell);
    }
    let peak = peaks.into_iter().fold(0.0, |a: f32, b| if b > a { b } else { a });
    (sums.into_iter().sum(), f64::from(peak))
}
