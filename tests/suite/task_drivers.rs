//! Tasks that make a motion which another file limits and sends to the arm: the arm rests with the task.

use std::fs;

use tactflow_runtime::engine::{End, Engine, run_virtual};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::Joints;
use tactflow_runtime::source::Code;
use tactflow_tests::{catalogue, workspace};
use tempfile::TempDir;

use crate::tool::say;

/// A task that moves along z, and ends as `{end}` says.
const PLAN: &str = r#"
[graph]
start = "reach"

[inputs]
present = "whether something touches the pad"

[exports]
twist = "reach.twist"

[nodes.reach]
type = "twist_source"
twist = [0, 0, 0, 0, 0, 0]

[modes.reach]
set.reach.twist = [0, 0, 0.005, 0, 0, 0]
go = { to = "rest", when = "inputs.present", for_ms = 40 }
{end}

[modes.rest]
"#;

/// A folder with `hybrid.toml`, in which the part `plan` makes the motion.
fn folder(end: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let graphs = workspace().join("graphs");
    let text = fs::read_to_string(graphs.join("hybrid.toml")).unwrap();
    let text = text.replace("file = \"parts/", "file = \"builtin:parts/");
    let text = text.replace("bench = \"benches/", &format!("bench = \"{}/benches/", graphs.display()));
    let (head, rest) = text.split_once("[modes.approach]").unwrap();
    let limits = &rest[rest.find("[limits]").unwrap()..];
    let head =
        head.replace("start = \"approach\"\n", "").replace("in.twist = \"sum.twist\"", "in.twist = \"plan.twist\"");
    let plan = "[parts.plan]\nfile = \"plan.toml\"\nin.present = \"touch.present\"\n\n";
    fs::write(folder.path().join("whole.toml"), format!("{head}{plan}{limits}")).unwrap();
    fs::write(folder.path().join("plan.toml"), PLAN.replace("{end}", end)).unwrap();
    folder
}

#[test]
fn an_arm_rests_with_the_task_that_moves_it() {
    let cases = [
        ("fail = { after_ms = 600 }", None),
        ("done = { after_ms = 600 }", None),
        ("fail = { after_ms = 5000 }", Some("plan.stop")),
    ];
    for (end, word) in cases {
        let folder = folder(end);
        let request = Request::file(folder.path().join("whole.toml")).set("devices.bench.objects=[]");
        let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{end}: {}", report.render(false)));
        let mut engine = Engine::new(plan);
        let (mut moved, mut late) = (0.0_f64, 0.0_f64);
        while let Some(next) = engine.next().filter(|next| *next <= 2_000_000_000 && !engine.is_done()) {
            if next == 600_000_000 {
                word.into_iter().for_each(|word| engine.send(word).unwrap());
            }
            engine.tick(next).unwrap_or_else(|fault| panic!("{end}: {fault}"));
            let command = engine.commands("bench").unwrap().iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            match next {
                ..600_000_000 => moved = moved.max(command),
                700_000_000.. => late = late.max(command),
                _ => {}
            }
        }
        assert!(moved > 1e-3, "{end}: it moves before");
        assert!(late == 0.0, "{end}: {late} rad/s after its task has ended or stopped");
        assert!(engine.get::<Joints>("move.velocity").is_some(), "the limiters still step");
    }
}

#[test]
fn a_run_ends_when_all_that_moves_has_ended() {
    let folder = folder("fail = { after_ms = 600 }");
    let path = folder.path().join("whole.toml");
    let said = say(&["run", path.to_str().unwrap(), "--set", "devices.bench.objects=[]", "--for", "5s"]);
    assert_eq!(said.code, 1, "{}", said.err);
    assert!(said.out.contains("a fault after 0.6"), "{}", said.out);
    let mut engine = Engine::new(compile(&catalogue(), &Request::file(&path).set("devices.bench.objects=[]")).unwrap());
    let outcome = run_virtual(&mut engine, 5.0, &|| false, &mut |_| {});
    assert!(outcome.time < 700_000_000, "{} ns", outcome.time);
}

#[test]
fn limits_of_a_part_without_an_arm_are_an_error() {
    let folder = folder("fail = { after_ms = 600 }");
    let path = folder.path().join("plan.toml");
    let text = fs::read_to_string(&path).unwrap() + "\n[limits]\nforce_n = 1.0\n";
    fs::write(&path, text).unwrap();
    let Err(report) = compile(&catalogue(), &Request::file(folder.path().join("whole.toml"))) else {
        panic!("it loads")
    };
    let found = report.diagnostics.iter().find(|found| found.message.contains("hold for no arm"));
    assert_eq!(found.expect("the limits are reported").code, Code::UnknownPort, "{}", report.render(false));
}

#[test]
fn a_word_with_a_dot_is_that_of_the_mode_which_waits_for_it() {
    let folder = folder(
        "go = [{ to = \"rest\", on = \"plan.go\" }, { to = \"rest\", when = \"inputs.present\", for_ms = 40 }]\nfail = { after_ms = 5000 }",
    );
    let path = folder.path().join("plan.toml");
    let text = fs::read_to_string(&path).unwrap();
    let text = text.replacen("go = { to = \"rest\", when = \"inputs.present\", for_ms = 40 }\n", "", 1);
    fs::write(
        &path,
        text.replace(
            "when = \"inputs.present\", for_ms = 40 }",
            "when = \"inputs.present\", for_ms = 40, priority = 1 }",
        ),
    )
    .unwrap();
    let request = Request::file(folder.path().join("whole.toml"));
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    engine.tick(0).unwrap();
    engine.send("plan.go").unwrap();
    engine.tick(4_000_000).unwrap();
    assert_eq!(engine.tasks()[1].mode(), Some("rest"));
}

#[test]
fn the_failure_of_a_device_that_no_task_uses_ends_the_run() {
    let request = Request::file(workspace().join("graphs/two_arms.toml"))
        .set("roles.spare={ type = 'tactile_pad', on = 'none' }")
        .set("bind.spare='spare'")
        .set("devices.spare={ type = 'mock_pad', glitch = [{ at_s = 0.2, for_s = 1.0, kind = 'unplug' }] }");
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let outcome = run_virtual(&mut engine, 1.0, &|| false, &mut |_| {});
    let End::Fault(fault) = outcome.end else { panic!("{:?}", outcome.end) };
    assert!(fault.to_string().starts_with("device `spare` failed"), "{fault}");
}
