//! Which scalars a graph's ports have, and how to read them: the one place that takes every kind apart.

use nalgebra::UnitQuaternion;

use crate::graph::PlannedPort;
use crate::node::{Bus, PortId};
use crate::signal::{Arenas, Features, Flag, Joints, Kind, Pose, Scalar, Shape, Signal, Twist, Unit};

/// One scalar of a port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// `node.port`, or `node.port.x` for a part of one.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
}

/// The scalars of some ports, port after port.
#[derive(Debug, Clone, Default)]
pub struct Columns {
    /// The scalars.
    pub list: Vec<Column>,
    ports: Vec<(PortId, Part)>,
}

/// How a port is taken apart.
#[derive(Debug, Clone, Copy)]
enum Part {
    Scalar,
    Flag,
    Features,
    Twist,
    Pose,
    Joints,
}

impl Columns {
    /// The scalars of `ports`. Images, masks, regions and Jacobians have none.
    #[must_use]
    pub fn new(ports: &[(PlannedPort, PortId)]) -> Self {
        let mut columns = Self::default();
        for (port, id) in ports {
            let Some((part, _)) = columns_of(&port.shape) else { continue };
            columns.ports.push((*id, part));
            columns.list.extend(Self::of(port));
        }
        columns
    }

    /// The scalars of one port.
    #[must_use]
    pub fn of(port: &PlannedPort) -> Vec<Column> {
        let named = |(suffix, unit): (String, Unit)| {
            let name = if suffix.is_empty() { port.name.clone() } else { format!("{}.{suffix}", port.name) };
            Column { name, unit }
        };
        columns_of(&port.shape).map_or_else(Vec::new, |(_, suffixes)| suffixes.into_iter().map(named).collect())
    }

    /// Number of columns of a port of that shape.
    #[must_use]
    pub fn width(shape: &Shape) -> usize {
        columns_of(shape).map_or(0, |(_, suffixes)| suffixes.len())
    }

    /// Reads every column into `row`; what is absent is NaN. Allocates nothing.
    ///
    /// # Panics
    /// If `row` is not as long as the list.
    pub fn read(&self, bus: &Bus, row: &mut [f64]) {
        let mut rest = row;
        for (id, part) in &self.ports {
            let is_present = bus.marks[id.mark as usize].is_present();
            let width = read_port(&bus.arenas, *id, *part, rest);
            let (mine, others) = rest.split_at_mut(width);
            if !is_present {
                mine.fill(f64::NAN);
            }
            rest = others;
        }
        assert!(rest.is_empty(), "a row is as long as the list of columns");
    }
}

fn columns_of(shape: &Shape) -> Option<(Part, Vec<(String, Unit)>)> {
    let named = |names: &[&str], unit: Unit| names.iter().map(|name| ((*name).to_owned(), unit)).collect::<Vec<_>>();
    Some(match shape {
        Shape::Scalar(shape) => (Part::Scalar, named(&[""], shape.unit)),
        Shape::Flag(_) => (Part::Flag, named(&[""], Unit::ONE)),
        Shape::Features(shape) => {
            (Part::Features, shape.features.iter().map(|feature| (feature.name.clone(), feature.unit)).collect())
        }
        Shape::Twist(_) => {
            let linear = named(&["vx", "vy", "vz"], Unit::METRE.per_second());
            (Part::Twist, [linear, named(&["wx", "wy", "wz"], Unit::RADIAN.per_second())].concat())
        }
        Shape::Pose(_) => {
            (Part::Pose, [named(&["x", "y", "z"], Unit::METRE), named(&["qx", "qy", "qz", "qw"], Unit::ONE)].concat())
        }
        Shape::Joints(shape) => {
            (Part::Joints, shape.joints.iter().map(|joint| (joint.name.clone(), shape.unit)).collect())
        }
        Shape::Image(_) | Shape::Mask(_) | Shape::Regions(_) | Shape::Jacobian(_) => return None,
    })
}

/// How a port of that kind is recorded, for the reference.
#[must_use]
pub const fn recorded(kind: Kind) -> &'static str {
    match kind {
        Kind::Scalar => "a column",
        Kind::Flag => "a column, 0 or 1",
        Kind::Features => "a column for each name",
        Kind::Twist => "the columns `vx` `vy` `vz` [m/s] and `wx` `wy` `wz` [rad/s]",
        Kind::Pose => "the columns `x` `y` `z` [m] and the quaternion `qx` `qy` `qz` `qw`",
        Kind::Joints => "a column for each joint, by its name",
        Kind::Image | Kind::Mask | Kind::Regions | Kind::Jacobian => "not at all",
    }
}

/// Reads one port into the front of `row` and tells how many columns it has.
fn read_port(arenas: &Arenas, id: PortId, part: Part, row: &mut [f64]) -> usize {
    let slot = id.slot as usize;
    match part {
        Part::Scalar => write(row, [Scalar::arena(arenas)[slot]]),
        Part::Flag => write(row, [f64::from(u8::from(Flag::arena(arenas)[slot]))]),
        Part::Features => {
            let features = Features::arena(arenas)[slot].components();
            write(row, features.iter().map(|component| component.get().unwrap_or(f64::NAN)))
        }
        Part::Twist => write(row, Twist::arena(arenas)[slot].0.iter().copied()),
        Part::Pose => {
            let pose = Pose::arena(arenas)[slot].0;
            let turn = UnitQuaternion::from_rotation_matrix(&pose.rotation).coords;
            write(row, pose.translation.vector.iter().chain(turn.iter()).copied())
        }
        Part::Joints => write(row, Joints::arena(arenas)[slot].0.iter().copied()),
    }
}

fn write(row: &mut [f64], values: impl IntoIterator<Item = f64>) -> usize {
    let mut count = 0;
    for (cell, value) in row.iter_mut().zip(values) {
        *cell = value;
        count += 1;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{
        FeaturesShape, FlagShape, ImageShape, JacobianShape, JointsShape, MaskShape, PoseShape, RegionsShape,
        ScalarShape, TwistShape,
    };

    #[test]
    fn what_is_said_to_be_recorded_has_columns_and_nothing_else_has() {
        let shapes: [Shape; 10] = [
            ScalarShape::default().into(),
            FlagShape.into(),
            FeaturesShape::default().into(),
            ImageShape::default().into(),
            MaskShape::default().into(),
            RegionsShape::default().into(),
            TwistShape.into(),
            PoseShape.into(),
            JointsShape::default().into(),
            JacobianShape::default().into(),
        ];
        assert!(Kind::ALL.iter().all(|kind| shapes.iter().any(|shape| shape.kind() == *kind)));
        for shape in shapes {
            let said = recorded(shape.kind());
            let columns = columns_of(&shape).map(|(_, columns)| columns);
            assert_eq!(said == "not at all", columns.is_none(), "{}", shape.kind());
            // Those whose columns have fixed names are said by these names.
            for (name, _) in columns.iter().flatten().filter(|(name, _)| !name.is_empty()) {
                assert!(said.contains(&format!("`{name}`")), "{}: {name}", shape.kind());
            }
        }
    }
}
