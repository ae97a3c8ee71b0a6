//! The simulated cell of two arms: its shipped bench, its bits, and the mistakes in its parameters.

use nalgebra::Vector3;
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::{Joints, Pose};
use tactflow_tests::{catalogue, workspace};

use crate::course::get;
use crate::tool::say;

/// Both arms press on the box of `graphs/benches/carried_box.toml` and move it 20 mm up.
fn lift() -> Request {
    Request::file(workspace().join("tests/data/two_arms/squeeze_and_lift.toml"))
}

fn engine(request: &Request) -> Engine {
    Engine::new(compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false))))
}

/// Runs until a time, and calls `see` after each tick with the time [s].
fn run(engine: &mut Engine, until_s: f64, mut see: impl FnMut(f64, &Engine)) {
    while let Some(next) = engine.next().filter(|next| *next as f64 * 1e-9 < until_s) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        see(next as f64 * 1e-9, engine);
    }
}

fn scalar(engine: &Engine, port: &str) -> f64 {
    *get::<f64>(engine, port).expect("the cell always knows it")
}

#[test]
fn both_pads_face_the_box_from_20_mm_and_lift_it() {
    let mut engine = engine(&lift());
    run(&mut engine, 0.01, |_, _| ());
    for port in ["left_move.state.sensor_pose", "right_move.state.sensor_pose"] {
        let pose = get::<Pose>(&engine, port).unwrap().0;
        let error = |axis: Vector3<f64>, wanted: Vector3<f64>| (pose.rotation * axis - wanted).norm();
        assert!(error(Vector3::z(), Vector3::x()) < 1e-4, "{port}: z points at the other arm");
        assert!(error(Vector3::y(), Vector3::z()) < 1e-4, "{port}: y is up");
        let place = Vector3::new(0.567 - 0.05, -0.1333, 0.4259 + 0.05);
        assert!((pose.translation.vector - place).norm() < 1e-4, "{port}: it is 50 mm beside the middle of the box");
    }
    let mut found = [None; 2];
    run(&mut engine, 2.46, |now, engine| {
        for (found, port) in found.iter_mut().zip(["left_touch.label.present", "right_touch.label.present"]) {
            if get::<bool>(engine, port) == Some(&true) {
                found.get_or_insert(now);
            }
        }
    });
    // The self-test of 0.16 s, 20 mm at 10 mm/s, the ramp of the speed, the latency of the image, and the threshold of the foam's force.
    for found in found {
        let found = found.expect("a pad that moves 23 mm along its z finds the box");
        assert!((2.16..2.41).contains(&found), "the contact is found after {found} s");
    }
    // Each contact is within two tactels of the centre of its pad, although the arms yield.
    for port in ["left_touch.moments.x", "left_touch.moments.y", "right_touch.moments.x", "right_touch.moments.y"] {
        assert!(scalar(&engine, port).abs() < 0.01, "{port}: {}", scalar(&engine, port));
    }
    run(&mut engine, 3.36, |_, _| ());
    let start = scalar(&engine, "object.z");
    let forces = ["object.left_force", "object.right_force"].map(|port| scalar(&engine, port));
    assert!((forces[0] / forces[1] - 1.0).abs() < 0.01 && forces[0] > 5.0, "{forces:?}");
    run(&mut engine, 5.16, |_, _| ());
    assert_eq!(get::<bool>(&engine, "object.held"), Some(&true));
    assert_eq!(scalar(&engine, "object.table_force"), 0.0);
    let risen = scalar(&engine, "object.z") - start;
    assert!((risen - 0.02).abs() < 0.002, "{risen} m");
    assert!(scalar(&engine, "object.tilt") < 0.01 && scalar(&engine, "object.x").abs() < 1e-3);
}

#[test]
fn a_box_that_is_too_heavy_for_its_friction_stays_on_the_table() {
    // Both pads together bear 2 mu N with N about 10 N, so 0.6 kg need a coefficient of about 0.3.
    let slippery = "devices.cell.foam={ static_friction = 0.1, sliding_friction = 0.1 }";
    let mut engine = engine(&lift().set("devices.cell.object.mass=0.6").set(slippery));
    run(&mut engine, 5.0, |_, _| ());
    assert_eq!(get::<bool>(&engine, "object.held"), Some(&false));
    assert!((scalar(&engine, "object.z") - 0.05).abs() < 1e-3, "{} m", scalar(&engine, "object.z"));
    let squeeze = scalar(&engine, "object.squeeze");
    let borne = 0.6 * 9.806_65 - scalar(&engine, "object.table_force");
    assert!(borne > 0.0 && borne <= 2.0 * 0.1 * squeeze * 1.01, "{borne} N of {squeeze} N");
}

#[test]
fn the_same_seed_gives_the_same_bits_and_each_pad_its_own_noise() {
    let ports = ["object.z", "object.left_force", "left_touch.source.sum", "right_touch.source.sum"];
    let bits = |seed: u64| {
        let mut engine = engine(&lift().set(format!("devices.cell.seed={seed}")));
        let mut bits = Vec::new();
        run(&mut engine, 2.6, |_, engine| {
            bits.extend(ports.map(|port| get::<f64>(engine, port).map(|value| value.to_bits())));
        });
        bits
    };
    let first = bits(3);
    assert!(first == bits(3), "the same bits");
    assert!(first != bits(4), "another noise");
    let last = &first[first.len() - 4..];
    assert_ne!(last[2], last[3], "each pad has its own noise");
}

/// The task whose roles of each name are on these sides of the cell.
fn bound(sides: [(&str, &str); 4]) -> Request {
    sides.iter().fold(lift(), |request, (role, side)| request.set(format!("bind.{role}=cell.{side}")))
}

#[test]
fn the_bench_says_on_which_side_of_the_cell_each_role_is() {
    let swapped = [("left_pad", "right"), ("left_arm", "right"), ("right_pad", "left"), ("right_arm", "left")];
    let same = swapped.map(|(role, _)| (role, role.split('_').next().unwrap()));
    for (sides, expected) in [(same, [true, false]), (swapped, [false, true])] {
        // The right arm of the cell is 100 mm further away, so only its left pad touches.
        let far = "devices.cell.right.base.xyz=[0.667, -0.1333, -0.4259]";
        let mut engine = engine(&bound(sides).set(far));
        run(&mut engine, 2.6, |_, _| ());
        let present =
            ["left", "right"].map(|side| *get::<bool>(&engine, &format!("{side}_touch.label.present")).unwrap());
        assert_eq!(present, expected, "{sides:?}");
        assert_eq!(scalar(&engine, "object.right_force"), 0.0);
    }
}

#[test]
fn a_pad_is_on_the_side_of_its_arm() {
    let crossed = [("left_pad", "right"), ("left_arm", "left"), ("right_pad", "left"), ("right_arm", "right")];
    let report = compile(&catalogue(), &bound(crossed)).err().expect("the pads are on the other arms").render(false);
    for message in [
        "`left_pad` is on `left_arm`, which is the left side of `cell`",
        "`right_pad` is on `right_arm`, which is the right side of `cell`",
    ] {
        assert!(report.contains(message), "{report}");
    }
    assert_eq!(report.matches("error[wrong-role]").count(), 2, "{report}");
    let twice = lift().set("bind.right_pad=cell.left");
    let report = compile(&catalogue(), &twice).err().expect("two roles have one pad").render(false);
    assert!(report.contains("device `cell.left` already fills the role `left_pad`"), "{report}");
}

#[test]
fn limits_in_a_bench_hold_for_the_arm_on_that_side() {
    let graphs = workspace().join("graphs");
    let text = std::fs::read_to_string(graphs.join("benches/carried_box.toml")).unwrap();
    let text = text.replace("\"../", &format!("\"{}/", graphs.display()));
    // An arm of the cell under another name than that of the task.
    let text = text.replace("[devices.cell]", "first_arm = \"cell.left\"\n\n[devices.cell]");
    let text = format!("{text}\n[limits.first_arm]\njoint_rad_per_s2 = 1.5\n");
    let folder = tempfile::tempdir().unwrap();
    let bench = folder.path().join("bench.toml");
    std::fs::write(&bench, text).unwrap();
    let said = say(&["show", "tests/data/two_arms/squeeze_and_lift.toml", "--bench", bench.to_str().unwrap()]);
    assert_eq!(said.code, 0, "{}", said.err);
    let limited = |node: &str| {
        let block = said.out.split(&format!("[nodes.{node}]")).nth(1).expect("the node is shown");
        block.split("\n[").next().unwrap().contains("acceleration = 1.5")
    };
    assert_eq!([limited("left_move.joints"), limited("right_move.joints")], [true, false], "{}", said.out);
}

#[test]
fn an_arm_can_be_another_robot() {
    let panda = [
        "urdf='builtin:panda.urdf'",
        "tip='panda_link8'",
        "home=[0.0, -0.1, 0.0, -2.2, 0.0, 2.1, 0.7854]",
        "inertia=[1.6, 2.3, 1.5, 1.3, 0.23, 0.24, 0.21]",
        "acceleration=7.5",
    ];
    let request = panda.iter().fold(lift(), |request, set| request.set(format!("devices.cell.right.{set}")));
    let mut engine = engine(&request);
    run(&mut engine, 0.1, |_, _| ());
    let joints = ["left_arm.position", "right_arm.position"].map(|port| get::<Joints>(&engine, port).unwrap().0.len());
    assert_eq!(joints, [6, 7]);
}

#[test]
fn settings_that_cannot_be_are_told_at_their_place() {
    let cases = [
        ("object.size=[0.06, 0.0, 0.1]", "each `size` must be greater than 0"),
        ("object.radius=0.1", "a box does not use `radius`: remove it"),
        ("object={ shape = 'ball', mass = 0.1 }", "a ball needs `radius`"),
        ("object={ shape = 'ball', mass = 0.1, radius = 0.1, size = [1, 1, 1] }", "a ball does not use `size`"),
        ("object={ shape = 'plane', mass = 0.1 }", "expected one of `box`, `ball`"),
        ("object.mass=0.0002", "and at most 64 are simulated"),
        ("left.inertia=[1.0]", "left arm: `inertia` has 1 entries, but the arm has 6 joints"),
        ("right.home=[0.0]", "right arm: `home` has 1 entries, but the arm has 6 joints"),
        ("right.tip='nothing'", "right arm: the model has no link `nothing`"),
        ("right.stiffness=1e6", "right arm: a joint of 0.1 kg m² moves too fast"),
        ("step_s=0.01", "the step must be from 1e-6 to 0.002 s"),
        ("foam.damping=1e4", "must be at most 10 N s/m"),
    ];
    for (set, message) in cases {
        let report = compile(&catalogue(), &lift().set(format!("devices.cell.{set}"))).err();
        let text = report.unwrap_or_else(|| panic!("{set} loads")).render(false);
        assert!(text.contains(message), "{set}: {text}");
    }
}
