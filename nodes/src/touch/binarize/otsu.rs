//! Otsu's threshold of an image.

/// Steps from the least to the greatest value at which the image may be split.
pub(super) const STEPS: usize = 256;

/// The values between two steps.
#[derive(Debug, Clone, Copy)]
struct Level {
    count: f64,
    sum: f64,
    greatest: f32,
}

/// The greatest value of the lower of the two classes with the greatest variance between them, so that the upper class
/// is what is strictly above it; none if all values are equal. Of several splits that are equal, the lowest.
///
/// The classes' means are those of the values and not of the steps: only where the image can be split is coarse.
#[must_use]
pub fn otsu(cells: &[f32]) -> Option<f32> {
    let (least, greatest) = cells.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(least, greatest), value| {
        (if *value < least { *value } else { least }, if *value > greatest { *value } else { greatest })
    });
    // An image of nothing has no values to tell apart either.
    if least >= greatest {
        return None;
    }
    let mut levels = [Level { count: 0.0, sum: 0.0, greatest: f32::NEG_INFINITY }; STEPS];
    let per_value = (STEPS - 1) as f64 / (f64::from(greatest) - f64::from(least));
    for value in cells {
        let level = &mut levels[((f64::from(*value) - f64::from(least)) * per_value) as usize];
        level.count += 1.0;
        level.sum += f64::from(*value);
        level.greatest = if *value > level.greatest { *value } else { level.greatest };
    }
    Some(split(&levels))
}

fn split(levels: &[Level; STEPS]) -> f32 {
    let (count, sum) = levels.iter().fold((0.0, 0.0), |(count, sum), level| (count + level.count, sum + level.sum));
    let (mut below, mut sum_below) = (0.0, 0.0);
    let (mut best, mut variance) = (f32::NEG_INFINITY, f64::NEG_INFINITY);
    for level in levels.iter().filter(|level| level.count > 0.0) {
        below += level.count;
        sum_below += level.sum;
        let above = count - below;
        if above == 0.0 {
            break;
        }
        let difference = sum_below / below - (sum - sum_below) / above;
        let between = below * above * difference * difference;
        if between > variance {
            (best, variance) = (level.greatest, between);
        }
    }
    best
}
