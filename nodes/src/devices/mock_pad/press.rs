//! Scripted presses on a pad.

use tactflow_runtime::node::Param;
use tactflow_runtime::signal::ImageShape;

/// A press of a point or a bar on the pad.
#[derive(Debug, Clone, Param)]
pub struct Press {
    /// Start.
    #[param(unit = "s", default = 0.0)]
    from_s: f64,
    /// End; unlimited if not given.
    #[param(unit = "s")]
    to_s: Option<f64>,
    /// Position of its middle at `from_s`, from the middle of the pad.
    #[param(unit = "m", default = [0.0, 0.0])]
    at: [f64; 2],
    /// Velocity.
    #[param(unit = "m/s", default = [0.0, 0.0])]
    speed: [f64; 2],
    /// Radius of the bump around the point or the bar; at least the pitch.
    #[param(unit = "m", above = 0.0, default = 0.008)]
    radius: f64,
    /// Length of the bar; 0 is a point.
    #[param(unit = "m", range = 0.0.., default = 0.0)]
    length: f64,
    /// Direction of the bar, from x toward y.
    #[param(unit = "rad", default = 0.0)]
    angle: f64,
    /// Total force.
    #[param(unit = "$unit", above = 0.0, default = 10.0)]
    force: f64,
    /// Total force along the pad's x and y; with it the pad has three axes.
    #[param(unit = "$unit")]
    drag: Option<[f64; 2]>,
}

/// Maximum width of a bump [tactels].
const MAX_WIDTH: f64 = 256.0;

impl Press {
    /// Returns what is wrong with the press on a pad with a `pitch` [m].
    #[must_use]
    pub fn mistake(&self, pitch: f64) -> Option<String> {
        let (radius, length) = (self.radius, self.length);
        if radius < pitch {
            return Some(format!(
                "a bump of radius {radius} m can fit between two tactels: `radius` must be at least the pitch, {pitch} m"
            ));
        }
        if 2.0 * radius + length > MAX_WIDTH * pitch {
            return Some(format!("a bump of {} m is wider than {MAX_WIDTH} tactels", 2.0 * radius + length));
        }
        None
    }

    /// Whether it drags the pad.
    #[must_use]
    pub const fn has_drag(&self) -> bool {
        self.drag.is_some()
    }

    /// Adds the force of the press at `time` [s] to the cells of a pad, and what it does along three axes to `vectors`,
    /// which are empty for a pad with one axis.
    pub fn add(&self, shape: &ImageShape, time: f64, cells: &mut [f32], vectors: &mut [[f32; 3]]) {
        let [x, y] = self.drag.unwrap_or_default();
        self.each(shape, time, |at, bump, whole| {
            let force = (self.force / whole * bump) as f32;
            cells[at] += force;
            if let Some([along, across, normal]) = vectors.get_mut(at) {
                *along += (x / whole * bump) as f32;
                *across += (y / whole * bump) as f32;
                *normal += force;
            }
        });
    }

    /// Calls `add` for each tactel under the press, with its index, the height of the bump, and the sum of all heights on
    /// an infinite array.
    fn each(&self, shape: &ImageShape, time: f64, mut add: impl FnMut(usize, f64, f64)) {
        if time < self.from_s || self.to_s.is_some_and(|to| time >= to) {
            return;
        }
        let since = time - self.from_s;
        let middle = [self.at[0] + self.speed[0] * since, self.at[1] + self.speed[1] * since];
        let (sin, cos) = libm::sincos(self.angle);
        let reach = self.radius + 0.5 * self.length;
        // Far off the pad the press adds nothing, and indices would lose their precision.
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
        for i in span(1).filter(|i| (0..shape.rows as i64).contains(i)) {
            for j in span(0).filter(|j| (0..shape.cols as i64).contains(j)) {
                add(i as usize * shape.cols + j as usize, bump(i, j), whole);
            }
        }
    }

    /// Returns the height of the bump, from 1 on the bar to 0 at the radius; `along` and `across` start in its middle
    /// [m].
    fn bump(&self, along: f64, across: f64) -> f64 {
        let past = (along.abs() - 0.5 * self.length).max(0.0);
        let rest = (1.0 - (past * past + across * across) / (self.radius * self.radius)).max(0.0);
        rest * rest
    }
}
