//! `probe`: a step never logs. It only decides whether a line is due and sets a flag; the tool writes the line after
//! the tick, from the values on the wires at that time ([`Node::LOGS`]).

use tactflow_runtime::node::{
    At, Describe, In, Inputs, Many, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::{Features, Flag, Joints, Pose, Scalar, Twist};
use tactflow_runtime::source::Code;

/// Prints the values of wires while the graph runs.
///
/// Wire the signals to show by kind (`in.flag`, `in.features`, `in.twist`, `in.joints`, `in.pose`), and any number of
/// scalars under names of your choice. `run` then prints lines to standard error with the time, the node's name, and
/// every value with its port and its unit:
///
/// ```text
/// INFO probe: at 0.512 s: watch: moments.force = 1.500 N, moments.x is absent
/// ```
///
/// A line is due when a wire has a new value or loses its value, but not before `every_ms` have passed since the last
/// line. A change before that time appears in the next line that is due, or not at all if no other change follows. The
/// node does not print within the tick: it sets a flag, and the tool prints after the tick, so a probe delays no
/// command. `RUST_LOG=warn` turns the lines off; `--out` records every tick instead.
///
/// Without `every_ms` a graph that runs faster than real time prints thousands of lines per second.
///
/// ```toml
/// [nodes.probe]
/// type = "probe"
/// in.force = "moments.force"
/// in.flag = "label.present"
/// in.twist = "sum.twist"
/// every_ms = 100                      # at most ten lines per second
/// ```
#[derive(Describe)]
#[describe(logs)]
pub struct Probe {
    /// Minimum time between two lines [ns].
    every: i64,
}

/// Parameters of `probe`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Minimum time between two lines; with 0 every change prints a line.
    #[param(unit = "ms", range = 0.0.., default = 0.0)]
    every_ms: f64,
}

/// What `probe` reads.
#[derive(Inputs)]
#[expect(dead_code, reason = "the tool reads the values on the wires after the tick")]
pub struct Inputs<'a> {
    /// Scalars, each under a name of your choice.
    #[port(unit = "_", frame = "_")]
    value: Many<'a, Scalar>,
    /// A flag.
    #[port(optional)]
    flag: Option<In<'a, Flag>>,
    /// A feature vector.
    #[port(unit = "_", frame = "_", optional)]
    features: Option<In<'a, Features>>,
    /// A twist.
    #[port(frame = "_", optional)]
    twist: Option<In<'a, Twist>>,
    /// A joint vector.
    #[port(unit = "_", robot = "_", optional)]
    joints: Option<In<'a, Joints>>,
    /// A pose.
    #[port(frame = "_", reference = "_", optional)]
    pose: Option<In<'a, Pose>>,
}

/// What `probe` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Whether a line is due.
    due: Out<Flag>,
}

/// What `probe` remembers.
#[derive(State)]
pub struct State {
    /// Time of the last line [ns].
    last: Option<i64>,
}

impl Node for Probe {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let InputsShapes { value, flag, features, twist, joints, pose } = &setup.inputs;
        let others = [flag.is_some(), features.is_some(), twist.is_some(), joints.is_some(), pose.is_some()];
        if value.is_empty() && !others.contains(&true) {
            let mistake = Mistake::new(Code::MissingInput, At::Node, "no input is wired, so there is nothing to print");
            return Err(mistake.help("wire a signal to it: `in.force = \"moments.force\"`").into());
        }
        Ok(Self { every: (params.every_ms * 1e6) as i64 })
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
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::{
        Flag, FlagShape, Freshness, Joints, JointsShape, Pose, PoseShape, ScalarShape, Shape, Twist, TwistShape,
    };

    use super::*;

    fn rig(params: &str, wires: &[(&str, Shape)]) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<Probe>(params, wires)
    }

    #[test]
    fn a_line_is_due_for_every_new_value_and_every_loss() {
        let scalar = || Shape::from(ScalarShape::default());
        let wires = [
            ("force", scalar()),
            ("area", scalar()),
            ("flag", FlagShape.into()),
            ("twist", TwistShape.into()),
            ("joints", JointsShape::default().into()),
            ("pose", PoseShape::default().into()),
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
            assert_eq!(rig.freshness("due"), Freshness::Held, "{wire}: no change");
            rig.lose(wire);
            rig.step();
            assert_eq!((rig.freshness("due"), rig.get::<Flag>("due")), (Freshness::New, Some(&true)), "{wire} is lost");
        }
    }

    #[test]
    fn lines_have_a_minimum_interval() {
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
    fn a_probe_without_a_wire_is_an_error() {
        assert_eq!(rig("", &[]).err().unwrap()[0].code, Code::MissingInput);
        let negative = "every_ms = -1";
        let refused = rig(negative, &[("force", ScalarShape::default().into())]);
        assert_eq!(places(negative, &refused), ["bad-value: `-1`"]);
    }
}
