//! What moves stops by itself: a tick that hangs, a process that is stopped, a driver that blocks.

use std::fs;
use std::io::Write;
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use tactflow_runtime::engine::{self, End, Engine, Outcome, RunOptions};
use tactflow_runtime::fault::Cause;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::record::OutputFile;
use tactflow_runtime::recording::{RecordRequest, RunRecorder};
use tactflow_runtime::source::Code;
use tactflow_tests::catalogue;

use crate::cli::in_new_folder;
use crate::replay::ticks_of_replay;
use crate::tool::tool;

const GRAPH: &str = "
[graph]
clock = 'motor'

[roles]
motor = 'drive'

[commands]
motor.velocity = 'motor.wanted'
";

/// Time after the last tick within which the motor must be at rest: the lease, the ramp from 1 rad/s at 10 rad/s², and
/// what a busy machine adds.
const REST: Duration = Duration::from_millis(250);

/// A motor that listens, and what it was told: when, and which velocity [rad/s].
struct Motor {
    address: String,
    thread: thread::JoinHandle<Vec<(Instant, f64)>>,
}

impl Motor {
    /// Listens until nothing comes for a second.
    fn listen() -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = socket.local_addr().unwrap().to_string();
        let thread = thread::spawn(move || {
            let (mut told, mut datagram) = (Vec::new(), [0; 8]);
            socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
            while socket.recv(&mut datagram).is_ok() {
                told.push((Instant::now(), f64::from_le_bytes(datagram)));
                socket.set_read_timeout(Some(Duration::from_secs(1))).unwrap();
            }
            told
        });
        Self { address, thread }
    }

    fn told(self) -> Vec<(Instant, f64)> {
        self.thread.join().unwrap()
    }

    fn bench(&self) -> String {
        format!("bind.motor = 'motor'\ndevices.motor = {{ type = 'udp_motor', address = '{}' }}\n", self.address)
    }
}

/// Runs the graph on a motor for three seconds. `act` is called after each tick, on its thread.
fn run(set: &str, act: &mut dyn FnMut(&Engine)) -> (Outcome, Engine, Vec<(Instant, f64)>) {
    let motor = Motor::listen();
    let request = Request { bench_text: Some(motor.bench()), ..Request::text(GRAPH) }.set(set);
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    // With a word that is still to come, a stop does not end the run.
    let sends = vec![(2.0, "resume".to_owned()), (9.0, "stop".to_owned())];
    let options = RunOptions { duration: Some(3.0), sends, ..RunOptions::default() };
    let outcome = engine::run(&mut engine, &options, act).unwrap();
    (outcome, engine, motor.told())
}

/// Returns the largest speed between two moments [rad/s].
fn speed(told: &[(Instant, f64)], from: Instant, to: Instant) -> f64 {
    told.iter().filter(|(at, _)| (from..to).contains(at)).fold(0.0, |most, (_, velocity)| velocity.abs().max(most))
}

/// Checks that the velocity never changes faster than the motor bears [rad/s in 10 ms, less what a busy machine makes
/// of them].
fn assert_smooth(told: &[(Instant, f64)]) {
    for pair in told.windows(2) {
        let dt = (pair[1].0 - pair[0].0).as_secs_f64().max(0.01);
        let change = (pair[1].1 - pair[0].1).abs();
        assert!(change <= 10.0 * (dt + 0.03), "{change} rad/s in {dt} s");
    }
}

#[test]
fn a_tick_that_hangs_leaves_the_motor_at_rest_until_the_operator_resumes() {
    let mut hung = None;
    let (outcome, engine, told) = run("devices.motor.acceleration=10", &mut |engine| {
        if engine.now() > 500_000_000 && hung.is_none() {
            let begin = Instant::now();
            // It spins, as a node with an endless loop would.
            while begin.elapsed() < Duration::from_millis(600) {
                std::hint::spin_loop();
            }
            hung = Some(begin);
        }
    });
    let hung = hung.unwrap();
    assert_eq!(outcome.end, End::Duration);
    assert!(speed(&told, hung - Duration::from_millis(100), hung) > 0.9, "it moved before");
    assert_eq!(speed(&told, hung + REST, hung + Duration::from_millis(1300)), 0.0, "it rests, also after the hang");
    assert!(speed(&told, hung + Duration::from_millis(1900), hung + Duration::from_millis(2400)) > 0.9, "resumed");
    assert_eq!(told.last().unwrap().1, 0.0);
    assert_smooth(&told);
    let halt = &engine.halts()[0];
    assert_eq!((&halt.fault.cause, halt.fault.node.as_str()), (&Cause::LostLease, "motor"), "{:?}", engine.halts());
}

#[test]
fn a_tick_of_300_ms_loses_the_lease_and_one_that_is_a_little_late_does_not() {
    for (late, is_lost) in [(300, true), (25, false)] {
        let mut acted = None;
        let (_, engine, told) = run("devices.motor.acceleration=10", &mut |engine| {
            if engine.now() > 500_000_000 && acted.is_none() {
                thread::sleep(Duration::from_millis(late));
                acted = Some(Instant::now());
            }
        });
        let has_lost = engine.halts().iter().any(|halt| halt.fault.cause == Cause::LostLease);
        // A busy machine may make any tick late.
        assert!(has_lost || !is_lost, "{late} ms: {:?}", engine.halts());
        let acted = acted.unwrap();
        if is_lost {
            assert_eq!(speed(&told, acted, acted + Duration::from_millis(1000)), 0.0, "it rests until `resume`");
        }
        assert_smooth(&told);
    }
}

#[test]
fn a_hang_that_is_shorter_than_the_ramp_does_not_end_the_ramp() {
    // It stops for a second, from 1 rad/s. With nobody to resume, the run ends meanwhile, and waits for the ramp.
    for can_resume in [true, false] {
        let mut acted = None;
        let mut act = |engine: &Engine| {
            if engine.now() > 1_300_000_000 && acted.is_none() {
                acted = Some(Instant::now());
                thread::sleep(Duration::from_millis(90));
            }
        };
        let told = if can_resume {
            run("devices.motor.acceleration=1", &mut act).2
        } else {
            let motor = Motor::listen();
            let request = Request { bench_text: Some(motor.bench()), ..Request::text(GRAPH) };
            let plan = compile(&catalogue(), &request.set("devices.motor.acceleration=1")).unwrap();
            let outcome = engine::run(&mut Engine::new(plan), &RunOptions::default(), &mut act).unwrap();
            assert!(matches!(outcome.end, End::Fault(_)), "{:?}", outcome.end);
            motor.told()
        };
        let acted = acted.unwrap();
        let after = |ms: u64| acted + Duration::from_millis(ms);
        assert!(speed(&told, after(0), after(40)) > 0.9, "it moved before");
        assert!(speed(&told, after(300), after(500)) > 0.4, "it ramps for a second");
        let resting = if can_resume { after(1300)..acted + Duration::from_secs(9) } else { after(1300)..after(5000) };
        let is_moving = |(at, velocity): &&(Instant, f64)| resting.contains(at) && velocity.abs() > 0.0;
        // In the other case the word `resume` comes 700 ms after the hang.
        assert!(can_resume || told.iter().find(is_moving).is_none(), "it rests");
        assert_eq!(told.last().unwrap().1, 0.0);
        let largest = told.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs()).fold(0.0, f64::max);
        assert!(largest < 0.15, "a step of {largest} rad/s");
    }
}

#[test]
fn without_anybody_to_resume_a_lost_lease_ends_the_run() {
    let motor = Motor::listen();
    let request = Request { bench_text: Some(motor.bench()), ..Request::text(GRAPH) };
    let mut engine = Engine::new(compile(&catalogue(), &request).unwrap());
    let mut has_hung = false;
    let outcome = engine::run(&mut engine, &RunOptions::default(), &mut |engine| {
        if engine.now() > 300_000_000 && !std::mem::replace(&mut has_hung, true) {
            thread::sleep(Duration::from_millis(300));
        }
    });
    let End::Fault(fault) = outcome.unwrap().end else { panic!("it goes on") };
    assert_eq!(fault.cause, Cause::LostLease);
    assert_eq!(motor.told().last().unwrap().1, 0.0);
}

#[test]
fn a_driver_that_blocks_does_not_keep_another_device_from_its_commands() {
    let motor = Motor::listen();
    let bench = format!("{}\nbind.length = 'b'\ndevices.b.type = 'blocking'\n", motor.bench());
    let graph = format!("{GRAPH}\n[policy]\nstale = 'count'\n")
        .replace("motor = 'drive'", "motor = 'drive'\nlength = 'length'");
    let request = Request { bench_text: Some(bench), ..Request::text(graph) };
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let begin = Instant::now();
    let options = RunOptions { duration: Some(1.0), ..RunOptions::default() };
    let outcome = engine::run(&mut engine, &options, &mut |_| {}).unwrap();
    assert_eq!(outcome.end, End::Duration);
    let told = motor.told();
    assert!(speed(&told, begin, begin + Duration::from_secs(1)) > 0.9, "it moves");
    assert_eq!(told.last().unwrap().1, 0.0);
}

/// Sends a signal to a process.
fn signal(child: &Child, name: &str) {
    let kill = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
}

/// Starts the tool on a motor, and waits until the motor runs.
fn process(motor: &Motor) -> (tempfile::TempDir, Child) {
    let (folder, graph) = in_new_folder("graph.toml");
    let bench =
        format!("[bind]\nmotor = 'motor'\n[devices.motor]\ntype = 'udp_motor'\naddress = '{}'\n", motor.address);
    fs::write(&graph, format!("{GRAPH}{bench}")).unwrap();
    let mut command = tool(&["run", &graph, "--listen"]);
    let child = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    thread::sleep(Duration::from_millis(1000));
    (folder, child)
}

#[test]
fn a_process_that_was_stopped_and_continues_moves_nothing_until_the_operator_resumes() {
    let motor = Motor::listen();
    let (_folder, mut child) = process(&motor);
    signal(&child, "STOP");
    let stopped = Instant::now();
    thread::sleep(Duration::from_millis(700));
    signal(&child, "CONT");
    let continued = Instant::now();
    thread::sleep(Duration::from_millis(600));
    child.stdin.as_mut().unwrap().write_all(b"resume\n").unwrap();
    let resumed = Instant::now();
    thread::sleep(Duration::from_millis(700));
    signal(&child, "INT");
    assert!(child.wait().unwrap().code().is_some(), "it ends by itself");
    let told = motor.told();
    assert!(speed(&told, stopped - Duration::from_millis(300), stopped) > 0.9, "it moved before");
    assert_eq!(speed(&told, continued, resumed), 0.0, "the motor has stopped by itself, and nothing moves it");
    assert!(speed(&told, resumed, resumed + Duration::from_millis(700)) > 0.9, "it moves again");
    assert_eq!(told.last().unwrap().1, 0.0);
}

#[test]
fn a_motor_that_nothing_stops_does_not_load() {
    for (params, is_refused) in [
        ("silence_ms = 100", false),
        ("keeps_moving = true", true),
        ("keeps_moving = true\nwatchdog = 'a loop on the motor'", false),
    ] {
        let bench = format!("bind.motor = 'motor'\n[devices.motor]\ntype = 'udp_motor'\naddress = 'x:1'\n{params}\n");
        let request = Request { bench_text: Some(bench), ..Request::text(GRAPH) };
        let codes: Vec<Code> = match compile(&catalogue(), &request) {
            Ok(_) => Vec::new(),
            Err(report) => report.diagnostics.iter().map(|diagnostic| diagnostic.code).collect(),
        };
        assert_eq!(codes, if is_refused { vec![Code::UnwatchedDevice] } else { vec![] }, "{params}");
    }
}

#[test]
fn a_recorded_run_with_a_lost_lease_comes_again_without_the_motor() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let motor = Motor::listen();
    let request = Request { bench_text: Some(motor.bench()), ..Request::text(GRAPH) };
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let record = RecordRequest { request: &request, is_real: true, seed: None, path: None };
    let mut recorder = RunRecorder::start(OutputFile::create(&path).unwrap(), &mut engine, &record).unwrap();
    let sends = vec![(1.2, "resume".to_owned()), (9.0, "stop".to_owned())];
    let options = RunOptions { duration: Some(1.6), sends, ..RunOptions::default() };
    let mut has_hung = false;
    let outcome = engine::run(&mut engine, &options, &mut |engine| {
        recorder.record(engine, || false);
        if engine.now() > 500_000_000 && !has_hung {
            has_hung = true;
            thread::sleep(Duration::from_millis(300));
        }
    });
    let outcome = outcome.unwrap();
    recorder.end(&engine, &outcome.end);
    let recorded = recorder.finish(|_| true);
    assert!(recorded.error.is_none() && recorded.lost + recorded.lost_ports == 0, "{recorded:?}");
    motor.told();
    let halt = &engine.halts()[0];
    assert!(halt.fault.cause == Cause::LostLease && halt.until.is_some(), "{:?}", engine.halts());
    assert_eq!(ticks_of_replay(&path), Ok(outcome.ticks));
}
