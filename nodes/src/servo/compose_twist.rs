//! `compose_twist`: a twist from scalars. All inputs are optional; a node without a wire is a mistake.

use tactflow_runtime::node::{At, Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Scalar, Twist};
use tactflow_runtime::source::Code;

/// Composes a motion from scalars, such as a test signal on one axis.
///
/// Each input is one component of the twist; a component that is not wired is zero. A `signal_generator` on one input
/// moves one axis alone, to identify an arm or a contact: a chirp on vz against the pressure, a step on wx against the
/// place of the contact.
///
/// A component that is absent counts as zero. When all wired components are absent, the twist is absent, which means
/// zero motion. The twist is as old as the oldest component in it. The linear part is in m/s, the angular part in
/// rad/s. `frame` is the role of the sensor (`"pad"`) or `"base"`; leave it out if a wire defines it.
///
/// ```toml
/// [nodes.compose_twist]                    # the test signal along the pad's normal
/// type = "compose_twist"
/// in.vz = "signal_generator.value"
/// frame = "pad"
/// ```
#[derive(Describe)]
pub struct ComposeTwist;

/// Parameters of `compose_twist`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Frame of the twist. Without it, the frame follows from the wires.
    frame: Option<String>,
}

/// What `compose_twist` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Speed along x.
    #[port(unit = "m/s", frame = "$frame", optional)]
    vx: Option<In<'a, Scalar>>,
    /// Speed along y.
    #[port(unit = "m/s", frame = "$frame", optional)]
    vy: Option<In<'a, Scalar>>,
    /// Speed along z.
    #[port(unit = "m/s", frame = "$frame", optional)]
    vz: Option<In<'a, Scalar>>,
    /// Angular speed about x.
    #[port(unit = "rad/s", frame = "$frame", optional)]
    wx: Option<In<'a, Scalar>>,
    /// Angular speed about y.
    #[port(unit = "rad/s", frame = "$frame", optional)]
    wy: Option<In<'a, Scalar>>,
    /// Angular speed about z.
    #[port(unit = "rad/s", frame = "$frame", optional)]
    wz: Option<In<'a, Scalar>>,
}

/// What `compose_twist` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The twist.
    #[port(frame = "$frame")]
    twist: Out<Twist>,
}

impl Node for ComposeTwist {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(_: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let InputsShapes { vx, vy, vz, wx, wy, wz, .. } = &setup.inputs;
        if [vx, vy, vz, wx, wy, wz].iter().all(|wire| wire.is_none()) {
            let mistake = Mistake::new(Code::MissingInput, At::Node, "no component is wired");
            return Err(mistake.help("wire one of vx, vy, vz, wx, wy and wz: `in.vz = \"node.port\"`").into());
        }
        Ok(Self)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let Inputs { vx, vy, vz, wx, wy, wz, .. } = inputs;
        let components = [vx, vy, vz, wx, wy, wz];
        if components.iter().any(Option::is_some) {
            out.twist.set(Twist(components.map(|component| component.map_or(0.0, |value| *value)).into()));
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, ScalarShape, Shape, Stamp, Unit};

    use super::*;
    use crate::motion::COMPONENTS;

    fn rig(names: &[&str]) -> Result<NodeRig, Mistakes> {
        let shape = || Shape::from(ScalarShape::of(Unit::METRE.per_second()));
        let wires: Vec<(&str, Shape)> = names.iter().map(|name| (*name, shape())).collect();
        NodeRig::new::<ComposeTwist>("", &wires)
    }

    #[test]
    fn each_input_is_one_component_and_an_absent_one_is_zero() {
        let mut rig = rig(&COMPONENTS).unwrap();
        for (i, name) in COMPONENTS.iter().enumerate() {
            rig.set(name, 1.0);
            rig.step();
            let mut expected = Twist::default();
            expected.0[i] = 1.0;
            assert_eq!(rig.get::<Twist>("twist"), Some(&expected), "{name}");
            rig.lose(name);
            rig.step();
            assert_eq!((rig.get::<Twist>("twist"), rig.freshness("twist")), (None, Freshness::Lost), "{name}");
        }
        for (i, name) in COMPONENTS.iter().enumerate() {
            rig.set(name, i as f64);
        }
        rig.step();
        assert_eq!(rig.get::<Twist>("twist"), Some(&Twist([0.0, 1.0, 2.0, 3.0, 4.0, 5.0].into())));
    }

    #[test]
    fn the_twist_is_as_old_as_its_oldest_component() {
        let mut rig = rig(&["vz", "wx"]).unwrap();
        rig.edit("vz", Stamp::TIMELESS, |vz: &mut f64| *vz = 0.1);
        rig.step();
        assert!(rig.mark("twist").stamp().is_timeless());
        rig.set("wx", 0.2);
        rig.step();
        rig.edit("vz", Stamp::TIMELESS, |vz: &mut f64| *vz = 0.3);
        rig.step();
        assert_eq!(rig.mark("twist").stamp(), Stamp { nanos: 1_000_000, device: 0 });
        assert_eq!(rig.get::<Twist>("twist"), Some(&Twist([0.0, 0.0, 0.3, 0.2, 0.0, 0.0].into())));
    }

    #[test]
    fn no_wired_component_is_a_mistake() {
        let mistakes = rig(&[]).err().unwrap();
        assert_eq!((mistakes.len(), mistakes[0].code, &mistakes[0].at), (1, Code::MissingInput, &At::Node));
    }
}
