//! A recorded run is a bench: any graph runs on its arm and its pads, and the recorded graph computes the same again.

use std::fs;
use std::path::{Path, PathBuf};

use tactflow_tests::workspace;

use crate::replay::recorded;
use crate::tool::{Said, say};
use crate::ur::Peer;
use crate::ur_process::GRAPH;

/// Writes a bench on a recording in the same folder: its roles, each with the device that plays it and the role that
/// selects the device.
fn bench(folder: &Path, limits: &str, roles: &[(&str, &str, Option<&str>)]) -> PathBuf {
    let bind: String = roles.iter().map(|(role, device, _)| format!("{role} = \"{device}\"\n")).collect();
    let mut devices: Vec<String> = roles
        .iter()
        .map(|(_, device, of)| {
            let of = of.map_or_else(String::new, |of| format!("role = \"{of}\"\n"));
            format!("[devices.{device}]\ntype = \"replay\"\nfile = \"run.mcap\"\n{of}")
        })
        .collect();
    devices.dedup();
    let robot = format!("robot = {:?}\n", workspace().join("graphs/robots/lwr4p.toml"));
    let last = devices.last_mut().expect("a bench has a device");
    last.push_str(&robot);
    let workspace = "workspace_min_m = [-0.8, -0.4, 0.1]\nworkspace_max_m = [-0.3, 0.4, 0.7]";
    let text = format!("[bind]\n{bind}\n{}\n[limits]\n{workspace}\n{limits}\n", devices.join("\n"));
    let path = folder.join("yesterday.toml");
    fs::write(&path, text).unwrap();
    path
}

/// Runs a graph on a bench and records it.
fn again(folder: &Path, graph: &str, bench: &Path, args: &[&str]) -> (Said, PathBuf) {
    let path = folder.join("again.mcap");
    let run = ["run", graph, "--bench", bench.to_str().unwrap(), "--record", path.to_str().unwrap()];
    (say(&[&run, args].concat()), path)
}

fn diff(a: &Path, b: &Path) -> Said {
    say(&["diff", a.to_str().unwrap(), b.to_str().unwrap()])
}

const SIMULATED: [(&str, &str, Option<&str>); 3] =
    [("pad", "cell", None), ("arm", "cell", None), ("truth", "cell", None)];

#[test]
fn the_recorded_graph_computes_the_same_to_the_last_bit_and_another_gain_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let run = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "1.5s"]);
    let bench = bench(folder.path(), "", &SIMULATED);
    let (said, path) = again(folder.path(), "graphs/hybrid.toml", &bench, &[]);
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{}", said.out);
    assert_eq!(said.out.matches("`arm` follows no command: its samples are those of ").count(), 1, "{}", said.out);
    // It ends with the recording.
    assert!(said.out.contains("a device has no more samples after 1.500 s and 376 ticks"), "{}", said.out);
    let same = diff(&run, &path);
    assert_eq!((same.code, same.err.as_str()), (0, ""), "{}", same.out);
    assert!(same.out.contains("376 ticks") && same.out.contains("the same to the last bit"), "{}", same.out);

    let (said, path) = again(folder.path(), "graphs/hybrid.toml", &bench, &["--set", "nodes.pid.gains.x.kp=3.4", "-q"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let other = diff(&run, &path);
    assert_eq!(other.code, 1, "{}", other.out);
    let differs = |port: &str| other.out.lines().any(|line| line.trim_start().starts_with(port));
    assert!(differs("pid.control ") && !differs("pad.image ") && !differs("arm.position "), "{}", other.out);
}

#[test]
fn another_graph_runs_on_the_recorded_arm_and_pad() {
    let folder = tempfile::tempdir().unwrap();
    let run = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "1s"]);
    let bench = bench(folder.path(), "", &SIMULATED[..2]);
    let (said, path) = again(folder.path(), "graphs/force.toml", &bench, &["-q"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let other = diff(&run, &path);
    let differs = |port: &str| other.out.lines().any(|line| line.trim_start().starts_with(port));
    assert!(other.code == 1 && !differs("pad.image ") && !differs("arm.position "), "{}", other.out);
}

#[test]
fn a_run_that_was_slow_is_the_same_with_the_same_fraction() {
    let folder = tempfile::tempdir().unwrap();
    let run = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "1s", "--slow", "0.3"]);
    let bench = bench(folder.path(), "", &SIMULATED);
    let (said, path) = again(folder.path(), "graphs/hybrid.toml", &bench, &["--slow", "0.3"]);
    assert!(said.out.contains("`arm` was recorded with `--slow 0.3`"), "{}{}", said.out, said.err);
    assert_eq!(diff(&run, &path).code, 0);
}

#[test]
fn a_recording_with_several_devices_is_played_by_their_roles() {
    let folder = tempfile::tempdir().unwrap();
    let run = ["graphs/hybrid.toml", "--bench", "graphs/benches/mock.toml", "--for", "800ms"];
    let run = recorded(folder.path(), &run);
    let two = [("pad", "skin", Some("pad")), ("arm", "robot", Some("arm"))];
    let path = bench(folder.path(), "", &two);
    let (said, again_path) = again(folder.path(), "graphs/hybrid.toml", &path, &["-q"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    assert_eq!(diff(&run, &again_path).code, 0);

    let without = [("pad", "skin", None), ("arm", "robot", Some("arm"))];
    let unknown = [("pad", "skin", Some("paw")), ("arm", "robot", Some("arm"))];
    let swapped = [("pad", "skin", Some("arm")), ("arm", "robot", Some("arm"))];
    let cases: [(&[_], [&str; 2]); 3] = [
        (&without, ["the recording has 2 devices: ", "select one by a role: `role = \"pad\"`"]),
        (&unknown, ["no device of the recording was the role `paw`", "did you mean `pad`?"]),
        (&swapped, ["device `skin` cannot fill the role `pad`", "it can fill: `velocity_arm`"]),
    ];
    for (roles, words) in cases {
        let path = bench(folder.path(), "", roles);
        let said = say(&["check", "graphs/hybrid.toml", "--bench", path.to_str().unwrap()]);
        assert_ne!(said.code, 0, "{}", said.out);
        let text = format!("{}{}", said.out, said.err);
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    }
}

#[test]
fn a_run_of_a_live_arm_is_a_bench_in_virtual_time() {
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("graph.toml");
    {
        let peer = Peer::start(serde_json::json!({}));
        // At 125 Hz, a timer ticks before the first sample of a busy machine comes, and a recording has no such tick.
        fs::write(&graph, format!("{GRAPH}{}", peer.params("rate_hz = 25"))).unwrap();
        recorded(folder.path(), &[graph.to_str().unwrap(), "--slow", "1", "--for", "1.5s"]);
    }
    let device = "type = 'replay'\nfile = 'run.mcap'\nrobot = 'builtin:ur5e.toml'\n";
    fs::write(&graph, GRAPH.replace("type = 'ur'\n", device)).unwrap();
    let path = folder.path().join("again.mcap");
    let said = say(&["run", graph.to_str().unwrap(), "--slow", "1", "--record", path.to_str().unwrap()]);
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{}", said.out);
    assert!(said.out.contains("`arm` follows no command"), "{}", said.out);
    let same = diff(&folder.path().join("run.mcap"), &path);
    assert!(same.code == 0, "{}{}", same.out, same.err);
}

#[test]
fn a_file_that_is_no_recording_is_refused_and_one_that_was_cut_is_played_up_to_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let run = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "2s"]);
    let bytes = fs::read(&run).unwrap();
    let bench = bench(folder.path(), "", &SIMULATED[..2]);
    fs::write(&run, &bytes[..bytes.len() * 3 / 4]).unwrap();
    let said = say(&["run", "graphs/hybrid.toml", "--bench", bench.to_str().unwrap()]);
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{}", said.out);
    assert!(said.out.contains("a device has no more samples after 1."), "{}", said.out);
    for (bytes, words) in [(&b"nothing"[..], "no recording of tactflow"), (&bytes[..2000], "was cut")] {
        fs::write(&run, bytes).unwrap();
        let said = say(&["run", "graphs/hybrid.toml", "--bench", bench.to_str().unwrap()]);
        assert!(said.code != 0 && said.err.contains(words) && said.err.contains("yesterday.toml"), "{}", said.err);
    }
}
