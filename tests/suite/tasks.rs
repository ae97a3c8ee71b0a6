//! Two tasks in one graph: what happens to one of them changes no bit of the other one.

use std::fs;
use std::path::PathBuf;

use tactflow_runtime::engine::TaskEnd;
use tactflow_runtime::fault::{Cause, Fault};
use tactflow_runtime::graph::Request;
use tactflow_runtime::signal::{Flag, Twist};

use crate::task_folder::{Edit, Folder, LEFT_ROLES, assert_same_bits, trace};
use crate::tool::say;

/// Ticks in a second.
const SECOND: usize = 250;

/// The right task approaches so slowly that its contact comes five seconds after that of the left one.
const SLOW: Edit<'_> = ("right.toml", "[0, 0, 0.008, 0, 0, 0]", "[0, 0, 0.0024, 0, 0, 0]");
/// There is no ball under the left pad.
const NO_BALL: &str = "devices.left.objects=[]";

#[test]
fn two_tasks_side_by_side_are_each_the_task_alone() {
    let folder = Folder::new(&[SLOW]);
    let both = trace(&folder.request(), &[]);
    for part in ["left", "right"] {
        assert_same_bits(&both, part, &trace(&folder.alone(part), &[]));
    }
    let [left, right] = ["left", "right"].map(|task| both.entered(task, "servo") as usize);
    assert!(right > left + 5 * SECOND, "contacts in ticks {left} and {right}");
}

#[test]
fn a_task_whose_object_is_missing_stops_alone() {
    let folder = Folder::new(&[]);
    let both = trace(&folder.request().set(NO_BALL), &[]);
    assert_same_bits(&both, "right", &trace(&folder.alone("right"), &[]));
    assert_eq!((both.failures(), &both.fault), (vec!["left"], &None));
    // The self-test of 0.16 s, then 60 mm at 8 mm/s.
    let Some(TaskEnd::Failed(fault)) = both.task("left").end() else { panic!("it has failed") };
    assert!((7.66..7.8).contains(&(fault.time as f64 * 1e-9)), "{fault}");
    let end = both.fastest["left"].len();
    assert!(both.are_at_rest("left", fault.tick as usize + 25..end) && !both.are_at_rest("right", end - SECOND..end));
    let flags = ["left.modes.approach", "left.modes.servo", "right.modes.servo"];
    assert_eq!(flags.map(|flag| *both.engine.get::<Flag>(flag).unwrap()), [false, false, true]);
}

#[test]
fn a_pad_that_fails_its_self_test_stops_its_task_alone() {
    let folder = Folder::new(&[]);
    let both = trace(&folder.request().set("devices.left.electronics={ serial = 2 }"), &[]);
    assert_same_bits(&both, "right", &trace(&folder.alone("right"), &[]));
    let Some(TaskEnd::Failed(fault)) = both.task("left").end() else { panic!("it has failed") };
    let Cause::Found(why) = &fault.cause else { panic!("{fault}") };
    assert!(fault.node == "left.touch.calibrate" && why.starts_with("the calibration does not fit the pad"), "{fault}");
    assert!(both.are_at_rest("left", 0..both.fastest["left"].len()), "nothing has moved");
}

#[test]
fn a_failed_task_fails_the_run_at_its_end() {
    let folder = Folder::new(&[]);
    let out = folder.path("rows.csv").display().to_string();
    let run = folder.say(&["run", "--set", NO_BALL, "--out", &out]);
    assert_eq!(run.code, 1);
    assert!(
        run.err.contains("error: task `left` has failed: a `fail` condition of mode `left.approach`"),
        "{}",
        run.err
    );
    assert!(run.out.contains("task `left`\n") && run.out.contains("task `right`\n"), "{}", run.out);
    assert!(
        run.out.contains("left.touch.image: 16x16 tactels") && run.out.contains("right.touch.image"),
        "{}",
        run.out
    );
    let rows = fs::read_to_string(&out).unwrap();
    let head = rows.lines().find(|line| !line.starts_with('#')).unwrap();
    assert!(head.starts_with("time,left.mode,left.halted,right.mode,right.halted,"), "{head}");
}

#[test]
fn the_failure_of_a_part_can_end_the_run() {
    let on_fail = format!("{LEFT_ROLES}\non_fail = \"run\"");
    let folder = Folder::new(&[("two.toml", LEFT_ROLES, &on_fail)]);
    let fault = trace(&folder.request().set(NO_BALL), &[]).fault.expect("the run has ended");
    assert_eq!(fault.node, "left.approach");
}

#[test]
fn a_stop_for_one_task_does_not_reach_the_other_one() {
    let folder = Folder::new(&[]);
    let both = trace(&folder.request(), &[(3.0, "left.stop"), (5.0, "left.resume")]);
    assert_same_bits(&both, "right", &trace(&folder.alone("right"), &[]));
    assert!(both.are_at_rest("left", 3 * SECOND + 50..5 * SECOND));
    assert!(!both.are_at_rest("left", 5 * SECOND + 2..6 * SECOND), "it goes on");
    let modes: Vec<String> = both.task("left").changes().into_iter().map(|change| change.mode).collect();
    assert_eq!(modes, ["approach", "servo", "approach", "servo"]);
    assert_eq!((both.task("left").halts().len(), both.task("right").halts().len()), (1, 0));
    let all = trace(&folder.request(), &[(3.0, "stop"), (5.0, "right.resume")]);
    assert!(all.are_at_rest("left", 3 * SECOND + 50..all.fastest["left"].len()));
    assert!(all.are_at_rest("right", 3 * SECOND + 50..5 * SECOND));
    assert!(!all.are_at_rest("right", 5 * SECOND + 2..6 * SECOND), "only the right one goes on");
}

#[test]
fn a_task_that_is_done_rests_and_its_word_is_refused() {
    let done = ("left.toml", "[modes.servo]", "[modes.servo]\ndone = { on = \"enough\" }");
    let folder = Folder::new(&[done]);
    let mut both = trace(&folder.request(), &[(3.0, "left.enough")]);
    assert_same_bits(&both, "right", &trace(&folder.alone("right"), &[]));
    assert_eq!((both.task("left").end(), both.task("right").end()), (Some(&TaskEnd::Done), None));
    assert!(both.are_at_rest("left", 3 * SECOND + 50..both.fastest["left"].len()));
    assert!(!both.engine.get::<Flag>("left.modes.servo").unwrap());
    for word in ["left.enough", "left.stop", "left.resume"] {
        let refused = both.engine.send(word).unwrap_err();
        assert!(refused.contains("has ended"), "{refused}");
    }
    let refused = both.engine.send("lefft.stop").unwrap_err();
    assert!(refused.contains("did you mean `left.stop`?"), "{refused}");
}

/// Both tasks wait in `ready` until the other one is there.
fn waiting() -> Folder {
    let roles = |part: &str| format!("roles = {{ pad = \"{part}_pad\", arm = \"{part}_arm\" }}");
    let (left, right) = (roles("left"), roles("right"));
    let wired = |roles: &str, other: &str| format!("{roles}\nin.partner = \"{other}.modes.ready\"");
    let inputs = "[inputs]\npartner = \"whether the other task is ready\"\n\
                  [modes.ready]\nset.projector.select = [0, 0, 0, 0, 0, 0]\n\
                  go = { to = \"servo\", when = \"inputs.partner\" }";
    let to = ("to = \"servo\"", "to = \"ready\"");
    Folder::new(&[
        ("two.toml", &left, &wired(&left, "right")),
        ("two.toml", &right, &wired(&right, "left")),
        ("left.toml", to.0, to.1),
        ("right.toml", to.0, to.1),
        ("left.toml", "", inputs),
        ("right.toml", "", inputs),
        SLOW,
    ])
}

#[test]
fn two_tasks_that_wait_for_each_other_go_on_in_one_tick() {
    let both = trace(&waiting().request(), &[]);
    let [left, right] = ["left", "right"].map(|task| both.entered(task, "ready"));
    assert!(right > left, "{left}, {right}");
    // The tick after `ready` shows its flag, and both decide on it.
    assert_eq!(["left", "right"].map(|task| both.entered(task, "servo")), [right + 1, right + 1]);
    let failed = trace(&waiting().request().set(NO_BALL), &[]);
    assert_eq!((failed.failures(), failed.task("right").mode()), (vec!["left"], Some("ready")), "it waits");
}

/// A node in the file of a task that goes wrong in a tick.
fn broken<'a>(file: &'a str, how: &'a str) -> [Edit<'a>; 2] {
    [(file, "in.pressure = \"calm.value\"", "in.pressure = \"bad.value\""), (file, "", how)]
}

const NAN: &str = "[nodes.bad]\ntype = \"breaks\"\nin.value = \"calm.value\"\nhow = \"nan\"\ntick = 800";
const PANIC: &str = "[nodes.bad]\ntype = \"breaks\"\nin.value = \"calm.value\"\nhow = \"panic\"\ntick = 800";

#[test]
fn a_node_that_goes_wrong_concerns_its_own_task() {
    for (how, cause) in [(NAN, Some(Cause::NotFinite)), (PANIC, None)] {
        let folder = Folder::new(&broken("left.toml", how));
        let both = trace(&folder.request(), &[]);
        assert_same_bits(&both, "right", &trace(&folder.alone("right"), &[]));
        let found: Vec<(&str, &Fault)> = both.engine.failures().collect();
        assert_eq!((found.len(), found[0].0, found[0].1.node.as_str()), (1, "left", "left.bad"));
        assert!(found[0].1.tick == 800 && cause.is_none_or(|cause| cause == found[0].1.cause), "{}", found[0].1);
        assert!(both.are_at_rest("left", 850..both.fastest["left"].len()));
    }
}

#[test]
fn the_policy_of_one_task_does_not_reach_the_other_one() {
    let [wire, node] = broken("left.toml", NAN);
    let hold = ("left.toml", "", "[policy]\nnot_finite = \"hold\"");
    let folder = Folder::new(&[wire, node, hold]);
    let both = trace(&folder.request(), &[]);
    assert_same_bits(&both, "right", &trace(&folder.alone("right"), &[]));
    assert_eq!((both.failures().len(), both.task("left").halts().len(), both.task("right").halts().len()), (0, 1, 0));
}

#[test]
fn two_tasks_that_go_wrong_in_one_tick_both_fail() {
    for how in [NAN, PANIC] {
        let edits = [broken("left.toml", how), broken("right.toml", how)].concat();
        let both = trace(&Folder::new(&edits).request(), &[]);
        assert_eq!(both.failures(), ["left", "right"]);
        let ends = both.engine.failures().map(|(_, fault)| (fault.node.clone(), fault.tick));
        assert_eq!(ends.collect::<Vec<_>>(), [("left.bad".to_owned(), 800), ("right.bad".to_owned(), 800)]);
        assert!(both.fastest.values().flatten().all(|speed| speed.is_finite()), "no arm gets a NaN");
    }
}

#[test]
fn a_task_may_have_tasks() {
    let cell = "[roles]\nleft_pad = \"tactile_pad\"\nleft_arm = \"velocity_arm\"\nright_pad = \"tactile_pad\"\n\
                right_arm = \"velocity_arm\"\n[parts.left]\nfile = \"left.toml\"\n\
                roles = { pad = \"left_pad\", arm = \"left_arm\" }\n[parts.right]\nfile = \"right.toml\"\n\
                roles = { pad = \"right_pad\", arm = \"right_arm\" }\n";
    let root = "[graph]\nclock = \"left_pad\"\nbench = \"bench.toml\"\n[roles]\nleft_pad = \"tactile_pad\"\n\
                left_arm = \"velocity_arm\"\nright_pad = \"tactile_pad\"\nright_arm = \"velocity_arm\"\n\
                [parts.cell]\nfile = \"cell.toml\"\n";
    let folder = Folder::new(&[("cell.toml", "", cell), ("root.toml", "", root)]);
    let request = || Request::file(folder.path("root.toml"));
    let one = trace(&request(), &[(3.0, "cell.left.stop")]);
    let end = one.fastest["left"].len();
    assert!(one.are_at_rest("left", 3 * SECOND + 50..end) && !one.are_at_rest("right", end - SECOND..end));
    assert_same_bits(&one, "cell.right", &trace(&folder.alone("right"), &[]).without_roles());
    let both = trace(&request(), &[(3.0, "cell.stop"), (5.0, "cell.left.resume")]);
    assert!(both.are_at_rest("left", 3 * SECOND + 50..5 * SECOND) && !both.are_at_rest("left", 5 * SECOND + 2..end));
    assert!(both.are_at_rest("right", 3 * SECOND + 50..end));
    assert!(both.engine.get::<Twist>("cell.left.sum.twist").is_some(), "a port has its whole path");
}

#[test]
fn a_graph_may_coordinate_its_tasks() {
    let start = ("two.toml", "[graph]", "[graph]\nstart = \"one\"");
    let modes = "[modes.one]\ngo = { to = \"two\", when = \"left.modes.servo\" }\n\
                 [modes.two]\ndone = { when = \"right.modes.servo\", for_ms = 1000 }";
    let folder = Folder::new(&[start, ("two.toml", "", modes)]);
    let run = trace(&folder.request(), &[]);
    assert_eq!(run.entered("", "two"), run.entered("left", "servo") + 1);
    let ends: Vec<_> = run.engine.tasks().iter().map(|task| task.end().cloned()).collect();
    assert_eq!(ends, [Some(TaskEnd::Done), Some(TaskEnd::Done), Some(TaskEnd::Done)], "its end is that of all");
    assert!(run.engine.is_done());
}

#[test]
fn a_scenario_names_the_modes_of_a_task() {
    let scenario = |mode: &str| {
        format!(
            "[scenario]\ngraph = \"two.toml\"\nseeds = 2\nfor_s = 5.0\nfrom = \"right.touch.present\"\n\
             ends_in = \"{mode}\"\nstays_in = \"right.servo\"\n[check.x]\nof = \"left.error.error.x\"\n\
             unit = {{ mm = 0.001 }}\nduring = \"left.servo\"\nstd_below = 100.0\n"
        )
    };
    let folder =
        Folder::new(&[("good.toml", "", &scenario("left.servo")), ("bad.toml", "", &scenario("left.approach"))]);
    let wrong = Folder::new(&[("wrong.toml", "", &scenario("left.serv"))]);
    let verify = |path: PathBuf| say(&["verify", &path.display().to_string()]);
    let good = verify(folder.path("good.toml"));
    assert_eq!(good.code, 0, "{}{}", good.out, good.err);
    assert_eq!(verify(folder.path("bad.toml")).code, 1);
    let wrong = verify(wrong.path("wrong.toml"));
    assert_eq!(wrong.code, 2, "{}", wrong.out);
    assert!((wrong.out + &wrong.err).contains("did you mean `left.servo`?"));
}
