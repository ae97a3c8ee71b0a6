//! The guard against a contact that really slides and rolls over a pad.

use nalgebra::{IsometryMatrix3, Point3, Rotation3, Translation3, Vector3};
use proptest::array::{uniform2, uniform6};
use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::node::At;
use tactflow_runtime::signal::{Freshness, Image, ScalarShape, Shape, TwistShape, Unit};

use super::*;

const PITCH: f64 = 0.005;
/// Tactels 2 to 13 of 16.
const MARGIN: f64 = 5.5 * PITCH;
const FENCE: Fence = Fence { margin: MARGIN, ramp: PITCH };

/// A ball that rests in the world, and a pad that moves with a twist of its own frame. The contact is where the ball's
/// centre stands over the pad; a radius of zero is a tip that slides.
struct Scene {
    pad: IsometryMatrix3<f64>,
    ball: Point3<f64>,
    radius: f64,
}

impl Scene {
    fn new([x, y]: [f64; 2], radius: f64) -> Self {
        Self { pad: IsometryMatrix3::identity(), ball: Point3::new(x, y, radius), radius }
    }

    fn contact(&self) -> [f64; 2] {
        let ball = self.pad.inverse() * self.ball;
        [ball.x, ball.y]
    }

    /// Moves the pad; the ball stays in contact.
    fn step(&mut self, twist: &Twist, dt: f64) {
        let turn = Rotation3::new(twist.angular() * dt);
        self.pad *= IsometryMatrix3::from_parts(Translation3::from(twist.linear() * dt), turn);
        let height = (self.pad.inverse() * self.ball).z - self.radius;
        self.pad *= IsometryMatrix3::from_parts(Translation3::new(0.0, 0.0, height), Rotation3::identity());
    }
}

/// Furthest from the middle that the contact gets, along either axis, while each twist lasts for 0.2 s.
fn furthest(scene: &mut Scene, twists: &[[f64; 6]], guard: bool) -> f64 {
    let mut most = 0.0_f64;
    for twist in twists {
        let twist = Twist((*twist).into());
        for _ in 0..400 {
            let contact = scene.contact();
            scene.step(&if guard { guarded(&twist, contact, FENCE, FENCE) } else { twist }, 0.0005);
            most = scene.contact().into_iter().fold(most, |most, place| most.max(place.abs()));
        }
    }
    most
}

fn a_twist() -> impl Strategy<Value = [f64; 6]> {
    let (v, w) = (-0.1..0.1_f64, -0.8..0.8_f64);
    [v.clone(), v.clone(), v, w.clone(), w.clone(), w]
}

/// Anywhere, and often on a border, where a jump would be.
fn a_place() -> impl Strategy<Value = f64> {
    const BORDERS: [f64; 5] = [0.0, MARGIN - PITCH, MARGIN, PITCH - MARGIN, -MARGIN];
    prop_oneof![-0.04..0.04, prop::sample::select(&BORDERS[..])]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_contact_never_leaves_the_margin(
        at in uniform2(-MARGIN..MARGIN),
        radius in prop_oneof![Just(0.0), 0.005..0.05],
        twists in prop::collection::vec(a_twist(), 1..8),
    ) {
        let most = furthest(&mut Scene::new(at, radius), &twists, true);
        prop_assert!(most < MARGIN + 0.01 * PITCH, "{most}");
    }
}

proptest! {
    #[test]
    fn outward_speed_is_scaled_and_inward_speed_is_not(
        at in uniform2(-0.04..0.04), twist in a_twist(),
    ) {
        // A tip that slides, so that the speed of the contact is that of the moving frame and nothing else.
        let speed = |twist: &Twist| {
            let mut scene = Scene::new(at, 0.0);
            scene.step(twist, 1e-7);
            let [x, y] = scene.contact();
            [(x - at[0]) * 1e7, (y - at[1]) * 1e7]
        };
        let before = Twist(twist.into());
        let after = guarded(&before, at, FENCE, FENCE);
        let (free, held) = (speed(&before), speed(&after));
        for i in 0..2 {
            let room = (MARGIN - at[i] * free[i].signum()) / PITCH;
            prop_assert!((held[i] - free[i] * room.clamp(0.0, 1.0)).abs() < 1e-6, "{free:?} {held:?}");
        }
    }

    #[test]
    fn motion_inward_or_in_the_middle_passes_bit_for_bit(at in uniform2(-0.04..0.04), twist in a_twist()) {
        let [x, y]: [f64; 2] = at;
        let [vx, vy, vz, wx, wy, _] = twist.map(f64::abs);
        // Toward the middle along both axes, rolling too; without a turn, which goes outward for one or the other.
        let inward = Twist([vx * x.signum(), vy * y.signum(), vz, -wx * y.signum(), wy * x.signum(), 0.0].into());
        prop_assert_eq!(guarded(&inward, at, FENCE, FENCE), inward);
        let (anything, middle) = (Twist(twist.into()), at.map(|place| place * (MARGIN - PITCH) / 0.04));
        prop_assert_eq!(guarded(&anything, middle, FENCE, FENCE), anything);
        let held = guarded(&anything, at, FENCE, FENCE).0;
        prop_assert_eq!((held[2], held[5]), (twist[2], twist[5]), "vz and wz are no way out");
    }

    #[test]
    fn the_output_is_continuous(
        at in uniform2(a_place()), twist in a_twist(), nudge in uniform6(-1e-7..1e-7), shift in uniform2(-1e-7..1e-7),
        zero in prop::option::of(0..6_usize),
    ) {
        let mut twist = Twist(twist.into());
        if let Some(i) = zero {
            twist.0[i] = 0.0;
        }
        let moved = Twist(twist.0 + nalgebra::Vector6::from(nudge));
        let (x, y) = (at[0] + shift[0], at[1] + shift[1]);
        let change = guarded(&moved, [x, y], FENCE, FENCE).0 - guarded(&twist, at, FENCE, FENCE).0;
        // The steepest there is: 0.8 rad/s over a ramp of 5 mm.
        prop_assert!(change.amax() < 1e-7 * (2.0 + 0.8 / PITCH), "{change}");
    }
}

#[test]
fn without_the_guard_each_outward_motion_leaves_the_margin() {
    let ways = [
        ("slide", 0.0, [0.02, 0.0], [-0.05, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ("slide", 0.0, [0.0, -0.02], [0.0, 0.05, 0.0, 0.0, 0.0, 0.0]),
        ("roll", 0.04, [0.02, 0.0], [0.0, 0.0, 0.0, 0.0, -0.8, 0.0]),
        ("roll", 0.04, [0.0, 0.02], [0.0, 0.0, 0.0, 0.8, 0.0, 0.0]),
        ("turn", 0.0, [0.02, 0.025], [0.0, 0.0, 0.0, 0.0, 0.0, 0.8]),
    ];
    for (what, radius, at, twist) in ways {
        for (guard, expected) in [(false, true), (true, false)] {
            let most = furthest(&mut Scene::new(at, radius), &[twist; 4], guard);
            assert_eq!(most > MARGIN, expected, "{what}, guarded {guard}: {most}");
        }
    }
}

/// The servo's columns (a contact at +x is brought back by vx > 0 and wy > 0) are inward.
#[test]
fn motion_of_the_servo_is_never_held_back() {
    for [x, y] in [[0.035, 0.0], [-0.035, 0.03], [0.0, -0.035], [0.03, 0.03]] {
        let (ex, ey, r): (f64, f64, f64) = (-2.0 * x, -2.0 * y, 20.0);
        let servo = Twist([-ex, -ey, 0.01, r * ey, -r * ex, 0.0].into());
        assert_eq!(guarded(&servo, [x, y], FENCE, FENCE), servo);
    }
}

fn rig(params: &str, rows: usize, cols: usize) -> Result<NodeRig, Mistakes> {
    let metre = || Shape::from(ScalarShape::of(Unit::METRE));
    let image = ImageShape { rows, cols, pitch: [PITCH; 2], unit: Unit::NEWTON };
    let wires = [("twist", TwistShape.into()), ("x", metre()), ("y", metre()), ("image", image.into())];
    NodeRig::new::<EdgeGuard>(params, &wires)
}

const OUTWARD: [f64; 6] = [-0.01, 0.0, 0.02, 0.0, 0.0, 0.1];

/// A step with the contact at `x` tactels from the middle, if there is one: vx that comes out, and the flag.
fn show(rig: &mut NodeRig, x: Option<f64>) -> (Option<f64>, Option<bool>) {
    rig.set("twist", Twist(OUTWARD.into()));
    for (name, place) in [("x", x), ("y", x.map(|_| 0.0))] {
        match place {
            Some(place) => rig.set(name, place * PITCH),
            None => rig.lose(name),
        }
    }
    rig.step();
    (rig.get::<Twist>("twist").map(|twist| twist.0[0]), rig.get("at_rim").copied())
}

#[test]
fn the_ramp_and_the_flag_with_its_hysteresis() {
    let mut rig = rig("", 16, 16).unwrap();
    rig.set("image", Image::zeros(16, 16));
    let steps = [
        (None, -0.01, false, "no contact yet: everything passes"),
        (Some(4.4), -0.01, false, "in the middle"),
        (Some(4.75), -0.0075, false, "on the ramp"),
        (Some(5.1), -0.004, true, "past its middle"),
        (Some(4.6), -0.009, true, "the flag holds on"),
        (Some(4.4), -0.01, false, "until nothing is held back"),
        (Some(5.5), 0.0, true, "at the margin"),
        (Some(7.5), 0.0, true, "and beyond"),
        (Some(-7.5), -0.01, true, "the other way is inward there, but it is at the rim"),
    ];
    for (x, vx, at_rim, what) in steps {
        let (got, flag) = show(&mut rig, x);
        assert!((got.unwrap() - vx).abs() < 1e-12, "{what}: {got:?}");
        assert_eq!(flag, Some(at_rim), "{what}");
    }
    assert_eq!(rig.get::<Twist>("twist").map(|twist| (twist.0[2], twist.0[5])), Some((0.02, 0.1)));
}

#[test]
fn a_contact_that_flickers_is_remembered_and_a_lost_one_is_forgotten() {
    let mut rig = rig("", 16, 16).unwrap();
    rig.set("image", Image::zeros(16, 16));
    assert_eq!(show(&mut rig, Some(6.0)), (Some(0.0), Some(true)));
    for ms in 0..20 {
        assert_eq!(show(&mut rig, None), (Some(0.0), Some(true)), "{ms} ms after");
    }
    assert_eq!(show(&mut rig, None), (Some(-0.01), Some(false)), "20 ms after");
    assert_eq!(show(&mut rig, Some(6.0)), (Some(0.0), Some(true)));
    assert_eq!(show(&mut rig, None), (Some(0.0), Some(true)), "each flicker is counted by itself");
}

#[test]
fn margin_and_ramp_are_in_tactels_of_their_axis() {
    let fences = |axis: usize, place: f64| {
        let shape = ImageShape { rows: 12, cols: 16, pitch: [0.005, 0.002], unit: Unit::NEWTON };
        let metre = || Shape::from(ScalarShape::of(Unit::METRE));
        let image = Image::zeros(shape.rows, shape.cols);
        let wires = [("twist", TwistShape.into()), ("x", metre()), ("y", metre()), ("image", shape.into())];
        let mut rig = NodeRig::new::<EdgeGuard>("margin_tactels = 1.5\nramp_tactels = 2", &wires).unwrap();
        rig.set("image", image);
        rig.set("twist", Twist([-1.0, -1.0, 0.0, 0.0, 0.0, 0.0].into()));
        rig.set("x", if axis == 0 { place } else { 0.0 });
        rig.set("y", if axis == 1 { place } else { 0.0 });
        rig.step();
        rig.get::<Twist>("twist").unwrap().0[axis]
    };
    // Six tactels of 5 mm along x and four of 2 mm along y are free; half of the ramp is a tactel before.
    for (axis, place) in [(0, 0.025), (1, 0.006)] {
        assert!((fences(axis, place) + 0.5).abs() < 1e-9, "axis {axis}: {}", fences(axis, place));
    }
}

#[test]
fn a_contact_that_moves_changes_the_output_of_a_held_twist() {
    let mut rig = rig("", 16, 16).unwrap();
    rig.set("image", Image::zeros(16, 16));
    assert_eq!(show(&mut rig, Some(0.0)).0, Some(-0.01));
    rig.set("x", 6.0 * PITCH);
    rig.step();
    assert_eq!((rig.freshness("twist"), rig.get::<Twist>("twist").unwrap().0[0]), (Freshness::New, 0.0));
    rig.step();
    assert_eq!(rig.freshness("twist"), Freshness::Held);
    rig.lose("twist");
    rig.step();
    assert_eq!((rig.freshness("twist"), rig.freshness("at_rim")), (Freshness::Lost, Freshness::Lost));
}

#[test]
fn a_pad_without_a_middle_is_a_mistake() {
    let small = rig("margin_tactels = 2.0", 4, 16).err().unwrap();
    assert_eq!(small[0].at, At::Param("margin_tactels".into()));
    assert_eq!(small[0].message, "a margin of 2 and a ramp of 1 tactels leave no middle on a pad of 4 by 16 tactels");
    assert!(rig("margin_tactels = 0.5", 4, 16).is_ok(), "just enough");
    let strip = rig("margin_tactels = 0.0", 1, 16).err().unwrap();
    assert_eq!(strip[0].at, At::Input("image".into()));
    assert_eq!(strip[0].message, "a pad of 1 by 16 tactels has no middle: every contact on it is at the rim");
    for (bad, place) in [("margin_tactels = -1.0", "bad-value: `-1.0`"), ("ramp_tactels = 0.0", "bad-value: `0.0`")] {
        assert_eq!(places(bad, &rig(bad, 16, 16)), [place], "{bad}");
    }
}

#[test]
fn the_scene_rolls_as_a_ball_does() {
    // A quarter of a radian over a ball of 40 mm is 10 mm of its skin.
    let mut scene = Scene::new([0.0, 0.0], 0.04);
    let roll = Twist::new(Vector3::zeros(), Vector3::new(0.0, 0.25, 0.0));
    (0..1000).for_each(|_| scene.step(&roll, 0.001));
    let [x, y] = scene.contact();
    assert!((x + 0.01).abs() < 1e-4 && y.abs() < 1e-9, "{x} {y}");
}
