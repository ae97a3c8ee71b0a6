//! Two pads on one arm: the approach of each against its own ceiling, computed from the velocities of points.
//!
//! The oracle does not use twists of the second pad: it moves the points of both pads with the rigid body for a short
//! time, and takes the change of their distance along the normals.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion};
use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{ImageShape, PoseShape, Shape, TwistShape, Unit};

use super::super::contact_limit::ContactLimit;
use super::*;

/// On a pad of 4 by 4 tactels of 10 mm: 160 N/m under the pad, and 80 N/m under a tactel.
const CEILINGS: &str = "force_n = 10.0\npeak_n = 4.0\ndeceleration_m_per_s2 = 1.0\nfoam_n_per_m3 = 1e5";
/// Half of the side of a pad of 4 by 4 tactels of 10 mm [m].
const HALF: f64 = 0.02;

fn shape() -> ImageShape {
    ImageShape { rows: 4, cols: 4, pitch: [0.01; 2], unit: Unit::NEWTON }
}

/// Both limiters, one after the other.
struct Pair {
    first: NodeRig,
    second: NodeRig,
}

impl Pair {
    fn new() -> Self {
        let (twist, image, pose): (Shape, Shape, Shape) =
            (TwistShape.into(), shape().into(), PoseShape::default().into());
        let first = [("twist", twist.clone()), ("image", image.clone())];
        let second = [("twist", twist), ("image", image), ("pose", pose.clone()), ("image_pose", pose)];
        Self {
            first: NodeRig::new::<ContactLimit>(CEILINGS, &first).unwrap(),
            second: NodeRig::new::<SecondContactLimit>(CEILINGS, &second).unwrap(),
        }
    }

    /// Returns the motion behind the first limiter, and that behind both.
    fn pass(&mut self, wanted: &Twist, base: &Pose, mount: &IsometryMatrix3<f64>, cells: [&[f32]; 2]) -> [Twist; 2] {
        self.first.set("twist", *wanted);
        self.first.set("image", Image::from_cells(4, cells[0]));
        self.first.step();
        let between = *self.first.get::<Twist>("twist").unwrap();
        self.second.set("twist", between);
        self.second.set("image", Image::from_cells(4, cells[1]));
        self.second.set("pose", *base);
        self.second.set("image_pose", Pose(base.0 * mount));
        self.second.step();
        [between, *self.second.get::<Twist>("twist").unwrap()]
    }
}

/// Returns the speed of a point `[x, y]` of a pad along its normal, by the finite motion of the rigid body: the pose of
/// the pad in the frame of the twist, moved by the exponential of the twist for +-h.
fn approach(twist: &Twist, pad: &IsometryMatrix3<f64>, [x, y]: [f64; 2]) -> f64 {
    let h = 1e-4;
    let moved = |dt: f64| {
        let (v, w) = (twist.linear() * dt, twist.angular() * dt);
        // The translation of the exponential to the third order, which is enough for this h.
        let shift = v + w.cross(&v) / 2.0 + w.cross(&w.cross(&v)) / 6.0;
        let turn = UnitQuaternion::from_scaled_axis(w);
        let body = Isometry3::from_parts(Translation3::from(shift), turn);
        body * (pad * Point3::new(x, y, 0.0))
    };
    let normal = pad * Vector3::z();
    normal.dot(&(moved(h) - moved(-h))) / (2.0 * h)
}

/// The points of a pad that press, each with the speed that its load allows, by the sums of the definition.
fn pressed(cells: &[f32]) -> Vec<([f64; 2], f64)> {
    let at = |i: usize| [shape().x((i % 4) as f64), shape().y((i / 4) as f64)];
    let sum: f64 = cells.iter().map(|cell| f64::from(*cell)).sum();
    let centre = |axis: usize| cells.iter().enumerate().map(|(i, f)| f64::from(*f) * at(i)[axis]).sum::<f64>() / sum;
    let (highest, peak) =
        cells.iter().enumerate().fold((0, 0.0), |best, (i, f)| if *f > best.1 { (i, *f) } else { best });
    // The positive root of k (v τ + v²/2) = room, with τ of two periods of 1 ms and a deceleration of 1 m/s².
    let speed = |room: f64, k: f64| ((0.002_f64.powi(2) + 2.0 * (room / k).max(0.0)).sqrt() - 0.002).max(0.0);
    let (by_sum, by_tactel) = (speed(10.0 - sum, 160.0), speed(4.0 - f64::from(peak), 80.0));
    if peak <= 0.04 {
        let corners = [[HALF, HALF], [-HALF, HALF], [HALF, -HALF], [-HALF, -HALF]];
        return corners.map(|corner| (corner, by_sum.min(by_tactel))).to_vec();
    }
    vec![([centre(0), centre(1)], by_sum), (at(highest), by_tactel)]
}

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    [-size..size, -size..size, -size..size].prop_map(Vector3::from)
}

fn a_pose(size: f64) -> impl Strategy<Value = IsometryMatrix3<f64>> {
    let turn = prop_oneof![
        4 => vector(3.1),
        1 => Just(Vector3::zeros()),
        // Pads that face each other, and pads at a right angle, exactly and nearly.
        1 => Just(Vector3::x() * std::f64::consts::PI),
        1 => Just(Vector3::y() * std::f64::consts::FRAC_PI_2),
        1 => vector(1e-6).prop_map(|off| Vector3::x() * std::f64::consts::PI + off),
        1 => vector(1e-12).prop_map(|off| Vector3::y() * std::f64::consts::FRAC_PI_2 + off),
    ];
    (turn, vector(size))
        .prop_map(|(turn, place)| IsometryMatrix3::from_parts(Translation3::from(place), Rotation3::new(turn)))
}

fn cells() -> impl Strategy<Value = Vec<f32>> {
    prop::collection::vec(prop_oneof![3 => Just(0.0f32), 1 => 0.0..5.0f32], 16)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Both ceilings hold behind both limiters, with mounts up to 1 m apart, in any order of the two pads.
    #[test]
    fn no_pad_approaches_faster_than_its_own_ceiling_allows(
        wanted in (vector(0.5), vector(2.0)), mount in a_pose(1.0), base in a_pose(1.0), loads in (cells(), cells()),
    ) {
        let wanted = Twist::new(wanted.0, wanted.1);
        let [between, out] = Pair::new().pass(&wanted, &Pose(base), &mount, [&loads.0, &loads.1]);
        for (pad, cells) in [(IsometryMatrix3::identity(), &loads.0), (mount, &loads.1)] {
            for (point, allowed) in pressed(cells) {
                let speed = approach(&out, &pad, point);
                prop_assert!(speed <= allowed + 1e-6, "{speed} > {allowed} at {point:?}");
            }
        }
        // No point of the first pad approaches faster than before, and none that approached is pushed harder.
        for point in [[HALF, HALF], [-HALF, HALF], [HALF, -HALF], [-HALF, -HALF], [0.0, 0.0]] {
            let here = IsometryMatrix3::identity();
            let (before, after) = (approach(&between, &here, point), approach(&out, &here, point));
            prop_assert!(after <= before.max(0.0) + 1e-6, "{before} became {after}");
        }
    }

    /// A retreat of the first pad is reduced only if the normals are more than 135 degrees apart.
    #[test]
    fn a_retreat_of_the_first_pad_is_kept(
        wanted in (vector(0.5), vector(2.0)), mount in a_pose(1.0), load in 5.0..30.0f32, place in 0..16usize,
    ) {
        let wanted = Twist::new(wanted.0, wanted.1);
        let (mut heavy, idle) = ([0.0f32; 16], [0.0f32; 16]);
        heavy[place] = load;
        let [between, out] = Pair::new().pass(&wanted, &Pose::default(), &mount, [&idle, &heavy]);
        let here = IsometryMatrix3::identity();
        let corners = [[HALF, HALF], [-HALF, HALF], [HALF, -HALF], [-HALF, -HALF]];
        let is_slower = |point: &[f64; 2]| approach(&out, &here, *point) <= approach(&between, &here, *point) + 1e-6;
        let is_kept = corners.iter().all(is_slower);
        let (point, _) = pressed(&heavy)[0];
        let on_second = mount * Point3::new(point[0], point[1], 0.0);
        let along_first = (between.linear() + between.angular().cross(&on_second.coords)).z;
        let normal = mount * Vector3::z();
        let faces = normal.z < -std::f64::consts::FRAC_1_SQRT_2;
        prop_assert!(is_kept || faces && along_first < 0.0, "{between:?} became {out:?}");
    }

    /// A second pad that is not in contact changes no slow motion, bit by bit.
    #[test]
    fn without_a_contact_the_twist_passes_with_its_bits(wanted in (vector(0.05), vector(0.2)), mount in a_pose(0.2)) {
        let wanted = Twist::new(wanted.0, wanted.1);
        let [_, out] = Pair::new().pass(&wanted, &Pose::default(), &mount, [&[0.0; 16], &[0.05; 16]]);
        prop_assert_eq!(out.0.map(f64::to_bits), wanted.0.map(f64::to_bits));
    }

    /// In the frame of its own pad the second limiter is the first one: the same pad twice, or pads side by side.
    #[test]
    fn with_the_same_normal_it_is_a_contact_limit(wanted in (vector(0.05), vector(0.5)), heavy in cells()) {
        let wanted = Twist::new(wanted.0, wanted.1);
        let mut pair = Pair::new();
        let same = IsometryMatrix3::identity();
        let [_, out] = pair.pass(&wanted, &Pose::default(), &same, [&[0.0; 16], &heavy]);
        let [alone, _] = Pair::new().pass(&wanted, &Pose::default(), &same, [&heavy, &[0.0; 16]]);
        prop_assert!((out.0 - alone.0).amax() < 1e-12, "{out:?} is not {alone:?}");
    }
}

/// An image with one tactel at its ceiling.
fn heavy() -> [f32; 16] {
    let mut cells = [0.0; 16];
    cells[5] = 4.0;
    cells
}

#[test]
fn closed_forms_of_the_ways_out() {
    let turned = |axis: Vector3<f64>, angle: f64| {
        IsometryMatrix3::from_parts(Translation3::identity(), Rotation3::new(axis * angle))
    };
    let (right, half, sixth) = (std::f64::consts::FRAC_PI_2, std::f64::consts::PI, std::f64::consts::PI * 2.0 / 3.0);
    let sin = sixth.sin();
    // The mount of the second pad, the wanted motion, and what is left of it with the second pad at its ceiling.
    let cases = [
        (
            "a right angle: the slide into it stops, and the retreat goes on",
            turned(Vector3::y(), right),
            [0.1, 0.05, -0.2],
            [0.0, 0.05, -0.2],
        ),
        ("face to face: the retreat itself presses", turned(Vector3::x(), half), [0.1, 0.05, -0.2], [0.0; 3]),
        ("face to face, and away from the second pad", turned(Vector3::x(), half), [0.1, 0.05, 0.2], [0.1, 0.05, 0.2]),
        ("side by side", turned(Vector3::y(), 0.0), [0.1, 0.05, 0.2], [0.1, 0.05, 0.0]),
        // n = (sin 120, 0, cos 120): pressing along x at 0.1 sin 120 is removed along x.
        ("120 degrees, along the first pad", turned(Vector3::y(), sixth), [0.1, 0.05, 0.0], [0.0, 0.05, 0.0]),
        // s = 0.05 * 0.5, which is removed along x.
        ("120 degrees, a retreat alone", turned(Vector3::y(), sixth), [0.0, 0.05, -0.05], [-0.025 / sin, 0.05, -0.05]),
        // n = (1/2, 0, -sin 120): 0.05 along x removes 0.025 of 0.05 sin 120.
        ("150 degrees, a retreat alone", turned(Vector3::y(), half - sixth / 4.0), [0.0, 0.05, -0.05], [0.0; 3]),
        (
            "a right angle and a bit: the retreat goes on",
            turned(Vector3::y(), right + 0.002),
            [0.0, 0.05, -0.2],
            [-0.2 * 0.002_f64.tan(), 0.05, -0.2],
        ),
        // Away along x by enough: s = -0.1 sin 120 + 0.025 < 0.
        ("120 degrees, a retreat to the side", turned(Vector3::y(), sixth), [-0.1, 0.05, -0.05], [-0.1, 0.05, -0.05]),
        // The retreat of the first pad and the motion toward the second: 0.05 sin 120 pays for nothing of the retreat.
        (
            "120 degrees, an approach of both",
            turned(Vector3::y(), sixth),
            [0.1, 0.0, 0.05],
            [0.1 - (0.1 * sin - 0.025) / sin, 0.0, 0.05],
        ),
    ];
    for (what, mount, wanted, left) in cases {
        let wanted = Twist::new(wanted.into(), Vector3::zeros());
        let [_, out] = Pair::new().pass(&wanted, &Pose::default(), &mount, [&[0.0; 16], &heavy()]);
        assert!((out.linear() - Vector3::from(left)).amax() < 1e-12, "{what}: {out:?}");
    }
}

#[test]
fn a_roll_about_the_first_pad_a_metre_away_is_not_a_way_around_the_ceiling() {
    // The second pad is 1 m along x, with the same normal: turning about -y moves it along +z at 1 m/s.
    let mount = IsometryMatrix3::translation(1.0, 0.0, 0.0);
    let roll = Twist::new(Vector3::zeros(), Vector3::new(0.0, -1.0, 0.0));
    let [between, out] = Pair::new().pass(&roll, &Pose::default(), &mount, [&[0.0; 16], &heavy()]);
    assert_eq!(between, roll);
    // The first limiter cannot know of it; behind the second one the roll goes on about the second contact.
    let (point, _) = pressed(&heavy())[0];
    assert!(approach(&roll, &mount, point) > 0.9);
    assert!(approach(&out, &mount, point).abs() < 1e-6 && out.angular() == roll.angular(), "{out:?}");
}

#[test]
fn an_old_image_or_an_old_pose_is_no_motion() {
    for stale in ["image", "pose", "image_pose"] {
        let mut rig = Pair::new().second;
        for step in 0..3 {
            rig.set("twist", Twist::default());
            for name in ["pose", "image_pose"].into_iter().filter(|name| step == 0 || *name != stale) {
                rig.set(name, Pose::default());
            }
            if step == 0 || stale != "image" {
                rig.set("image", Image::zeros(4, 4));
            }
            rig.step_ms(1.0);
        }
        assert!(rig.get::<Twist>("twist").is_some(), "{stale} is 2 ms old");
        for _ in 0..60 {
            rig.set("twist", Twist::default());
            for name in ["pose", "image_pose"].into_iter().filter(|name| *name != stale) {
                rig.set(name, Pose::default());
            }
            if stale != "image" {
                rig.set("image", Image::zeros(4, 4));
            }
            rig.step_ms(1.0);
        }
        assert!(rig.get::<Twist>("twist").is_none(), "{stale}");
    }
}

#[test]
fn ceilings_are_in_the_unit_of_the_image() {
    let raw = ImageShape { unit: Unit::RAW, ..shape() };
    let wires: [(&str, Shape); 4] = [
        ("twist", TwistShape.into()),
        ("image", raw.into()),
        ("pose", PoseShape::default().into()),
        ("image_pose", PoseShape::default().into()),
    ];
    let rig = NodeRig::new::<SecondContactLimit>(CEILINGS, &wires);
    assert_eq!(places(CEILINGS, &rig), ["unit-mismatch: `force_n`", "unit-mismatch: `peak_n`"]);
}
