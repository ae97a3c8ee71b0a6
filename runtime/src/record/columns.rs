//! The columns of a record: the scalars of a graph's ports, by name.

use crate::graph::PlannedPort;
use crate::node::{Bus, PortId};
use crate::signal::{Kind, Shape, Unit};

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
    ports: Vec<(PortId, Kind)>,
}

impl Columns {
    /// Lists the scalars of `ports`. Images, masks, regions and Jacobians have none.
    #[must_use]
    pub fn new(ports: &[(PlannedPort, PortId)]) -> Self {
        let mut columns = Self::default();
        for (port, id) in ports {
            columns.ports.push((*id, port.shape.kind()));
            columns.list.extend(Self::of(port));
        }
        columns
    }

    /// Lists the scalars of one port.
    #[must_use]
    pub fn of(port: &PlannedPort) -> Vec<Column> {
        let named = |(suffix, unit): (String, Unit)| {
            let name = if suffix.is_empty() { port.name.clone() } else { format!("{}.{suffix}", port.name) };
            Column { name, unit }
        };
        port.shape.scalars().into_iter().map(named).collect()
    }

    /// Returns the number of columns of a port of that shape.
    #[must_use]
    pub fn width(shape: &Shape) -> usize {
        shape.scalars().len()
    }

    /// Reads every column into `row`; an absent value is NaN. Allocates nothing.
    ///
    /// # Panics
    /// If `row` is not as long as the list.
    pub fn read(&self, bus: &Bus, row: &mut [f64]) {
        let mut rest = row;
        for (id, kind) in &self.ports {
            let is_present = bus.marks[id.mark as usize].is_present();
            let width = bus.arenas.read_scalars(*kind, id.slot, rest);
            let (mine, others) = rest.split_at_mut(width);
            if !is_present {
                mine.fill(f64::NAN);
            }
            rest = others;
        }
        assert!(rest.is_empty(), "a row is as long as the list of columns");
    }
}

/// Returns how a port of that kind is recorded, for the reference.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{
        Feature, FeaturesShape, FlagShape, ImageShape, JacobianShape, Joint, JointsShape, MaskShape, PoseShape,
        RegionsShape, ScalarShape, TwistShape,
    };

    #[test]
    fn what_is_said_to_be_recorded_has_columns_and_nothing_else_has() {
        let shapes: [Shape; 10] = [
            ScalarShape::default().into(),
            FlagShape.into(),
            FeaturesShape { features: vec![Feature::default()] }.into(),
            ImageShape::default().into(),
            MaskShape::default().into(),
            RegionsShape::default().into(),
            TwistShape.into(),
            PoseShape.into(),
            JointsShape { joints: vec![Joint::default()], ..JointsShape::default() }.into(),
            JacobianShape::default().into(),
        ];
        assert!(Kind::ALL.iter().all(|kind| shapes.iter().any(|shape| shape.kind() == *kind)));
        for shape in shapes {
            let said = recorded(shape.kind());
            let columns = shape.scalars();
            assert_eq!(said == "not at all", columns.is_empty(), "{}", shape.kind());
            let graph_named = matches!(shape.kind(), Kind::Features | Kind::Joints);
            for (name, _) in columns.iter().filter(|(name, _)| !name.is_empty() && !graph_named) {
                assert!(said.contains(&format!("`{name}`")), "{}: {name}", shape.kind());
            }
        }
    }
}
