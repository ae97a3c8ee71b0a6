//! `tactflow doctor` against a controller in another process.

use std::fs;
use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};

use tactflow_tests::workspace;
use tempfile::tempdir;

use crate::peer::free_udp_port;
use crate::tool::{Said, tool};

/// A controller that sends to a port, until it is dropped.
struct Controller(Child);

impl Controller {
    fn start(port: u16) -> Self {
        let script = workspace().join("tests/peers/lwr.py");
        let mut command = Command::new("python3");
        command.arg(script).args(["--port", &port.to_string(), "--seconds", "60", "--restart-s", "0.3"]);
        Self(command.stdout(Stdio::null()).spawn().expect("python3 is there"))
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn bench(port: u16) -> String {
    format!(
        "[bind]\narm = \"arm\"\n[devices.arm]\ntype = \"lwr_fri\"\nrobot = \"builtin:lwr4p.toml\"\nport = {port}\n\
         [limits]\nworkspace_min_m = [-0.9, -0.9, -0.2]\nworkspace_max_m = [0.9, 0.9, 1.2]\n"
    )
}

/// Runs the tool with a line on its standard input.
fn answered(args: &[&str], line: &str) -> Said {
    let mut child = tool(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // A tool that asks nothing may have ended.
    let _ = child.stdin.take().unwrap().write_all(line.as_bytes());
    let (mut out, mut err) = (String::new(), String::new());
    child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    Said { code: child.wait().unwrap().code().unwrap(), out, err }
}

#[test]
fn an_arm_is_described_and_it_moves_and_is_commissioned_only_after_a_yes() {
    let (folder, port) = (tempdir().unwrap(), free_udp_port());
    let path = folder.path().join("cell.toml");
    let note = folder.path().join("cell.commissioned.toml");
    fs::write(&path, bench(port)).unwrap();
    let path = path.to_str().unwrap();
    let _controller = Controller::start(port);
    let refused = answered(&["doctor", path, "--for", "500ms", "--move"], "no\n");
    assert_eq!(refused.code, 0, "{}{}", refused.out, refused.err);
    for text in ["position 4: lwr_a3_joint", "Hz (declared 250.0 Hz)", "it stops within 200 ms", "warning: not moved"] {
        assert!(refused.out.contains(text), "{text}: {}", refused.out);
    }
    assert!(!note.exists());
    let proven = answered(&["doctor", path, "--for", "300ms", "--move"], "yes\n");
    assert_eq!(proven.code, 0, "{}{}", proven.out, proven.err);
    assert!(proven.out.contains("without commands, it was at rest after"), "{}", proven.out);
    let note = fs::read_to_string(note).unwrap();
    assert!(note.contains("\n[arm]\nfingerprint = \""), "{note}");
}

#[test]
fn a_device_that_sends_nothing_is_a_problem() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("cell.toml");
    fs::write(&path, bench(free_udp_port())).unwrap();
    let silent = answered(&["doctor", path.to_str().unwrap(), "--for", "300ms", "--move"], "yes\n");
    assert_eq!(silent.code, 1, "{}{}", silent.out, silent.err);
    assert!(silent.out.contains("problem: position: no sample in 0.3 s"), "{}", silent.out);
    assert!(!silent.out.contains("Type `yes`"), "nothing moves: {}", silent.out);
}
