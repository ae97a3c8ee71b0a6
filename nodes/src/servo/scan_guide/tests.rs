//! The guide on a sensor that follows every command exactly, over surfaces with a shape in closed form.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{FlagShape, Freshness, Pose, PoseShape, ScalarShape, Shape, Unit};

use super::*;

const SCAN: &str = "speed_m_per_s = 0.02\nstrokes = 3\nstroke_m = 0.04\nstep_m = 0.01";
/// Way in one sample at that speed [m].
const GRAIN: f64 = 0.02 * 0.004;
/// Half of the pad [m].
const HALF_PAD: f64 = 0.04;

/// A sensor on a plate that covers a rectangle of the base; the base lies as the sensor does at the start.
struct ScanScene {
    rig: NodeRig,
    pose: IsometryMatrix3<f64>,
    plate: [[f64; 2]; 2],
    /// Where a wall stands, across the base's x.
    wall: f64,
    /// Radius of a cylinder along the base's y that the sensor rolls over, if it does.
    radius: f64,
    track: Vec<[f64; 2]>,
    turns: Vec<[f64; 2]>,
    last: [f64; 2],
    is_done: bool,
}

impl ScanScene {
    fn new(params: &str) -> Self {
        let metre = || Shape::from(ScalarShape::of(Unit::METRE));
        let wires = [("gate", FlagShape.into()), ("pose", PoseShape::default().into()), ("x", metre()), ("y", metre())];
        let tilt = Rotation3::from_euler_angles(0.3, -0.2, 0.5);
        Self {
            rig: NodeRig::new::<ScanGuide>(params, &wires).unwrap(),
            pose: IsometryMatrix3::from_parts(Translation3::new(0.4, 0.1, 0.3), tilt),
            plate: [[-1.0, 1.0]; 2],
            wall: f64::INFINITY,
            radius: f64::INFINITY,
            track: Vec::new(),
            turns: Vec::new(),
            last: [0.0; 2],
            is_done: false,
        }
    }

    /// Where the sensor is, seen from where it began.
    fn place(&self) -> Vector3<f64> {
        let start = Self::new(SCAN).pose;
        start.inverse_transform_point(&self.pose.translation.vector.into()).coords
    }

    /// Where the middle of what the pad touches is, along one of its axes; none beside the plate.
    fn contact(&self, axis: usize) -> Option<f64> {
        let at = self.place()[axis];
        let (from, to) = ((self.plate[axis][0] - at).max(-HALF_PAD), (self.plate[axis][1] - at).min(HALF_PAD));
        (from < to).then_some((from + to) / 2.0)
    }

    /// One sample, and a step of `ms` of a sensor that moves at a fraction `share` of the commanded speed.
    fn step(&mut self, ms: f64, share: f64) {
        let contact = [self.contact(0), self.contact(1)];
        self.rig.set("gate", contact.iter().all(Option::is_some));
        self.rig.set("pose", Pose(self.pose));
        for (name, place) in ["x", "y"].into_iter().zip(contact) {
            match place {
                Some(place) => self.rig.set(name, place),
                None => self.rig.lose(name),
            }
        }
        self.rig.step_ms(ms);
        self.is_done = self.rig.get("done").copied().unwrap_or(false);
        let [vx, vy, vz, wx, wy, wz] = self.rig.get::<Twist>("twist").map_or([0.0; 6], |twist| twist.0.into());
        // Rounding leaves a little of the other axis.
        let [vx, vy] = [vx, vy].map(|v: f64| if v.abs() < 1e-12 { 0.0 } else { v });
        assert!([vz, wx, wy, wz] == [0.0; 4] && (vx == 0.0 || vy == 0.0));
        let place = self.place();
        if [vx.signum() * f64::from(vx != 0.0), vy.signum() * f64::from(vy != 0.0)] != self.last {
            self.last = [vx, vy].map(|v: f64| if v == 0.0 { 0.0 } else { v.signum() });
            self.turns.push([place.x, place.y]);
        }
        self.track.push([place.x, place.y]);
        let mut go = [vx, vy].map(|v| share * v * ms * 1e-3);
        if place.x + go[0] > self.wall {
            go[0] = 0.0;
        }
        let turn = Rotation3::from_euler_angles(0.0, go[0] / self.radius, 0.0);
        self.pose *= IsometryMatrix3::from_parts(Translation3::new(go[0], go[1], 0.0), turn);
    }

    /// Until it is done; the time that took [s].
    fn run(&mut self) -> f64 {
        for i in 0..50_000 {
            self.step(4.0, 1.0);
            if self.is_done {
                return f64::from(i) * 0.004;
            }
        }
        panic!("it is never done: {:?}", self.turns);
    }

    fn assert_turns(&self, expected: &[[f64; 2]], within: f64) {
        assert_eq!(self.turns.len(), expected.len(), "{:?}", self.turns);
        for (turn, expected) in self.turns.iter().zip(expected) {
            let off = (turn[0] - expected[0]).abs().max((turn[1] - expected[1]).abs());
            assert!(off <= within, "{:?}, not {expected:?}: {:?}", turn, self.turns);
        }
    }
}

/// Where the way turns, from its start to where it rests: stroke beside stroke, about the start.
const ROWS: [[f64; 2]; 8] =
    [[0.0, 0.0], [0.0, -0.01], [-0.02, -0.01], [0.02, -0.01], [0.02, 0.0], [-0.02, 0.0], [-0.02, 0.01], [0.02, 0.01]];

#[test]
fn the_scan_is_centred_on_its_start_and_ends_with_done() {
    let mut scene = ScanScene::new(SCAN);
    let time = scene.run();
    scene.assert_turns(&ROWS, 2.0 * GRAIN);
    let way = 0.01 + 0.02 + 3.0 * 0.04 + 2.0 * 0.01;
    assert!((time - way / 0.02).abs() < 0.1, "{time}");
    for _ in 0..5 {
        scene.step(4.0, 1.0);
        assert!(scene.is_done && scene.rig.freshness("twist") != Freshness::New);
    }
}

#[test]
fn along_y_the_scan_is_the_same_with_the_axes_exchanged() {
    let mut scene = ScanScene::new(&format!("{SCAN}\naxis = \"y\""));
    scene.run();
    scene.assert_turns(&ROWS.map(|[x, y]| [y, x]), 2.0 * GRAIN);
}

#[test]
fn the_distance_counts_and_not_the_time() {
    // A sensor that lags, stands still for a while, and whose samples come as they will.
    let mut scene = ScanScene::new(SCAN);
    for i in 0..30_000 {
        let share = if (400..700).contains(&i) { 0.0 } else { 0.3 + 0.5 * f64::from(i % 5) / 4.0 };
        scene.step(if i % 7 == 0 { 9.0 } else { 3.0 }, share);
        if scene.is_done {
            break;
        }
    }
    scene.assert_turns(&ROWS, 4.0 * GRAIN);
}

#[test]
fn on_a_cylinder_the_distance_is_along_the_surface() {
    // The sensor's origin rolls along the arc, so the way along x is radius times angle.
    let mut scene =
        ScanScene { radius: 0.05, ..ScanScene::new("speed_m_per_s = 0.02\nstroke_m = 0.06\nstep_m = 0.01") };
    scene.run();
    let start = ScanScene::new(SCAN).pose;
    let turned = (start.rotation.inverse() * scene.pose.rotation).scaled_axis();
    assert!((turned.y * 0.05 - 0.03).abs() < 3.0 * GRAIN, "{turned}");
}

#[test]
fn on_a_cylinder_the_strokes_end_where_it_is_steep() {
    let params = "speed_m_per_s = 0.02\nstrokes = 3\nstroke_m = 0.4\nstep_m = 0.01\nmax_tilt_rad = 0.6";
    let mut scene = ScanScene { radius: 0.05, ..ScanScene::new(params) };
    let (mut least, mut most) = (0.0_f64, 0.0_f64);
    let start = scene.pose.rotation;
    while !scene.is_done {
        scene.step(4.0, 1.0);
        let tilt = (start.inverse() * scene.pose.rotation).scaled_axis().y;
        (least, most) = (least.min(tilt), most.max(tilt));
    }
    let late = 2.0 * GRAIN / 0.05;
    assert!((0.6..0.6 + late).contains(&most) && (-0.6 - late..-0.6).contains(&least), "{least} {most}");
    assert_eq!(scene.rig.get("progress"), Some(&1.0));
}

#[test]
fn across_a_cylinder_the_scan_begins_and_ends_where_it_is_steep() {
    // The rows are along y, the cylinder's axis, and the steps across lead over it.
    let params = "speed_m_per_s = 0.02\naxis = \"y\"\nstrokes = 99\nstroke_m = 0.04\nstep_m = 0.01\nmax_tilt_rad = 0.6";
    let mut scene = ScanScene { radius: 0.05, ..ScanScene::new(params) };
    let start = scene.pose.rotation;
    let mut rows = std::collections::BTreeSet::new();
    while !scene.is_done {
        scene.step(4.0, 1.0);
        let tilt = (start.inverse() * scene.pose.rotation).scaled_axis().y;
        assert!(tilt.abs() < 0.6 + 0.21, "{tilt}");
        if scene.last[1] != 0.0 {
            rows.insert((tilt * 50.0).round() as i64);
        }
    }
    // From -30 mm along the arc to the first row that is beyond 30 mm.
    assert_eq!(rows.into_iter().collect::<Vec<_>>(), [-30, -20, -10, 0, 10, 20, 30]);
}

#[test]
fn the_scan_turns_at_the_edge_of_the_object_and_never_leaves_it() {
    // The contact is 20 mm behind the middle when the pad is past the edge by 10 mm: (-40 - 0) / 2 = -20.
    let mut scene = ScanScene { plate: [[-0.03, 0.02], [-1.0, 1.0]], ..ScanScene::new(&SCAN.replace("0.04", "0.2")) };
    scene.run();
    let (least, most) = scene.track.iter().fold((0.0, 0.0), |(a, b): (f64, f64), at| (a.min(at[0]), b.max(at[0])));
    // 40 ms pass before it is taken for an edge.
    let late = 0.04 * 0.02 + 3.0 * GRAIN;
    assert!((0.02..0.02 + late).contains(&most) && (-0.03 - late..-0.03).contains(&least), "{least} {most}");
    let rows = scene.turns.iter().map(|turn| (turn[1] * 1e3).round() as i64).collect::<std::collections::BTreeSet<_>>();
    assert_eq!(rows.into_iter().collect::<Vec<_>>(), [-10, 0, 10]);
}

#[test]
fn the_scan_ends_where_a_step_across_leaves_the_surface() {
    let mut scene = ScanScene {
        plate: [[-1.0, 1.0], [-0.1, 0.012]],
        ..ScanScene::new(&SCAN.replace("strokes = 3", "strokes = 9"))
    };
    scene.run();
    let most = scene.track.iter().fold(0.0, |most: f64, at| most.max(at[1]));
    assert!((0.012..0.012 + 0.04 * 0.02 + 3.0 * GRAIN).contains(&most), "{most}");
    assert_eq!(scene.rig.get("progress"), Some(&1.0));
}

#[test]
fn an_obstacle_ends_a_leg() {
    let mut scene = ScanScene { wall: 0.005, ..ScanScene::new(SCAN) };
    scene.run();
    assert!(scene.track.iter().all(|at| at[0] < 0.005 + 1e-9));
    let rows = scene.turns.iter().map(|turn| (turn[1] * 1e3).round() as i64).collect::<std::collections::BTreeSet<_>>();
    assert_eq!(rows.into_iter().collect::<Vec<_>>(), [-10, 0, 10]);
}

#[test]
fn one_image_with_another_contact_is_not_an_edge() {
    let mut scene = ScanScene::new(SCAN);
    (0..100).for_each(|_| scene.step(4.0, 1.0));
    let before = scene.turns.len();
    for _ in 0..9 {
        scene.rig.set("gate", true);
        scene.rig.set("x", 0.03);
        scene.rig.set("y", 0.03);
        scene.rig.step_ms(4.0);
    }
    scene.step(4.0, 1.0);
    assert_eq!(scene.turns.len(), before);
}

#[test]
fn flicker_pauses_the_scan_and_a_scan_that_is_abandoned_begins_anew() {
    for (ms, patience, goes_on) in [
        (12, "", true),
        (40, "", false),
        (4000, "abandon_after_ms = 5000", true),
        (6000, "abandon_after_ms = 5000", false),
    ] {
        let mut scene = ScanScene::new(&format!("{SCAN}\n{patience}"));
        while scene.rig.get::<f64>("progress").is_none_or(|progress| *progress < 0.4) {
            scene.step(4.0, 1.0);
        }
        for _ in 0..ms / 4 {
            scene.rig.set("gate", false);
            scene.rig.step_ms(4.0);
            assert_eq!(scene.rig.get::<Twist>("twist"), None, "no contact, no motion");
        }
        let turns = scene.turns.len();
        scene.step(4.0, 1.0);
        assert_eq!(*scene.rig.get::<f64>("progress").unwrap() > 0.3, goes_on, "{ms} ms {patience}");
        assert!(scene.rig.get::<Twist>("twist").is_some(), "{ms} ms {patience}");
        assert!(!goes_on || scene.turns.len() == turns, "the leg goes on: {ms} ms {patience}");
    }
}

#[test]
fn a_sensor_that_follows_a_slow_guide_is_not_stuck() {
    // The guide moves with a quarter of the speed, and the sensor with half of that.
    let mut scene = ScanScene::new(SCAN);
    let mut way = 0.0;
    for _ in 0..750 {
        for (name, place) in [("x", 0.0), ("y", 0.016)] {
            scene.rig.set(name, place);
        }
        scene.rig.set("gate", true);
        scene.rig.set("pose", Pose(scene.pose));
        scene.rig.step_ms(4.0);
        let step = 0.5 * 0.004 * scene.rig.get::<Twist>("twist").unwrap().linear();
        assert!(step.y < 0.0 && step.x == 0.0, "the first leg goes on after {way} m: {step}");
        way -= step.y;
        scene.pose *= IsometryMatrix3::from_parts(step.into(), Rotation3::identity());
    }
    assert!((way - 0.0075).abs() < 1e-9, "{way}");
}

#[test]
fn the_guide_waits_for_a_contact_that_is_behind() {
    // The first leg moves along -y, and the contact is behind on the side of +y.
    for (y, pace) in [(-0.01, 1.0), (0.0, 1.0), (0.005, 0.75), (0.01, 0.5), (0.019, 0.25)] {
        let mut scene = ScanScene::new(SCAN);
        for (name, place) in [("x", 0.02), ("y", y)] {
            scene.rig.set(name, place);
        }
        scene.rig.set("gate", true);
        scene.rig.set("pose", Pose(scene.pose));
        scene.rig.step_ms(4.0);
        let speed = scene.rig.get::<Twist>("twist").unwrap().linear().norm();
        assert!((speed - pace * 0.02).abs() < 1e-12, "{y} m: {speed} m/s");
    }
}

#[test]
fn progress_rises_from_0_to_1() {
    let mut scene = ScanScene::new(SCAN);
    let mut last = 0.0;
    while !scene.is_done {
        scene.step(4.0, 1.0);
        let progress = *scene.rig.get::<f64>("progress").unwrap();
        assert!((last..=1.0).contains(&progress), "{progress} after {last}");
        last = progress;
    }
    assert_eq!(last, 1.0);
}

#[test]
fn the_motion_is_as_old_as_the_gate_and_absent_at_a_speed_of_0() {
    let mut scene = ScanScene::new(SCAN);
    scene.step(4.0, 1.0);
    assert_eq!(scene.rig.mark("twist").stamp().nanos, 0);
    scene.rig.step_ms(4.0);
    assert_eq!(scene.rig.freshness("twist"), Freshness::Held, "a silent pad makes nothing new");
    let mut still = ScanScene::new("stroke_m = 0.04\nstep_m = 0.01");
    still.step(4.0, 1.0);
    assert_eq!((still.rig.get::<Twist>("twist"), still.rig.get("done")), (None, Some(&false)));
}

#[test]
fn another_axis_begins_another_scan() {
    let params = |axis| Params {
        speed_m_per_s: 0.02,
        axis,
        strokes: 2,
        stroke_m: 0.04,
        step_m: 0.01,
        edge_m: 0.02,
        max_tilt_rad: None,
        abandon_after_ms: None,
    };
    let (across, along) = (Scan::new(&params(StrokeAxis::X)), Scan::new(&params(StrokeAxis::Y)));
    let mut done = across;
    done.leg = None;
    assert_eq!(done.progress(2), 1.0);
    assert!(along.leg.is_some() && along.axis != done.axis);
    assert_eq!(along.axis.along(along.axis.across()), [0.0, 1.0]);
    assert_eq!(across.axis.along(across.axis.across()), [1.0, 0.0]);
}

#[test]
fn a_bad_parameter_is_a_mistake() {
    let wires = [("gate", FlagShape.into()), ("pose", PoseShape::default().into())];
    for (bad, place) in [
        ("step_m = 0.01", "missing-key: `the node`"),
        ("stroke_m = 0.01", "missing-key: `the node`"),
        ("axis = \"z\"\nstroke_m = 0.1\nstep_m = 0.1", "bad-value: `\"z\"`"),
        ("step_m = 0.01\nstroke_m = 0.1\nstrokes = 0", "bad-value: `0`"),
    ] {
        assert_eq!(places(bad, &NodeRig::new::<ScanGuide>(bad, &wires)), [place], "{bad}");
    }
}

proptest! {
    #[test]
    fn every_row_is_swept_from_end_to_end(strokes in 1..6usize, stroke in 0.01..0.1_f64, step in 0.002..0.02_f64, along_y: bool) {
        let axis = if along_y { "y" } else { "x" };
        let params = format!("speed_m_per_s = 0.05\nstrokes = {strokes}\nstroke_m = {stroke}\nstep_m = {step}\naxis = \"{axis}\"");
        let mut scene = ScanScene::new(&params);
        scene.run();
        let side = usize::from(along_y);
        for row in 0..strokes {
            let v: f64 = (row as f64 - (strokes as f64 - 1.0) / 2.0) * step;
            // Each step aside may overshoot by a sample.
            let near = scene.track.iter().filter(|at: &&[f64; 2]| (at[1 - side] - v).abs() < (row + 1) as f64 * 2.5e-4);
            let (least, most) = near.fold((1.0, -1.0), |(a, b): (f64, f64), at| (a.min(at[side]), b.max(at[side])));
            prop_assert!(least <= -stroke / 2.0 + 4e-4 && most >= stroke / 2.0 - 4e-4, "row {row}: {least} {most}");
        }
        let (least, most) = scene.track.iter().fold((1.0, -1.0), |(a, b): (f64, f64), at| (a.min(at[side]), b.max(at[side])));
        prop_assert!(least > -stroke / 2.0 - 4e-4 && most < stroke / 2.0 + 4e-4);
    }
}
