//! `lost_contact`: its phases by the clock, no corner into the object, and the lead against a finite difference.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
use proptest::prelude::*;
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::signal::{
    FlagShape, ImageShape, JacobianShape, Joint, JointsShape, PoseShape, Shape, TwistShape,
};

use super::*;

/// Period of the rig [ms].
const MS: f64 = 4.0;
/// Half of the width and of the height of the pad [m].
const HALF: [f64; 2] = [0.02, 0.01];

/// A pad of 40 mm by 20 mm on an arm with one sliding joint along z, whose sensor is at the origin.
struct Cell {
    rig: NodeRig,
    wanted: [f64; 6],
    /// Way of the commands along z [m].
    way: f64,
}

impl Cell {
    fn new() -> Self {
        let pad = ImageShape { rows: 4, cols: 8, pitch: [0.005; 2], unit: Unit::NEWTON };
        let joint = Joint { name: "slide".into(), ..Joint::default() };
        let joints = JointsShape { joints: vec![joint], unit: Unit::RADIAN };
        let wires: [(&str, Shape); 7] = [
            ("twist", TwistShape.into()),
            ("contact", FlagShape.into()),
            ("image", pad.into()),
            ("pose", PoseShape::default().into()),
            ("jacobian", JacobianShape(joints.clone()).into()),
            ("position", joints.clone().into()),
            ("equilibrium", joints.into()),
        ];
        // Shorter than the default, so that a case is short.
        let rig =
            NodeRig::new::<LostContact>("wait_ms = 600", &wires).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
        Self { rig, wanted: [0.01, 0.0, 0.03, 0.1, 0.0, 0.0], way: 0.0 }
    }

    /// Steps for some time with this flag and this lead [m]. Returns the outputs.
    fn run(&mut self, ms: f64, contact: bool, lead: f64) -> Vec<Twist> {
        (0..(ms / MS) as usize).map(|_| self.step(contact, lead)).collect()
    }

    fn step(&mut self, contact: bool, lead: f64) -> Twist {
        let rig = &mut self.rig;
        rig.set("twist", Twist(self.wanted.into()));
        rig.set("contact", contact);
        rig.set("image", Image::zeros(4, 8));
        rig.set("pose", Pose(IsometryMatrix3::identity()));
        rig.set("jacobian", Jacobian([Twist([0.0, 0.0, 1.0, 0.0, 0.0, 0.0].into())].into()));
        rig.set("position", Joints([0.5].into()));
        rig.set("equilibrium", Joints([0.5 + lead].into()));
        rig.step_ms(MS);
        let twist = rig.get::<Twist>("twist").copied().unwrap_or_default();
        self.way += twist.linear().z * MS * 1e-3;
        twist
    }

    fn is_lost(&self) -> bool {
        *self.rig.get::<Flag>("lost").expect("in every tick")
    }
}

/// Speeds along z of the corners of the pad [m/s].
fn corners(twist: &Twist) -> [f64; 4] {
    [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|[x, y]| {
        let corner = Vector3::new(x * HALF[0], y * HALF[1], 0.0);
        (twist.linear() + twist.angular().cross(&corner)).z
    })
}

fn is_into_the_object(twist: &Twist) -> bool {
    corners(twist).into_iter().any(|speed| speed > 1e-15)
}

#[test]
fn everything_passes_before_a_contact_has_lasted_and_while_it_does() {
    let mut cell = Cell::new();
    let all = Twist(cell.wanted.into());
    for (ms, contact) in [(200.0, false), (36.0, true), (8.0, false), (2000.0, true)] {
        assert!(cell.run(ms, contact, 0.002).iter().all(|twist| *twist == all), "{ms} ms with {contact}");
        assert!(!cell.is_lost());
    }
}

#[test]
fn a_lost_contact_bars_retreats_by_the_lead_rests_and_searches() {
    let mut cell = Cell::new();
    cell.run(2000.0, true, 0.003);
    cell.way = 0.0;
    let barred = cell.run(20.0, false, 0.003);
    assert!(barred.iter().all(|twist| !is_into_the_object(twist) && twist.0[0] == 0.01 && twist.0[3] == 0.1));
    assert!(cell.is_lost());
    // -|wx| h/2 = -1 mm/s: the roll goes on, and no corner moves in.
    assert!(barred.iter().all(|twist| (twist.linear().z + 0.001).abs() < 1e-15), "{barred:?}");
    cell.way = 0.0;
    let after = cell.run(576.0, false, 0.003);
    let retreat = out_along_z(-0.02);
    let steps = after.iter().take_while(|twist| **twist == retreat).count();
    // 3 mm at 20 mm/s are 150 ms; a step of 4 ms is 0.08 mm.
    assert!((cell.way + 0.003).abs() <= 0.08e-3, "{} mm in {steps} steps", cell.way * 1e3);
    assert!(after[steps..].iter().all(|twist| *twist == Twist::default()), "{:?}", &after[steps..]);
    let search = cell.run(400.0, false, 0.0);
    let fastest = |twist: &Twist| {
        let speed = |x: f64, y: f64| (twist.linear() + twist.angular().cross(&Vector3::new(x, y, 0.0))).norm();
        speed(HALF[0], HALF[1]).max(speed(HALF[0], -HALF[1]))
    };
    // The first one is still at rest: 596 ms have passed since the first tick without the contact.
    assert!(search[1..].iter().all(|twist| (fastest(twist) - 0.005).abs() < 1e-12), "{search:?}");
    let found = cell.run(80.0, true, 0.0);
    assert!(found[..10].iter().all(|twist| fastest(twist) < 0.0051) && !cell.is_lost());
    assert_eq!(found.last(), Some(&Twist(cell.wanted.into())));
}

#[test]
fn a_flicker_is_no_loss_and_a_bounce_is_searched_at_once() {
    let mut cell = Cell::new();
    cell.run(2000.0, true, 0.003);
    cell.run(16.0, false, 0.003);
    assert_eq!(cell.run(4.0, true, 0.003), [Twist(cell.wanted.into())], "a gap of 16 ms");
    let mut cell = Cell::new();
    cell.run(400.0, true, 0.003);
    let after = cell.run(200.0, false, 0.003);
    assert!(after[..5].iter().all(|twist| !is_into_the_object(twist)));
    assert!(after[5..].iter().all(|twist| twist.linear().z > 0.0), "no retreat just after a first touch");
}

#[test]
fn a_touch_for_a_moment_begins_the_rest_anew() {
    let mut cell = Cell::new();
    cell.run(2000.0, true, 0.0);
    cell.run(400.0, false, 0.0);
    let during = cell.run(20.0, true, 0.0);
    assert!(during.iter().all(|twist| !is_into_the_object(twist)), "{during:?}");
    let after = cell.run(596.0, false, 0.0);
    assert!(after.iter().all(|twist| !is_into_the_object(twist)), "{after:?}");
    assert!(cell.run(8.0, false, 0.0).last().is_some_and(is_into_the_object), "then it searches");
}

#[test]
fn a_touch_that_flickers_does_not_let_the_arm_rest_for_ever() {
    let mut cell = Cell::new();
    cell.run(2000.0, true, 0.0);
    let mut flicker = |ms: f64| {
        let steps = (0..(ms / 80.0) as u32)
            .flat_map(|_| [cell.run(60.0, false, 0.0), cell.run(20.0, true, 0.0)].concat())
            .collect::<Vec<_>>();
        steps.iter().filter(|twist| is_into_the_object(twist)).count() * 4
    };
    // For 3 s a hand may be there; then the arm rests once more, and searches.
    assert_eq!(flicker(2960.0), 0);
    assert!((160..=480).contains(&flicker(960.0)), "the search begins 0.6 s later");
    assert_eq!(flicker(800.0), 800);
}

#[test]
fn a_contact_that_comes_back_soon_is_no_first_touch() {
    let mut cell = Cell::new();
    cell.run(2000.0, true, 0.003);
    cell.run(60.0, false, 0.003);
    cell.run(100.0, true, 0.003);
    let after = cell.run(400.0, false, 0.003);
    assert!(after.iter().all(|twist| !is_into_the_object(twist)), "the same contact is lost again: {after:?}");
    let mut cell = Cell::new();
    cell.run(2000.0, true, 0.003);
    cell.run(900.0, false, 0.003);
    cell.run(100.0, true, 0.003);
    let after = cell.run(400.0, false, 0.003);
    assert!(after[5..].iter().all(|twist| twist.linear().z > 0.0), "a new contact may bounce");
}

#[test]
fn the_way_out_is_free_at_any_moment() {
    let mut cell = Cell::new();
    cell.run(2000.0, true, 0.003);
    cell.wanted = [0.0, 0.0, -0.04, 0.0, 0.0, 0.0];
    let out = Twist(cell.wanted.into());
    assert!(cell.run(1000.0, false, 0.003).iter().all(|twist| *twist == out));
    cell.wanted = [0.04, 0.0, 0.0, 0.0, 0.0, 0.0];
    let aside = Twist(cell.wanted.into());
    assert!(cell.run(100.0, false, 0.0).iter().all(|twist| *twist == aside), "a transfer, once the rest is over");
}

#[test]
fn an_absent_or_old_contact_is_none_and_an_absent_motion_does_not_end_the_retreat() {
    let mut cell = Cell::new();
    cell.run(2000.0, true, 0.003);
    let rig = &mut cell.rig;
    rig.lose("contact");
    rig.lose("twist");
    let mut way = 0.0;
    for step in 0..100 {
        rig.step_ms(MS);
        let twist = rig.get::<Twist>("twist");
        assert!(step > 0 || twist.is_none(), "barred: an absent motion stays absent");
        way += twist.map_or(0.0, |twist| twist.linear().z * MS * 1e-3);
    }
    assert!((way + 0.003).abs() <= 0.08e-3, "{way}");
}

/// The turn by `angle` [rad] about an axis through a point.
fn turn(axis: Vector3<f64>, through: Vector3<f64>, angle: f64) -> IsometryMatrix3<f64> {
    let rotation = Rotation3::new(axis * angle);
    IsometryMatrix3::from_parts((through - rotation * through).into(), rotation)
}

#[test]
fn the_lead_is_the_way_of_the_sensor_between_both_postures() {
    let axes = [Vector3::new(0.6, 0.0, 0.8), Vector3::new(0.0, -1.0, 0.0), Vector3::new(0.48, 0.6, 0.64)];
    let points = [Vector3::new(0.1, 0.2, 0.3), Vector3::new(-0.2, 0.0, 0.5), Vector3::new(0.4, -0.1, 0.2)];
    let leads = [2e-7, -3e-7, 5e-7];
    let pose = turn(Vector3::new(0.5, 0.4, -0.3), Vector3::zeros(), 1.0) * Translation3::new(0.5, -0.2, 0.4);
    let turns = axes.iter().zip(&points).zip(&leads).map(|((axis, point), lead)| turn(*axis, *point, *lead));
    let ahead = turns.fold(IsometryMatrix3::identity(), |all, turn| all * turn) * pose;
    let by_poses = (pose.inverse() * ahead).translation.vector.z;
    let columns = axes.iter().zip(&points).map(|(axis, point)| Twist::new(point.cross(axis), *axis)).collect();
    let by_lead = lead(&Pose(pose), &Jacobian(columns), &Joints([0.0; 3].into()), &Joints(leads.into()));
    assert!((by_lead - by_poses).abs() < 1e-5 * by_poses.abs(), "{by_lead} and {by_poses}");
}

proptest! {
    #[test]
    fn nothing_moves_into_the_object_in_the_first_half_second(
        wanted in prop::collection::vec(prop::array::uniform6(-1.0..1.0f64), 120),
        lead in -0.01..0.01f64, lasted in 1100.0..3000.0f64,
    ) {
        let mut cell = Cell::new();
        cell.run(lasted, true, lead);
        for wanted in wanted {
            cell.wanted = wanted;
            let twist = cell.step(false, lead);
            prop_assert!(!is_into_the_object(&twist), "{:?} for {:?}", twist, wanted);
        }
    }

    #[test]
    fn a_search_is_slow_and_keeps_its_direction(wanted in prop::array::uniform6(-1.0..1.0f64)) {
        let (wanted, speed) = (Twist(wanted.into()), 0.005);
        let twist = slowed_down(&wanted, HALF, speed);
        let scale = twist.0.norm() / wanted.0.norm();
        prop_assert!((twist.0 - wanted.0 * scale).norm() < 1e-12);
        let is_slow = corners(&twist).into_iter().all(|corner| corner <= speed + 1e-12) && twist.linear().norm() <= speed + 1e-12;
        prop_assert!(is_slow || !is_into_the_object(&wanted), "{:?}", twist);
    }
}
