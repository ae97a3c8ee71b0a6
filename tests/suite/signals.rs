//! The signals of the operating system: each ends a run by the ramp and soon, or is refused.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::cli::{Running, in_new_folder};
use crate::lockstep::{Peer, command, number};
use crate::tool::{Said, said, tool};

const HYBRID: &str = "graphs/hybrid.toml";
const MOCK: &str = "--bench=graphs/benches/mock.toml";

const IN_CONTACT: &str = "--set=devices.pad.press=[{ from_s = 0.3, force = 3.0, at = [0.008, -0.004] }]";

/// The time in which a signal ends a run, with some for a busy machine.
const SOON: Duration = Duration::from_millis(5500);

/// An approach of the hybrid task by the wall clock, with a simulator that sees what the arm is commanded. It ends by
/// itself after four seconds, without a contact.
struct Approach {
    peer: Peer,
    running: Running,
    _folder: tempfile::TempDir,
}

impl Approach {
    /// Starts it and waits until the arm moves.
    fn start(more: &[&str]) -> Self {
        let (folder, path) = in_new_folder("rows.csv");
        let peer = Peer::start("--scene none --seconds 20 --wall");
        let mut command = command("hybrid", &peer.port, &[&["--out", &path], more].concat());
        let running = Running::started(&mut command, Path::new(&path), 150_000);
        Self { peer, running, _folder: folder }
    }

    /// How long it took to end, what the tool said, and what the simulator saw.
    fn end(self) -> (Duration, Said, serde_json::Value) {
        let (took, said) = self.running.end();
        (took, said, self.peer.seen())
    }
}

#[test]
fn each_signal_ends_a_run_by_the_ramp() {
    let names = ["INT", "TERM", "HUP", "QUIT", "ALRM", "USR1", "USR2", "XCPU", "VTALRM", "PROF", "IO"];
    let check = |name: &str| {
        let approach = Approach::start(&[]);
        approach.running.signal(&format!("-{name}"));
        let (took, said, seen) = approach.end();
        assert_eq!(said.code, 0, "{name}: {}", said.err);
        assert!(said.out.contains(&format!("interrupted by SIG{name} after")), "{name}: {}", said.out);
        assert!(took < SOON, "{name}: {took:?}");
        assert_eq!(seen["end"].as_str(), Some("the operator interrupted the run"), "{name}: {seen}");
        assert!(number(&seen, "q_eq_moved") > 0.001, "{name}: it moved: {seen}");
        assert_eq!(number(&seen, "last_dq"), 0.0, "{name}: {seen}");
    };
    for some in names.chunks(4) {
        std::thread::scope(|scope| some.iter().for_each(|name| drop(scope.spawn(move || check(name)))));
    }
}

#[test]
fn a_run_cannot_be_suspended() {
    let begin = Instant::now();
    let (_folder, path) = in_new_folder("rows.csv");
    let args = ["run", HYBRID, MOCK, IN_CONTACT, "--realtime", "--for", "2.5s", "--out", &path];
    let running = Running::start(&args, Path::new(&path));
    for signal in ["-TSTP", "-TTIN", "-TTOU", "-XFSZ", "-TSTP"] {
        running.signal(signal);
        std::thread::sleep(Duration::from_millis(50));
    }
    let (_, said) = running.end();
    assert_eq!(said.code, 0, "{}", said.err);
    assert_eq!(said.err.matches("a run cannot be suspended").count(), 1, "{}", said.err);
    assert!(said.out.contains("the time limit ended the run after 2.500 s"), "{}", said.out);
    assert!(begin.elapsed() < Duration::from_secs(15));
}

#[test]
fn a_run_in_the_background_of_a_terminal_goes_on_and_listens_when_it_comes_to_the_front() {
    let mut command = Command::new("python3");
    let tool = env!("CARGO_BIN_EXE_tactflow-under-test");
    let args = ["run", HYBRID, MOCK, IN_CONTACT, "--realtime", "--listen", "--for", "3s", "--send", "90s:resume"];
    command.arg("tests/peers/background.py").args(["stop", tool]).args(args).arg("--quiet");
    let said = said(command.current_dir(tactflow_tests::workspace()));
    // The terminal shows standard error too.
    assert_eq!(said.code, 0, "{}", said.out);
    let away =
        "cannot read words from standard input: Input/output error (os error 5); bring the run to the foreground";
    assert!(said.out.contains(away) && said.out.contains("the operator sent `stop`"), "{}", said.out);
    let used = said.out.lines().find_map(|line| line.strip_prefix("processor: ")?.strip_suffix(" s"));
    let used: f64 = used.unwrap().parse().unwrap();
    assert!(used < 0.7, "{used} s of processor time in 1.3 s");
}

#[test]
fn a_second_signal_does_not_cut_the_ramp() {
    // The ramp takes a second or more.
    let approach = Approach::start(&["--set", "devices.bench.acceleration=0.05"]);
    approach.running.signal("-INT");
    for signal in ["-INT", "-TERM", "-QUIT", "-TSTP"] {
        std::thread::sleep(Duration::from_millis(60));
        approach.running.signal(signal);
    }
    let (took, said, seen) = approach.end();
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(took < SOON, "{took:?}");
    assert_eq!(number(&seen, "last_dq"), 0.0, "{seen}");
    // In real time, a tick may be late by a period and more; a cut would be a step of 0.01 rad/s.
    assert!(number(&seen, "step") <= 4.0 * 0.05 * 0.004, "within the acceleration: {seen}");
}

#[test]
fn a_ramp_that_takes_too_long_is_cut_and_reported() {
    let approach = Approach::start(&["--set", "devices.bench.acceleration=0.003"]);
    // It takes as long to stop as it took to get fast.
    std::thread::sleep(Duration::from_secs(4));
    approach.running.signal("-TERM");
    let (took, said, seen) = approach.end();
    assert!(took < SOON && took > Duration::from_secs(2), "{took:?}");
    assert_eq!(number(&seen, "last_dq"), 0.0, "{seen}");
    let message = "`bench` still moves: its ramp takes too long, so its command is zero at once";
    assert!(said.code == 0 && said.err.contains(message), "{}", said.err);
}

/// Starts a command, sends it Ctrl-C a second later, and waits for its end.
fn interrupted(command: &mut Command) -> (Duration, Said) {
    let running = Running::of(command.stdout(Stdio::piped()));
    std::thread::sleep(Duration::from_secs(1));
    running.signal("-INT");
    running.end()
}

#[test]
fn a_node_that_hangs_does_not_keep_the_process() {
    let args = ["run", "tests/data/breaks.toml", "--set", "nodes.bad.how=hang", "--realtime"];
    let (took, said) = interrupted(&mut tool(&args));
    assert_eq!(said.code, 130, "{}", said.err);
    assert!(took < SOON && took > Duration::from_secs(3), "{took:?}");
    assert!(said.err.contains("error: the process did not end within 5 s of SIGINT"), "{}", said.err);
}

#[test]
fn a_driver_that_blocks_does_not_take_ctrl_c_with_it() {
    let (_folder, path) = in_new_folder("graph.toml");
    let text = "[graph]\nclock = 'a'\n[roles]\na = 'length'\n[bind]\na = 'b'\n[devices.b]\ntype = 'blocking'\n\
                [policy]\ndevice = 'hold'\n";
    std::fs::write(&path, text).unwrap();
    let (took, said) = interrupted(&mut tool(&["run", &path]));
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(took < SOON && said.out.contains("interrupted by SIGINT"), "{took:?}: {}", said.out);
}

#[test]
fn a_reader_that_reads_nothing_does_not_keep_the_process() {
    let (reader, mut writer) = std::io::pipe().unwrap();
    let full = writer.try_clone().unwrap();
    // It fills the pipe and waits for ever, as the run does that prints to it.
    std::thread::spawn(move || while writer.write_all(&[b' '; 4096]).is_ok() {});
    std::thread::sleep(Duration::from_millis(200));
    let mut command = tool(&["run", HYBRID, MOCK, "--realtime", "--for", "60s"]);
    let running = Running::of(command.stdout(full));
    std::thread::sleep(Duration::from_secs(1));
    running.signal("-INT");
    let took = running.gone();
    assert!(took < SOON, "{took:?}");
    drop(reader);
}

#[test]
fn a_simulator_that_hangs_does_not_keep_the_process() {
    let (_folder, path) = in_new_folder("rows.csv");
    let peer = Peer::start("--scene pen --seconds 1000");
    let mut command = command("force", &peer.port, &["--out", &path]);
    let running = Running::started(&mut command, Path::new(&path), 150_000);
    peer.signal("-STOP");
    std::thread::sleep(Duration::from_millis(300));
    running.signal("-INT");
    let (took, said) = running.end();
    peer.signal("-KILL");
    assert!(said.code == 0 && said.out.contains("interrupted by SIGINT"), "{}{}", said.out, said.err);
    assert!(took < Duration::from_secs(3), "{took:?}");
}
