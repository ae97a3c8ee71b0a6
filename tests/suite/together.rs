//! The graphs that ship and consist of tasks: two arms, a hand, and a box that two arms carry.

use tactflow_runtime::engine::{Engine, TaskEnd, TaskRun, run_virtual};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::{Features, Scalar};
use tactflow_tests::{catalogue, workspace};

use crate::tool::say;

/// Runs a graph that ships with some assignments for a time [s].
fn run(graph: &str, set: &[&str], seconds: f64) -> Engine {
    let request = Request::file(workspace().join("graphs").join(graph));
    let request = set.iter().fold(request, |request, assignment| request.set(*assignment));
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    run_virtual(&mut engine, seconds, &|| false, &mut |_| {});
    engine
}

fn parts(engine: &Engine) -> &[TaskRun] {
    &engine.tasks()[1..]
}

#[test]
fn a_palm_and_five_fingers_hold_a_contact_each() {
    let engine = run("hand.toml", &[], 6.0);
    assert_eq!(parts(&engine).len(), 6);
    for task in parts(&engine) {
        let name = task.name();
        assert_eq!(task.mode(), Some("servo"), "{name}");
        let error = engine.get::<Features>(&format!("{name}.error.error")).expect("every pad is in contact");
        let pressure = error.values().next().flatten().expect("the pressure is known");
        assert!(pressure.abs() < 5e-3, "{name}: {pressure} N per tactel from the setpoint");
    }
}

#[test]
fn a_finger_without_an_object_fails_alone() {
    let engine = run("hand.toml", &["devices.ring.objects=[]"], 11.0);
    for task in parts(&engine) {
        let has_failed = matches!(task.end(), Some(TaskEnd::Failed(_)));
        assert_eq!(has_failed, task.name() == "ring", "{}", task.name());
        assert!(has_failed || task.mode() == Some("servo"), "{}", task.name());
    }
    assert_eq!(engine.commands("ring"), Some(vec![0.0; 4]), "it is at rest");
}

#[test]
fn two_arms_that_carry_a_box_stop_together() {
    let height = |engine: &Engine| *engine.get::<Scalar>("object.z").expect("the bench knows the box");
    let lifted = run("carry.toml", &[], 8.0);
    assert!(parts(&lifted).iter().all(|task| task.mode() == Some("lift")));
    assert!((0.055..0.07).contains(&height(&lifted)), "{} m", height(&lifted));
    // A box that is too heavy slips through, and both arms notice that the contact moves or ends, or carry nothing up.
    let heavy = run("carry.toml", &["devices.cell.object.mass=0.6"], 8.0);
    assert!(height(&heavy) < 0.06, "{} m", height(&heavy));
    let stopped = say(&["run", "graphs/carry.toml", "--for", "8s", "--send", "7s:left.stop"]);
    assert_eq!(stopped.code, 1, "{}", stopped.err);
    assert!(stopped.err.contains("task `right` has failed: ") && stopped.err.contains("`inputs.partner_carries`"));
    let page = "collisions between `left_arm`, `right_arm` are not checked";
    assert!(stopped.out.contains(page), "{}", stopped.out);
}
