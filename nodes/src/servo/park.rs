//! `park`: a sensor lifts off and rests.

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Motion, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Flag, Pose, Scalar, Twist};

use crate::usual::{USUAL_LENGTH_M, USUAL_M_PER_S};

/// Lifts a sensor off its object when a task is done, and lets it rest there.
///
/// The sensor moves along its own -z, away from what it touches, until it is `lift_m` from the pose at which it began.
/// Its speed is at most `speed_m_per_s`, and `gain_per_s` times the rest of the way, so it comes to rest smoothly. When
/// less than 0.5 mm are left, the motion is over: `twist` is absent, `done` is set, and the sensor stays where it is.
///
/// The motion begins when `start` is set, such as `scan.done`, and then goes on to its end, whatever `start` does: a
/// scan is no longer done once its contact is lost. Without this wire it begins at once, in the first mode in which
/// `speed_m_per_s` is not 0. It ends for good in a mode with a speed of 0; the next mode with a speed lifts off again.
///
/// The way is measured along the z that the sensor has at the beginning. An arm that cannot move is never done: give
/// the mode a `fail = { after_ms = … }`. If the pose is absent for the graph's `reset_after_ms`, the motion begins
/// afresh. The servoing must be off meanwhile: set `select` of the `projector` to zeros in the mode that parks.
///
/// ```toml
/// [nodes.park]                        # 2 cm off the surface, at once; or with `in.start = "scan.done"`
/// type = "park"
/// in.pose = "state.sensor_pose"
/// lift_m = 0.02
/// ```
#[derive(Describe)]
pub struct Park {
    params: Params,
    has_start: bool,
}

/// Parameters of `park`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Way along the sensor's -z.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_LENGTH_M, default = 0.02, live)]
    lift_m: f64,
    /// Largest speed. At 0 there is no motion.
    #[param(unit = "m/s", range = 0.0.., usual = ..=USUAL_M_PER_S, default = 0.02, live)]
    speed_m_per_s: f64,
    /// Speed per rest of the way.
    #[param(unit = "1/s", above = 0.0, usual = ..=20.0, default = 2.0, live)]
    gain_per_s: f64,
}

/// What `park` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Pose of the sensor in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose")]
    pose: In<'a, Pose>,
    /// The motion begins when this is set. Without this wire it begins at once.
    #[port(optional)]
    start: Option<In<'a, Flag>>,
}

/// What `park` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The motion away from the object; absent before it begins, and when it is over.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Way from the pose at which it began, along the sensor's -z; absent before.
    #[port(unit = "m", frame = "A")]
    way: Out<Scalar>,
    /// Whether the motion is over.
    done: Out<Flag>,
}

/// What `park` remembers.
#[derive(State)]
pub struct State {
    /// Pose of the sensor at which the motion began.
    begin: Option<IsometryMatrix3<f64>>,
    /// Whether the motion is over.
    is_done: bool,
}

/// Rest of the way at which the motion is over [m].
const DONE_M: f64 = 0.0005;

impl Node for Park {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.motion = if params.speed_m_per_s > 0.0 { Motion::Retreat } else { Motion::Still };
        Ok(Self { params, has_start: setup.inputs.start.is_some() })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let Params { lift_m: lift, speed_m_per_s: speed, gain_per_s: gain } = self.params;
        let pose = &inputs.pose.0;
        if speed == 0.0 {
            (state.begin, state.is_done) = (None, false);
        } else if state.begin.is_none() && (!self.has_start || inputs.start.is_some_and(|start| *start)) {
            state.begin = Some(*pose);
        }
        if let Some(begin) = state.begin {
            let way = -begin.inverse_transform_point(&pose.translation.vector.into()).z;
            let rest = lift - way;
            state.is_done |= rest < DONE_M;
            out.way.set(way);
            if !state.is_done {
                out.twist.set(Twist::new(Vector3::new(0.0, 0.0, -speed.min(gain * rest)), Vector3::zeros()));
            }
        }
        out.done.set(state.is_done);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Translation3};
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::{FlagShape, Freshness, PoseShape, Shape};

    use super::*;

    const DT: f64 = 0.004;

    /// A sensor that follows every command exactly.
    struct Scene {
        rig: NodeRig,
        pose: IsometryMatrix3<f64>,
        is_stuck: bool,
    }

    fn built(params: &str, has_start: bool) -> Result<NodeRig, Mistakes> {
        let pose: (&str, Shape) = ("pose", PoseShape::default().into());
        let wires = if has_start { vec![pose, ("start", FlagShape.into())] } else { vec![pose] };
        NodeRig::new::<Park>(params, &wires)
    }

    fn begin() -> IsometryMatrix3<f64> {
        let turn = Rotation3::from_euler_angles(0.5, -2.0, 0.9);
        IsometryMatrix3::from_parts(Translation3::new(0.5, 0.1, 0.3), turn)
    }

    impl Scene {
        fn new(params: &str, has_start: bool) -> Self {
            Self { rig: built(params, has_start).unwrap(), pose: begin(), is_stuck: false }
        }

        /// Steps and moves the sensor. Returns its speed along its z and whether it is done.
        fn step(&mut self) -> (Option<f64>, bool) {
            self.rig.set("pose", Pose(self.pose));
            self.rig.step_ms(1e3 * DT);
            let twist = self.rig.get::<Twist>("twist").copied();
            if let Some(twist) = twist {
                assert_eq!((twist.linear().xy().norm(), twist.angular().norm()), (0.0, 0.0));
                if !self.is_stuck {
                    self.pose *= Translation3::from(twist.linear() * DT);
                }
            }
            (twist.map(|twist| twist.linear().z), *self.rig.get::<Flag>("done").unwrap())
        }

        /// Where the sensor is, in the frame in which it began [m].
        fn place(&self) -> Vector3<f64> {
            (begin().inverse() * self.pose).translation.vector
        }
    }

    #[test]
    fn it_lifts_off_along_its_z_with_the_closed_form_of_the_law_and_rests() {
        let mut scene = Scene::new("lift_m = 0.03\nspeed_m_per_s = 0.02", false);
        // At full speed until the rest is speed over gain, then a decay by 1 - g dt in each sample.
        let (mut rest, mut steps) = (0.03_f64, 0);
        while rest >= 0.0005 {
            let (speed, is_done) = scene.step();
            assert!((speed.unwrap() + (2.0 * rest).min(0.02)).abs() < 1e-9 && !is_done, "{rest}: {speed:?}");
            rest = if rest > 0.01 { rest - 0.02 * DT } else { rest * (1.0 - 2.0 * DT) };
            steps += 1;
        }
        assert!((600..800).contains(&steps), "1 s at full speed, and 1.5 s to rest: {steps}");
        for _ in 0..100 {
            assert_eq!(scene.step(), (None, true));
        }
        let place = scene.place();
        assert!(place.xy().norm() < 1e-9 && (place.z + 0.03).abs() <= 0.0005, "{place}");
        assert!((scene.rig.get::<Scalar>("way").unwrap() + place.z).abs() < 1e-9);
    }

    #[test]
    fn it_begins_with_its_start_and_ends_by_itself() {
        let mut scene = Scene::new("", true);
        assert_eq!(scene.step(), (None, false), "no flag yet");
        for start in [Some(false), None] {
            match start {
                Some(start) => scene.rig.set("start", start),
                None => scene.rig.lose("start"),
            }
            assert_eq!(scene.step(), (None, false));
            assert_eq!(scene.rig.freshness("way"), Freshness::Absent);
        }
        scene.rig.set("start", true);
        assert_eq!(scene.step(), (Some(-0.02), false));
        scene.rig.set("start", false);
        (0..1000).for_each(|_| {
            scene.step();
        });
        assert!((scene.place().z + 0.02).abs() <= 0.0005);
        scene.rig.set("start", true);
        assert_eq!(scene.step(), (None, true), "once");
    }

    #[test]
    fn an_arm_that_cannot_move_is_never_done() {
        let mut scene = Scene::new("", false);
        scene.is_stuck = true;
        assert!((0..1000).all(|_| scene.step() == (Some(-0.02), false)));
    }

    #[test]
    fn without_a_pose_it_is_absent_and_after_long_it_begins_afresh() {
        let mut scene = Scene::new("", false);
        (0..1000).for_each(|_| {
            scene.step();
        });
        scene.rig.lose("pose");
        scene.rig.step_ms(30.0);
        assert_eq!(scene.rig.get::<Flag>("done"), None);
        scene.rig.step();
        assert_eq!(scene.step(), (Some(-0.02), false));
    }

    #[test]
    fn at_a_speed_of_zero_there_is_no_motion() {
        let mut scene = Scene::new("speed_m_per_s = 0", false);
        assert_eq!(scene.step(), (None, false));
    }

    #[test]
    fn wrong_parameters_are_refused() {
        for (bad, place) in [
            ("lift_m = 0", "bad-value: `0`"),
            ("speed_m_per_s = -1", "bad-value: `-1`"),
            ("gain_per_s = 0", "bad-value: `0`"),
        ] {
            assert_eq!(places(bad, &built(bad, false)), [place], "{bad}");
        }
    }
}
