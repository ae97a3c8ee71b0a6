//! A run that uses a fraction of the speeds: `--slow`, and a bench with a real arm that is not commissioned.

use std::fs;

use tactflow_runtime::cli::{Commissioning, Proof};
use tactflow_runtime::graph::{Request, compile, open_bench};
use tactflow_tests::{catalogue, workspace};

use crate::cli::in_new_folder;
use crate::tool::{said, tool};

/// The largest speed of the sensor and of a joint in a recording [m/s, rad/s].
fn speeds(slow: &[&str]) -> [f64; 2] {
    let (_folder, path) = in_new_folder("run.csv");
    let said = said(&mut tool(&[&["run", "graphs/hybrid.toml", "--for", "4s", "-q", "--out", &path], slow].concat()));
    assert_eq!(said.code, 0, "{}", said.err);
    let text = fs::read_to_string(&path).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns = |start: &str| -> Vec<usize> {
        let found = names.iter().enumerate().filter(|(_, name)| name.starts_with(start)).map(|(i, _)| i).collect();
        assert_ne!(found, Vec::<usize>::new(), "{start}: {names:?}");
        found
    };
    let (linear, joints) = (columns("move.acceleration.twist.v"), columns("move.joints.velocity."));
    let mut most = [0.0_f64; 2];
    for line in lines {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(0.0)).collect();
        let speed = linear.iter().map(|i| cells[*i].powi(2)).sum::<f64>().sqrt();
        let joint = joints.iter().map(|i| cells[*i].abs()).fold(0.0, f64::max);
        most = [most[0].max(speed), most[1].max(joint)];
    }
    most
}

#[test]
fn a_slow_run_moves_at_that_fraction_of_its_limits() {
    let [whole, _] = speeds(&[]);
    assert!(whole > 0.009, "the approach is at 10 mm/s: {whole}");
    let [slow, joint] = speeds(&["--slow", "0.1"]);
    assert!(slow <= 0.005 + 1e-9 && slow > 0.0045, "a tenth of 50 mm/s: {slow}");
    assert!(joint > 0.0);
}

#[test]
fn every_shipped_task_loads_slowly() {
    for entry in fs::read_dir(workspace().join("graphs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let plan = compile(&catalogue(), &Request::file(&path).slow(0.1));
            plan.unwrap_or_else(|report| panic!("{}: {}", path.display(), report.render(false)));
        }
    }
}

/// A graph that moves the motor of the tests, which counts as a real one.
const GRAPH: &str = "
[graph]
clock = 'motor'
bench = 'bench.toml'
[roles]
motor = 'drive'
[commands]
motor.velocity = 'motor.wanted'
";
const BENCH: &str = "
[bind]
motor = 'motor'
[devices.motor]
type = 'udp_motor'
address = '127.0.0.1:9'
needs_commissioning = true
";

#[test]
fn a_real_arm_is_slow_until_it_is_commissioned_and_again_after_a_change() {
    let (folder, graph) = in_new_folder("graph.toml");
    let path = folder.path().join("bench.toml");
    fs::write(&graph, GRAPH).unwrap();
    fs::write(&path, BENCH).unwrap();
    let run = || said(&mut tool(&["run", &graph, "--for", "200ms", "-q"]));
    let warning = "device `motor` has not passed `tactflow doctor ";
    assert!(run().err.contains(warning), "{}", run().err);
    // What `doctor --move` writes.
    let bench = open_bench(&catalogue(), &path).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let device = bench.devices[0].to_commission.as_ref().unwrap();
    let mut commissioning = Commissioning::default();
    let proof = Proof { fingerprint: device.fingerprint.clone(), stopped_after_ms: 80.0, stopped_after_mrad: 1.0 };
    commissioning.add("motor", proof);
    commissioning.write(&path).unwrap();
    assert!(!run().err.contains(warning), "{}", run().err);
    fs::write(&path, BENCH.replace("needs", "acceleration = 5.0\nneeds")).unwrap();
    assert!(run().err.contains(warning), "another acceleration is another device");
    fs::write(&path, BENCH).unwrap();
    fs::write(Commissioning::path(&path), "motor = 'yes'").unwrap();
    let broken = run();
    assert!(broken.code == 2 && broken.err.contains("is not a file of `tactflow doctor --move`"), "{}", broken.err);
}
