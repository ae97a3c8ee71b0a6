//! `pivot`: rotations of a sensor about the contact.
//!
//! For the contact at c and the rotation w, the origin of the sensor moves at -w x c, so that the point of the sensor at
//! the contact does not move: the velocity of that point is v + w x c.

use nalgebra::Vector3;
use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Setup, Tick};
use tactflow_runtime::signal::{Scalar, Twist};

/// Lets a sensor rotate about the contact instead of about its origin.
///
/// Rolling and turning about the origin of the sensor move a contact that is not there: the force changes with each
/// rotation, by the rotation times the distance of the contact. Behind this node the rotation leaves the contact where
/// it is, so the loops of force and rolling do not disturb each other. The linear part of the twist is then the
/// velocity of the contact, and not that of the origin.
///
/// Wire it behind the `projector`, before the motions of guides are added. Without a contact, while `in.x` or `in.y` is
/// absent, the twist is absent too.
///
/// ```toml
/// [nodes.pivot]                       # roll about the contact
/// type = "pivot"
/// in.twist = "projector.twist"
/// in.x = "moments.x"
/// in.y = "moments.y"
/// ```
#[derive(Describe)]
pub struct Pivot;

/// What `pivot` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The motion, with rotations about the contact.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
    /// Place of the contact along the sensor's x.
    #[port(unit = "m", frame = "A", quantity = "x", sampled)]
    x: In<'a, Scalar>,
    /// Place of the contact along the sensor's y.
    #[port(unit = "m", frame = "A", quantity = "y", sampled)]
    y: In<'a, Scalar>,
}

/// What `pivot` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion, as a twist at the origin of the sensor.
    #[port(frame = "A")]
    twist: Out<Twist>,
}

impl Node for Pivot {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new((): (), _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let contact = Vector3::new(*inputs.x, *inputs.y, 0.0);
        let [linear, angular] = [inputs.twist.linear(), inputs.twist.angular()];
        out.twist.set(Twist::new(linear - angular.cross(&contact), angular));
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{ScalarShape, Shape, TwistShape, Unit};

    use super::*;

    #[test]
    fn the_point_at_the_contact_moves_with_the_linear_part_alone() {
        for (rotation, contact) in
            [([0.3, 0.0, 0.0], [0.01, -0.02]), ([0.0, -0.5, 0.0], [0.03, 0.01]), ([0.1, 0.2, -0.7], [-0.02, 0.04])]
        {
            let wanted = Vector3::new(0.001, 0.0, 0.002);
            let place = || Shape::from(ScalarShape::of(Unit::METRE));
            let wires = [("twist", Shape::from(TwistShape)), ("x", place()), ("y", place())];
            let mut rig = NodeRig::new::<Pivot>("", &wires).unwrap();
            rig.set("twist", Twist::new(wanted, rotation.into()));
            rig.step();
            assert_eq!(rig.get::<Twist>("twist"), None, "there is no contact");
            rig.set("twist", Twist::new(wanted, rotation.into()));
            rig.set("x", contact[0]);
            rig.set("y", contact[1]);
            rig.step();
            let twist = rig.get::<Twist>("twist").unwrap();
            let at_contact = twist.linear() + twist.angular().cross(&Vector3::new(contact[0], contact[1], 0.0));
            assert!((at_contact - wanted).norm() < 1e-15, "{at_contact}");
            assert_eq!(twist.angular(), Vector3::from(rotation));
        }
    }
}
