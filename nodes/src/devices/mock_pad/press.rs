//! What presses on a scripted pad.

use tactflow_runtime::node::{NonNegative, Positive};
use tactflow_runtime::params;
use tactflow_runtime::signal::ImageShape;

params! {
    Press:
    /// When it begins [s].
    from_s: f64 = 0.0,
    /// When it is over; never unless given [s].
    to_s: Option<f64>,
    /// Where its middle is when it begins, from the middle of the pad [m].
    at: [f64; 2] = [0.0, 0.0],
    /// How fast it moves [m/s].
    speed: [f64; 2] = [0.0, 0.0],
    /// How far the bump reaches from the point or the bar, at least a pitch [m].
    radius: Positive = Positive(0.008),
    /// Length of the bar; 0 is a point [m].
    length: NonNegative = NonNegative(0.0),
    /// Direction of the bar, from x toward y [rad].
    angle: f64 = 0.0,
    /// Its total force [unit of a tactel].
    force: Positive = Positive(10.0),
}

/// The most tactels that a bump reaches across.
const WIDEST: f64 = 256.0;

impl Press {
    /// What is wrong with it on a pad of that pitch [m].
    #[must_use]
    pub fn mistake(&self, pitch: f64) -> Option<String> {
        let (radius, length) = (*self.radius, *self.length);
        if radius < pitch {
            return Some(format!("a bump of radius {radius} m falls between tactels that are {pitch} m apart"));
        }
        if 2.0 * radius + length > WIDEST * pitch {
            return Some(format!("a bump of {} m is wider than {WIDEST} tactels", 2.0 * radius + length));
        }
        None
    }

    /// Adds its force at `time` [s] to the cells of a pad.
    pub fn add(&self, shape: &ImageShape, time: f64, cells: &mut [f32]) {
        if time < self.from_s || self.to_s.is_some_and(|to| time >= to) {
            return;
        }
        let since = time - self.from_s;
        let middle = [self.at[0] + self.speed[0] * since, self.at[1] + self.speed[1] * since];
        let (sin, cos) = libm::sincos(self.angle);
        let reach = *self.radius + 0.5 * *self.length;
        // Far off the pad there is nothing to add, and indices would lose their precision.
        let half = [shape.x(shape.cols as f64), shape.y(shape.rows as f64)];
        if (0..2).any(|k| middle[k].abs() > half[k] + reach) {
            return;
        }
        let index =
            |k: usize, by: f64| (middle[k] + by) / shape.pitch[k] + [shape.cols, shape.rows][k] as f64 / 2.0 - 0.5;
        let span = |k: usize| index(k, -reach).floor() as i64..=index(k, reach).ceil() as i64;
        let bump = |i: i64, j: i64| {
            let (dx, dy) = (shape.x(j as f64) - middle[0], shape.y(i as f64) - middle[1]);
            self.bump(cos * dx + sin * dy, cos * dy - sin * dx)
        };
        let mut whole = 0.0;
        for i in span(1) {
            for j in span(0) {
                whole += bump(i, j);
            }
        }
        let scale = *self.force / whole;
        for i in span(1).filter(|i| (0..shape.rows as i64).contains(i)) {
            for j in span(0).filter(|j| (0..shape.cols as i64).contains(j)) {
                cells[i as usize * shape.cols + j as usize] += (scale * bump(i, j)) as f32;
            }
        }
    }

    /// Height of the bump at (along, across) the bar from its middle [m]: 1 on the bar, 0 from the radius on.
    fn bump(&self, along: f64, across: f64) -> f64 {
        let past = (along.abs() - 0.5 * *self.length).max(0.0);
        let rest = (1.0 - (past * past + across * across) / (*self.radius * *self.radius)).max(0.0);
        rest * rest
    }
}
