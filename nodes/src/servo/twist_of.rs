//! `twist_of`: a twist from scalars, one for each component that is wired.
//!
//! A component that is absent, or that nothing is wired to, is zero; the twist is absent when all are absent. It is as
//! old as the oldest component in it.

use tactflow_runtime::node::{At, Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::Twist;
use tactflow_runtime::source::Code;
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// Frame of the twist; what it is wired to decides when this is not said.
    frame: Option<String>,
}

inputs! {
    /// Speed along x [m/s].
    vx: Trigger<Scalar["m/s", "$frame"]>,
    /// Speed along y [m/s].
    vy: Trigger<Scalar["m/s", "$frame"]>,
    /// Speed along z [m/s].
    vz: Trigger<Scalar["m/s", "$frame"]>,
    /// Angular speed about x [rad/s].
    wx: Trigger<Scalar["rad/s", "$frame"]>,
    /// Angular speed about y [rad/s].
    wy: Trigger<Scalar["rad/s", "$frame"]>,
    /// Angular speed about z [rad/s].
    wz: Trigger<Scalar["rad/s", "$frame"]>,
}

outputs! {
    /// The twist [m/s, rad/s].
    twist: Twist["$frame"],
}

/// What is put together has nothing to set.
pub struct TwistOf;

impl tactflow_runtime::node::Describe for TwistOf {
    const NAME: &'static str = "twist_of";
    const SUMMARY: &'static str = "puts a motion together from scalars, such as a test signal on one axis";
    const DOC: &'static str = "Each wire is one component of the twist; what is not wired is zero. With a \
        `signal_generator` on one wire it moves one axis alone, which is what the identification of an arm or of a \
        contact takes: a chirp on vz against the pressure, a step on wx against the place of the contact.\n\n\
        A component that is absent counts as zero, and when all that are wired are absent the twist is absent: \
        zero motion. The units are checked: m/s for the linear part, rad/s for the angular part. `frame` is the \
        sensor's role (`\"pad\"`) or `\"base\"`; it need not be said where a wire tells it.";
    const EXAMPLE: &'static str = r#"
[nodes.twist_of]                    # the test signal along the pad's normal
type = "twist_of"
in.vz = "signal_generator.value"
frame = "pad"
"#;
}

impl Node for TwistOf {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(_: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let InputShapes { vx, vy, vz, wx, wy, wz, .. } = &setup.inputs;
        if [vx, vy, vz, wx, wy, wz].iter().all(|wire| wire.is_none()) {
            let mistake = Mistake::new(Code::MissingInput, At::Node, "no component is wired");
            return Err(mistake.help("wire one of vx, vy, vz, wx, wy and wz: `in.vz = \"node.port\"`").into());
        }
        Ok(Self)
    }

    fn state(&self) {}

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

    const NAMES: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];

    fn rig(names: &[&str]) -> Result<NodeRig, Mistakes> {
        let shape = || Shape::from(ScalarShape::of(Unit::METRE.per_second()));
        let wires: Vec<(&str, Shape)> = names.iter().map(|name| (*name, shape())).collect();
        NodeRig::new::<TwistOf>("", &wires)
    }

    #[test]
    fn each_wire_is_its_component_and_what_is_absent_is_zero() {
        let mut rig = rig(&NAMES).unwrap();
        for (i, name) in NAMES.iter().enumerate() {
            rig.set(name, 1.0);
            rig.step();
            let mut expected = Twist::default();
            expected.0[i] = 1.0;
            assert_eq!(rig.get::<Twist>("twist"), Some(&expected), "{name}");
            rig.lose(name);
            rig.step();
            assert_eq!((rig.get::<Twist>("twist"), rig.freshness("twist")), (None, Freshness::Lost), "{name}");
        }
        for (i, name) in NAMES.iter().enumerate() {
            rig.set(name, i as f64);
        }
        rig.step();
        assert_eq!(rig.get::<Twist>("twist"), Some(&Twist([0.0, 1.0, 2.0, 3.0, 4.0, 5.0].into())));
    }

    #[test]
    fn it_is_as_old_as_its_oldest_component() {
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
    fn nothing_to_put_together_is_a_mistake() {
        let mistakes = rig(&[]).err().unwrap();
        assert_eq!((mistakes.len(), mistakes[0].code, &mistakes[0].at), (1, Code::MissingInput, &At::Node));
    }
}
