//! Recognizes a touch in the images of a pad: where it is, and when it ends.

use tactflow_runtime::signal::{Image, ImageShape, Mask};

use crate::touch::moments::{Weighing, ellipse};

/// Time for which a touch must stay where it is, and for which a pad must be free [s].
const STEADY_S: f64 = 0.3;
/// Number of images in this time, at least.
const MIN_IMAGES: u32 = 3;
/// Distance between two places of one touch [tactel].
const MAX_MOTION_TACTELS: f64 = 1.5;
/// Part of the highest reading above which a tactel belongs to the touch.
const EDGE: f64 = 0.3;
/// Part of the highest reading of a touch below which the pad is free: foam recovers slowly.
const RELEASED: f64 = 0.25;

/// A place where a pad is pressed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spot {
    /// Centre along the sensor's x and y, from the middle of the pad [m].
    pub(super) centre: [f64; 2],
    /// Sum of the variances along x and y [m²].
    pub(super) spread: f64,
}

/// Returns where an image above the unloaded one shows a touch; `None` if no tactel is above 0.
pub(super) fn spot(above: &Image, shape: &ImageShape) -> Option<Spot> {
    let edge = EDGE * f64::from(peak(above));
    let mut region = Mask::empty(shape.rows, shape.cols);
    for (k, cell) in above.cells().iter().enumerate().filter(|(_, cell)| **cell > 0.0) {
        if f64::from(*cell) >= edge {
            region.insert(k / shape.cols, k % shape.cols);
        }
    }
    let sums = Weighing::Force.add_up(above, &region);
    Some(Spot { centre: sums.centre(shape)?, spread: ellipse(&sums, shape.pitch).spread() })
}

fn peak(image: &Image) -> f32 {
    image.cells().iter().copied().fold(f32::NEG_INFINITY, f32::max)
}

/// A touch that has been felt.
#[derive(Debug, Clone)]
pub(super) struct Touch {
    pub(super) spot: Spot,
    /// The mean image above the unloaded one.
    pub(super) above: Image,
}

/// What has happened to a pad.
#[derive(Debug, Clone)]
pub(super) enum Event {
    Touched(Touch),
    Released,
}

/// Recognizes touches.
#[derive(Debug, Clone)]
pub(super) struct Feeler {
    shape: ImageShape,
    /// What each tactel reads without a load.
    unloaded: Vec<f64>,
    /// Reading above that from which a tactel is pressed.
    threshold: f64,
    /// The lowest reading below that: a pad whose readings fall with the force is never pressed.
    pub(super) lowest: f64,
    /// The touch or the pause that may have begun.
    begun: Option<Begun>,
    /// The highest reading of the touch that has been felt.
    held: Option<f64>,
}

/// Images of one touch, or of a free pad.
#[derive(Debug, Clone)]
struct Begun {
    /// Time of the first image [s].
    since: f64,
    count: u32,
    /// Sum of the images.
    sum: Vec<f64>,
    centre: [f64; 2],
}

impl Feeler {
    /// `unloaded` is what each tactel reads without a load, and `threshold` is the reading above it from which it is
    /// pressed.
    pub(super) fn new(shape: ImageShape, unloaded: Vec<f64>, threshold: f64) -> Self {
        Self { shape, unloaded, threshold, lowest: 0.0, begun: None, held: None }
    }

    pub(super) const fn threshold(&self) -> f64 {
        self.threshold
    }

    /// Adds an image that arrived at `now` [s].
    pub(super) fn add(&mut self, image: &Image, now: f64) -> Option<Event> {
        let above: Vec<f32> = image
            .cells()
            .iter()
            .zip(&self.unloaded)
            .map(|(cell, unloaded)| (f64::from(*cell) - unloaded) as f32)
            .collect();
        let above = Image::from_cells(self.shape.cols, &above);
        let highest = f64::from(peak(&above));
        self.lowest = above.cells().iter().fold(self.lowest, |lowest, cell| lowest.min(f64::from(*cell)));
        match self.held {
            None if highest > self.threshold => {
                let centre = spot(&above, &self.shape)?.centre;
                let mean = self.steady(&above, centre, now)?;
                let spot = spot(&mean, &self.shape)?;
                self.held = Some(f64::from(peak(&mean)));
                Some(Event::Touched(Touch { spot, above: mean }))
            }
            Some(held) if highest <= self.threshold.max(RELEASED * held) => {
                // What the foam still shows is the new zero.
                let mean = self.steady(&above, [0.0; 2], now)?;
                self.unloaded.iter_mut().zip(mean.cells()).for_each(|(zero, rest)| *zero += f64::from(*rest));
                self.held = None;
                Some(Event::Released)
            }
            _ => {
                self.begun = None;
                None
            }
        }
    }

    /// Adds an image to those that show the same. Returns their mean once they have done so for long enough.
    fn steady(&mut self, above: &Image, centre: [f64; 2], now: f64) -> Option<Image> {
        let pitch = self.shape.pitch;
        let has_moved = |begun: &Begun| {
            (0..2).any(|axis| (centre[axis] - begun.centre[axis]).abs() > MAX_MOTION_TACTELS * pitch[axis])
        };
        if self.begun.as_ref().is_none_or(has_moved) {
            self.begun = Some(Begun { since: now, count: 0, sum: vec![0.0; above.cells().len()], centre });
        }
        let begun = self.begun.as_mut()?;
        begun.count += 1;
        begun.sum.iter_mut().zip(above.cells()).for_each(|(sum, cell)| *sum += f64::from(*cell));
        if now - begun.since < STEADY_S || begun.count < MIN_IMAGES {
            return None;
        }
        let count = f64::from(begun.count);
        let mean: Vec<f32> = begun.sum.iter().map(|sum| (sum / count) as f32).collect();
        self.begun = None;
        Some(Image::from_cells(self.shape.cols, &mean))
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::Unit;

    use super::*;

    const SHAPE: ImageShape = ImageShape { rows: 4, cols: 6, pitch: [0.002; 2], unit: Unit::RAW };

    /// An image that reads 10 everywhere, with a touch of a height on two tactels.
    fn image(row: usize, height: f32) -> Image {
        let mut image = Image::from_cells(6, &[10.0; 24]);
        image.cells_mut()[6 * row + 4] += height;
        image.cells_mut()[6 * row + 5] += height;
        image
    }

    fn feeler() -> Feeler {
        Feeler::new(SHAPE, vec![10.0; 24], 2.0)
    }

    /// Adds the same image for a time, 50 times a second. Returns the first event and when it happened.
    fn keep(feeler: &mut Feeler, image: &Image, from: f64, time: f64) -> Option<(f64, Event)> {
        let times = (0..(time * 50.0) as u32).map(|i| from + f64::from(i) / 50.0);
        times.into_iter().find_map(|now| Some((now, feeler.add(image, now)?)))
    }

    #[test]
    fn a_steady_touch_is_felt_where_it_is_and_then_its_release() {
        let mut feeler = feeler();
        assert!(keep(&mut feeler, &image(0, 1.9), 0.0, 2.0).is_none(), "below the threshold");
        let (now, Event::Touched(touch)) = keep(&mut feeler, &image(0, 50.0), 2.0, 2.0).expect("it is felt") else {
            panic!("it is a touch");
        };
        assert!((now - 2.3).abs() < 0.021, "{now} s");
        // The middle of columns 4 and 5 of 6, and row 0 of 4, 2 mm apart.
        let [x, y] = touch.spot.centre;
        assert!((x - 0.004).abs() < 1e-12 && (y + 0.003).abs() < 1e-12, "{x}, {y}");
        assert!((touch.spot.spread - 1e-6).abs() < 1e-15, "two tactels, 1 mm from their middle");
        assert!(keep(&mut feeler, &image(0, 50.0), 4.0, 2.0).is_none(), "it is felt once");
        // The foam has not recovered: a rest of 6 stays, and it is no touch afterwards.
        let (_, event) = keep(&mut feeler, &image(0, 6.0), 6.0, 1.0).expect("it is released");
        assert!(matches!(event, Event::Released));
        assert!(keep(&mut feeler, &image(0, 6.0), 7.0, 2.0).is_none());
        assert!(keep(&mut feeler, &image(3, 50.0), 9.0, 1.0).is_some(), "the next touch");
    }

    #[test]
    fn a_touch_that_moves_or_ends_too_soon_is_not_felt() {
        let mut moving = feeler();
        for i in 0..50 {
            assert!(keep(&mut moving, &image(2 * (i % 2), 50.0), f64::from(i as u8) * 0.2, 0.2).is_none(), "it moves");
        }
        let mut short = feeler();
        assert!(keep(&mut short, &image(1, 50.0), 0.0, 0.28).is_none());
        assert!(keep(&mut short, &image(1, 0.0), 0.28, 0.1).is_none());
        assert!(keep(&mut short, &image(1, 50.0), 0.38, 0.28).is_none(), "its time begins anew");
    }

    #[test]
    fn readings_that_fall_are_no_touch_and_are_noticed() {
        let mut feeler = feeler();
        assert!(keep(&mut feeler, &image(1, -8.0), 0.0, 1.0).is_none());
        assert!((feeler.lowest + 8.0).abs() < 1e-6);
    }
}
