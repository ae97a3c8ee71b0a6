//! Sum and peak of an image.
//!
//! The sum is made in f64, in a fixed number of lanes that are added in a fixed order: it is exact for whole counts,
//! and has the same bits on every machine.

/// Number of cells that are added at once.
const LANES: usize = 8;

/// Returns the sum and the largest of all cells.
#[must_use]
pub fn sum_and_peak(cells: &[f32]) -> (f64, f64) {
    let mut lanes = Lanes::default();
    let (chunks, rest) = cells.as_chunks();
    chunks.iter().for_each(|chunk| lanes.add(chunk));
    lanes.finish(rest)
}

/// Copies all cells, and returns their sum and the largest.
pub(super) fn copy_sum_and_peak(from: &[f32], to: &mut [f32]) -> (f64, f64) {
    let mut lanes = Lanes::default();
    let ((chunks, rest), (copies, copied)) = (from.as_chunks(), to.as_chunks_mut());
    for (chunk, copy) in chunks.iter().zip(copies) {
        *copy = *chunk;
        lanes.add(chunk);
    }
    copied.copy_from_slice(rest);
    lanes.finish(rest)
}

struct Lanes {
    sums: [f64; LANES],
    peaks: [f32; LANES],
}

impl Default for Lanes {
    fn default() -> Self {
        Self { sums: [0.0; LANES], peaks: [f32::NEG_INFINITY; LANES] }
    }
}

/// Returns the larger of two numbers; a NaN in `b` is ignored.
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

impl Lanes {
    #[inline]
    #[expect(
        clippy::needless_range_loop,
        reason = "the compiler vectorizes an index into arrays of one length, but not three iterators"
    )]
    fn add(&mut self, chunk: &[f32; LANES]) {
        for lane in 0..LANES {
            self.sums[lane] += f64::from(chunk[lane]);
            self.peaks[lane] = larger(self.peaks[lane], chunk[lane]);
        }
    }

    /// Adds the cells after the last full chunk, then the lanes.
    fn finish(mut self, rest: &[f32]) -> (f64, f64) {
        for ((sum, peak), value) in self.sums.iter_mut().zip(&mut self.peaks).zip(rest) {
            *sum += f64::from(*value);
            *peak = larger(*peak, *value);
        }
        let [a, b, c, d, e, f, g, h] = self.sums;
        let sum = ((a + e) + (c + g)) + ((b + f) + (d + h));
        (sum, self.peaks.into_iter().fold(f32::NEG_INFINITY, larger).into())
    }
}
