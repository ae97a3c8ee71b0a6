//! The force ceiling in closed loop: a stiff arm runs into stiff objects at several rates, as fast as its limits allow.
//! Judged by the true force on the pad.

use std::fs;

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::{Flag, Scalar};
use tactflow_tests::{catalogue, workspace};

/// The ceiling of the shipped tasks [N].
const CEILING: f64 = 15.0;
/// What the moving mass of the arm adds when it hits a rigid plate, and what the pad reads too little of it: 6 % on a
/// plate that loads each tactel with 0.06 N [N].
const HIT: f64 = 3.0;

/// Runs a shipped task, with an approach at 50 mm/s, against `object` with a pad of `rate` [Hz] on an arm whose joints
/// have `stiffness` [N m/rad]. Returns the largest true force [N].
fn largest_force(task: &str, object: &str, stiffness: f64, rate: f64) -> f64 {
    let folder = workspace().join("graphs");
    let ball = fs::read_to_string(folder.join("benches/ball.toml")).unwrap();
    let old = ball.lines().find(|line| line.contains("shape = ")).unwrap();
    let device = format!("[devices.bench]\nstiffness = {stiffness:?}\nrate_hz = {rate:?}");
    let bench = ball.replace("\"../", &format!("\"{}/", folder.display())).replace("[devices.bench]", &device);
    let bench = bench.replace("for_s = 22.0", "for_s = 60.0").replace(old, &format!("  {{ {object} }},"));
    let fast = "modes.approach.set.reach.twist = [0.0, 0.0, 0.05, 0.0, 0.0, 0.0]";
    let set = vec![fast.to_owned(), "modes.approach.fail.after_ms = 60000".to_owned()];
    let request = Request { bench_text: Some(bench), set, ..Request::file(folder.join(format!("{task}.toml"))) };
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let (mut engine, mut largest, mut touched) = (Engine::new(plan), 0.0_f64, None);
    while let Some(next) = engine.next() {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        largest = largest.max(engine.get::<Scalar>("truth.force").copied().unwrap_or_default());
        if engine.get::<Flag>("touch.present").copied().unwrap_or_default() {
            touched.get_or_insert(next);
        }
        if touched.is_some_and(|touched| next - touched > 3_000_000_000) {
            break;
        }
    }
    assert!(touched.is_some(), "{task} at {rate} Hz touches {object}");
    largest
}

#[test]
fn a_stiff_arm_meets_stiff_objects_within_the_ceiling() {
    let plate = r#"shape = "plane", at = [0.0, 0.0, 0.012]"#;
    let ball = r#"shape = "ball", radius = 0.04, at = [0.01, -0.01, 0.046], stiffness = 12000.0"#;
    for (object, rate) in [(plate, 250.0), (plate, 100.0), (plate, 10.0), (ball, 250.0), (ball, 10.0)] {
        let largest = largest_force("force", object, 20_000.0, rate);
        assert!(largest <= CEILING + HIT, "{largest} N at {rate} Hz on {object}");
    }
}

#[test]
fn a_compliant_arm_does_too() {
    let plate = r#"shape = "plane", at = [0.0, 0.0, 0.012]"#;
    for rate in [250.0, 50.0] {
        let largest = largest_force("hybrid", plate, 200.0, rate);
        assert!(largest <= CEILING + HIT, "{largest} N at {rate} Hz");
    }
}
