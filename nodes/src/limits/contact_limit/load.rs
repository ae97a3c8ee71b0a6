//! The load on a pad: its sum and its peak, and where they are.

use tactflow_runtime::signal::{Image, ImageShape};

/// The load on the pad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PadLoad {
    /// Sum of the tactels [unit of the image].
    pub sum: f64,
    /// Value of the highest tactel [unit of the image].
    pub peak: f64,
}

impl PadLoad {
    /// Returns this load, low-passed where it is less than the `last` one: the fraction `fall` of a fall counts. It keeps
    /// a NaN.
    #[must_use]
    pub fn held(self, last: Self, fall: f64) -> Self {
        let held = |last: f64, new: f64| if new < last { last + (new - last) * fall } else { new };
        Self { sum: held(last.sum, self.sum), peak: held(last.peak, self.peak) }
    }
}

/// Returns the load of an image; its sum is NaN if a tactel is.
///
/// It adds up in eight lanes and a fixed order: the same bits on every machine.
#[must_use]
pub fn load(image: &Image) -> PadLoad {
    let (mut sums, mut peaks) = ([0.0_f64; 8], [0.0_f32; 8]);
    let mut add = |lane: usize, cell: f32| {
        sums[lane] += pressed(cell);
        peaks[lane] = if cell > peaks[lane] { cell } else { peaks[lane] };
    };
    let (chunks, rest) = image.cells().as_chunks::<8>();
    for chunk in chunks {
        for (lane, cell) in chunk.iter().enumerate() {
            add(lane, *cell);
        }
    }
    for (lane, cell) in rest.iter().enumerate() {
        add(lane, *cell);
    }
    let peak = peaks.into_iter().fold(0.0, |a: f32, b| if b > a { b } else { a });
    PadLoad { sum: sums.into_iter().sum(), peak: f64::from(peak) }
}

/// Returns the centre of gravity of an image [m], the middle of the pad for an image without a load.
#[must_use]
pub fn centre(shape: &ImageShape, image: &Image) -> [f64; 2] {
    let (mut sum, mut moments) = (0.0, [0.0; 2]);
    for (i, row) in image.cells().chunks(shape.cols).enumerate() {
        let (mut force, mut moment) = (0.0, 0.0);
        for (j, cell) in row.iter().enumerate() {
            let value = pressed(*cell);
            force += value;
            moment += value * shape.x(j as f64);
        }
        sum += force;
        moments = [moments[0] + moment, moments[1] + force * shape.y(i as f64)];
    }
    if sum > 0.0 { moments.map(|moment| moment / sum) } else { [0.0; 2] }
}

/// Returns the position of the highest tactel, whose value is `peak` [m]; the middle of the pad if there is none.
#[must_use]
pub fn highest(shape: &ImageShape, image: &Image, peak: f64) -> [f64; 2] {
    let place = image.cells().iter().position(|cell| f64::from(*cell) == peak);
    place.map_or([0.0; 2], |at| [shape.x((at % shape.cols) as f64), shape.y((at / shape.cols) as f64)])
}

/// Returns the load of a tactel, 0 if it is negative. Unlike `max`, it keeps a NaN.
fn pressed(cell: f32) -> f64 {
    f64::from(if cell < 0.0 { 0.0 } else { cell })
}
