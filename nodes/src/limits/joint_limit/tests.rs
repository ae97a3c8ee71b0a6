//! `joint_limit` with an arm that integrates exactly, at once or one tick late, and that can be held.

use proptest::prelude::*;
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::node::At;
use tactflow_runtime::signal::{Freshness, Joints, Shape, Stamp};

use super::limiter::{Room, follow, room};
use super::*;

const MS: i64 = 1_000_000;

/// Longest tick of the tests [s]; the shortest is a tenth of a millisecond.
const GAP: f64 = 0.02;

fn arm(accelerations: &[f64]) -> JointsShape {
    let joint = |(i, acceleration): (usize, &f64)| Joint {
        name: format!("j{i}"),
        lower: -1.0,
        upper: 0.8,
        speed: 1.5 + i as f64,
        acceleration: *acceleration,
        start: None,
    };
    JointsShape { joints: accelerations.iter().enumerate().map(joint).collect(), unit: Unit::RADIAN }
}

fn wires(shape: &JointsShape) -> [(&'static str, Shape); 3] {
    let velocity = shape.in_unit(Unit::RADIAN.per_second());
    [("velocity", velocity.into()), ("position", shape.clone().into()), ("equilibrium", shape.clone().into())]
}

fn rig(params: &str, accelerations: &[f64]) -> NodeRig {
    let mut rig = NodeRig::new::<JointLimit>(params, &wires(&arm(accelerations))).unwrap();
    rig.tick.max_gap = GAP;
    rig
}

fn joints(values: &[f64]) -> Joints {
    Joints(values.into())
}

fn place(rig: &mut NodeRig, position: &[f64], equilibrium: &[f64]) {
    rig.set("position", joints(position));
    rig.set("equilibrium", joints(equilibrium));
}

fn velocity(rig: &NodeRig) -> Option<Vec<f64>> {
    rig.get::<Joints>("velocity").map(|velocity| velocity.0.to_vec())
}

/// The wanted velocities of some ticks.
#[derive(Debug, Clone)]
struct Course {
    /// The velocity is absent, or too old.
    is_absent: bool,
    is_old: bool,
    /// The arm is held in place.
    is_held: bool,
    wanted: [f64; 3],
    /// Durations of the ticks, in turn [ms].
    ticks: [f64; 3],
    count: usize,
}

fn course() -> impl Strategy<Value = Course> {
    let tick = prop_oneof![0.1..20.0f64, Just(20.0), Just(1.0)];
    let wanted = prop_oneof![-4.0..4.0f64, Just(1e300), Just(-1e300), Just(0.0)];
    let flags = (0..5u8, 0..3u8);
    (flags, prop::array::uniform3(wanted), prop::array::uniform3(tick), 1..80usize).prop_map(
        |((what, held), wanted, ticks, count)| Course {
            is_absent: what == 0,
            is_old: what == 1,
            is_held: held == 0,
            wanted,
            ticks,
            count,
        },
    )
}

/// An arm of three joints; with `late` a command acts one tick after it arrives.
struct Plant {
    position: [f64; 3],
    equilibrium: [f64; 3],
    late: Option<[f64; 3]>,
}

impl Plant {
    fn go(&mut self, command: [f64; 3], dt: f64, is_held: bool) {
        let acts = self.late.as_mut().map_or(command, |late| std::mem::replace(late, command));
        for (e, v) in self.equilibrium.iter_mut().zip(acts) {
            *e += v * dt;
        }
        if !is_held {
            self.position = self.equilibrium;
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn no_random_input_makes_it_cross_a_limit(
        start in prop::array::uniform3(-1.0..0.8f64),
        accelerations in prop::array::uniform3(0.5..20.0f64),
        lead_rad in 0.01..0.5f64,
        is_late in any::<bool>(),
        courses in prop::collection::vec(course(), 1..25),
    ) {
        let mut rig = rig(&format!("lead_rad = {lead_rad}"), &accelerations);
        let limits = arm(&accelerations).joints;
        let mut plant = Plant { position: start, equilibrium: start, late: is_late.then_some([0.0; 3]) };
        let mut last = [0.0; 3];
        for course in &courses {
            for tick in 0..course.count {
                place(&mut rig, &plant.position, &plant.equilibrium);
                if course.is_absent {
                    rig.lose("velocity");
                } else {
                    let old = i64::from(course.is_old) * 500 * MS;
                    let stamp = Stamp { nanos: rig.tick.now - old, device: 0 };
                    rig.edit("velocity", stamp, |velocity: &mut Joints| velocity.0.copy_from_slice(&course.wanted));
                }
                let since = rig.tick.dt;
                let next = course.ticks[tick % 3];
                rig.step_ms(next);
                let given: [f64; 3] = velocity(&rig).map_or([0.0; 3], |given| given.try_into().unwrap());
                for ((v, last), joint) in given.iter().zip(last).zip(&limits) {
                    prop_assert!(v.abs() <= joint.speed, "speed {v}");
                    prop_assert!((v - last).abs() <= joint.acceleration * since + 1e-12, "{last} to {v} in {since}");
                }
                last = given;
                plant.go(given, rig.tick.dt, course.is_held);
                for ((e, q), joint) in plant.equilibrium.iter().zip(plant.position).zip(&limits) {
                    for x in [*e, q] {
                        prop_assert!((joint.lower - 1e-12..=joint.upper + 1e-12).contains(&x), "position {x}");
                    }
                    prop_assert!((e - q).abs() <= lead_rad + 1e-12, "lead {}", e - q);
                }
            }
        }
    }

    #[test]
    fn far_from_every_limit_the_direction_stays(
        wanted in prop::array::uniform3(-9.0..9.0f64), ticks in 1..400usize,
    ) {
        let mut rig = rig("lead_rad = 9.0", &[1.0, 5.0, 9.0]);
        for _ in 0..ticks {
            place(&mut rig, &[0.0; 3], &[0.0; 3]);
            rig.set("velocity", joints(&wanted));
            rig.step();
        }
        let given = velocity(&rig).unwrap();
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            prop_assert!((given[i] * wanted[j] - given[j] * wanted[i]).abs() < 1e-9, "{given:?} for {wanted:?}");
            prop_assert!(given[i] * wanted[i] >= 0.0);
        }
    }
}

#[test]
fn the_allowed_velocities_of_a_joint() {
    let joint = Joint { lower: -1.0, upper: 1.0, speed: 2.0, acceleration: 5.0, ..Joint::default() };
    // With τ = 0.2 s and 5 rad/s² a stop from 1 rad/s takes 0.3 rad.
    let cases = [
        ((0.0, 0.0, 0.0), 9.0, (-2.0, 2.0), "in the middle: its speed"),
        ((0.7, 0.7, 0.0), 9.0, (-2.0, 1.0), "toward the upper end"),
        ((0.6, 0.6, 1.0), 9.0, (-2.0, 1.0), "the distance that the last command may still travel is subtracted"),
        ((0.7, 0.7, -1.0), 9.0, (-2.0, 1.0), "but not when it moves away"),
        ((0.5, 0.7, 0.0), 9.0, (-2.0, 1.0), "an equilibrium ahead has less room"),
        ((-0.7, -0.7, 0.0), 9.0, (-1.0, 2.0), "toward the lower end"),
        ((1.2, 1.2, 0.0), 9.0, (-2.0, 0.0), "beyond its end it can only move back"),
        ((1.0, -1.0, 0.0), 9.0, (0.0, 0.0), "and not at all when both are at an end"),
        ((-0.2, 0.0, 0.0), 0.5, (-1.828427125, 1.0), "toward the bound of the lead"),
        ((0.2, 0.0, 0.0), 0.5, (-1.0, 1.828427125), "and in the other direction"),
        ((0.0, 0.6, 0.0), 0.5, (-2.0, 0.0), "beyond its bound the lead can only shrink"),
    ];
    for ((q, equilibrium, last), lead, (min, max), what) in cases {
        let got = room(&joint, q, equilibrium, lead, last, 0.1).all();
        assert!((got.0 - min).abs() < 1e-9 && (got.1 - max).abs() < 1e-9, "{what}: {got:?}");
    }
    let endless = Joint { lower: f64::NEG_INFINITY, upper: f64::INFINITY, ..joint };
    assert_eq!(room(&endless, 1e300, -1e300, 1e308, 0.0, 0.1).all(), (-2.0, 2.0));
}

#[test]
fn a_joint_without_room_to_brake_with_the_others_brakes_by_itself() {
    let shape = arm(&[0.5, 10.0]).joints;
    let free = |joint: &Joint| (-joint.speed, joint.speed);
    let rooms = [0, 1].map(|i| Room { speed: free(&shape[i]), position: free(&shape[i]), lead: free(&shape[i]) });
    let mut last = [1.0, 1.0];
    let share = follow(&shape, 0.01, &[0.0, 0.0], &rooms, &mut last);
    assert!((share - 0.005).abs() < 1e-12 && (last[0] - 0.995).abs() < 1e-12 && last[0] == last[1], "{last:?}");
    let near = [rooms[0], Room { position: (0.0, 0.95), ..rooms[1] }];
    let mut last = [1.0, 1.0];
    follow(&shape, 0.01, &[0.0, 0.0], &near, &mut last);
    assert!((last[0] - 0.995).abs() < 1e-12 && last[1] == 0.95, "{last:?}");
    let wall = [rooms[0], Room { position: (0.0, 0.0), ..rooms[1] }];
    let mut last = [1.0, 1.0];
    follow(&shape, 0.01, &[0.0, 0.0], &wall, &mut last);
    assert!((last[1] - 0.9).abs() < 1e-12, "never with more than its acceleration: {last:?}");
}

#[test]
fn without_fresh_inputs_the_output_ramps_to_zero_and_is_absent_then() {
    type Spoil = fn(&mut NodeRig, Stamp);
    let spoils: [(&str, Spoil); 4] = [
        ("the velocity is lost", |rig, _| rig.lose("velocity")),
        ("the velocity is old", |rig, old| rig.edit("velocity", old, |_: &mut Joints| {})),
        ("the position is old", |rig, old| rig.edit("position", old, |_: &mut Joints| {})),
        ("the equilibrium is old", |rig, old| rig.edit("equilibrium", old, |_: &mut Joints| {})),
    ];
    for (what, spoil) in spoils {
        let mut rig = rig("lead_rad = 0.5\nacceleration = 10.0", &[f64::INFINITY, 20.0]);
        let fresh = |rig: &mut NodeRig| {
            place(rig, &[0.0; 2], &[0.0; 2]);
            rig.set("velocity", joints(&[0.1, -0.05]));
        };
        for _ in 0..20 {
            fresh(&mut rig);
            rig.step();
        }
        assert_eq!(velocity(&rig).unwrap(), [0.1, -0.05], "{what}");
        // At 10 rad/s² the faster joint takes ten ticks of a millisecond, and the other keeps the direction.
        for tick in 1..=13 {
            fresh(&mut rig);
            let old = Stamp { nanos: rig.tick.now - 6 * MS, device: 0 };
            spoil(&mut rig, old);
            rig.step();
            let left = (1.0 - 0.1 * f64::from(tick)).max(0.0);
            let given = velocity(&rig);
            // Rounding may move the end of the ramp to the next tick.
            assert_eq!(given.is_none(), tick > 11 || (tick == 11 && given.is_none()), "{what}, tick {tick}");
            let given = given.unwrap_or(vec![0.0; 2]);
            assert!((given[0] - 0.1 * left).abs() < 1e-12, "{what}, tick {tick}: {given:?}");
            assert!((given[1] + 0.05 * left).abs() < 1e-12, "{what}, tick {tick}: {given:?}");
        }
        fresh(&mut rig);
        rig.step();
        assert!((velocity(&rig).unwrap()[0] - 0.01).abs() < 1e-12, "{what}: it resumes within its acceleration");
    }
}

#[test]
fn without_the_arm_the_command_is_absent_at_once() {
    let mut rig = rig("lead_rad = 0.5", &[10.0]);
    for _ in 0..3 {
        place(&mut rig, &[0.0], &[0.0]);
        rig.set("velocity", joints(&[0.5]));
        rig.step();
    }
    rig.lose("equilibrium");
    rig.step();
    assert_eq!(rig.freshness("velocity"), Freshness::Lost);
}

#[test]
fn the_fractions_show_which_limit_acts() {
    let share = |rig: &NodeRig, name: &str| *rig.get::<f64>(name).unwrap();
    // (position, equilibrium, wanted), then the fractions of the lead, the position and the speed.
    let cases = [
        ((0.0, 0.0, 1.0), [1.0, 1.0, 1.0], "nothing"),
        ((0.0, 0.0, 2.5), [1.0, 1.0, 0.6], "speed"),
        ((0.8, 0.8, 1.0), [1.0, 0.0, 1.0], "position"),
        ((0.0, 0.5, 1.0), [0.0, 1.0, 1.0], "lead"),
    ];
    for ((q, equilibrium, wanted), shares, what) in cases {
        let mut rig = rig("lead_rad = 0.5", &[10.0]);
        place(&mut rig, &[q], &[equilibrium]);
        rig.set("velocity", joints(&[wanted]));
        rig.step();
        let got = ["lead", "joint_position", "joint_speed"].map(|name| share(&rig, name));
        assert_eq!(got, shares, "{what}");
    }
    let mut rig = rig("lead_rad = 0.5", &[10.0]);
    for wanted in [0.01, 0.01, 0.05] {
        place(&mut rig, &[0.0], &[0.0]);
        rig.set("velocity", joints(&[wanted]));
        rig.step();
    }
    assert!((share(&rig, "joint_acceleration") - 0.25).abs() < 1e-9, "0.01 of 0.04 rad/s in a millisecond");
}

#[test]
fn the_narrowest_of_all_stated_limits_applies() {
    let JointsShape { joints, .. } = arm(&[10.0]);
    let model = Joint { lower: -0.5, upper: 2.0, speed: 1.0, acceleration: f64::INFINITY, ..joints[0].clone() };
    let velocity = JointsShape { joints: vec![model], unit: Unit::RADIAN.per_second() };
    let shape = arm(&[10.0]);
    let wires = [("velocity", velocity.into()), ("position", shape.clone().into()), ("equilibrium", shape.into())];
    let rig = NodeRig::new::<JointLimit>("lead_rad = 0.1\nspeed = 0.5\nacceleration = 12.0", &wires).unwrap();
    let Shape::Joints(given) = rig.shape("velocity") else { panic!("joints") };
    let narrowest = Joint { name: "j0".into(), lower: -0.5, upper: 0.8, speed: 0.5, acceleration: 10.0, start: None };
    assert_eq!((&given.joints, given.unit), (&vec![narrowest], Unit::RADIAN.per_second()));
}

#[test]
fn bad_settings() {
    let known = wires(&arm(&[10.0]));
    let unknown = wires(&arm(&[f64::INFINITY]));
    let other = wires(&arm(&[10.0, 10.0]))[1].clone();
    let cases = [
        ("lead_rad = 0.1", &unknown[..], At::Node, "the arm states no maximum acceleration of joint `j0`"),
        (
            "lead_rad = 0.1",
            &[known[0].clone(), other, known[2].clone()],
            At::Input("position".into()),
            "`position` has the joints [\"j0\", \"j1\"], but `velocity` [\"j0\"]",
        ),
    ];
    for (params, wires, at, message) in cases {
        let mistakes = NodeRig::new::<JointLimit>(params, wires).err().expect(message);
        assert_eq!((mistakes.len(), &mistakes[0].at, mistakes[0].message.as_str()), (1, &at, message));
    }
    assert!(NodeRig::new::<JointLimit>("lead_rad = 0.1\nacceleration = 5.0", &unknown).is_ok());
}

/// Tells an arm of two joints `told` [rad/s] for `seconds`, while the joints follow with these parts of it, `lag` ticks
/// late. Returns when a joint is found stuck [s], and what is said.
fn found(told: impl Fn(f64) -> [f64; 2], parts: [f64; 2], lag: usize, seconds: f64) -> Option<(f64, String)> {
    let mut rig = rig("lead_rad = 10.0", &[50.0, 50.0]);
    let mut equilibrium = [0.0; 2];
    let mut on_their_way = std::collections::VecDeque::from(vec![[0.0; 2]; lag]);
    for tick in 0..(seconds * 250.0) as i64 {
        place(&mut rig, &equilibrium, &equilibrium);
        rig.set("velocity", joints(&told(tick as f64 * 0.004)));
        rig.step_ms(4.0);
        if rig.get::<Flag>("stuck").is_some_and(|stuck| *stuck) {
            return Some((tick as f64 * 0.004, rig.found().expect("it says which")));
        }
        let command = velocity(&rig).map_or([0.0; 2], |velocity| [velocity[0], velocity[1]]);
        on_their_way.push_back(command);
        let acts = on_their_way.pop_front().expect("one was just added");
        for i in 0..2 {
            equilibrium[i] += parts[i] * acts[i] * 0.004;
        }
    }
    None
}

#[test]
fn a_joint_that_does_not_follow_its_commands_is_found() {
    let steady = |_| [0.02, 0.1];
    // 0.004 rad take 0.04 s at 0.1 rad/s, and 0.2 s at 0.02 rad/s; a command may act 0.1 s late.
    let (at, why) = found(steady, [1.0, 0.0], 0, 2.0).unwrap();
    assert!((0.14..0.26).contains(&at), "{at} s");
    assert!(why.starts_with("joint `j1` does not follow its commands: it was commanded by 0.0"), "{why}");
    let (at, why) = found(steady, [0.0, 1.0], 0, 2.0).unwrap();
    assert!((0.3..0.42).contains(&at) && why.contains("`j0`"), "{at} s, {why}");
    // A creep is found too: 0.004 rad at 0.001 rad/s.
    let (at, _) = found(|_| [0.001, 0.0], [0.0, 1.0], 0, 10.0).unwrap();
    assert!((4.1..4.3).contains(&at), "{at} s");
    // One that runs the wrong way does not follow.
    assert!(found(steady, [1.0, -1.0], 0, 2.0).is_some());
}

#[test]
fn joints_that_follow_are_never_found_stuck() {
    let sine = |f: f64| move |t: f64| [0.3 * (std::f64::consts::TAU * f * t).sin(), 0.05];
    for lag in [0, 1, 10, 25] {
        for frequency in [0.2, 0.5, 1.0, 2.0, 5.0, 12.0] {
            assert_eq!(found(sine(frequency), [1.0, 1.0], lag, 10.0), None, "{lag} ticks late at {frequency} Hz");
        }
        // A fast motion that turns into a slow one the other way: what is on its way goes on.
        for (fast, slow) in [(0.5, -0.02), (1.0, -0.002), (-0.3, 0.1), (0.2, -0.02)] {
            let turn = move |t: f64| if t < 0.5 { [fast, 0.05] } else { [slow, 0.05] };
            assert_eq!(found(turn, [1.0, 1.0], lag, 6.0), None, "{lag} ticks late, {fast} and then {slow} rad/s");
        }
        let square = |t: f64| if t % 1.0 < 0.5 { [0.7, 0.0] } else { [-0.7, 0.1] };
        assert_eq!(found(square, [1.0, 1.0], lag, 10.0), None, "{lag} ticks late");
    }
    // A robot that somebody has slowed down follows slowly.
    assert_eq!(found(|_| [0.01, 0.1], [0.2, 0.2], 2, 5.0), None);
    assert_eq!(found(|_| [0.0, 0.0], [0.0, 0.0], 0, 2.0), None, "a joint that is told nothing");
}

#[test]
fn a_command_that_the_arm_does_not_get_does_not_count() {
    let mut rig = rig("lead_rad = 10.0", &[50.0, 50.0]);
    // An arm that stands still, whatever it is commanded; `age_ms` is that of its state.
    let mut stands = |ticks: usize, age_ms: i64, is_halted: bool, is_overruled: bool| {
        (rig.tick.is_halted, rig.tick.is_overruled) = (is_halted, is_overruled);
        (0..ticks).any(|_| {
            let stamp = Stamp { nanos: rig.tick.now - age_ms * MS, device: 0 };
            rig.edit("position", stamp, |position: &mut Joints| position.0.fill(0.0));
            rig.edit("equilibrium", stamp, |equilibrium: &mut Joints| equilibrium.0.fill(0.0));
            rig.set("velocity", joints(&[0.1, 0.0]));
            rig.step_ms(4.0);
            rig.get::<Flag>("stuck").is_some_and(|stuck| *stuck)
        })
    };
    assert!(!stands(500, 0, true, false), "halted");
    assert!(!stands(500, 0, false, true), "another task drives the arm");
    assert!(!stands(500, 5000, false, false), "the state of the arm is old");
    // What came before counts for nothing.
    assert!(!stands(20, 0, false, false) && stands(60, 0, false, false));
}
