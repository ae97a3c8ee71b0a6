//! The guide in fields of eccentricity with a known ridge, on a sensor that follows every command exactly.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI, TAU};

use nalgebra::{IsometryMatrix3, Rotation3, Translation3};
use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{Freshness, PoseShape, ScalarShape, Unit};

use super::*;
use crate::motion::axis::wrap_axial;
use tactflow_runtime::random::Random;

/// A ridge: how far off a place is from it, to its left, and its direction there.
type Ridge = fn([f64; 2]) -> (f64, f64);

/// A line at 0.7 rad through the origin.
fn straight([x, y]: [f64; 2]) -> (f64, f64) {
    let (sine, cosine) = libm::sincos(0.7);
    (cosine * y - sine * x, 0.7)
}

/// A circle of 12 cm.
fn ring([x, y]: [f64; 2]) -> (f64, f64) {
    (0.12 - (x * x + y * y).sqrt(), libm::atan2(y, x) + FRAC_PI_2)
}

/// A wave along x.
fn wave([x, y]: [f64; 2]) -> (f64, f64) {
    let slope = 0.6 * libm::cos(30.0 * x);
    ((y - 0.02 * libm::sin(30.0 * x)) / (1.0 + slope * slope).sqrt(), libm::atan(slope))
}

struct RidgeScene {
    rig: NodeRig,
    ridge: Ridge,
    at: [f64; 2],
    /// The sensor's yaw.
    yaw: f64,
    noise: f64,
    random: Random,
    is_on: bool,
    /// Direction of the motion in the base.
    course: f64,
}

const PARAMS: &str = "speed_m_per_s = 0.02\nleg_m = 0.01";
/// Speed toward the middle of the contact, as the servoing adds it [1/s].
const CENTRE: f64 = 2.0;

impl RidgeScene {
    fn new(ridge: Ridge, at: [f64; 2], yaw: f64, noise: f64, params: &str) -> Self {
        let one = || ScalarShape::of(Unit::ONE).into();
        let wires = [
            ("eccentricity", one()),
            ("orientation", ScalarShape::of(Unit::AXIAL).into()),
            ("pose", PoseShape::default().into()),
        ];
        let rig = NodeRig::new::<RidgeGuide>(params, &wires).unwrap();
        Self { rig, ridge, at, yaw, noise, random: Random::new(11, 0), is_on: false, course: f64::NAN }
    }

    /// What the pad feels: the nearer the ridge, the narrower.
    fn eccentricity(&self) -> f64 {
        let (off, _) = (self.ridge)(self.at);
        0.3 + 0.69 * libm::exp(-(off / 0.04) * (off / 0.04))
    }

    fn step(&mut self) {
        let (off, angle) = (self.ridge)(self.at);
        let narrow = (self.eccentricity() + self.noise * self.random.normal()).clamp(0.0, 1.0);
        let shown = wrap_axial(angle - self.yaw + 0.5 * self.noise * self.random.normal());
        let turn = Rotation3::from_euler_angles(0.0, 0.0, self.yaw);
        let pose = IsometryMatrix3::from_parts(Translation3::new(self.at[0], self.at[1], 0.2), turn);
        self.rig.set("eccentricity", narrow);
        if narrow > 0.5 {
            self.rig.set("orientation", shown)
        } else {
            self.rig.lose("orientation")
        }
        self.rig.set("pose", Pose(pose));
        self.rig.step_ms(4.0);
        self.is_on = *self.rig.get("on_ridge").unwrap();
        let [vx, vy, vz, wx, wy, wz] = self.rig.get::<Twist>("twist").unwrap().0.into();
        assert!([vz, wx, wy, wz] == [0.0; 4] && ((vx * vx + vy * vy).sqrt() - 0.02).abs() < 1e-9);
        let [vx, vy, _] = (turn * nalgebra::Vector3::new(vx, vy, 0.0)).into();
        let course = libm::atan2(vy, vx);
        let change = course - self.course;
        let change = (change - TAU * (change / TAU).round()).abs();
        assert!(!self.is_on || !change.is_finite() || change < 0.5 * PI + 1e-9, "it turned by {change} rad");
        self.course = course;
        // The servoing keeps a line in the middle of the pad.
        let pull = if narrow > 0.9 { -CENTRE * off } else { 0.0 };
        let (sine, cosine) = libm::sincos(angle);
        self.at[0] += (vx - sine * pull) * 0.004;
        self.at[1] += (vy + cosine * pull) * 0.004;
    }

    /// Until it has found the ridge; how long that took [s].
    fn find(&mut self) -> f64 {
        let found = (0..10_000).find(|_| {
            self.step();
            self.is_on
        });
        f64::from(found.unwrap_or_else(|| panic!("no ridge is found: at {:?}", self.at))) * 0.004
    }
}

#[test]
fn the_search_finds_the_ridge_from_every_side_and_in_noise() {
    let mut cases = 0;
    for (name, ridge) in [("straight", straight as Ridge), ("ring", ring), ("wave", wave)] {
        for start in [[0.05, 0.0], [-0.05, 0.01], [0.0, 0.05], [0.02, -0.05], [0.09, 0.04], [-0.07, -0.02]] {
            for (yaw, noise) in [(0.0, 0.0), (1.0, 0.0), (-2.5, 0.0), (0.0, 0.02), (2.0, 0.04)] {
                let mut scene = RidgeScene::new(ridge, start, yaw, noise, PARAMS);
                // Farther off there is no slope to feel, and it goes straight on.
                if scene.eccentricity() < 0.36 {
                    continue;
                }
                cases += 1;
                let way = scene.find() * 0.02;
                // The bound is where the way is straight up the slope, and twice that for the zigzag and its first legs.
                let off = ridge(start).0.abs();
                assert!(way < 2.0 * off + 0.06, "{name} from {start:?} at {yaw}, {noise}: {way} m for {off} m");
                // The bound on the eccentricity is 1 cm away, and noise brings it nearer.
                assert!(ridge(scene.at).0.abs() < 0.011 + 0.5 * noise, "{name} from {start:?}: {}", ridge(scene.at).0);
            }
        }
    }
    assert!(cases > 60, "{cases}");
}

#[test]
fn the_sensor_follows_the_ridge_without_turning_back() {
    // Ways that a full circle needs turn through all angles: nothing may happen where an axis changes its name.
    for (name, ridge, noise) in
        [("straight", straight as Ridge, 0.0), ("ring", ring, 0.0), ("wave", wave, 0.0), ("ring", ring, 0.01)]
    {
        let mut scene = RidgeScene::new(ridge, [0.05, 0.03], 0.4, noise, PARAMS);
        scene.find();
        (0..500).for_each(|_| scene.step());
        let (mut way, mut worst, mut last) = (0.0, 0.0_f64, scene.at);
        for i in 0..10_000 {
            scene.step();
            let (off, angle) = ridge(scene.at);
            let (sine, cosine) = libm::sincos(angle);
            let gone = (scene.at[0] - last[0]) * cosine + (scene.at[1] - last[1]) * sine;
            last = scene.at;
            // A full turn of the ring needs no change of sign; a line has none to change.
            way += gone;
            worst = worst.max(off.abs());
            assert!(scene.is_on, "{name}: off the ridge in step {i} at {:?}", scene.at);
        }
        assert!(way.abs() > 0.99 * 0.02 * 40.0, "{name}: {way}");
        assert!(worst < 0.003, "{name}: {worst}");
    }
}

#[test]
fn without_an_orientation_the_last_direction_is_kept() {
    let mut scene = RidgeScene::new(straight, [0.03, 0.0], 0.0, 0.0, PARAMS);
    scene.find();
    (0..10).for_each(|_| scene.step());
    let before = *scene.rig.get::<Twist>("twist").unwrap();
    for _ in 0..50 {
        scene.rig.lose("orientation");
        scene.rig.set("eccentricity", 0.99);
        scene.rig.step_ms(4.0);
        assert_eq!(scene.rig.get::<Twist>("twist"), Some(&before));
    }
    scene.rig.set("orientation", wrap_axial(0.7 + PI));
    scene.rig.set("eccentricity", 0.99);
    scene.rig.step_ms(4.0);
    let after = scene.rig.get::<Twist>("twist").unwrap();
    assert!((after.0 - before.0).norm() < 1e-3, "{after:?}");
}

#[test]
fn a_ridge_begins_and_ends_with_hysteresis() {
    let mut scene = RidgeScene::new(straight, [1.0, 1.0], 0.0, 0.0, PARAMS);
    let cases = [(0.92, false), (0.96, true), (0.92, true), (0.91, true), (0.89, false), (0.94, false), (0.951, true)];
    for (narrow, expected) in cases {
        scene.rig.set("eccentricity", narrow);
        scene.rig.set("orientation", 0.3);
        scene.rig.set("pose", Pose(IsometryMatrix3::identity()));
        scene.rig.step_ms(4.0);
        assert_eq!(scene.rig.get("on_ridge"), Some(&expected), "{narrow}");
    }
}

#[test]
fn over_an_even_surface_noise_does_not_change_the_heading() {
    for heading in [0.0, 2.0] {
        let params = format!("{PARAMS}\nheading_rad = {heading}");
        let mut scene = RidgeScene::new(|_| (1.0, 0.0), [0.0, 0.0], 0.0, 0.01, &params);
        (0..5000).for_each(|_| scene.step());
        // Two legs of l at right angles go sqrt(2) l.
        let way = 0.02 * 20.0 * FRAC_1_SQRT_2;
        let (sine, cosine) = libm::sincos(heading);
        let (x, y) = (scene.at[0] - way * cosine, scene.at[1] - way * sine);
        assert!((x * x + y * y).sqrt() < 0.02, "{:?}, headed {heading}", scene.at);
    }
}

#[test]
fn a_sensor_without_progress_turns_round() {
    let mut scene = RidgeScene::new(straight, [1.0, 1.0], 0.0, 0.0, PARAMS);
    let mut course = || {
        scene.rig.set("eccentricity", 0.3);
        scene.rig.set("pose", Pose(IsometryMatrix3::identity()));
        scene.rig.step_ms(4.0);
        scene.rig.get::<Twist>("twist").unwrap().0[0]
    };
    assert!((0..499).all(|_| course() > 0.0));
    assert!((0..100).map(|_| course()).last().unwrap() < 0.0);
}

#[test]
fn the_motion_is_as_old_as_the_contact_and_absent_without_one() {
    let mut scene = RidgeScene::new(straight, [0.03, 0.0], 0.0, 0.0, PARAMS);
    scene.step();
    assert_eq!(scene.rig.mark("twist").stamp().nanos, 0);
    scene.rig.step_ms(4.0);
    assert_eq!(scene.rig.freshness("twist"), Freshness::Held);
    scene.rig.lose("eccentricity");
    scene.rig.step_ms(4.0);
    assert_eq!((scene.rig.get::<Twist>("twist"), scene.rig.get::<bool>("on_ridge")), (None, None));
}

#[test]
fn a_bad_parameter_is_a_mistake() {
    let wires = || {
        let one = ScalarShape::of(Unit::ONE).into();
        [
            ("eccentricity", one),
            ("orientation", ScalarShape::of(Unit::AXIAL).into()),
            ("pose", PoseShape::default().into()),
        ]
    };
    for (bad, place) in [
        ("on_above = 0.9\noff_below = 0.9", "bad-value: `off_below`"),
        ("off_below = 0.99", "bad-value: `off_below`"),
        ("on_above = 1.1", "bad-value: `1.1`"),
        ("leg_m = 0", "bad-value: `0`"),
        ("heading_rad = nan", "bad-value: `nan`"),
    ] {
        assert_eq!(places(bad, &NodeRig::new::<RidgeGuide>(bad, &wires())), [place], "{bad}");
    }
}

proptest! {
    #[test]
    fn the_slope_is_that_of_the_least_squares_line(samples in prop::collection::vec((0.0..0.002, 0.0..1.0), 3..200)) {
        let mut leg = slope::Slope::default();
        let mut points = Vec::new();
        for (step, narrow) in samples {
            leg.add(step, narrow);
            points.push((leg.way, narrow));
        }
        let n = points.len() as f64;
        let (sx, sy) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
        let above: f64 = points.iter().map(|(x, y)| (x - sx) * (y - sy)).sum();
        let below: f64 = points.iter().map(|(x, _)| (x - sx) * (x - sx)).sum();
        prop_assume!(below > 1e-9);
        prop_assert!((leg.slope() - above / below).abs() < 1e-6 * (1.0 + (above / below).abs()));
    }

    #[test]
    fn in_a_plane_field_the_next_heading_is_its_gradient(angle in -3.0..3.0_f64, heading in -3.0..3.0_f64, yaw in -3.0..3.0_f64) {
        let guide = NodeRig::new::<RidgeGuide>(&format!("{PARAMS}\nheading_rad = {heading}"), &[
            ("eccentricity", ScalarShape::of(Unit::ONE).into()),
            ("orientation", ScalarShape::of(Unit::AXIAL).into()),
            ("pose", PoseShape::default().into()),
        ]);
        let mut rig = guide.unwrap();
        let (mut at, mut courses) = ([0.0; 2], Vec::new());
        for _ in 0..400 {
            let turn = Rotation3::from_euler_angles(0.0, 0.0, yaw);
            let field = 0.4 + 5.0 * (at[0] * libm::cos(angle) + at[1] * libm::sin(angle));
            rig.set("eccentricity", field);
            rig.set("pose", Pose(IsometryMatrix3::from_parts(Translation3::new(at[0], at[1], 0.0), turn)));
            rig.step_ms(4.0);
            let twist = rig.get::<Twist>("twist").unwrap().0;
            let go = turn * nalgebra::Vector3::new(twist[0], twist[1], 0.0);
            at = [at[0] + 0.004 * go.x, at[1] + 0.004 * go.y];
            courses.push(libm::atan2(go.y, go.x));
        }
        // After two legs of 125 samples each, the third is half a right angle to the left of the gradient.
        let off = courses[300] - (angle + PI / 4.0);
        prop_assert!((off - TAU * (off / TAU).round()).abs() < 1e-6, "{off}");
        // 5 a metre over a leg of 1 cm.
        prop_assert!((rig.get::<f64>("rise").unwrap() - 0.05).abs() < 1e-9);
    }
}
