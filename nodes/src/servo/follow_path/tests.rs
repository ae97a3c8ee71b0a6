//! The node on a sensor that follows every command exactly, or with a lag.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::signal::{Flag, FlagShape, Freshness, Pose, PoseShape, Scalar, Shape, Twist};

use super::FollowPath;
use super::path::tests::{SQUARE, off_square};

const MS: f64 = 4.0;
const DT: f64 = MS * 1e-3;

/// A sensor in space that a guide moves.
struct Scene {
    rig: NodeRig,
    start: IsometryMatrix3<f64>,
    pose: IsometryMatrix3<f64>,
    /// The last twist.
    twist: Option<Vector3<f64>>,
    time: f64,
}

fn square(more: &str) -> String {
    format!("path = {SQUARE:?}\nclosed = true\nrelative_to = \"start\"\nspeed_m_per_s = 0.01\n{more}")
}

impl Scene {
    fn new(params: &str) -> Self {
        let wires: [(&str, Shape); 2] = [("pose", PoseShape::default().into()), ("gate", FlagShape.into())];
        let rig = NodeRig::new::<FollowPath>(params, &wires).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
        let start =
            IsometryMatrix3::from_parts(Translation3::new(0.4, 0.1, 0.3), Rotation3::from_euler_angles(0.3, -0.2, 0.5));
        Self { rig, start, pose: start, twist: None, time: 0.0 }
    }

    /// Where the sensor is, seen from where it began.
    fn place(&self) -> Vector3<f64> {
        self.start.inverse_transform_point(&self.pose.translation.vector.into()).coords
    }

    /// Shows a sample and moves the sensor by the twist.
    fn step(&mut self, gate: bool) {
        self.rig.set("gate", gate);
        self.rig.set("pose", Pose(self.pose));
        self.rig.step_ms(MS);
        self.twist = self.rig.get::<Twist>("twist").map(|twist| {
            assert_eq!(twist.angular(), Vector3::zeros());
            twist.linear()
        });
        self.pose *= Translation3::from(self.twist.unwrap_or_default() * DT);
        self.time += DT;
    }

    fn get(&self, output: &str) -> f64 {
        *self.rig.get::<Scalar>(output).unwrap()
    }

    fn is_done(&self) -> bool {
        *self.rig.get::<Flag>("done").unwrap()
    }
}

#[test]
fn an_exact_sensor_stays_on_the_rounded_square_and_rests_at_its_end() {
    let mut scene = Scene::new(&square(""));
    let (mut worst, mut last, mut progress) = (0.0_f64, 0.0, 0.0);
    while !scene.is_done_after_step() {
        let place = scene.place();
        worst = worst.max(off_square(&place, 0.005));
        let speed = scene.twist.unwrap().norm();
        let corner_speed = (0.005_f64 * 0.005).sqrt();
        let in_corner = place.x.abs() > 0.0155 && (place.y - 0.02).abs() > 0.0155;
        assert!(speed <= if in_corner { 1.05 * corner_speed } else { 0.0101 }, "{speed} m/s at {place:?}");
        assert!((speed - last).abs() <= 0.0055 * DT, "from {last} to {speed} m/s at {place:?}");
        last = speed;
        assert!(scene.get("progress") >= progress && scene.get("error") < 2e-5, "{place:?}");
        progress = scene.get("progress");
        assert!(scene.time < 60.0, "it is never done: {place:?}");
    }
    // One sample of 20 um along a tangent leaves an arc of 5 mm by 40 nm; the gain brings it back within 0.5 s.
    assert!(worst < 1e-5, "{worst} m beside the square");
    assert!(scene.place().norm() < 2e-4 && scene.get("progress") == 1.0);
    (0..500).for_each(|_| scene.step(true));
    assert!(scene.is_done() && scene.place().norm() < 2e-5 && scene.twist.unwrap().norm() < 1e-4);
}

impl Scene {
    /// Takes a step and returns whether the path is done.
    fn is_done_after_step(&mut self) -> bool {
        self.step(true);
        self.is_done()
    }
}

#[test]
fn the_time_is_that_of_the_speeds() {
    let params = "path = [[0, 0, 0], [0.1, 0, 0]]\nrelative_to = \"start\"\nspeed_m_per_s = 0.02\n\
                  acceleration_m_per_s2 = 0.1\ngain_per_s = 5.0";
    let mut scene = Scene::new(params);
    while !scene.is_done_after_step() {}
    // Up to speed in 0.2 s over 2 mm. The rest d = v / g + v² / 2a is 6 mm at full speed, and 0.1 mm at v = 0.494 mm/s.
    // From there on, (1 / g + v / a) dv/dt = -v.
    let last = -0.02 + (0.02_f64 * 0.02 + 2.0 * 0.1 * 0.0001).sqrt();
    let exact = 0.2 + (0.1 - 0.002 - 0.006) / 0.02 + (0.02 / last).ln() / 5.0 + (0.02 - last) / 0.1;
    assert!((scene.time - exact).abs() < 0.03, "{} s against {exact} s", scene.time);
}

#[test]
fn a_path_in_the_base_is_first_approached_on_a_straight_line() {
    let params = "path = [[0, 0, 0], [0.05, 0, 0]]\n\
                  origin = { xyz = [0.42, 0.1, 0.3], rpy = [0, 0, 1.5707963267948966] }\n\
                  speed_m_per_s = 0.02";
    let mut scene = Scene::new(params);
    let from = scene.start.translation.vector;
    scene.step(true);
    assert!((scene.get("error") - 0.02).abs() < 1e-12 && scene.get("progress") == 0.0);
    while scene.get("progress") == 0.0 {
        let place = scene.pose.translation.vector - from;
        assert!(place.y.hypot(place.z) < 1e-6 || place.x > 0.0194, "beside the line: {place:?}");
        assert!(scene.twist.unwrap().norm() <= 0.02 * (1.0 + 1e-12) + 1e-4, "{:?}", scene.twist);
        scene.step(true);
        assert!(scene.time < 10.0);
    }
    while !scene.is_done_after_step() {}
    let end = scene.pose.translation.vector - Vector3::new(0.42, 0.15, 0.3);
    assert!(end.norm() < 2e-4, "the path turns with its origin: {end:?}");
}

#[test]
fn a_pushed_sensor_comes_back_to_where_it_left_the_path() {
    let mut scene = Scene::new(&square("gain_per_s = 4.0"));
    while scene.get_progress_after_step() < 0.3 {}
    let (before, push) = (scene.get("progress"), Vector3::new(-0.004, 0.0, 0.002));
    scene.pose *= Translation3::from(push);
    scene.step(true);
    assert!((scene.get("progress") - before).abs() < 0.01);
    (0..500).for_each(|_| scene.step(true));
    assert!(off_square(&scene.place(), 0.005) < 1e-5, "{:?}", scene.place());
}

impl Scene {
    fn get_progress_after_step(&mut self) -> f64 {
        self.step(true);
        self.get("progress")
    }
}

#[test]
fn a_flicker_of_the_gate_pauses_a_run_and_its_loss_begins_afresh() {
    let mut scene = Scene::new(&square(""));
    while scene.get_progress_after_step() < 0.3 {}
    let before = scene.get("progress");
    (0..3).for_each(|_| scene.step(false));
    assert_eq!((scene.twist, scene.rig.freshness("error")), (None, Freshness::Absent));
    assert_eq!(scene.get("progress"), before);
    scene.step(true);
    assert!(scene.get("progress") >= before && scene.twist.unwrap().norm() < 1e-4, "from rest, where it was");
    (0..10).for_each(|_| scene.step(false));
    assert_eq!(scene.get("progress"), 0.0);
    scene.start = scene.pose;
    (0..500).for_each(|_| scene.step(true));
    assert!(scene.get("progress") > 0.05 && off_square(&scene.place(), 0.005) < 1e-5, "a new square, from here");
}

#[test]
fn a_sensor_that_cannot_move_skips_nothing() {
    let mut scene = Scene::new(&square(""));
    for _ in 0..1000 {
        let held = scene.pose;
        scene.step(true);
        scene.pose = held;
    }
    assert_eq!(scene.get("progress"), 0.0);
}

#[test]
fn in_plane_the_z_of_the_sensor_is_left_out() {
    let mut scene = Scene::new(&square("in_plane = true"));
    scene.step(true);
    for _ in 0..200 {
        // Something else moves the sensor along its z.
        scene.pose *= Translation3::new(0.0, 0.0, 1e-5);
        scene.step(true);
        assert!(scene.twist.unwrap().z.abs() < 1e-15 && scene.get("error") < 1e-5, "{:?}", scene.twist);
    }
    let place = scene.place();
    assert!((place.z - 0.002).abs() < 1e-9 && place.y.abs() < 1e-6 && place.x > 0.001, "{place:?}");
}

#[test]
fn at_a_speed_of_zero_there_is_no_run() {
    let mut scene = Scene::new(&square("").replace("speed_m_per_s = 0.01", ""));
    scene.step(true);
    assert_eq!((scene.twist, scene.get("progress"), scene.is_done()), (None, 0.0, false));
}
