//! How a feature answers the motion of the sensor, by geometry: which components change it, and with which sign.
//!
//! z of the sensor points toward the object, and x, y and z are right-handed. A contact moves against the sensor. Where
//! the sensor turns toward the object, it is touched: a turn about +y moves the side at -x toward the object, and a turn
//! about +x the side at +y. This holds for objects of every shape.

use crate::motion::COMPONENTS;

/// A component of a twist that changes a feature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Answer {
    /// Number of the component.
    pub(super) component: usize,
    /// Sign of the change.
    pub(super) sign: f64,
    /// The reason, for a message.
    pub(super) reason: &'static str,
}

/// The components that change a feature.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// Those with a known sign. A tilt changes a force too, in either direction.
    pub(super) known: &'static [Answer],
    /// Whether a column without any of them is a mistake.
    pub(super) is_needed: bool,
}

const fn answer(component: usize, sign: f64, reason: &'static str) -> Answer {
    Answer { component, sign, reason }
}

const X: &[Answer] = &[
    answer(0, -1.0, "a contact moves along -x when the sensor moves along +x"),
    answer(4, -1.0, "a contact rolls along -x when the sensor turns about +y"),
];
const Y: &[Answer] = &[
    answer(1, -1.0, "a contact moves along -y when the sensor moves along +y"),
    answer(3, 1.0, "a contact rolls along +y when the sensor turns about +x"),
];
const FORCE: &[Answer] = &[answer(2, 1.0, "the force grows when the sensor moves along +z, toward the object")];
const AREA: &[Answer] = &[answer(2, 1.0, "the area grows when the sensor moves along +z, toward the object")];
const DRAG_X: &[Answer] = &[answer(0, -1.0, "an object drags the pad along -x when the sensor moves along +x")];
const DRAG_Y: &[Answer] = &[answer(1, -1.0, "an object drags the pad along -y when the sensor moves along +y")];
const TORQUE: &[Answer] = &[answer(5, -1.0, "an object turns the pad back when the sensor turns about +z")];
const ANGLE: &[Answer] = &[answer(5, -1.0, "a line turns by a negative angle when the sensor turns about +z")];

impl Row {
    /// Returns the components that change a quantity; `None` if geometry does not say.
    pub(super) fn of(quantity: &str) -> Option<Self> {
        let (known, is_needed) = match quantity {
            "x" => (X, true),
            "y" => (Y, true),
            "pressure" | "force" => (FORCE, true),
            "orientation" => (ANGLE, true),
            "area" => (AREA, false),
            "fx" => (DRAG_X, false),
            "fy" => (DRAG_Y, false),
            "torque" => (TORQUE, false),
            _ => return None,
        };
        Some(Self { known, is_needed })
    }

    /// Returns the components that change it, for a message.
    pub(super) fn components(self, or: &str) -> String {
        let names: Vec<String> =
            self.known.iter().map(|answer| format!("`{}`", COMPONENTS[answer.component])).collect();
        names.join(or)
    }

    /// Returns a column with the signs that reduce the error.
    pub(super) fn signed(self, mut column: [f64; 6]) -> [f64; 6] {
        for answer in self.known {
            column[answer.component] = answer.sign * column[answer.component].abs();
        }
        column
    }

    /// Returns whether a motion changes the quantity.
    pub(super) fn changes(self, column: &[f64; 6]) -> bool {
        self.known.iter().any(|answer| column[answer.component] != 0.0)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;

    /// Where a pad with a pose touches a ball: the point of the pad's plane that is nearest to the centre, in its frame.
    fn touched(turn: Vector3<f64>, at: Vector3<f64>, centre: Vector3<f64>) -> Vector3<f64> {
        Rotation3::new(turn).inverse() * (centre - at)
    }

    #[test]
    fn the_signs_are_those_of_a_pad_on_a_ball() {
        let centre = Vector3::new(0.002, -0.003, 0.05);
        let step = 1e-6;
        for (quantity, axis) in [("x", 0), ("y", 1)] {
            for answer in Row::of(quantity).unwrap().known {
                let motion = Vector3::ith(answer.component % 3, step);
                let still = Vector3::zeros();
                let (turn, at) = if answer.component < 3 { (still, motion) } else { (motion, still) };
                let change = touched(turn, at, centre)[axis] - touched(still, still, centre)[axis];
                assert_eq!(change.signum(), answer.sign, "{quantity} and {}", COMPONENTS[answer.component]);
            }
        }
        let nearer = touched(Vector3::zeros(), Vector3::z() * step, centre).z - centre.z;
        assert_eq!(-nearer.signum(), Row::of("pressure").unwrap().known[0].sign);
        let line = Rotation3::new(Vector3::z() * step).inverse() * Vector3::x();
        assert_eq!(line.y.atan2(line.x).signum(), Row::of("orientation").unwrap().known[0].sign);
    }
}
