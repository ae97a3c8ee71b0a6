//! The ports of the role `true_object`: quantities of the object that only a simulation knows.

use std::borrow::Cow;

use tactflow_runtime::device::{Description, Output, Samples};
use tactflow_runtime::node::PortSpec;
use tactflow_runtime::signal::{Flag, FlagShape, Kind, Scalar, ScalarShape};

use super::world::PairWorld;
use crate::roles::true_object;

/// The ports, in the order of the role.
pub struct ObjectPorts {
    /// Each scalar with its name.
    scalars: Vec<(Cow<'static, str>, Output<Scalar>)>,
    held: Output<Flag>,
}

impl ObjectPorts {
    /// Adds the role to a description.
    pub fn fill(description: &mut Description) -> Self {
        let role = true_object();
        let mut object = description.fills(role.name);
        let held = object.output("held", FlagShape);
        let scalars = role.outputs.into_iter().filter(|port| port.kind == Kind::Scalar);
        let scalar = |port: PortSpec| {
            let unit = port.args[0].parse().expect("the role's units are units");
            (port.name.clone(), object.output(port.name, ScalarShape::of(unit)))
        };
        Self { scalars: scalars.map(scalar).collect(), held }
    }

    /// Writes the values at `now` [ns].
    pub fn write(&self, world: &PairWorld, now: i64, sequence: u64, samples: &mut Samples) {
        let place = world.body.object.pose.translation;
        // A sum of nothing is -0, and a recording shows its sign.
        let force = |side: usize| world.sides[side].contact.normal() + 0.0;
        let tangential = |side: usize| world.sides[side].contact.friction().length();
        let value = |name: &str| match name {
            "x" => place.x,
            "y" => place.y,
            "z" => place.z,
            "tilt" => world.body.tilt(),
            "squeeze" => force(0).min(force(1)),
            "left_force" => force(0),
            "right_force" => force(1),
            "left_tangential" => tangential(0),
            "right_tangential" => tangential(1),
            "table_force" => world.table.force,
            other => unreachable!("the role has an output `{other}` that the cell does not know"),
        };
        for (name, port) in &self.scalars {
            *samples.write(*port, now, sequence) = value(name);
        }
        *samples.write(self.held, now, sequence) = world.is_held();
    }
}
