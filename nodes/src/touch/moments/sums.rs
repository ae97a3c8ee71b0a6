//! Sums over a region, and the ellipse with its second moments: shared by all nodes that measure a contact.

use tactflow_runtime::node::{At, Mistake, Mistakes, Param};
use tactflow_runtime::signal::{Image, ImageShape, Mask};
use tactflow_runtime::source::Code;

use crate::motion::axis::half_angle;

/// Weight of a tactel in the position and the shape of its region.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub enum Weight {
    /// Its value.
    Force,
    /// Its value minus a threshold.
    Excess,
    /// 1.
    Area,
}

/// A weight with its threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Weighing {
    /// The value.
    Force,
    /// The value minus this threshold, and 0 below it.
    Excess(f64),
    /// 1.
    Area,
}

impl Weighing {
    /// Returns the weight that the parameters `weight` and `threshold` select.
    ///
    /// # Errors
    /// If the threshold is missing, or has no effect.
    pub fn new(weight: Weight, threshold: Option<f64>) -> Result<Self, Mistakes> {
        match (weight, threshold) {
            (Weight::Force, None) => Ok(Self::Force),
            (Weight::Area, None) => Ok(Self::Area),
            (Weight::Excess, Some(threshold)) => Ok(Self::Excess(threshold)),
            (Weight::Excess, None) => {
                let message = "`weight = \"excess\"` needs a `threshold`";
                let mistake = Mistake::new(Code::MissingKey, At::Param("weight".into()), message);
                Err(mistake.help("write the `threshold` of `binarize`, or its `release` if it has one").into())
            }
            (Weight::Force | Weight::Area, Some(_)) => {
                let mistake = Mistake::key("threshold", "`threshold` has no effect without `weight = \"excess\"`");
                Err(mistake.help("write `weight = \"excess\"`, or leave `threshold` out").into())
            }
        }
    }

    /// Returns the weight of a tactel of this value.
    #[must_use]
    pub fn weight(self, value: f64) -> f64 {
        match self {
            Self::Force => value,
            Self::Excess(threshold) => (value - threshold).max(0.0),
            Self::Area => 1.0,
        }
    }

    /// Returns the sums over a region, in one pass in raster order.
    #[must_use]
    pub fn add_up(self, image: &Image, region: &Mask) -> Sums {
        match self {
            Self::Force => add_up_by(image, region, |value| value),
            other => add_up_by(image, region, |value| other.weight(value)),
        }
    }
}

/// Sums over a region, with positions in tactels from its first tactel in raster order.
#[derive(Debug, Default)]
pub struct Sums {
    /// Row and column of the first tactel.
    pub first: [f64; 2],
    /// Number of tactels.
    pub area: f64,
    /// Sum of the weights; the force, if the weight is the value.
    pub force: f64,
    /// Sum of weight times column.
    pub x: f64,
    /// Sum of weight times row.
    pub y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Sums {
    /// Returns the centre of gravity along the sensor's x and y, from the middle of the pad [m]; `None` if the sum of the
    /// weights is not positive.
    #[must_use]
    pub fn centre(&self, shape: &ImageShape) -> Option<[f64; 2]> {
        let (j, i) = (self.x / self.force, self.y / self.force);
        (self.force > 0.0).then(|| [shape.x(self.first[1] + j), shape.y(self.first[0] + i)])
    }
}

/// Returns the sums over a region with each tactel weighted by a function of its value.
#[inline]
fn add_up_by(image: &Image, region: &Mask, weight: impl Fn(f64) -> f64) -> Sums {
    let mut sums = Sums::default();
    let Some(at) = region.words().iter().position(|word| *word != 0) else { return sums };
    let stride = region.stride();
    let (top, left) = (at / stride, at % stride * 64 + region.words()[at].trailing_zeros() as usize);
    sums.first = [top as f64, left as f64];
    for i in top..region.rows() {
        let row = image.row(i);
        let (mut area, mut force, mut x, mut xx) = (0, 0.0, 0.0, 0.0);
        for (k, word) in region.row(i).iter().enumerate() {
            area += word.count_ones();
            let mut rest = *word;
            while rest != 0 {
                let j = 64 * k + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let (value, along) = (weight(f64::from(row[j])), j as f64 - sums.first[1]);
                force += value;
                x += value * along;
                xx += value * along * along;
            }
        }
        let down = (i - top) as f64;
        sums.area += f64::from(area);
        sums.force += force;
        sums.x += x;
        sums.xx += xx;
        sums.y += force * down;
        sums.xy += x * down;
        sums.yy += force * down * down;
    }
    sums
}

/// The second central moments of a region [m²].
///
/// The sine and the cosine are those of the doubled angle of the long axis, times the difference of the two variances.
pub struct Ellipse {
    /// Sum of the variances.
    spread: f64,
    sine: f64,
    cosine: f64,
}

/// Returns the ellipse with the second central moments of a region whose weights have a positive sum; `pitch` is in
/// metres.
#[must_use]
pub fn ellipse(sums: &Sums, pitch: [f64; 2]) -> Ellipse {
    let (x, y) = (sums.x / sums.force, sums.y / sums.force);
    let m20 = (sums.xx / sums.force - x * x) * pitch[0] * pitch[0];
    let m02 = (sums.yy / sums.force - y * y) * pitch[1] * pitch[1];
    let m11 = (sums.xy / sums.force - x * y) * pitch[0] * pitch[1];
    Ellipse { spread: m20 + m02, sine: 2.0 * m11, cosine: m20 - m02 }
}

impl Ellipse {
    /// Returns the difference of the two variances over their sum, from 0 (round) to 1 (a line).
    ///
    /// It is 0 if the region has no extent, or if negative tactels make the sum negative.
    #[must_use]
    pub fn anisotropy(&self) -> f64 {
        if self.spread > 0.0 {
            ((self.sine * self.sine + self.cosine * self.cosine).sqrt() / self.spread).min(1.0)
        } else {
            0.0
        }
    }

    /// Returns the angle of the long axis from +x toward +y, in (-pi/2, pi/2] [rad], or `None` if the anisotropy is 0
    /// or less than `min_anisotropy`.
    #[must_use]
    pub fn orientation(&self, min_anisotropy: f64) -> Option<f64> {
        let anisotropy = self.anisotropy();
        (anisotropy > 0.0 && anisotropy >= min_anisotropy).then(|| half_angle(self.sine, self.cosine))
    }

    /// Returns the sum of the variances [m²].
    #[must_use]
    pub const fn spread(&self) -> f64 {
        self.spread
    }

    /// Returns the variances along the long and the short axis [m²].
    ///
    /// Both are 0 if the region has no extent, or if negative tactels make their sum negative.
    #[must_use]
    pub fn variances(&self) -> [f64; 2] {
        if self.spread <= 0.0 {
            return [0.0; 2];
        }
        let strength = libm::hypot(self.sine, self.cosine);
        [self.spread + strength, self.spread - strength].map(|sum| (0.5 * sum).max(0.0))
    }
}
