//! The device of docs/writing-a-device.md in a graph: a pad that goes silent holds the arm until it is back.

use std::net::{SocketAddr, UdpSocket};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tactflow_runtime::engine::{End, Engine, RunOptions, run};
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
    /// Sends nothing for so long [ms], and waits for the next hello.
    Silence(u64),
}

/// A pad of 16 by 16 tactels that nothing touches. Returns its address.
fn pad(script: Vec<Act>) -> (SocketAddr, JoinHandle<()>) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let address = socket.local_addr().unwrap();
    let hello = move |socket: &UdpSocket| socket.recv_from(&mut [0; 8]).expect("the driver says hello").1;
    let handle = thread::spawn(move || {
        let mut driver = hello(&socket);
        let mut number = 0_u64;
        for act in script {
            match act {
                Act::Frames(count) => {
                    for _ in 0..count {
                        number += 1;
                        let datagram = [&number.to_le_bytes()[..], &[0; 4 * 256]].concat();
                        socket.send_to(&datagram, driver).unwrap();
                        thread::sleep(Duration::from_millis(10));
                    }
                }
                Act::Nonsense => drop(socket.send_to(b"nonsense", driver).unwrap()),
                Act::Silence(ms) => {
                    thread::sleep(Duration::from_millis(ms));
                    socket.set_nonblocking(true).unwrap();
                    while socket.recv_from(&mut [0; 8]).is_ok() {}
                    socket.set_nonblocking(false).unwrap();
                    driver = hello(&socket);
                }
            }
        }
    });
    (address, handle)
}

fn bench(address: SocketAddr) -> String {
    format!(
        "[bind]\npad = \"skin\"\narm = \"arm\"\n[devices.skin]\ntype = \"udp_pad\"\naddress = \"{address}\"\n\
         silence_s = 0.1\n[devices.arm]\ntype = \"mock_arm\"\nrobot = \"builtin:lwr4p.toml\"\n\
         [facts.pad]\nmount = {{ xyz = [0.0, 0.0, 0.03], rpy = [0.0, 0.0, 0.0] }}\n\
         [limits]\nworkspace_min_m = [-0.8, -0.4, 0.1]\nworkspace_max_m = [-0.3, 0.4, 0.7]\n"
    )
}

/// The pad states no pressure.
const SETPOINT: &str = "nodes.error.setpoint.pressure=0.1";

#[test]
fn a_pad_that_goes_silent_holds_the_arm_until_it_is_back() {
    let (address, handle) = pad(vec![Act::Frames(50), Act::Silence(400), Act::Frames(100)]);
    let request = Request::file(workspace().join("graphs/force.toml")).set("policy.device='hold'").set(SETPOINT);
    let request = Request { bench_text: Some(bench(address)), ..request };
    let compiled = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(compiled);
    let mut fastest = Vec::new();
    let options = RunOptions { duration: Some(1.5), ..RunOptions::default() };
    let outcome = run(&mut engine, &options, &mut |engine| {
        let command = engine.commands("arm").unwrap();
        fastest.push((engine.now(), command.iter().fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()))));
    });
    assert_eq!(outcome.unwrap().end, End::Duration);
    handle.join().unwrap();
    let all: Vec<String> = engine.halts().iter().map(|halt| halt.fault.to_string()).collect();
    let lost = engine.halts().iter().find(|halt| matches!(halt.fault.cause, Cause::Lost(_)));
    let lost = lost.unwrap_or_else(|| panic!("{all:?}"));
    assert_eq!((lost.fault.node.as_str(), lost.fault.port.as_deref()), ("pad", Some("image")));
    assert!(lost.fault.to_string().contains("no frame for 100ms"), "{all:?}");
    let until = lost.until.expect("it is over when the pad is back");
    let held = until - lost.fault.time;
    assert!((150_000_000..900_000_000).contains(&held), "{held} ns");
    let moves = |from: i64, to: i64| fastest.iter().filter(|(at, _)| (from..to).contains(at)).any(|(_, v)| *v > 0.0);
    assert!(moves(0, lost.fault.time), "it approaches");
    assert!(!moves(until - 50_000_000, until), "it is held");
    assert!(moves(until + 100_000_000, i64::MAX), "it goes on");
    let (device, counts) = engine.counts().next().unwrap();
    assert_eq!((device, counts[0].0), ("skin", "reconnects"));
}

#[test]
fn the_summary_of_a_run_says_what_a_device_has_counted() {
    let (address, handle) = pad(vec![Act::Frames(5), Act::Nonsense, Act::Nonsense, Act::Frames(20)]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bench.toml");
    std::fs::write(&file, bench(address)).unwrap();
    let bench = format!("--bench={}", file.display());
    let Said { code, out, err } = say(&["run", "graphs/force.toml", &bench, "--for", "300ms", "--set", SETPOINT]);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("device `skin`: 2 bad frames\n"), "{out}");
    handle.join().unwrap();
}
