//! `probe`: shows what is on some wires while the graph runs.
//!
//! A step never logs. This one only decides whether a line is due, by a flag; the tool writes the line after the tick,
//! from what is on the wires then ([`Node::LOGS`]).

use tactflow_runtime::node::{At, Mistake, Mistakes, Node, NonNegative, Setup, Tick};
use tactflow_runtime::source::Code;
use tactflow_runtime::{inputs, outputs, params, state};

params! {
    /// Least time between two lines; with 0 there is one for everything new [ms].
    every_ms: NonNegative = NonNegative(0.0),
}

inputs! {
    /// Scalars, each under a name of your choice [any unit].
    value: Many<Scalar["_"]>,
    /// A flag.
    flag: Trigger<Flag>,
    /// A feature vector [any units].
    features: Trigger<Features["_"]>,
    /// A twist [m/s, rad/s].
    twist: Trigger<Twist>,
    /// A joint vector [any unit].
    joints: Trigger<Joints["_"]>,
    /// A pose [m].
    pose: Trigger<Pose>,
}

outputs! {
    /// Whether a line is due.
    due: Flag,
}

state! {
    /// When a line was due last [ns].
    last: Option<i64>,
}

/// How often it shows something.
pub struct Probe {
    every: i64,
}

impl tactflow_runtime::node::Describe for Probe {
    const NAME: &'static str = "probe";
    const SUMMARY: &'static str = "prints what is on a wire while the graph runs";
    const DOC: &'static str = "Wire to it what you want to see, by kind (`in.flag`, `in.features`, `in.twist`, \
        `in.joints`, `in.pose`), and any number of scalars under names of your choice. `run` then prints a line on \
        standard error with the time, the node's name, and every value with its port and its unit:\n\n\
        ```text\n\
        INFO probe: at 0.512 s: watch: moments.force = 1.500 N, moments.x is absent\n\
        ```\n\n\
        A line is due when anything on the wires is new or gets lost, and no sooner than `every_ms` after the last \
        one. What comes sooner shows with the next line that is due, and not at all if nothing comes after it. Nothing \
        is printed from within the tick: the node raises a flag, and the tool writes after the tick, \
        so a probe delays no command. `RUST_LOG=warn` turns it off, `--out` records every tick instead.\n\n\
        Without `every_ms` a graph that runs faster than real time prints thousands of lines a second.";
    const EXAMPLE: &'static str = r#"
[nodes.probe]
type = "probe"
in.force = "moments.force"
in.flag = "label.present"
in.twist = "sum.twist"
every_ms = 100                      # ten lines a second at most
"#;
    const LOGS: bool = true;
}

impl Node for Probe {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let InputShapes { value, flag, features, twist, joints, pose, .. } = &setup.inputs;
        let others = [flag.is_some(), features.is_some(), twist.is_some(), joints.is_some(), pose.is_some()];
        if value.is_empty() && !others.contains(&true) {
            let mistake = Mistake::new(Code::MissingInput, At::Node, "nothing is wired, so there is nothing to show");
            return Err(mistake.help("wire what you want to see: `in.force = \"moments.force\"`").into());
        }
        Ok(Self { every: (*params.every_ms * 1e6) as i64 })
    }

    fn state(&self) -> State {
        State { last: None }
    }

    fn step(&self, tick: &Tick, _: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let is_due = state.last.is_none_or(|last| tick.now - last >= self.every);
        if is_due {
            state.last = Some(tick.now);
        }
        out.due.set(is_due);
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{
        Flag, FlagShape, Freshness, Joints, JointsShape, Pose, PoseShape, ScalarShape, Shape, Twist, TwistShape,
    };

    use super::*;

    fn rig(params: &str, wires: &[(&str, Shape)]) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<Probe>(params, wires)
    }

    #[test]
    fn a_line_is_due_for_everything_new_and_for_every_loss() {
        let scalar = || Shape::from(ScalarShape::default());
        let wires = [
            ("force", scalar()),
            ("area", scalar()),
            ("flag", FlagShape.into()),
            ("twist", TwistShape.into()),
            ("joints", JointsShape::default().into()),
            ("pose", PoseShape.into()),
        ];
        let mut rig = rig("", &wires).unwrap();
        let bring: [fn(&mut NodeRig); 6] = [
            |rig| rig.set("force", 1.0),
            |rig| rig.set("area", 1.0),
            |rig| rig.set("flag", false),
            |rig| rig.set("twist", Twist::default()),
            |rig| rig.set("joints", Joints::zeros(0)),
            |rig| rig.set("pose", Pose::default()),
        ];
        for (bring, (wire, _)) in bring.into_iter().zip(&wires) {
            bring(&mut rig);
            rig.step();
            assert_eq!((rig.freshness("due"), rig.get::<Flag>("due")), (Freshness::New, Some(&true)), "{wire}");
            rig.step();
            assert_eq!(rig.freshness("due"), Freshness::Held, "{wire}: nothing happened");
            rig.lose(wire);
            rig.step();
            assert_eq!((rig.freshness("due"), rig.get::<Flag>("due")), (Freshness::New, Some(&true)), "{wire} went");
        }
    }

    #[test]
    fn lines_keep_their_distance() {
        let mut rig = rig("every_ms = 10", &[("force", ScalarShape::default().into())]).unwrap();
        let due: Vec<u32> = (0..35)
            .filter(|_| {
                rig.set("force", 1.0);
                rig.step();
                *rig.get::<Flag>("due").unwrap()
            })
            .collect();
        assert_eq!(due, [0, 10, 20, 30]);
    }

    #[test]
    fn nothing_to_show_is_a_mistake() {
        assert_eq!(rig("", &[]).err().unwrap()[0].code, Code::MissingInput);
        assert!(rig("every_ms = -1", &[("force", ScalarShape::default().into())]).is_err());
    }
}
