//! A task runs on another arm if the bench names that arm: no task holds a number of a robot or of a cell.

use std::fs;
use std::path::PathBuf;

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::{Features, Pose};
use tactflow_tests::{catalogue, single_tasks, workspace};

use crate::course::get;

/// Each robot with a box around the place where its sensor starts [m].
const ROBOTS: [(&str, [f64; 3], [f64; 3]); 4] = [
    ("lwr4p", [-0.8, -0.4, 0.1], [-0.3, 0.4, 0.7]),
    ("ur5e", [0.28, -0.33, 0.06], [0.68, 0.07, 0.45]),
    ("panda", [0.36, -0.15, 0.22], [0.66, 0.15, 0.55]),
    ("gantry", [-0.3, -0.3, -0.3], [0.3, 0.3, 0.3]),
];

/// A pad of 24 mm by 24 mm, slower and smaller than that of the shipped benches.
const SMALL_PAD: &str = "rows = 8\ncols = 8\npitch = 0.003\nrate_hz = 100\n";

/// The shipped tasks: the modes on the way to the work, a time by which each is there [s], and the place of the pressure
/// among the errors of a task that controls it in newtons.
const TASKS: [(&str, &[&str], f64, Option<usize>); 12] = [
    ("cable", &["approach", "press", "servo"], 4.0, Some(2)),
    ("edge", &["approach", "servo"], 3.2, Some(0)),
    ("explore", &["approach", "align", "scan"], 4.0, Some(2)),
    ("finger_press", &["none"], 2.0, None),
    ("force", &["approach", "servo"], 2.6, Some(0)),
    ("guided", &["approach", "press", "guided"], 5.2, Some(0)),
    ("hold_without_slip", &["approach", "servo"], 2.6, None),
    ("hybrid", &["approach", "servo"], 2.6, Some(2)),
    ("position", &["approach", "press", "servo"], 2.6, None),
    ("rolling", &["approach", "servo"], 2.6, Some(2)),
    ("seek_ridge", &["approach", "press", "turn", "follow"], 3.8, Some(2)),
    ("square", &["approach", "press", "trace"], 5.4, Some(0)),
];

/// The bench that a shipped task names.
fn bench_of(task: &str) -> String {
    let text = fs::read_to_string(workspace().join(format!("graphs/{task}.toml"))).unwrap();
    text.split("bench = \"benches/").nth(1).and_then(|rest| rest.split('"').next()).unwrap().to_owned()
}

/// A shipped task on its own bench, with another robot and its workspace.
fn on_robot(task: &str, bench: &str, (robot, min, max): (&str, [f64; 3], [f64; 3])) -> Request {
    let folder = workspace().join("graphs");
    let text = fs::read_to_string(folder.join("benches").join(bench)).unwrap();
    let file = match robot {
        "gantry" => workspace().join("tests/data/robots/gantry.toml"),
        _ => folder.join(format!("robots/{robot}.toml")),
    };
    let text = text.lines().map(|line| match line.split(" = ").next() {
        Some("robot" | "urdf") => format!("robot = {file:?}\n"),
        Some("tip" | "home") => String::new(),
        Some("workspace_min_m") => format!("workspace_min_m = {min:?}\n"),
        Some("workspace_max_m") => format!("workspace_max_m = {max:?}\n"),
        _ => format!("{line}\n"),
    });
    let text: String = text.collect::<String>().replace("\"../", &format!("\"{}/", folder.display()));
    Request { bench_text: Some(text), ..Request::file(folder.join(format!("{task}.toml"))) }
}

/// What a run of some seconds shows: the visited modes, the last error, and how far the sensor is from its start [m].
fn shown(request: &Request, until_s: f64) -> (Vec<String>, Features, f64) {
    let plan = compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let (mut modes, mut start) = (Vec::<String>::new(), None);
    while let Some(next) = engine.next().filter(|next| *next as f64 * 1e-9 < until_s) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        let mode = engine.mode().unwrap_or("none");
        if modes.last().is_none_or(|last| last != mode) {
            modes.push(mode.to_owned());
        }
        start = start.or_else(|| get::<Pose>(&engine, "move.state.sensor_pose").copied());
    }
    let end = get::<Pose>(&engine, "move.state.sensor_pose").expect("the arm has a pose").0.translation.vector;
    let start = start.expect("the arm has a pose").0.translation.vector;
    let error = get::<Features>(&engine, "error.error").expect("there is a contact").clone();
    (modes, error, (end - start).norm())
}

#[test]
fn a_task_holds_the_contact_on_every_robot_with_only_another_bench() {
    for robot in ROBOTS {
        let (modes, error, way) = shown(&on_robot("hybrid", "ball.toml", robot), 6.0);
        let name = robot.0;
        assert_eq!(modes, ["approach", "servo"], "{name}");
        let error: Vec<f64> = error.values().map(|value| value.expect("the ball is under the pad")).collect();
        let [x, y, pressure] = error[..] else { panic!("{name}: {error:?}") };
        assert!(x.abs() < 1e-3 && y.abs() < 1e-3, "{name}: {x} and {y} m from the centre");
        assert!(pressure.abs() < 5e-3, "{name}: {pressure} N per tactel from the setpoint");
        assert!((0.005..0.06).contains(&way), "{name}: the sensor moved {way} m");
    }
}

/// Runs every shipped task on a changed bench until it works, and checks that it got there and holds its contact.
fn every_task_works(name: &str, on: impl Fn(&str, &str) -> Request) {
    for (task, way, until_s, pressure) in TASKS {
        let (modes, error, _) = shown(&on(task, &bench_of(task)), until_s);
        assert_eq!(modes, way, "{task} on {name}");
        let error: Vec<Option<f64>> = error.values().collect();
        assert!(error.iter().any(Option::is_some), "{task} on {name} has lost the contact");
        let pressure = pressure.map(|at| error[at].expect("there is a contact"));
        assert!(pressure.is_none_or(|error| error.abs() < 0.02), "{task} on {name}: {pressure:?} N per tactel");
    }
}

#[test]
fn all_tasks_are_listed() {
    let names = |path: &PathBuf| path.file_stem().unwrap().to_str().unwrap().to_owned();
    assert_eq!(single_tasks().iter().map(names).collect::<Vec<_>>(), TASKS.map(|(task, ..)| task));
}

#[test]
fn every_shipped_task_works_on_an_lwr() {
    every_task_works("lwr4p", |task, bench| on_robot(task, bench, ROBOTS[0]));
}

#[test]
fn every_shipped_task_works_on_a_ur5e() {
    every_task_works("ur5e", |task, bench| on_robot(task, bench, ROBOTS[1]));
}

#[test]
fn every_shipped_task_works_on_a_panda() {
    every_task_works("panda", |task, bench| on_robot(task, bench, ROBOTS[2]));
}

#[test]
fn every_shipped_task_works_on_a_gantry() {
    every_task_works("gantry", |task, bench| on_robot(task, bench, ROBOTS[3]));
}

#[test]
fn every_shipped_task_works_on_a_small_slow_pad() {
    let calibration = workspace().join("tests/data/pads/8x8.toml");
    every_task_works("8x8", |task, bench| {
        let mut request = on_robot(task, bench, ROBOTS[0]);
        let line = |line: &str| match line.split(" = ").next() {
            Some("calibration") => format!("calibration = {calibration:?}\n{SMALL_PAD}"),
            _ => format!("{line}\n"),
        };
        request.bench_text = request.bench_text.map(|text| text.lines().map(line).collect());
        request
    });
}

#[test]
fn a_ridge_is_kept_by_an_arm_with_little_damping() {
    // While the contact with a line is light, a small tilt moves its middle far: rolling toward it makes such an arm
    // oscillate, and the pad leaves the ridge.
    let request = on_robot("seek_ridge", "ridge.toml", ROBOTS[2]).set("devices.bench.damping_ratio=0.2");
    let (modes, error, _) = shown(&request, 3.0);
    assert_eq!(modes, ["approach", "press", "turn", "follow"]);
    assert!(error.values().all(|value| value.is_some()), "{error:?}");
}
