//! Objects for tests of the simulation.

use super::object::{ObjectParams, ShapeKind};

/// Returns a rigid, fixed object without a size.
pub(super) fn thing(shape: ShapeKind, at: [f64; 3]) -> ObjectParams {
    ObjectParams {
        shape,
        at,
        turn: [0.0; 3],
        radius: None,
        length: None,
        size: None,
        points: None,
        stiffness: None,
        mount: None,
        mass: 1.0,
        turn_mount: None,
        inertia: 0.001,
        scatter: 0.0,
        motion: vec![],
    }
}

/// Returns a rigid, fixed ball.
pub(super) fn ball(radius: f64, at: [f64; 3]) -> ObjectParams {
    ObjectParams { radius: Some(radius), ..thing(ShapeKind::Ball, at) }
}
