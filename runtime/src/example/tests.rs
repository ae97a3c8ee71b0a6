//! Examples of a world of one motor and two nodes.

use super::*;
use crate::device::{Commands, Description, Device, DeviceError, Driver, Opened, RoleType, Samples, Stepped};
use crate::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, PortSpec, Setup, Tick};
use crate::signal::{Joint, Joints, JointsShape, Kind, Unit};

mod follow {
    use super::*;

    /// Follows its position.
    ///
    /// ```toml
    /// [nodes.follow]
    /// type = "follow"                     # it is all there is
    /// in.position = "motor.position"
    /// ```
    #[derive(Describe)]
    pub(super) struct Follow;

    /// What it reads.
    #[derive(Inputs)]
    pub(super) struct Inputs<'a> {
        /// The position.
        #[port(unit = "rad", robot = "A")]
        #[expect(dead_code, reason = "the node never steps")]
        position: In<'a, Joints>,
    }

    /// What it writes.
    #[derive(Outputs)]
    pub(super) struct Outputs {
        /// The velocity.
        #[port(unit = "rad/s", robot = "A")]
        velocity: Out<Joints>,
    }

    impl Node for Follow {
        type Params = ();
        type Inputs<'a> = Inputs<'a>;
        type Outputs = Outputs;
        type State = ();

        fn new((): (), setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
            setup.outputs.velocity = setup.inputs.position.in_unit(Unit::RADIAN.per_second());
            Ok(Self)
        }
        fn step(&self, _: &Tick, _: Inputs<'_>, _: &mut Outputs, (): &mut ()) {}
    }
}

mod bound {
    use super::*;

    /// Bounds a velocity.
    ///
    /// ```toml
    /// [nodes.bound]
    /// type = "bound"
    /// in.velocity = "follow.velocity"
    /// ```
    #[derive(Describe)]
    #[describe(name = "bound")]
    pub(super) struct BoundVelocity;

    /// What it reads.
    #[derive(Inputs)]
    pub(super) struct Inputs<'a> {
        /// Any velocity.
        #[port(unit = "rad/s", robot = "A")]
        #[expect(dead_code, reason = "the node never steps")]
        velocity: In<'a, Joints>,
    }

    /// What it writes.
    #[derive(Outputs)]
    pub(super) struct Outputs {
        /// The same velocity, bounded.
        #[port(unit = "rad/s", robot = "A")]
        velocity: Out<Joints>,
    }

    impl Node for BoundVelocity {
        type Params = ();
        type Inputs<'a> = Inputs<'a>;
        type Outputs = Outputs;
        type State = ();

        fn new((): (), setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
            setup.outputs.velocity = setup.inputs.velocity.clone();
            Ok(Self)
        }
        fn step(&self, _: &Tick, _: Inputs<'_>, _: &mut Outputs, (): &mut ()) {}
    }
}

/// A motor that stands still.
struct Motor;

impl tactflow_runtime::node::Describe for Motor {
    const NAME: &'static str = "still_motor";
    const SUMMARY: &'static str = "";
    const EXAMPLE: &'static str = r#"
[roles]
motor = "motor"

[commands]
motor.velocity = "follow.velocity"

[bind]
motor = "m"

[devices.m]
type = "still_motor"
"#;
}

impl Device for Motor {
    type Params = ();

    fn open((): ()) -> Result<Opened, Mistakes> {
        let joint = Joint { name: "a".into(), lower: -1.0, upper: 1.0, speed: 1.0, acceleration: 10.0, start: None };
        let shape = JointsShape { joints: vec![joint], unit: Unit::RADIAN };
        let mut description = Description::every(0.004);
        let mut motor = description.fills("motor");
        motor.command("velocity", shape.in_unit(Unit::RADIAN.per_second()));
        motor.output::<Joints>("position", shape);
        Ok(Opened { description, driver: Driver::Stepped(Box::new(Self)) })
    }
}

impl Stepped for Motor {
    fn next(&self) -> Option<i64> {
        None
    }
    fn exchange(&mut self, _: i64, _: &Commands, _: &mut Samples) -> Result<(), DeviceError> {
        Ok(())
    }
}

fn world() -> Catalogue {
    let port = |name, unit| PortSpec::new(name, "", Kind::Joints, &[unit, "self"]);
    let role = RoleType {
        name: "motor".into(),
        outputs: vec![port("position", "rad")],
        commands: vec![port("velocity", "rad/s")],
        ..RoleType::default()
    };
    Catalogue::new().role(role).node::<follow::Follow>().node::<bound::BoundVelocity>().device::<Motor>()
}

#[test]
fn a_command_pulls_in_what_drives_it_and_the_block_is_marked() {
    let expected = "\
[graph]
clock = \"motor\"

[roles]
motor = \"motor\"

[commands]
motor.velocity = \"follow.velocity\"

[nodes.follow]
type = \"follow\"                     # it is all there is
in.position = \"motor.position\"

[bind]
motor = \"m\"

# ==== still_motor ====
[devices.m]
type = \"still_motor\"
";
    assert_eq!(example_graph(&world(), "still_motor").as_deref(), Ok(expected));
    assert!(compile(&world(), &Request::text(expected)).is_ok_and(|plan| plan.warnings().is_none()));
}

#[test]
fn a_node_that_nobody_reads_is_put_into_the_wire_it_reads() {
    let text = example_graph(&world(), "bound").unwrap();
    assert!(text.contains("motor.velocity = \"bound.velocity\""), "{text}");
    assert!(text.contains("# ==== bound ====\n[nodes.bound]\ntype = \"bound\"\nin.velocity = \"follow.velocity\""));
    assert!(compile(&world(), &Request::text(text)).is_ok_and(|plan| plan.warnings().is_none()));
    let other = example_graph(&world(), "follow").unwrap();
    assert!(other.contains("motor.velocity = \"follow.velocity\"") && !other.contains("bound"), "{other}");
}

#[test]
fn a_missing_example_is_named() {
    let bound = Catalogue::new().node::<bound::BoundVelocity>();
    assert_eq!(example_graph(&bound, "bound"), Err("no example has the `follow` that `bound` needs".into()));
    assert_eq!(example_graph(&bound, "follow"), Err("`follow` has no example".into()));
}

#[test]
fn a_text_is_split_into_sections_and_keeps_its_comments() {
    let text = "\n# What a task asks.\n[roles]\narm = \"x\"   # the arm\n\n[bind]\narm = \"a\"\n\n# The one.\n[devices.a]\n\
                type = \"t\"\nlist = [\n[1, 2],\n]\n[[devices.a.press]]\nforce = 3.0\n# end\n";
    let sections = sections(text);
    assert_eq!(sections["roles"], "# What a task asks.\narm = \"x\"   # the arm\n\n");
    assert_eq!(sections["bind"], "arm = \"a\"\n\n");
    let block =
        "# The one.\n[devices.a]\ntype = \"t\"\nlist = [\n[1, 2],\n]\n[[devices.a.press]]\nforce = 3.0\n# end\n";
    assert_eq!(sections[""], block);
}
