//! The elements of a path: straight lines, and arcs tangent to their neighbours.
//!
//! With the way w from the beginning of an element:
//!
//! ```text
//! line    p(w) = a + w t
//! arc     p(w) = c + r (u cos(w / r) + t sin(w / r))
//! ```
//!
//! u is the unit vector from the centre c to the beginning of the arc, and t is the direction at the beginning.

use nalgebra::Vector3;

/// A line or an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Element {
    /// Its length [m].
    pub(super) length: f64,
    /// Its beginning [m].
    from: Vector3<f64>,
    /// Direction at its beginning, a unit vector.
    along: Vector3<f64>,
    /// The bend of an arc.
    bend: Option<Bend>,
}

/// What an arc has beyond a line.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bend {
    radius: f64,
    /// Unit vector from the centre to the beginning.
    outward: Vector3<f64>,
}

/// A point of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Foot {
    /// Way from the beginning of the element [m].
    pub(super) way: f64,
    /// The point [m].
    pub(super) point: Vector3<f64>,
}

impl Element {
    /// Returns the line between two different points.
    pub(super) fn line(from: Vector3<f64>, to: Vector3<f64>) -> Self {
        let length = (to - from).norm();
        Self { length, from, along: (to - from) / length, bend: None }
    }

    /// Returns the arc that begins at a point in the direction `along` and turns by `angle` [rad] toward `next`, the
    /// direction at its end.
    pub(super) fn arc(from: Vector3<f64>, along: Vector3<f64>, next: Vector3<f64>, radius: f64, angle: f64) -> Self {
        let inward = (next - along * along.dot(&next)).normalize();
        Self { length: radius * angle, from, along, bend: Some(Bend { radius, outward: -inward }) }
    }

    /// Returns the radius of an arc [m].
    pub(super) fn radius(&self) -> Option<f64> {
        self.bend.map(|bend| bend.radius)
    }

    /// Returns the point after a way [m].
    pub(super) fn point(&self, way: f64) -> Vector3<f64> {
        let Some(Bend { radius, outward }) = self.bend else { return self.from + self.along * way };
        let half = libm::sin(0.5 * way / radius);
        // With 1 - cos x = 2 sin²(x / 2), a short way on a large arc keeps its digits.
        self.from + (self.along * libm::sin(way / radius) - outward * (2.0 * half * half)) * radius
    }

    /// Returns the direction after a way [m], a unit vector.
    pub(super) fn direction(&self, way: f64) -> Vector3<f64> {
        let Some(Bend { radius, outward }) = self.bend else { return self.along };
        let (sine, cosine) = libm::sincos(way / radius);
        self.along * cosine - outward * sine
    }

    /// Returns the curvature vector after a way [1/m]: it points to the centre of an arc, and is zero on a line.
    pub(super) fn curvature(&self, way: f64) -> Vector3<f64> {
        let Some(Bend { radius, outward }) = self.bend else { return Vector3::zeros() };
        let (sine, cosine) = libm::sincos(way / radius);
        -(outward * cosine + self.along * sine) / radius
    }

    /// Returns the point with a way between `least` and the length [m] that is closest to a place.
    pub(super) fn closest(&self, place: &Vector3<f64>, least: f64) -> Foot {
        let foot = |way: f64| Foot { way, point: self.point(way) };
        let Some(Bend { radius, outward }) = self.bend else {
            // Not `clamp`, which panics if rounding puts `least` behind the end.
            return foot((place - self.from).dot(&self.along).max(least).min(self.length));
        };
        let spoke = place - (self.from - outward * radius);
        let way = libm::atan2(spoke.dot(&self.along), spoke.dot(&outward)) * radius;
        if (least..=self.length).contains(&way) {
            return foot(way);
        }
        let (first, last) = (foot(least.min(self.length)), foot(self.length));
        if (last.point - place).norm() < (first.point - place).norm() { last } else { first }
    }
}
