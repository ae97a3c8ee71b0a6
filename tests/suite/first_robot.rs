//! `docs/first-robot.md`, step by step, with a simulated cell in the place of the robot.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::Duration;

use tactflow_tests::workspace;

use crate::cell::Cell;
use crate::cell::benches::ur_ball;
use crate::tool::{Said, said, tool};

/// Force of the largest reading [N].
const FULL_N: f64 = 3.0;
/// Times that a busy machine may halt a motion.
const TRIALS: usize = 5;

/// The parameters of the simulated bench: a pad without offsets, and a soft ball in front of it.
fn simulation(folder: &Path) -> String {
    let tactels: String = (0..256)
        .map(|i| {
            let (row, col) = (i / 16, i % 16);
            format!("{{ at = [{row}, {col}], offset = 0.0, gain = 0.001, squash = 1e-6, most = {FULL_N:?} }},\n")
        })
        .collect();
    let calibration = folder.join("sim_pad.toml");
    let head = "kind = 'calibration'\nversion = 1\ncurve = 'rational'\nrows = 16\ncols = 16\nreading = 'raw'\n\
                unit = 'N'\ndead = []\n";
    fs::write(&calibration, format!("{head}tactels = [\n{tactels}]\n")).unwrap();
    format!(
        "[set]\nrate_hz = 100.0\nlatency_s = 0.0\nfor_s = 1e6\nstiffness = 2000.0\ncalibration = '{}'\n\
         objects = [{{ shape = 'ball', radius = 0.06, at = [0.0, 0.0, 0.066], stiffness = 100.0, scatter = 0.0005 }}]\n",
        calibration.display(),
    )
}

/// Corrects each line of the bench that has the comment `yours`.
fn correct(bench: &Path, link: &Path, [rtde, script]: [u16; 2]) {
    let text = fs::read_to_string(bench).unwrap();
    let mut corrected = String::new();
    for line in text.lines() {
        let Some((key, _)) = line.split_once('=').filter(|_| line.contains("# yours")) else {
            corrected.push_str(&format!("{line}\n"));
            continue;
        };
        let value = match key.trim() {
            "sensor" => "\"builtin:pads/flexitac_16x16.toml\"".into(),
            "link" => format!("\"serial:{}\"", link.display()),
            "scale" => format!("{{ gain = {:?} }}", FULL_N / 255.0),
            "threshold" => "0.05".into(),
            "mount" => "{ xyz = [0.0, 0.0, 0.03], rpy = [0.0, 0.0, 0.0] }".into(),
            // A robot has the usual ports, and a machine that does nothing else takes the usual times.
            "address" => format!(
                "\"127.0.0.1\"\nrtde_port = {rtde}\nscript_port = {script}\nreverse_port = 0\nrate_hz = 125\n\
                 receive_timeout_ms = 200"
            ),
            "robot" => "\"builtin:ur5e.toml\"".into(),
            "workspace_min_m" => "[0.3, -0.4, 0.1]".into(),
            "workspace_max_m" => "[0.7, 0.4, 0.6]".into(),
            other => panic!("the page does not say what to write for `{other}`"),
        };
        corrected.push_str(&format!("{key}= {value}\n"));
    }
    assert_ne!(corrected, text);
    fs::write(bench, corrected).unwrap();
}

/// Says a line to a process every half a second, until this is dropped.
fn repeat(child: &mut Child, line: &'static str) -> Sender<()> {
    let mut input = child.stdin.take().unwrap();
    let (end, ended) = channel::<()>();
    thread::spawn(move || {
        // The process may have ended.
        while input.write_all(line.as_bytes()).is_ok()
            && ended.recv_timeout(Duration::from_millis(500)) == Err(std::sync::mpsc::RecvTimeoutError::Timeout)
        {
        }
    });
    end
}

/// Runs a command to its end, with a line on its standard input again and again.
fn answered(command: &mut Command, line: &'static str) -> Said {
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let _end = repeat(&mut child, line);
    let output = child.wait_with_output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Said { code: output.status.code().unwrap(), out: text(output.stdout), err: text(output.stderr) }
}

/// Returns what a row of the page's table shows of the output, in pieces without numbers.
fn pieces(row: &str) -> Vec<&str> {
    let quoted = row.split('`').nth(1).unwrap();
    quoted.split(|c: char| c.is_ascii_digit() || "…-.".contains(c)).filter(|piece| piece.trim().len() > 3).collect()
}

#[test]
fn the_page_leads_from_a_new_bench_to_a_touch() {
    let folder = tempfile::tempdir().unwrap();
    let page = fs::read_to_string(workspace().join("docs/first-robot.md")).unwrap();
    let link = folder.path().join("pad");
    let wires = format!(
        "{}[pad]\nwire = 'flexitac'\nfull_scale = {:?}\nlink = '{}'\n[arm]\nwire = 'ur'\n",
        simulation(folder.path()),
        FULL_N * 1e3,
        link.display()
    );
    let cell = Cell::start(&ur_ball(folder.path()), &wires);
    let bench = folder.path().join("cell.toml");
    let mut steps = Vec::new();
    for line in page.lines().filter_map(|line| line.strip_prefix("$ tactflow ")) {
        let words: Vec<&str> = line.split(' ').collect();
        let run = |more: &[&str]| {
            let mut command = tool(&words);
            command.args(more).current_dir(folder.path());
            command
        };
        match words[..] {
            ["new", what, name] => {
                let new = said(&mut run(&[]));
                assert!(new.code == 0 && new.out.starts_with(&format!("wrote {name}.toml\n")), "{}", new.err);
                if what == "bench" {
                    correct(&bench, &link, [("arm", "rtde_port"), ("arm", "script_port")].map(|at| cell.port(at)));
                }
            }
            ["check" | "pose", ..] => {
                let check = said(&mut run(&[]));
                let says =
                    if words[0] == "pose" { "tip in the base: xyz [" } else { "without commands: it stops within " };
                assert!(check.code == 0 && check.out.contains(says), "{}{}", check.out, check.err);
            }
            ["doctor", _] => {
                let doctor = said(&mut run(&["--for", "2s"]));
                assert!(!doctor.out.contains("it would not move"), "{}", doctor.out);
                // The rows of the table that are not about a fault of the hardware.
                let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| `")).collect();
                for piece in [0, 1, 3].into_iter().flat_map(|row| pieces(rows[row])) {
                    assert!(doctor.out.contains(piece), "`{piece}` is not in {}", doctor.out);
                }
                steps.push("doctor");
            }
            ["doctor", _, "--move"] => {
                let moves = || answered(&mut run(&["--for", "2s"]), "yes\n");
                let moved = (0..TRIALS).map(|_| moves()).find(|said| said.code == 0).expect("it moves in some trial");
                for part in
                    ["will move backwards along its own z axis, at 5 mm/s", "Type `yes`", "it was at rest after"]
                {
                    assert!(moved.out.contains(part), "{part}: {}", moved.out);
                }
                assert!(folder.path().join("cell.commissioned.toml").exists());
                steps.push("move");
            }
            ["run", ..] => {
                let run = answered(&mut run(&["--for", "9s"]), "resume\n");
                assert_eq!(run.code, 0, "{}{}", run.out, run.err);
                for part in ["servo ", "pressure [N/tactel]", "limited by", "device `pad`: "] {
                    assert!(run.out.contains(part), "{part}: {}{}", run.out, run.err);
                }
                steps.push("run");
            }
            // A person takes part in these, and they have tests of their own.
            ["doctor", _, "--press"] | ["calibrate", "mount" | "tool", _] | ["teach", _] => {}
            _ => panic!("the page has another command: {line}"),
        }
    }
    assert_eq!(steps, ["doctor", "move", "run"]);
    let hybrid = workspace().join("graphs/hybrid.toml");
    let check = said(tool(&["check", hybrid.to_str().unwrap(), "--bench", "cell.toml"]).current_dir(folder.path()));
    assert_eq!(check.code, 0, "{}", check.err);
}
