//! The columns of a recording: the scalars of a graph's ports, by name.

use crate::graph::PlannedPort;
use crate::node::{Bus, PortId, ScalarId};
use crate::signal::{Kind, Shape, Unit};

/// The name and unit of one scalar.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortColumn {
    /// `node.port`, or `node.port.x` for a component.
    pub name: String,
    /// The end of the name behind that of the port: empty, or `.x` for a component.
    pub part: String,
    /// Unit of the values.
    pub unit: Unit,
}

/// The scalars of several ports, port by port.
#[derive(Debug, Clone, Default)]
pub struct PortColumns {
    /// The columns.
    pub list: Vec<PortColumn>,
    ports: Vec<(PortId, Kind)>,
}

impl PortColumns {
    /// Returns the columns of `ports`. Images, vector images, masks, regions and Jacobians have none.
    #[must_use]
    pub fn new(ports: &[(PlannedPort, PortId)]) -> Self {
        let mut columns = Self::default();
        for (port, id) in ports {
            columns.ports.push((*id, port.shape.kind()));
            columns.list.extend(Self::of(port));
        }
        columns
    }

    /// Returns the columns of one port.
    #[must_use]
    pub fn of(port: &PlannedPort) -> Vec<PortColumn> {
        let named = |(suffix, unit): (String, Unit)| {
            let part = if suffix.is_empty() { suffix } else { format!(".{suffix}") };
            PortColumn { name: format!("{}{part}", port.name), part, unit }
        };
        port.shape.scalars().into_iter().map(named).collect()
    }

    /// Finds the scalar with that column name among the scalars of `ports`.
    #[must_use]
    pub fn find(ports: &[(PlannedPort, PortId)], name: &str) -> Option<ScalarId> {
        ports.iter().find_map(|(port, id)| {
            let index = Self::of(port).iter().position(|column| column.name == name)?;
            Some(ScalarId { port: *id, kind: port.shape.kind(), index })
        })
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
            let width = bus.arenas.read_scalars(*kind, id.slot, 0, rest);
            let (values, others) = rest.split_at_mut(width);
            if !bus.mark(*id).is_present() {
                values.fill(f64::NAN);
            }
            rest = others;
        }
        assert!(rest.is_empty(), "a row must be as long as the list of columns");
    }
}

/// Describes how a port of that kind is recorded, for the reference.
#[must_use]
pub const fn recorded(kind: Kind) -> &'static str {
    match kind {
        Kind::Scalar => "a column",
        Kind::Flag => "a column, 0 or 1",
        Kind::Features => "a column for each name",
        Kind::Twist => "the columns `vx` `vy` `vz` [m/s] and `wx` `wy` `wz` [rad/s]",
        Kind::Pose => "the columns `x` `y` `z` [m] and the quaternion `qx` `qy` `qz` `qw`",
        Kind::Joints => "a column for each joint, by its name",
        Kind::Image | Kind::VectorImage | Kind::Mask | Kind::Regions | Kind::Jacobian => "not at all",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{
        Feature, FeaturesShape, FlagShape, ImageShape, JacobianShape, Joint, JointsShape, MaskShape, PoseShape,
        RegionsShape, ScalarShape, TwistShape, VectorImageShape,
    };

    #[test]
    fn the_description_of_a_kind_matches_its_columns() {
        let shapes: [Shape; 11] = [
            ScalarShape::default().into(),
            FlagShape.into(),
            FeaturesShape { features: vec![Feature::default()] }.into(),
            ImageShape::default().into(),
            VectorImageShape::default().into(),
            MaskShape::default().into(),
            RegionsShape::default().into(),
            TwistShape.into(),
            PoseShape::default().into(),
            JointsShape { joints: vec![Joint::default()], ..JointsShape::default() }.into(),
            JacobianShape::default().into(),
        ];
        assert!(Kind::ALL.iter().all(|kind| shapes.iter().any(|shape| shape.kind() == *kind)));
        for shape in shapes {
            let description = recorded(shape.kind());
            let columns = shape.scalars();
            assert_eq!(description == "not at all", columns.is_empty(), "{}", shape.kind());
            let graph_named = matches!(shape.kind(), Kind::Features | Kind::Joints);
            for (name, _) in columns.iter().filter(|(name, _)| !name.is_empty() && !graph_named) {
                assert!(description.contains(&format!("`{name}`")), "{}: {name}", shape.kind());
            }
        }
    }
}
