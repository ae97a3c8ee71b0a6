//! How a feature answers the motion of the sensor, by geometry: which components change it, and with which sign.
//!
//! z of the sensor points toward the object, and x, y and z are right-handed. A contact moves against the sensor. Where
//! the sensor turns toward the object, it is touched: a turn about +y moves the side at -x toward the object, and a turn
//! about +x the side at +y. This holds for objects of every shape.

use crate::motion::COMPONENTS;

/// A component of a twist that changes a feature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct KnownSign {
    /// Number of the component.
    pub(super) component: usize,
    /// Sign of the change.
    pub(super) sign: f64,
    /// The reason, for a message.
    pub(super) reason: &'static str,
}

/// A component that changes a feature, and one that changes another feature and is easily written in its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Confusion {
    /// Number of the component that changes the feature.
    pub(super) own: usize,
    /// Number of the other one.
    pub(super) other: usize,
}

/// The components that change a feature.
#[derive(Debug, Clone, Copy)]
pub(super) struct Geometry {
    /// Those with a known sign. A tilt changes a force too, in either direction.
    pub(super) known: &'static [KnownSign],
    /// Whether a column without any of them is a mistake.
    pub(super) is_needed: bool,
    /// Which of them are confused with others.
    pub(super) confused: &'static [Confusion],
}

const fn known(component: usize, sign: f64, reason: &'static str) -> KnownSign {
    KnownSign { component, sign, reason }
}

const X: &[KnownSign] = &[
    known(0, -1.0, "a contact moves along -x when the sensor moves along +x"),
    known(4, -1.0, "a contact rolls along -x when the sensor turns about +y"),
];
const Y: &[KnownSign] = &[
    known(1, -1.0, "a contact moves along -y when the sensor moves along +y"),
    known(3, 1.0, "a contact rolls along +y when the sensor turns about +x"),
];
const FORCE: &[KnownSign] = &[known(2, 1.0, "the force grows when the sensor moves along +z, toward the object")];
const SPARE: &[KnownSign] = &[known(2, 1.0, "the spare force grows when the sensor moves along +z, toward the object")];
const AREA: &[KnownSign] = &[known(2, 1.0, "the area grows when the sensor moves along +z, toward the object")];
const DRAG_X: &[KnownSign] = &[known(0, -1.0, "an object drags the pad along -x when the sensor moves along +x")];
const DRAG_Y: &[KnownSign] = &[known(1, -1.0, "an object drags the pad along -y when the sensor moves along +y")];
const TORQUE: &[KnownSign] = &[known(5, -1.0, "an object turns the pad back when the sensor turns about +z")];
const ANGLE: &[KnownSign] = &[known(5, -1.0, "a line turns by a negative angle when the sensor turns about +z")];

const fn confused(own: usize, other: usize) -> Confusion {
    Confusion { own, other }
}

const OF_X: &[Confusion] = &[confused(0, 1), confused(4, 3)];
const OF_Y: &[Confusion] = &[confused(1, 0), confused(3, 4)];
const OF_FORCE: &[Confusion] = &[confused(2, 0), confused(2, 1)];
const NONE: &[Confusion] = &[];

/// Returns whether a quantity is the force on one tactel, or on the whole pad.
pub(super) fn is_force(quantity: &str) -> bool {
    matches!(quantity, "pressure" | "force")
}

/// Returns the components that a column moves, for a message.
pub(super) fn moved(column: &[f64; 6]) -> String {
    let moved: Vec<String> = (0..6).filter(|i| column[*i] != 0.0).map(|i| format!("`{}`", COMPONENTS[i])).collect();
    moved.join(" and ")
}

impl Geometry {
    /// Returns the components that change a quantity; `None` if geometry does not say.
    pub(super) fn of(quantity: &str) -> Option<Self> {
        let (known, is_needed, confused) = match quantity {
            "x" => (X, true, OF_X),
            "y" => (Y, true, OF_Y),
            force if is_force(force) => (FORCE, true, OF_FORCE),
            "orientation" => (ANGLE, true, NONE),
            "spare" => (SPARE, false, NONE),
            "area" => (AREA, false, NONE),
            "fx" => (DRAG_X, false, NONE),
            "fy" => (DRAG_Y, false, NONE),
            "torque" => (TORQUE, false, NONE),
            _ => return None,
        };
        Some(Self { known, is_needed, confused })
    }

    /// Returns the sign with which a component changes the quantity; `None` if geometry does not say.
    pub(super) fn sign(self, component: usize) -> Option<f64> {
        self.known.iter().find(|known| known.component == component).map(|known| known.sign)
    }

    /// Returns the components that change it, for a message.
    pub(super) fn components(self, or: &str) -> String {
        let names: Vec<String> = self.known.iter().map(|known| format!("`{}`", COMPONENTS[known.component])).collect();
        names.join(or)
    }

    /// Returns a column with the signs that reduce the error.
    pub(super) fn signed(self, mut column: [f64; 6]) -> [f64; 6] {
        for known in self.known {
            column[known.component] = known.sign * column[known.component].abs();
        }
        column
    }

    /// Returns whether a motion changes the quantity.
    pub(super) fn changes(self, column: &[f64; 6]) -> bool {
        self.known.iter().any(|known| column[known.component] != 0.0)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;
    use crate::tool::control::contacts::Answer;

    /// Where a pad with a pose touches a ball: the point of the pad's plane that is nearest to the centre, in its frame.
    fn touched(turn: Vector3<f64>, at: Vector3<f64>, centre: Vector3<f64>) -> Vector3<f64> {
        Rotation3::new(turn).inverse() * (centre - at)
    }

    #[test]
    fn the_signs_are_those_of_a_pad_on_a_ball() {
        let centre = Vector3::new(0.002, -0.003, 0.05);
        let step = 1e-6;
        for (quantity, axis) in [("x", 0), ("y", 1)] {
            for known in Geometry::of(quantity).unwrap().known {
                let motion = Vector3::ith(known.component % 3, step);
                let still = Vector3::zeros();
                let (turn, at) = if known.component < 3 { (still, motion) } else { (motion, still) };
                let change = touched(turn, at, centre)[axis] - touched(still, still, centre)[axis];
                assert_eq!(change.signum(), known.sign, "{quantity} and {}", COMPONENTS[known.component]);
            }
        }
        let nearer = touched(Vector3::zeros(), Vector3::z() * step, centre).z - centre.z;
        assert_eq!(-nearer.signum(), Geometry::of("pressure").unwrap().known[0].sign);
        let line = Rotation3::new(Vector3::z() * step).inverse() * Vector3::x();
        assert_eq!(line.y.atan2(line.x).signum(), Geometry::of("orientation").unwrap().known[0].sign);
    }

    #[test]
    fn the_answers_by_geometry_have_the_same_signs() {
        let mut compared = 0;
        for quantity in ["x", "y", "orientation", "angle", "pressure", "force", "area", "fx", "fy", "torque"] {
            let Some((answer, geometry)) = Answer::of_geometry(quantity).zip(Geometry::of(quantity)) else { continue };
            for (component, entry) in answer.row().into_iter().enumerate().filter(|(_, entry)| *entry != 0.0) {
                let sign = geometry.sign(component);
                assert_eq!(sign, Some(entry.signum()), "{quantity} and {}", COMPONENTS[component]);
                compared += 1;
            }
        }
        assert_eq!(compared, 3);
    }
}
