//! A force on a body and its moment.

use parry3d_f64::math::Vec3;

/// A force on a body, and a moment about a point that the user states.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wrench {
    /// Force [N].
    pub force: Vec3,
    /// Moment [N m].
    pub moment: Vec3,
}

impl Wrench {
    /// Adds a force at a place.
    pub(super) fn push(&mut self, place: Vec3, force: Vec3) {
        self.force += force;
        self.moment += place.cross(force);
    }

    /// Returns the same load with its moment about a point, for one about a point that is `from` there.
    pub(super) fn about(self, from: Vec3) -> Self {
        Self { moment: self.moment + from.cross(self.force), ..self }
    }
}
