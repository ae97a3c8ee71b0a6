//! Sums over a region, and the ellipse with its second moments: what all nodes that tell of a shape share.

use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::signal::{Image, Mask};
use tactflow_runtime::source::Code;

words! {
    /// What a tactel of the region counts in its place and its shape.
    Weight {
        /// Its value.
        Force = "force",
        /// What its value has above a threshold.
        Excess = "excess",
        /// The same as every other.
        Area = "area",
    }
}

/// A weight with its threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Weighing {
    /// The value.
    Force,
    /// What the value has above this threshold, and nothing below it.
    Excess(f64),
    /// The same for every tactel.
    Area,
}

impl Weighing {
    /// The weight that the parameters `weight` and `threshold` ask for.
    ///
    /// # Errors
    /// If a threshold is missing, or is given where it means nothing.
    pub fn new(weight: Weight, threshold: Option<f64>) -> Result<Self, Mistakes> {
        match (weight, threshold) {
            (Weight::Force, None) => Ok(Self::Force),
            (Weight::Area, None) => Ok(Self::Area),
            (Weight::Excess, Some(threshold)) => Ok(Self::Excess(threshold)),
            (Weight::Excess, None) => {
                let message = "`weight = \"excess\"` needs the `threshold` that it counts from";
                let mistake = Mistake::new(Code::MissingKey, At::Param("weight".into()), message);
                Err(mistake.help("give that of the `binarize`: its `release`, if it has one").into())
            }
            (Weight::Force | Weight::Area, Some(_)) => {
                let mistake = Mistake::key("threshold", "`threshold` means nothing without `weight = \"excess\"`");
                Err(mistake.help("say `weight = \"excess\"`, or leave it out").into())
            }
        }
    }

    /// The weight of a tactel.
    #[must_use]
    pub fn weight(self, value: f64) -> f64 {
        match self {
            Self::Force => value,
            Self::Excess(threshold) => (value - threshold).max(0.0),
            Self::Area => 1.0,
        }
    }

    /// One pass over the tactels of a region, in raster order.
    #[must_use]
    pub fn add_up(self, image: &Image, region: &Mask) -> Sums {
        match self {
            Self::Force => add_up(image, region),
            other => add_up_by(image, region, |value| other.weight(value)),
        }
    }
}

/// Sums over a region, places counted in tactels from its first tactel in raster order.
#[derive(Debug, Default)]
pub struct Sums {
    /// Row and column of that first tactel.
    pub first: [f64; 2],
    /// Number of tactels.
    pub area: f64,
    /// Sum of their weights: of their values, unless another weight was asked for.
    pub force: f64,
    /// Sum of weight times column.
    pub x: f64,
    /// Sum of weight times row.
    pub y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

/// One pass over the tactels of a region, in raster order, each weighted by its value.
#[must_use]
pub fn add_up(image: &Image, region: &Mask) -> Sums {
    add_up_by(image, region, |value| value)
}

/// The same with another weight, made of the value.
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

/// Second central moments: their sum, and the double of the axis they give, as a sine and a cosine times its strength.
pub struct Ellipse {
    spread: f64,
    /// Sine of the doubled axis, times its strength.
    pub sine: f64,
    /// Cosine of the doubled axis, times its strength.
    pub cosine: f64,
}

/// The ellipse with the second central moments of a region whose weights have a positive sum.
#[must_use]
pub fn ellipse(sums: &Sums, pitch: [f64; 2]) -> Ellipse {
    let (x, y) = (sums.x / sums.force, sums.y / sums.force);
    let m20 = (sums.xx / sums.force - x * x) * pitch[0] * pitch[0];
    let m02 = (sums.yy / sums.force - y * y) * pitch[1] * pitch[1];
    let m11 = (sums.xy / sums.force - x * y) * pitch[0] * pitch[1];
    Ellipse { spread: m20 + m02, sine: 2.0 * m11, cosine: m20 - m02 }
}

impl Ellipse {
    /// From 0 to 1; zero without extent, and where tactels below zero leave no positive spread.
    #[must_use]
    pub fn anisotropy(&self) -> f64 {
        if self.spread > 0.0 {
            ((self.sine * self.sine + self.cosine * self.cosine).sqrt() / self.spread).min(1.0)
        } else {
            0.0
        }
    }

    /// Variance along the long and along the short axis [m²]; zero without extent, and where tactels below zero leave no
    /// positive spread.
    #[must_use]
    pub fn variances(&self) -> [f64; 2] {
        if self.spread <= 0.0 {
            return [0.0; 2];
        }
        let strength = libm::hypot(self.sine, self.cosine);
        [self.spread + strength, self.spread - strength].map(|sum| (0.5 * sum).max(0.0))
    }
}
