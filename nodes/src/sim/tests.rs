//! The simulation against closed forms.

use nalgebra::{IsometryMatrix3, Vector3};
use parry3d_f64::math::{Pose3, Vec3};
use tactflow_runtime::device::Disturbance;
use tactflow_runtime::signal::{ImageShape, Joint as Limits, Unit};

use super::contact::{BodyMotion, Contact};
use super::foam::Foam;
use super::imprint::Imprint;
use super::joints::{ArmLoad, JointDynamics, SimArm};
use super::object::{Object, ObjectParams, ScriptedMove, ShapeKind};
use super::steps::is_resolved;
use super::testing::{ball, thing};
use super::world::World;
use super::wrench::Wrench;
use crate::arm::chain::{Chain, ChainSegment, JointKind};
use crate::arm::model::load;
use crate::arm::mount::Mount;

fn shape() -> ImageShape {
    ImageShape { rows: 16, cols: 16, pitch: [0.005; 2], unit: Unit::RAW }
}

fn object(thing: &ObjectParams) -> Object {
    Object::new(thing, Pose3::IDENTITY, [0.0; 2]).unwrap()
}

/// Returns a pad at rest in the base, moved along its z.
fn pad(z: f64) -> BodyMotion {
    BodyMotion { pose: Pose3::from_translation(Vec3::new(0.0, 0.0, z)), linear: Vec3::ZERO, angular: Vec3::ZERO }
}

/// Returns foam without losses.
fn lossless() -> Foam {
    Foam { damping: 0.0, static_friction: 0.0, sliding_friction: 0.0, ..Foam::default() }
}

fn world(arm: SimArm, foam: Foam, things: &[ObjectParams], step: f64) -> World {
    let from = arm.motion().pose;
    let objects = things.iter().map(|thing| Object::new(thing, from, [0.0; 2]).unwrap()).collect();
    World::new(arm, objects, shape(), foam, 0.001, step)
}

/// Returns a prismatic joint along the pad's z.
fn slide(joint: JointDynamics) -> SimArm {
    let limits = Limits { lower: -1.0, upper: 1.0, ..Limits::default() };
    let motion = JointKind::Prismatic;
    let segment = ChainSegment { fixed: IsometryMatrix3::identity(), axis: Vector3::z(), motion, joint: limits };
    SimArm::new(Chain::new(vec![segment], IsometryMatrix3::identity()), vec![joint], vec![0.0])
}

/// Returns the arm of the paper.
fn lwr(damping_ratio: f64, friction: f64) -> SimArm {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/robots/lwr4p.urdf");
    let urdf = tactflow_runtime::node::FilePath { path: path.into(), span: 0..0, builtin: None };
    let chain = load(&urdf, "lwr_7_link", &Mount { xyz: [0.0, 0.0, 0.03], rpy: [0.0; 3] }).unwrap();
    let inertia = [2.0, 2.0, 1.0, 0.8, 0.3, 0.25, 0.1];
    let joint = |inertia: f64| JointDynamics { stiffness: 200.0, damping_ratio, inertia, friction };
    SimArm::new(chain, inertia.map(joint).into(), vec![0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0])
}

#[test]
fn at_rest_the_prismatic_joint_and_the_foam_balance() {
    let joint = JointDynamics { stiffness: 5000.0, damping_ratio: 1.0, inertia: 2.0, friction: 0.0 };
    let soft =
        |stiffness: f64| ObjectParams { stiffness: Some(stiffness), ..thing(ShapeKind::Plane, [0.0, 0.0, 0.002]) };
    let mounted = |mount: f64| ObjectParams { mount: Some(mount), ..thing(ShapeKind::Plane, [0.0, 0.0, 0.002]) };
    // Stiffness of the foam of 256 tactels, alone or with a spring in series.
    let foam = 256.0 * 300.0;
    let cases = [
        (thing(ShapeKind::Plane, [0.0, 0.0, 0.002]), foam),
        (soft(100.0), 256.0 / (1.0 / 300.0 + 1.0 / 100.0)),
        (mounted(2e4), 1.0 / (1.0 / foam + 1.0 / 2e4)),
    ];
    for (plane, stiffness) in cases {
        let mut world = world(slide(joint), Foam::default(), &[plane], 0.001);
        world.advance(1.0, &[0.01]);
        world.advance(4.0, &[0.0]);
        // K (0.01 - z) = k (z - 0.002)
        let wanted = 5000.0 * (0.01 - 0.002) / (1.0 + 5000.0 / stiffness);
        let force = world.truth(0.015).force;
        assert!((force - wanted).abs() < 1e-3 * wanted, "{force} N, not {wanted} N");
        let clean: f64 = world.forces().normal.iter().sum();
        assert!((clean - force).abs() < 1e-9, "the image has the whole force: {clean}");
    }
}

#[test]
fn a_hand_and_a_disturbed_object_have_the_forces_of_springs() {
    let (foam, spring) = (lossless(), 5000.0);
    let joint = JointDynamics { stiffness: spring, damping_ratio: 1.0, inertia: 2.0, friction: 0.0 };
    let plane = ObjectParams { stiffness: Some(400.0), ..thing(ShapeKind::Plane, [0.0, 0.0, 0.002]) };
    let mut world = world(slide(joint), foam.clone(), &[plane], 0.0005);
    let mut time = 0.0;
    let mut settle = |disturbance: Disturbance, seconds: f64| {
        world.disturb(&disturbance);
        time += seconds;
        world.advance(time, &[0.0]);
        (world.arm.motion().pose.translation.z, world.contact.normal())
    };
    // The hand presses the pad on the plane: its force is that of the arm's spring and of the contact.
    let (way, force) = settle(Disturbance { push: [0.0, 0.0, 30.0], ..Disturbance::default() }, 2.0);
    assert!(way > 0.002 && force > 1.0 && (spring * way + force - 30.0).abs() < 1e-3, "{way} {force}");
    // A stiffer surface gives way less.
    let stiff = Disturbance { push: [0.0, 0.0, 30.0], stiffness: 10.0, ..Disturbance::default() };
    let (deep, harder) = settle(stiff, 2.0);
    assert!(harder > force && deep - 0.002 < 0.8 * (way - 0.002), "{harder} N at {deep} m");
    // Nothing is there.
    let (way, force) = settle(Disturbance { is_gone: true, ..Disturbance::default() }, 2.0);
    assert!(way.abs() < 1e-6 && force == 0.0, "{way} {force}");
    // The plane has moved by 5 mm in 1 s: 3 mm beyond the pad at rest, which the springs share.
    settle(Disturbance { velocity: [0.0, 0.0, -0.005], ..Disturbance::default() }, 1.0);
    let (way, force) = settle(Disturbance::default(), 2.0);
    assert!(way < -1e-4 && way > -0.003 && (spring * way + force).abs() < 1e-3, "{way} {force}");
}

#[test]
fn the_contact_of_a_ball_has_the_area_and_force_of_the_closed_form() {
    for radius in [0.02, 0.04, 0.1] {
        for depth in [0.0005, 0.001, 0.002] {
            let object = object(&ball(radius, [0.0007, -0.0011, radius]));
            let mut contact = Contact::new(shape(), lossless(), 0.001, 8);
            contact.step(0.001, &pad(depth), &[object], &mut [Wrench::default()]);
            // a² = 2 R d - d², and the force is the foundation's modulus times the volume of the cap.
            let area = std::f64::consts::PI * (2.0 * radius * depth - depth * depth);
            let volume = std::f64::consts::PI * depth * depth * (radius - depth / 3.0);
            let touched = contact.touching.len() as f64 * 1e-6;
            assert!((touched / area - 1.0).abs() < 0.03, "{radius} {depth}: {touched} m², not {area} m²");
            let force = contact.normal();
            assert!((force / (volume * 300.0 / 25e-6) - 1.0).abs() < 0.01, "{radius} {depth}: {force} N");
            let wrench = contact.wrench;
            assert!((wrench.force.z + force).abs() < 1e-9 && wrench.force.x.abs() < 0.01 * force, "{wrench:?}");
        }
    }
}

#[test]
fn energy_does_not_grow() {
    let undamped = JointDynamics { stiffness: 500.0, damping_ratio: 0.0, inertia: 2.0, friction: 0.0 };
    let ellipsoid =
        ObjectParams { size: Some([0.12, 0.08, 0.06]), ..thing(ShapeKind::Ellipsoid, [0.01, 0.015, 0.035]) };
    let tilted = ObjectParams { turn: [0.3, -0.2, 0.5], ..ellipsoid };
    let soft = ObjectParams { stiffness: Some(150.0), ..ball(0.04, [0.0, 0.0, 0.043]) };
    let cases = [
        (slide(undamped), lossless(), soft.clone(), true),
        (slide(undamped), Foam::default(), soft, false),
        (lwr(0.0, 0.0), lossless(), tilted.clone(), true),
        (lwr(0.0, 0.0).with_load(ArmLoad { mass: 1.5, ..ArmLoad::default() }), lossless(), tilted.clone(), true),
        (lwr(0.2, 0.1), Foam::default(), tilted, false),
    ];
    for (case, (arm, foam, thing, is_lossless)) in cases.into_iter().enumerate() {
        let mut world = world(arm, foam, &[thing], 0.00025);
        // The springs of the joints are loaded, then released.
        for (q, by) in world.arm.equilibrium.iter_mut().zip([0.02, 0.03, 0.02, -0.03, 0.02, 0.03, 0.1]) {
            *q += by;
        }
        let first = world.energy();
        let (mut max, mut min, mut touched) = (first, first, false);
        let still = vec![0.0; world.arm.position.len()];
        for step in 1..=4000 {
            world.advance(f64::from(step) * 0.00025, &still);
            max = max.max(world.energy());
            min = min.min(world.energy());
            touched |= world.contact.normal() > 1.0;
        }
        assert!(touched, "case {case} touches");
        assert!(max < 1.01 * first, "case {case}: from {first} J to {max} J");
        assert_eq!(min > 0.98 * first, is_lossless, "case {case}: from {first} J to {min} J");
    }
}

#[test]
fn a_load_slows_an_arm_and_hangs_from_its_springs() {
    let joint = JointDynamics { stiffness: 5000.0, damping_ratio: 0.0, inertia: 2.0, friction: 0.0 };
    let far = thing(ShapeKind::Plane, [0.0, 0.0, 0.5]);
    // The weight of 0.4 kg lets the spring sag by m g / k, and the arm begins at rest there.
    let hangs = slide(joint).with_load(ArmLoad { uncompensated: 0.4, ..ArmLoad::default() });
    let mut hanging = world(hangs, lossless(), std::slice::from_ref(&far), 0.0005);
    hanging.advance(1.0, &[0.0]);
    let (q, sag) = (hanging.arm.position[0], hanging.arm.equilibrium[0]);
    assert!(q.abs() < 1e-12 && (sag - 0.4 * crate::motion::weight::GRAVITY / 5000.0).abs() < 1e-12, "{q} {sag}");
    // A mass swings with the joint: half a period of √(k / (I + m)) after the spring was loaded, it is on the other side.
    let swings = slide(joint).with_load(ArmLoad { mass: 1.5, ..ArmLoad::default() });
    let mut swinging = world(swings, lossless(), &[far], 0.0001);
    swinging.arm.equilibrium[0] += 0.01;
    let half = std::f64::consts::PI / (5000.0_f64 / 3.5).sqrt();
    swinging.advance(half, &[0.0]);
    assert!((swinging.arm.position[0] - 0.02).abs() < 1e-5, "{}", swinging.arm.position[0]);
}

/// The acceleration of seven joints with a mass at the sensor, against the whole inertia matrix.
#[test]
fn a_load_couples_the_joints_as_the_inertia_matrix_says() {
    let mut coupled = lwr(0.0, 0.0).with_load(ArmLoad { mass: 1.5, ..ArmLoad::default() });
    let (step, inertia) = (1e-6, [2.0, 2.0, 1.0, 0.8, 0.3, 0.25, 0.1]);
    let pull: Vec<f64> = (0..7).map(|i| 0.01 * f64::from(i - 3)).collect();
    coupled.equilibrium.iter_mut().zip(&pull).for_each(|(equilibrium, by)| *equilibrium += by);
    // The way of the sensor by each joint, as a finite difference of its place.
    let place = |turned: Option<usize>| {
        let mut arm = lwr(0.0, 0.0);
        if let Some(i) = turned {
            arm.equilibrium[i] += 1e-5;
            arm.position[i] += 1e-5;
        }
        arm.step(0.0, &[0.0; 7], &Wrench::default());
        arm.motion().pose.translation
    };
    let way = |i: usize| (place(Some(i)) - place(None)) / 1e-5;
    let ways: Vec<Vector3<f64>> = (0..7).map(|i| Vector3::from(<[f64; 3]>::from(way(i)))).collect();
    let matrix =
        nalgebra::DMatrix::from_fn(7, 7, |i, j| 1.5 * ways[i].dot(&ways[j]) + if i == j { inertia[i] } else { 0.0 });
    let torque = nalgebra::DVector::from_iterator(7, pull.iter().map(|by| 200.0 * by));
    let wanted = matrix.lu().solve(&torque).expect("an inertia matrix is regular");
    let start = coupled.position.clone();
    coupled.step(step, &[0.0; 7], &Wrench::default());
    for i in 0..7 {
        let found = (coupled.position[i] - start[i]) / (step * step);
        assert!((found - wanted[i]).abs() < 1e-3 * wanted.norm(), "joint {i}: {found} and not {}", wanted[i]);
    }
}

#[test]
fn an_object_on_a_turning_mount_tilts_by_the_moment_over_its_stiffness() {
    // A box that ends under the pad: the pad meets it about 65 mm beside its centre.
    let turning = ObjectParams {
        size: Some([0.2, 0.2, 0.02]),
        turn_mount: Some(40.0),
        ..thing(ShapeKind::Box, [0.07, 0.0, 0.012])
    };
    let joint = JointDynamics { stiffness: 5000.0, damping_ratio: 1.0, inertia: 2.0, friction: 0.0 };
    let mut world = world(slide(joint), lossless(), &[turning], 0.0005);
    world.advance(1.0, &[0.004]);
    world.advance(4.0, &[0.0]);
    let (force, middle) = (world.truth(0.015).force, world.truth(0.015).middle.expect("it touches"));
    let tilt = world.objects[0].tilt;
    // The force of the pad pushes along z, on the side of negative x of the box.
    let wanted = force * (0.07 - middle.x) / 40.0;
    assert!(force > 3.0 && (tilt.y / wanted - 1.0).abs() < 0.03, "{tilt} under {force} N at {}", middle.x);
    assert!(tilt.x.abs() < 0.02 * tilt.y.abs(), "{tilt}");
    // The box itself has turned: a mark at its end moves by the tilt times the lever, against the push.
    let mark = world.objects[0].pose.transform_point(Vec3::new(-0.1, 0.0, 0.0));
    let moved = mark - Vec3::new(-0.03, 0.0, 0.012);
    assert!((moved.z / (0.1 * tilt.y) - 1.0).abs() < 0.02 && moved.z > 5e-4, "{moved} with {tilt}");
}

#[test]
fn the_velocity_of_an_object_that_turns_is_the_derivative_of_its_place() {
    let turning = ObjectParams { turn_mount: Some(4.0), ..ball(0.04, [0.0, 0.0, 0.05]) };
    let mut object = object(&turning);
    let (dt, load) = (1e-4, Wrench { force: Vec3::ZERO, moment: Vec3::new(0.3, -0.2, 0.1) });
    let mark = Vec3::new(0.03, 0.01, -0.02);
    let mut last = object.pose.transform_point(mark);
    for step in 1..=2000 {
        object.step(f64::from(step) * dt, dt, &load);
        let now = object.pose.transform_point(mark);
        let velocity = object.velocity_at(now);
        assert!(velocity.distance((now - last) / dt) < 0.06 * velocity.length() + 1e-5, "{velocity} in step {step}");
        last = now;
    }
    assert!(object.tilt.length() > 0.05, "it turns: {}", object.tilt);
}

#[test]
fn the_result_does_not_depend_on_the_step() {
    let run = |step: f64| {
        let mut world = world(lwr(0.2, 0.1), Foam::default(), &[ball(0.04, [0.01, -0.005, 0.042])], step);
        let mut forces = Vec::new();
        for beat in 1..=500 {
            // Down, then sideways.
            let wanted = if beat < 200 { [0.0, 0.0, -0.02] } else { [0.005, 0.01, 0.0] };
            let velocity = world.arm.moves(wanted.into());
            world.advance(f64::from(beat) * 0.004, &velocity);
            forces.push(world.truth(0.015));
        }
        forces
    };
    let fine = run(0.00025);
    let max_force = fine.iter().fold(0.0, |most: f64, truth| most.max(truth.force));
    assert!(max_force > 2.0, "it presses: {max_force} N");
    for step in [0.002, 0.001] {
        for (truth, exact) in run(step).iter().zip(&fine) {
            assert!((truth.force - exact.force).abs() < 0.02 * max_force, "{step}: {truth:?} {exact:?}");
            assert!((truth.tangential - exact.tangential).abs() < 0.03 * max_force, "{step}: {truth:?} {exact:?}");
        }
    }
}

#[test]
fn friction_stays_in_its_cone_and_sticks_and_slips() {
    let objects = [object(&thing(ShapeKind::Plane, [0.0, 0.0, 0.0]))];
    let mut contact = Contact::new(shape(), Foam::default(), 0.001, 8);
    let normal = 256.0 * 0.3;
    let mut slid = 0.0;
    let mut at_rest: f64 = 0.0;
    for step in 0..4000 {
        let speed = if step < 2000 { 2e-4 } else { 0.02 };
        let moving = BodyMotion { linear: Vec3::new(0.6, 0.8, 0.0) * speed, ..pad(0.001) };
        contact.step(0.001, &moving, &objects, &mut [Wrench::default()]);
        slid += speed * 0.001;
        let [x, y] = contact.friction().to_array();
        let friction = x.hypot(y);
        assert!(friction <= 0.4 * contact.normal() + 1e-9, "within the cone of rest: {friction} N");
        assert!(friction < 1e-12 || (x * 0.8 - y * 0.6).abs() < 1e-9 && x <= 0.0, "against the motion");
        if step < 2000 {
            // It sticks: the foam shears.
            assert!((friction - 256.0 * 200.0 * slid).abs() < 1e-6 * normal, "{friction} at {slid}");
            at_rest = at_rest.max(friction);
        }
    }
    assert!((contact.normal() - normal).abs() < 1e-9);
    let [x, y] = contact.friction().to_array();
    let wanted = (0.3 + 0.1 / (1.0 + 400.0)) * normal;
    assert!((x.hypot(y) - wanted).abs() < 1e-6, "slipping at 20 mm/s: {} N", x.hypot(y));
    assert!(at_rest > 0.8 * x.hypot(y), "{at_rest}");
}

#[test]
fn the_imprint_keeps_the_sum_and_the_centre_of_a_load() {
    let mut imprint = Imprint::new(&shape(), 5, 0.003);
    for (x, y) in [(0.0, 0.0), (0.0123, -0.0087), (0.038, 0.0), (-0.0385, 0.0385)] {
        let objects = [object(&ball(0.003, [x, y, 0.003]))];
        let mut contact = Contact::new(shape(), Foam::default(), 0.001, 8);
        contact.step(0.001, &pad(0.002), &objects, &mut [Wrench::default()]);
        imprint.take(&contact);
        let clean = &imprint.forces.normal;
        let sum: f64 = clean.iter().sum();
        assert!((sum - contact.normal()).abs() < 1e-9 * sum, "at ({x}, {y})");
        let at = |index: usize| [shape().x((index % 16) as f64), shape().y((index / 16) as f64)];
        let moment = |axis: usize| clean.iter().enumerate().map(|(i, f)| f * at(i)[axis]).sum::<f64>() / sum;
        if x.abs() < 0.02 {
            assert!((moment(0) - x).abs() < 2e-4 && (moment(1) - y).abs() < 2e-4, "({}, {})", moment(0), moment(1));
        }
    }
}

#[test]
fn drag_is_spread_as_the_force_that_causes_it() {
    let mut imprint = Imprint::new(&shape(), 5, 0.003).with_drag();
    let objects = [object(&ball(0.04, [0.0123, -0.0087, 0.040]))];
    let mut contact = Contact::new(shape(), Foam::default(), 0.001, 8);
    // First it sticks, then it slips.
    for (steps, speed) in [(100, 1e-3), (2000, 0.02)] {
        for _ in 0..steps {
            let moving = BodyMotion { linear: Vec3::new(0.6, 0.8, 0.0) * speed, ..pad(0.003) };
            contact.step(0.001, &moving, &objects, &mut [Wrench::default()]);
        }
        imprint.take(&contact);
        let [x, y] = imprint.forces.drag.as_ref().unwrap();
        let normal = &imprint.forces.normal;
        let friction = contact.friction();
        let sum = |forces: &[f64]| forces.iter().sum::<f64>();
        assert!((sum(x) - friction.x).abs() < 1e-9 && (sum(y) - friction.y).abs() < 1e-9, "{friction}");
        assert!(friction.x < -0.05 && friction.y < 1.3 * friction.x, "against the motion: {friction}");
        for ((x, y), normal) in x.iter().zip(y).zip(normal) {
            assert!(x.hypot(*y) <= 0.4 * normal + 1e-12, "within the cone: {x} {y} {normal}");
        }
    }
}

#[test]
fn objects_move_smoothly_along_their_script() {
    let (from_s, to_s) = (1.0, 2.0);
    let motion = vec![ScriptedMove { from_s, to_s, by: [0.0, 0.01, 0.0], turn: 1.0, steady: false }];
    let mut object = object(&ObjectParams { motion, ..ball(0.04, [0.0, 0.0, 0.05]) });
    // A point of the object, in its own frame.
    let mark = Vec3::new(0.03, 0.0, 0.01);
    let mut last = object.pose.transform_point(mark);
    for step in 1..=3000 {
        object.step(f64::from(step) * 0.001, 0.001, &Wrench::default());
        let now = object.pose.transform_point(mark);
        let velocity = object.velocity_at(now);
        assert!(velocity.distance((now - last) / 0.001) < 5e-4, "its velocity is the derivative of its position");
        assert!(velocity.length() <= 1.5 * (0.01 + 0.03) + 1e-9);
        last = now;
    }
    let wanted = Vec3::new(0.03 * 1f64.cos(), 0.01 + 0.03 * 1f64.sin(), 0.06);
    assert!(last.distance(wanted) < 1e-12, "{last}");
}

#[test]
fn a_steady_motion_has_one_speed() {
    let motion = vec![ScriptedMove { from_s: 1.0, to_s: 5.0, by: [0.0, 0.02, 0.0], turn: 0.4, steady: true }];
    let mut object = object(&ObjectParams { motion, ..ball(0.04, [0.0, 0.0, 0.05]) });
    for (time, part) in [(0.5, 0.0), (2.0, 0.25), (3.0, 0.5), (4.9, 0.975), (6.0, 1.0)] {
        object.step(time, 0.001, &Wrench::default());
        let mark = object.pose.transform_point(Vec3::new(0.03, 0.0, 0.0));
        let angle: f64 = 0.4 * part;
        let wanted = Vec3::new(0.03 * angle.cos(), 0.02 * part + 0.03 * angle.sin(), 0.05);
        assert!(mark.distance(wanted) < 1e-12, "{time}: {mark}");
        let moves = f64::from(part > 0.0 && part < 1.0);
        assert!((object.velocity_at(object.pose.translation).y - 0.005 * moves).abs() < 1e-12, "{time}");
        assert!((object.spin().z - 0.1 * moves).abs() < 1e-12, "{time}");
    }
}

#[test]
fn unresolved_springs_are_found() {
    // A damped spring comes to rest exactly if its steps are stable. An unstable one must not count as resolved.
    for (stiffness, damping) in [(1e3, 10.0), (1e5, 0.0), (4e5, 100.0), (4e5, 400.0), (1.1e6, 0.0), (1e3, 1100.0)] {
        let (mut place, mut speed, dt) = (1.0f64, 0.0, 0.002);
        for _ in 0..10_000 {
            speed -= (stiffness * place + damping * speed) * dt;
            place += speed * dt;
        }
        let is_bounded = place.abs() < 10.0;
        assert!(is_bounded || !is_resolved(stiffness, damping, dt), "{stiffness} {damping}");
    }
    assert!(is_resolved(7000.0, 20.0, 0.002), "the usual arm");
    assert!(!is_resolved(1e7, 3000.0, 0.002), "10 g on 1e5 N/m");
}
