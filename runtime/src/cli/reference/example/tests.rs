//! Examples of a world of one motor and two nodes.
#![allow(unreachable_pub, dead_code, reason = "what the macros declare is public, and these nodes never step")]

use std::borrow::Cow;

use super::*;
use crate::device::{Commands, Description, Device, DeviceError, Driver, Opened, RoleType, Samples, Stepped};
use crate::node::{Mistakes, Need, Node, PortSpec, Setup, Tick};
use crate::signal::{Joint, Joints, JointsShape, Kind, Unit};

/// Follows its position.
mod follow {
    use super::*;

    crate::inputs! {
        /// Where it is.
        position: Joints["rad", "A"],
    }
    crate::outputs! {
        /// Where it goes.
        velocity: Joints["rad/s", "A"],
    }
    crate::params! {}

    pub struct Follow;

    impl tactflow_runtime::node::Describe for Follow {
        const NAME: &'static str = "follow";
        const SUMMARY: &'static str = "";
        const EXAMPLE: &'static str = r#"
[nodes.follow]
type = "follow"                     # it is all there is
in.position = "motor.position"
"#;
    }

    impl Node for Follow {
        type Params = Params;
        type Inputs<'a> = Inputs<'a>;
        type Outputs = Outputs;
        type State = ();

        fn new(_: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
            setup.outputs.velocity = setup.inputs.position.in_unit(Unit::RADIAN.per_second());
            Ok(Self)
        }
        fn state(&self) {}
        fn step(&self, _: &Tick, _: Inputs<'_>, _: &mut Outputs, (): &mut ()) {}
    }
}

/// Bounds a velocity.
mod bound {
    use super::*;

    crate::inputs! {
        /// Any velocity.
        velocity: Joints["rad/s", "A"],
    }
    crate::outputs! {
        /// The same, bounded.
        velocity: Joints["rad/s", "A"],
    }
    crate::params! {}

    pub struct Bound;

    impl tactflow_runtime::node::Describe for Bound {
        const NAME: &'static str = "bound";
        const SUMMARY: &'static str = "";
        const EXAMPLE: &'static str = "[nodes.bound]\ntype = \"bound\"\nin.velocity = \"follow.velocity\"\n";
    }

    impl Node for Bound {
        type Params = Params;
        type Inputs<'a> = Inputs<'a>;
        type Outputs = Outputs;
        type State = ();

        fn new(_: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
            setup.outputs.velocity = setup.inputs.velocity.clone();
            Ok(Self)
        }
        fn state(&self) {}
        fn step(&self, _: &Tick, _: Inputs<'_>, _: &mut Outputs, (): &mut ()) {}
    }
}

crate::params! {}

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
    type Params = Params;

    fn open(_: Params) -> Result<Opened, Mistakes> {
        let joint = Joint { name: "a".into(), lower: -1.0, upper: 1.0, speed: 1.0, acceleration: 10.0 };
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
    let port = |name: &'static str, unit: &'static str| PortSpec {
        name: name.into(),
        doc: "".into(),
        kind: Kind::Joints,
        args: vec![Cow::Borrowed(unit), "self".into()].into(),
        need: Need::REQUIRED,
    };
    let (outputs, commands) = (vec![port("position", "rad")], vec![port("velocity", "rad/s")]);
    let role = RoleType {
        name: "motor".into(),
        summary: "".into(),
        outputs,
        commands,
        reports: vec![],
        limits: vec![],
        is_observed: false,
    };
    Catalogue::new().role(role).node::<follow::Follow>().node::<bound::Bound>().device::<Motor>()
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
    assert_eq!(example(&world(), "still_motor").as_deref(), Ok(expected));
    assert!(compile(&world(), &Request::text(expected)).is_ok_and(|plan| plan.warnings().is_none()));
}

#[test]
fn a_node_that_nobody_reads_is_put_into_the_wire_it_reads() {
    let text = example(&world(), "bound").unwrap();
    assert!(text.contains("motor.velocity = \"bound.velocity\""), "{text}");
    assert!(text.contains("# ==== bound ====\n[nodes.bound]\ntype = \"bound\"\nin.velocity = \"follow.velocity\""));
    assert!(compile(&world(), &Request::text(text)).is_ok_and(|plan| plan.warnings().is_none()));
    let other = example(&world(), "follow").unwrap();
    assert!(other.contains("motor.velocity = \"follow.velocity\"") && !other.contains("bound"), "{other}");
}

#[test]
fn a_missing_example_is_named() {
    let bound = Catalogue::new().node::<bound::Bound>();
    assert_eq!(example(&bound, "bound"), Err("no example has the `follow` that `bound` needs".into()));
    assert_eq!(example(&bound, "follow"), Err("`follow` has no example".into()));
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
