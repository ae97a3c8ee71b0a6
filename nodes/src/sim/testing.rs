//! Objects for the tests of the simulation.

use tactflow_runtime::node::{NonNegative, Positive};

use super::object::{Look, Thing};

/// A rigid, fixed object without a size.
pub(super) fn thing(shape: Look, at: [f64; 3]) -> Thing {
    Thing {
        shape,
        at,
        turn: [0.0; 3],
        radius: None,
        length: None,
        size: None,
        points: None,
        stiffness: None,
        mount: None,
        mass: Positive(1.0),
        scatter: NonNegative(0.0),
        motion: vec![],
    }
}

/// A rigid ball.
pub(super) fn ball(radius: f64, at: [f64; 3]) -> Thing {
    Thing { radius: Some(Positive(radius)), ..thing(Look::Ball, at) }
}
