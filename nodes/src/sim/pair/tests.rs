//! The cell against closed forms.

use nalgebra::{IsometryMatrix3, Vector3};
use parry3d_f64::math::{Mat3, Pose3, Rot3, Vec3};
use tactflow_runtime::signal::{ImageShape, Joint as Limits, Unit};

use super::body::GRAVITY_M_PER_S2 as G;
use super::carried::{CarriedParams, CarriedShape};
use super::table::Table;
use super::world::{ArmAndPad, PairWorld};
use crate::arm::chain::{Chain, ChainSegment, JointKind};
use crate::sim::foam::Foam;
use crate::sim::joints::{JointDynamics, SimArm};
use crate::sim::wrench::Wrench;

/// Half of the width of the box between the pads [m].
const HALF_WIDTH: f64 = 0.03;
/// Number of tactels of a pad that the box covers: 20 mm by 40 mm.
const TACTELS: f64 = 32.0;
/// Stiffness of the joints [N/m].
const STIFFNESS: f64 = 5000.0;

fn shape() -> ImageShape {
    ImageShape { rows: 8, cols: 8, pitch: [0.005; 2], unit: Unit::RAW }
}

fn box_of(mass: f64) -> CarriedParams {
    CarriedParams {
        shape: CarriedShape::Box,
        size: Some([2.0 * HALF_WIDTH, 0.02, 0.1]),
        radius: None,
        mass,
        at: [0.0; 2],
        turn: 0.0,
        stiffness: None,
        scatter: 0.0,
    }
}

fn ball_of(mass: f64, radius: f64) -> CarriedParams {
    CarriedParams { shape: CarriedShape::Ball, size: None, radius: Some(radius), ..box_of(mass) }
}

/// Returns foam whose friction is `mu` at rest and sliding.
fn foam(mu: f64) -> Foam {
    Foam { static_friction: mu, sliding_friction: mu, ..Foam::default() }
}

/// Returns an arm with a joint along the pad's y, which is up, and one along its z, towards the object.
fn gantry(dynamics: JointDynamics) -> SimArm {
    let limits = Limits { lower: -1.0, upper: 1.0, ..Limits::default() };
    let segment = |axis| ChainSegment {
        fixed: IsometryMatrix3::identity(),
        axis,
        motion: JointKind::Prismatic,
        joint: limits.clone(),
    };
    let chain = Chain::new(vec![segment(Vector3::y()), segment(Vector3::z())], IsometryMatrix3::identity());
    SimArm::new(chain, vec![dynamics; 2], vec![0.0; 2])
}

/// Returns a pad `gap` [m] away from the box, at half of its height: on its left (1) or on its right (-1).
fn side(sign: f64, gap: f64, dynamics: JointDynamics, foam: &Foam) -> ArmAndPad {
    let axes = Mat3::from_cols(Vec3::Y * sign, Vec3::Z, Vec3::X * sign);
    let place = Vec3::new(-sign * (HALF_WIDTH + gap), 0.0, 0.05);
    let base = Pose3::from_parts(place, Rot3::from_mat3(&axes));
    ArmAndPad::new(base, gantry(dynamics), &shape(), foam.clone(), 0.001)
}

/// Returns a cell with pads 2 mm away from the object, and with the step that the object needs divided by `divisor`.
fn cell_with(object: &CarriedParams, foam: &Foam, joints: [JointDynamics; 2], divisor: f64) -> PairWorld {
    let body = object.body(0.0, [0.0; 2]).unwrap();
    let table = Table::new(0.0, 0.4, &body);
    let [left, right] = joints;
    let sides = [side(1.0, 0.002, left, foam), side(-1.0, 0.002, right, foam)];
    let step = object.step(foam, shape().tactels() as f64 * 25e-6, 0.002).unwrap();
    PairWorld::new(sides, body, table, step / divisor)
}

const DAMPED: JointDynamics = JointDynamics { stiffness: STIFFNESS, damping_ratio: 1.0, inertia: 2.0, friction: 0.0 };

fn cell(object: &CarriedParams, foam: &Foam) -> PairWorld {
    cell_with(object, foam, [DAMPED; 2], 1.0)
}

/// Moves the equilibrium of both arms toward the box, so that each pad presses with a force [N].
fn press(world: &mut PairWorld, force: f64) {
    let ahead = 0.002 + force / STIFFNESS + force / (TACTELS * 300.0);
    world.sides.iter_mut().for_each(|side| side.arm.equilibrium[1] = ahead);
}

const STILL: [&[f64]; 2] = [&[0.0, 0.0], &[0.0, 0.0]];

fn height(world: &PairWorld) -> f64 {
    world.body.object.pose.translation.z
}

fn normal(world: &PairWorld) -> [f64; 2] {
    [0, 1].map(|side: usize| world.sides[side].contact.normal())
}

/// Lowers the table by 40 mm at 10 mm/s from `time` on, and returns the time at the end [s].
fn lower(world: &mut PairWorld, time: f64) -> f64 {
    let begin = world.table.height;
    for beat in 1..=1000 {
        world.table.height = begin - 4e-5 * f64::from(beat);
        world.advance(time + 0.004 * f64::from(beat), STILL);
        if beat > 30 && height(world) < 0.05 - 0.004 {
            break;
        }
        if beat == 150 {
            // The table is 6 mm lower; what holds now holds for good.
            world.table.height = begin - 1.0;
            world.advance(time + 0.9, STILL);
            return time + 0.9;
        }
    }
    f64::NAN
}

#[test]
fn a_free_object_falls_along_the_parabola() {
    for (object, divisor) in [(box_of(0.3), 1.0), (ball_of(0.05, 0.03), 1.0), (box_of(0.3), 7.0)] {
        let mut world = cell_with(&object, &foam(0.8), [DAMPED; 2], divisor);
        world.table.height = -100.0;
        let start = height(&world);
        for time in [0.1, 0.2, 0.5, 1.0] {
            world.advance(time, STILL);
            let fallen = start - height(&world);
            let wanted = G * time * time / 2.0;
            assert!((fallen / wanted - 1.0).abs() < 1e-3, "{fallen} m after {time} s, not {wanted} m");
        }
        assert!((world.body.object.velocity_at(world.body.object.pose.translation).z + G).abs() < 1e-3);
    }
}

#[test]
fn at_rest_the_table_bears_the_weight() {
    for object in [box_of(0.05), box_of(0.3), box_of(2.0), ball_of(0.2, 0.03)] {
        let mut world = cell(&object, &foam(0.8));
        let start = height(&world);
        for time in [0.01, 0.5] {
            world.advance(time, STILL);
            let weight = object.mass * G;
            assert!((world.table.force / weight - 1.0).abs() < 1e-6, "{} N, not {weight} N", world.table.force);
            assert!((height(&world) - start).abs() < 1e-9, "it starts at rest");
        }
    }
}

#[test]
fn a_box_that_leans_a_little_comes_to_rest_flat() {
    let mut world = cell(&box_of(0.3), &foam(0.8));
    let pose = world.body.object.pose;
    let lean = Rot3::from_xyzw((0.02f64).sin(), 0.0, 0.0, (0.02f64).cos());
    world.body.object.place(Pose3::from_parts(pose.translation + Vec3::Z * 0.001, lean), Vec3::ZERO, Vec3::ZERO);
    assert!((world.body.tilt() - 0.04).abs() < 1e-9);
    // It rocks from edge to edge for a while.
    world.advance(4.0, STILL);
    assert!(world.body.tilt() < 1e-5 && (world.table.force / (0.3 * G) - 1.0).abs() < 1e-3, "{}", world.body.tilt());
}

#[test]
fn a_ball_that_slides_ends_rolling_at_five_sevenths_of_its_speed() {
    let object = ball_of(0.3, 0.03);
    let mut world = cell(&object, &foam(0.8));
    let place = world.body.object.pose.translation + Vec3::Y * 0.3;
    world.body.object.place(Pose3::from_translation(place), Vec3::ZERO, Vec3::ZERO);
    // It is pushed for one step, so it starts to slide at 1 m/s without a spin.
    world.body.step(1e-9, &Wrench { force: Vec3::Y * (0.3 / 1e-9), moment: Vec3::ZERO });
    world.advance(1.0, STILL);
    let centre = world.body.object.pose.translation;
    let speed = world.body.object.velocity_at(centre).y;
    assert!((speed - 5.0 / 7.0).abs() < 0.005, "{speed} m/s");
    let spin = world.body.object.spin();
    assert!((spin.x * -0.03 - speed).abs() < 0.005 && spin.y.abs() < 1e-9, "it rolls: {spin}");
    assert!(world.body.object.velocity_at(centre - Vec3::Z * 0.03).y.abs() < 0.002, "without a slip");
}

#[test]
fn a_squeezed_object_stays_if_the_friction_bears_its_weight_and_falls_if_not() {
    for (mu, force) in [(0.3, 5.0), (0.8, 2.0), (0.8, 8.0), (1.2, 1.0)] {
        for margin in [1.1, 0.9] {
            // 2 mu N = margin m g
            let mass = 2.0 * mu * force / (margin * G);
            let mut world = cell(&box_of(mass), &foam(mu));
            press(&mut world, force);
            world.advance(0.5, STILL);
            let [left, right] = normal(&world);
            assert!((left / force - 1.0).abs() < 0.01 && (right / force - 1.0).abs() < 0.01, "{left} N {right} N");
            let start = height(&world);
            let end = lower(&mut world, 0.5);
            let fallen = start - height(&world);
            let case = format!("mu {mu}, {force} N, {mass} kg, margin {margin}: {fallen} m");
            if margin > 1.0 {
                // The weight bends the springs of both arms and shears the foam.
                let sag = mass * G / (2.0 * STIFFNESS) + mass * G / (2.0 * TACTELS * 200.0);
                assert!((fallen - sag).abs() < 1e-5 && world.is_held(), "it stays: {case}");
                let friction: f64 = world.sides.iter().map(|side| side.contact.friction().y).sum();
                assert!((friction.abs() / (mass * G) - 1.0).abs() < 0.01, "the friction is its weight: {friction} N");
                assert!(world.body.tilt() < 1e-3, "{case}");
            } else {
                assert!(fallen > 0.002 && end.is_nan(), "it falls: {case}");
            }
        }
    }
}

#[test]
fn rising_arms_lift_the_object_or_leave_it_on_the_table() {
    for (margin, is_lifted) in [(1.15, true), (0.85, false)] {
        let (mu, force) = (0.8, 2.0);
        let mass = 2.0 * mu * force / (margin * G);
        let mut world = cell(&box_of(mass), &foam(mu));
        press(&mut world, force);
        world.advance(0.4, STILL);
        let start = height(&world);
        let up: [&[f64]; 2] = [&[0.01, 0.0]; 2];
        world.advance(1.4, up);
        world.advance(1.8, STILL);
        let risen = height(&world) - start;
        assert_eq!(world.is_held(), is_lifted, "{margin}: {risen} m");
        // The weight bends the springs of both arms and shears the foam.
        let sag = mass * G / (2.0 * STIFFNESS) + mass * G / (2.0 * TACTELS * 200.0);
        let wanted = if is_lifted { 0.01 - sag } else { 0.0 };
        assert!((risen - wanted).abs() < 2e-4, "{margin}: {risen} m, not {wanted} m");
    }
}

#[test]
fn the_forces_of_both_pads_on_a_held_object_cancel() {
    // The left arm is stiffer and pushes further than the right one.
    let soft = JointDynamics { stiffness: 1500.0, ..DAMPED };
    let mut world = cell_with(&box_of(0.1), &foam(0.8), [DAMPED, soft], 1.0);
    world.sides[0].arm.equilibrium[1] = 0.006;
    world.sides[1].arm.equilibrium[1] = 0.003;
    world.advance(0.5, STILL);
    world.table.height = -1.0;
    world.advance(1.5, STILL);
    let [left, right] = normal(&world);
    assert!(world.is_held() && left > 1.0, "{left} N");
    assert!((left - right).abs() < 0.01 * left, "{left} N and {right} N");
    // Springs in series: K_l (e_l - g - u) = K_r (e_r - g + u) = N less the foam, with u the shift of the box.
    let foam = 1.0 / (TACTELS * 300.0);
    let wanted = (0.006 + 0.003 - 0.004) / (1.0 / STIFFNESS + 1.0 / 1500.0 + 2.0 * foam);
    assert!((left / wanted - 1.0).abs() < 0.01, "{left} N, not {wanted} N");
}

/// Returns the greatest energies of a cell in two half seconds without commands, as fractions of the first energy.
fn greatest_energy(object: &CarriedParams, foam: &Foam, joint: JointDynamics, divisor: f64) -> [f64; 2] {
    let mut world = cell_with(object, foam, [joint; 2], divisor);
    // The springs of the joints are loaded, then released; the arms push unequally, and the object drops on the table.
    world.sides[0].arm.equilibrium = vec![0.001, 0.004];
    world.sides[1].arm.equilibrium = vec![-0.002, 0.003];
    let place = world.body.object.pose.translation + Vec3::Z * 0.01;
    world.body.object.place(Pose3::from_parts(place, Rot3::from_rotation_z(0.1)), Vec3::ZERO, Vec3::ZERO);
    // The energy of the object at rest on the table does not count.
    let rest = object.mass * G * (place.z - 0.01);
    let first = world.energy() - rest;
    let (mut greatest, mut touched) = ([0.0f64; 2], false);
    for step in 0..1000 {
        world.advance(f64::from(step + 1) * 0.001, STILL);
        let half = &mut greatest[step as usize / 500];
        *half = half.max((world.energy() - rest) / first);
        touched |= normal(&world)[0] > 0.5;
    }
    assert!(touched, "the pads touch the object");
    greatest
}

#[test]
fn energy_does_not_grow_without_commands() {
    let undamped = JointDynamics { damping_ratio: 0.0, ..DAMPED };
    let lossless = Foam { damping: 0.0, ..foam(0.0) };
    let cases = [
        (box_of(0.3), lossless.clone(), undamped),
        (ball_of(0.3, 0.03), lossless, undamped),
        (box_of(0.3), foam(0.8), DAMPED),
        (box_of(0.02), foam(0.8), undamped),
        (ball_of(0.1, 0.03), foam(0.5), undamped),
    ];
    for (case, (object, foam, joint)) in cases.into_iter().enumerate() {
        // Semi-implicit Euler conserves an energy that differs from the true one by a term of the step. Without any
        // loss in the foam it shows in the first impacts.
        let coarse = if foam.damping == 0.0 { 1.03 } else { 1.001 };
        for (divisor, bound) in [(1.0, coarse), (4.0, 1.002)] {
            let [first, second] = greatest_energy(&object, &foam, joint, divisor);
            assert!(first < bound, "case {case}: {first} of the first energy, with steps by {divisor}");
            assert!(second <= first, "case {case}: it grows from {first} to {second}, with steps by {divisor}");
        }
    }
}

#[test]
fn half_of_the_step_changes_little() {
    let run = |divisor: f64| {
        let mut world = cell_with(&box_of(0.2), &foam(0.8), [DAMPED; 2], divisor);
        press(&mut world, 3.0);
        let mut course = Vec::new();
        for beat in 1..=300 {
            let up = [if beat > 100 { 0.02 } else { 0.0 }, 0.0];
            world.advance(f64::from(beat) * 0.004, [&up, &up]);
            course.push((height(&world), normal(&world)));
        }
        course
    };
    let [coarse, fine] = [run(1.0), run(2.0)];
    for (beat, ((z, force), (fine_z, fine_force))) in coarse.iter().zip(&fine).enumerate() {
        assert!((z - fine_z).abs() < 2e-5, "{beat}: {z} m and {fine_z} m");
        assert!((0..2).all(|i| (force[i] - fine_force[i]).abs() < 0.02 * 3.0), "{beat}: {force:?} {fine_force:?}");
    }
}

#[test]
fn a_hard_squeeze_is_stable_for_every_mass_that_is_accepted() {
    for mass in [0.01, 0.05, 0.3, 3.0] {
        let mut world = cell(&box_of(mass), &foam(0.8));
        press(&mut world, 60.0);
        world.advance(0.6, STILL);
        let [left, right] = normal(&world);
        assert!((left - right).abs() < 0.1 && left > 30.0, "{mass} kg: {left} N {right} N");
        let speed = world.body.object.velocity_at(world.body.object.pose.translation).length();
        assert!(speed < 1e-3, "{mass} kg moves at {speed} m/s");
    }
    let mistakes = box_of(2e-4).step(&foam(0.8), 1.6e-3, 0.002).unwrap_err();
    assert!(mistakes[0].message.contains("at most 64 are simulated"), "{}", mistakes[0].message);
}

#[test]
fn the_same_commands_give_the_same_bits() {
    let run = || {
        let mut world = cell(&box_of(0.2), &foam(0.8));
        press(&mut world, 3.0);
        world.advance(0.2, [&[0.01, 0.001], &[0.02, 0.0]]);
        let place = world.body.object.pose.translation;
        [place.x, place.y, place.z, normal(&world)[0], normal(&world)[1]].map(f64::to_bits)
    };
    assert_eq!(run(), run());
}
