//! The limits of a contact on the pad, and the motion that keeps within them.
//!
//! A contact at p = (x, y, 0) of an object at rest moves over the pad with dp/dt = -(v + omega x p):
//!
//! ```text
//! dx/dt = -vx + wz y        dy/dt = -vy - wz x
//! ```
//!
//! The outward part is removed by a correction of vx and vy alone: all of it from the margin on, and a fraction that
//! grows linearly over the ramp before the margin. A turn wz continues, but about the contact instead of the middle of
//! the pad. Rolling over an object of radius R adds -R wy to dx/dt and R wx to dy/dt. R is unknown but its sign is not,
//! so wx and wy are scaled when they roll toward the rim.
//!
//! Invariants: the output is a continuous function of the contact and the input, and inward motion passes unchanged,
//! bit for bit.

use tactflow_runtime::signal::Twist;

/// The limits of the contact along one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fence {
    /// Largest distance from the middle [m].
    pub(super) margin: f64,
    /// Width of the zone before it [m].
    pub(super) ramp: f64,
}

impl Fence {
    /// Returns the limits along an axis with `count` tactels; `margin` and `ramp` are in tactels.
    pub(super) fn new(count: usize, pitch: f64, margin: f64, ramp: f64) -> Self {
        Self { margin: ((count as f64 - 1.0) / 2.0 - margin) * pitch, ramp: ramp * pitch }
    }

    /// Returns the fraction of a motion from `place` [m] in the direction of `speed` that passes: 1 in the middle, 0
    /// from the margin on.
    pub(super) fn share(self, place: f64, speed: f64) -> f64 {
        let room = if speed > 0.0 { self.margin - place } else { self.margin + place };
        (room / self.ramp).clamp(0.0, 1.0)
    }

    /// Returns the part of `speed` that does not pass.
    fn excess(self, place: f64, speed: f64) -> f64 {
        (1.0 - self.share(place, speed)) * speed
    }
}

/// Returns the twist without the part that carries a contact at (x, y) [m] toward the rim.
pub(super) fn guarded(twist: &Twist, [x, y]: [f64; 2], along_x: Fence, along_y: Fence) -> Twist {
    let [vx, vy, vz, wx, wy, wz] = twist.0.into();
    Twist(
        [
            vx + along_x.excess(x, wz * y - vx),
            vy + along_y.excess(y, -wz * x - vy),
            vz,
            wx * along_y.share(y, wx),
            wy * along_x.share(x, -wy),
            wz,
        ]
        .into(),
    )
}
