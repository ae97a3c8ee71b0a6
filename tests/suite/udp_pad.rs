//! The device of docs/writing-a-device.md in a graph: a pad that goes silent holds the arm until it is back.

use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tactflow_runtime::engine::{End, Engine, Halt, RunOptions, run};
use tactflow_runtime::fault::Cause;
use tactflow_runtime::graph::{Request, compile};
use tactflow_tests::{catalogue, workspace};

use crate::tool::{Said, say};

/// What the pad does next.
enum Act {
    /// Sends so many frames, 10 ms apart.
    Frames(u32),
    /// Sends a datagram that is no frame.
    Nonsense,
    /// Sends nothing until the test says so, and waits for the next hello.
    Silence,
    /// Sends frames to the end of the test, 10 ms apart.
    FramesToTheEnd,
    /// The same, with a load of 1 N on a patch of four by four tactels.
    LoadToTheEnd,
}

/// A pad of 16 by 16 tactels that nothing touches at first. It follows its script in steps that the test takes, as a busy machine
/// has a time of its own.
struct Pad {
    address: SocketAddr,
    /// Whether the silence is over.
    speaks: Arc<AtomicBool>,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Pad {
    /// Ends the pad, and fails if it has failed.
    fn end(mut self) {
        self.is_over.store(true, Ordering::SeqCst);
        self.thread.take().expect("it ends once").join().unwrap();
    }
}

impl Drop for Pad {
    fn drop(&mut self) {
        self.speaks.store(true, Ordering::SeqCst);
        self.is_over.store(true, Ordering::SeqCst);
    }
}

fn pad(script: Vec<Act>) -> Pad {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let address = socket.local_addr().unwrap();
    let hello = move |socket: &UdpSocket| socket.recv_from(&mut [0; 8]).expect("the driver says hello").1;
    let [speaks, is_over] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
    let (may_speak, must_end) = (speaks.clone(), is_over.clone());
    let wait = || thread::sleep(Duration::from_millis(10));
    let thread = thread::spawn(move || {
        let mut driver = hello(&socket);
        let mut number = 0_u64;
        let mut frame = |driver: SocketAddr, cells: &[f32; 256]| {
            number += 1;
            let cells = cells.iter().flat_map(|cell| cell.to_le_bytes());
            let datagram: Vec<u8> = number.to_le_bytes().into_iter().chain(cells).collect();
            socket.send_to(&datagram, driver).unwrap();
            wait();
        };
        let (rest, load) =
            ([0.0; 256], std::array::from_fn(|i| if i / 16 < 4 && i % 16 < 4 { 1.0 / 16.0 } else { 0.0 }));
        for act in script {
            match act {
                Act::Frames(count) => (0..count).for_each(|_| frame(driver, &rest)),
                Act::FramesToTheEnd | Act::LoadToTheEnd => {
                    let cells = if matches!(act, Act::LoadToTheEnd) { &load } else { &rest };
                    while !must_end.load(Ordering::SeqCst) {
                        frame(driver, cells);
                    }
                }
                Act::Nonsense => drop(socket.send_to(b"nonsense", driver).unwrap()),
                Act::Silence => {
                    while !may_speak.load(Ordering::SeqCst) {
                        wait();
                    }
                    socket.set_nonblocking(true).unwrap();
                    while socket.recv_from(&mut [0; 8]).is_ok() {}
                    socket.set_nonblocking(false).unwrap();
                    driver = hello(&socket);
                }
            }
        }
    });
    Pad { address, speaks, is_over, thread: Some(thread) }
}

fn bench(address: SocketAddr) -> String {
    format!(
        "[bind]\npad = \"skin\"\narm = \"arm\"\n[devices.skin]\ntype = \"udp_pad\"\naddress = \"{address}\"\n\
         silence_s = 0.1\n[devices.arm]\ntype = \"mock_arm\"\nrobot = \"builtin:lwr4p.toml\"\n\
         [facts.pad]\nmount = {{ xyz = [0.0, 0.0, 0.03], rpy = [0.0, 0.0, 0.0] }}\n\
         [limits]\nworkspace_min_m = [-0.8, -0.4, 0.1]\nworkspace_max_m = [-0.3, 0.4, 0.7]\n"
    )
}

fn is_lost(halt: &Halt) -> bool {
    matches!(halt.fault.cause, Cause::Lost(_))
}

/// The pad states no pressure.
const SETPOINT: &str = "nodes.error.setpoint.pressure=0.1";

#[test]
fn a_pad_that_goes_silent_holds_the_arm_until_it_is_back() {
    holds_until_it_is_back("policy.device='hold'");
}

#[test]
fn so_does_a_pad_that_the_bench_lets_come_back() {
    holds_until_it_is_back("devices.skin.reconnect=true");
}

/// Runs `force` on a pad with a self-test of 20 frames that goes silent and comes back as `after` says. Returns the end,
/// and the greatest speed of a joint in each tick.
fn comes_back(reconnect: &str, after: Act) -> (End, Engine, Vec<(i64, f64)>) {
    let pad = pad(vec![Act::Frames(60), Act::Silence, after]);
    let facts = "[facts.pad]\nrest_frames = 20\ntare_bound = 0.01\n";
    let bench = bench(pad.address).replace("[facts.pad]\n", facts);
    let request = Request::file(workspace().join("graphs/force.toml")).set(reconnect).set(SETPOINT);
    let request = Request { bench_text: Some(bench), ..request };
    let compiled = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let (mut engine, mut fastest) = (Engine::new(compiled), Vec::new());
    let options = RunOptions { duration: Some(3.0), ..RunOptions::default() };
    let outcome = run(&mut engine, &options, &mut |engine| {
        let command = engine.commands("arm").unwrap();
        fastest.push((engine.now(), command.iter().fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()))));
        let is_long = |halt: &Halt| halt.until.is_none() && engine.now() - halt.fault.time > 200_000_000;
        if engine.halts().iter().any(|halt| is_lost(halt) && is_long(halt)) {
            pad.speaks.store(true, Ordering::SeqCst);
        }
    });
    pad.end();
    (outcome.unwrap().end, engine, fastest)
}

/// Returns the time from the end of the loss to the next motion [s].
fn rest_after(engine: &Engine, fastest: &[(i64, f64)]) -> f64 {
    let lost = engine.halts().iter().find(|halt| is_lost(halt)).expect("it was lost");
    let until = lost.until.expect("it is back");
    let moves = fastest.iter().find(|(at, speed)| *at > until && *speed > 0.0).expect("it goes on");
    (moves.0 - until) as f64 * 1e-9
}

#[test]
fn a_pad_that_comes_back_repeats_its_self_test_before_the_arm_moves() {
    let (end, engine, fastest) = comes_back("devices.skin.reconnect=true", Act::FramesToTheEnd);
    assert_eq!(end, End::Duration);
    let before = engine.halts().iter().find(|halt| is_lost(halt)).unwrap().fault.time;
    assert!(fastest.iter().any(|(at, speed)| *at < before && *speed > 0.0), "it approaches");
    // 20 frames, 10 ms apart; the first of them ends the loss.
    let rest = rest_after(&engine, &fastest);
    assert!(rest >= 0.18, "{rest} s");
}

#[test]
fn without_reconnect_the_verdict_of_the_start_holds() {
    let (end, engine, fastest) = comes_back("policy.device='hold'", Act::FramesToTheEnd);
    assert_eq!(end, End::Duration);
    let rest = rest_after(&engine, &fastest);
    assert!(rest < 0.15, "{rest} s");
}

#[test]
fn a_pad_that_is_touched_when_it_comes_back_ends_the_run_and_the_arm_stays() {
    let (end, engine, fastest) = comes_back("devices.skin.reconnect=true", Act::LoadToTheEnd);
    let End::Fault(fault) = end else { panic!("{end:?}") };
    assert!(fault.to_string().contains("something touches the pad"), "{fault}");
    let lost = engine.halts().iter().find(|halt| is_lost(halt)).expect("it was lost");
    let until = lost.until.expect("it is back");
    assert!(!fastest.iter().any(|(at, speed)| *at > until && *speed > 0.0), "nothing moves");
}

#[test]
fn a_device_that_runs_with_the_graph_cannot_come_back() {
    let request = Request::file(workspace().join("graphs/force.toml")).set("devices.bench.reconnect=true");
    let report = compile(&catalogue(), &request).err().expect("it is refused").render(false);
    assert!(report.contains("`bench` runs with the graph, so it cannot be lost and come back"), "{report}");
}

/// Lets a pad go silent and come back, in a task with the setting `set`.
fn holds_until_it_is_back(set: &str) {
    let pad = pad(vec![Act::Frames(30), Act::Silence, Act::FramesToTheEnd]);
    let request = Request::file(workspace().join("graphs/force.toml")).set(set).set(SETPOINT);
    let request = Request { bench_text: Some(bench(pad.address)), ..request };
    let compiled = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(compiled);
    let mut fastest = Vec::new();
    let options = RunOptions { duration: Some(3.0), ..RunOptions::default() };
    let outcome = run(&mut engine, &options, &mut |engine| {
        let command = engine.commands("arm").unwrap();
        fastest.push((engine.now(), command.iter().fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()))));
        let is_long = |halt: &Halt| halt.until.is_none() && engine.now() - halt.fault.time > 200_000_000;
        if engine.halts().iter().any(|halt| is_lost(halt) && is_long(halt)) {
            pad.speaks.store(true, Ordering::SeqCst);
        }
    });
    assert_eq!(outcome.unwrap().end, End::Duration);
    pad.end();
    let all: Vec<String> = engine.halts().iter().map(|halt| halt.fault.to_string()).collect();
    // On a busy machine, a frame may be late too.
    let length = |halt: &&Halt| halt.until.map_or(0, |until| until - halt.fault.time);
    let lost = engine.halts().iter().filter(|halt| is_lost(halt)).max_by_key(length);
    let lost = lost.unwrap_or_else(|| panic!("{all:?}"));
    assert_eq!((lost.fault.node.as_str(), lost.fault.port.as_deref()), ("pad", Some("image")));
    assert!(lost.fault.to_string().contains("no frame for 100ms"), "{all:?}");
    let until = lost.until.expect("it is over when the pad is back");
    let held = until - lost.fault.time;
    assert!(held > 200_000_000, "{held} ns");
    let moves = |from: i64, to: i64| fastest.iter().filter(|(at, _)| (from..to).contains(at)).any(|(_, v)| *v > 0.0);
    assert!(moves(0, lost.fault.time), "it approaches");
    assert!(!moves(until - 50_000_000, until), "it is held");
    assert!(moves(until + 100_000_000, i64::MAX), "it goes on");
    let (device, counts) = engine.counts().next().unwrap();
    assert_eq!((device, counts[0].0), ("skin", "reconnects"));
}

#[test]
fn the_summary_of_a_run_says_what_a_device_has_counted() {
    let pad = pad(vec![Act::Frames(5), Act::Nonsense, Act::Nonsense, Act::FramesToTheEnd]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bench.toml");
    // The pad is never lost here, however late a frame is.
    std::fs::write(&file, bench(pad.address).replace("silence_s = 0.1", "silence_s = 30.0")).unwrap();
    let bench = format!("--bench={}", file.display());
    let Said { code, out, err } = say(&["run", "graphs/force.toml", &bench, "--for", "1s", "--set", SETPOINT]);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("device `skin`: 2 bad frames\n"), "{out}");
    pad.end();
}
