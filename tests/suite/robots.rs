//! A task runs on another arm if the bench names that arm: no task holds a number of a robot or of a cell.

use std::fs;

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

#[test]
fn every_shipped_task_loads_on_every_robot() {
    let tasks = single_tasks();
    assert!(tasks.len() >= 10);
    for path in tasks {
        let text = fs::read_to_string(&path).unwrap();
        let bench = text.split("bench = \"benches/").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
        let task = path.file_stem().unwrap().to_str().unwrap();
        for robot in ROBOTS {
            if let Err(report) = compile(&catalogue(), &on_robot(task, bench, robot)) {
                panic!("{task} on {}: {}", robot.0, report.render(false));
            }
        }
    }
}
