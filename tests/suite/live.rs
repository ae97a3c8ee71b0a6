//! A live device: a sensor in another process, on the wall clock.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tactflow_runtime::device::{Attached, Description, Device, DeviceError, Driver, Link, Live, Opened, Output};
use tactflow_runtime::engine::{self, End, Engine, RunOptions};
use tactflow_runtime::fault::Cause;
use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::node::{Describe, Mistakes};
use tactflow_runtime::signal::{Scalar, ScalarShape, Unit};
use tactflow_tests::{catalogue, workspace};

use crate::record::record_live;
use crate::replay::ticks_of_replay;
use crate::tool::say;

const GRAPH: &str = "
[graph]
clock = \"a\"
[roles]
a = \"length\"
[nodes.count]
type = \"count\"
in.value = \"a.value\"
";

/// The peer and the port it listens on; it ends with the test.
struct Peer {
    child: Child,
    port: String,
}

impl Peer {
    fn start(count: u32, interval_s: f64, silence_s: f64, last_word: &str) -> Self {
        let script = workspace().join("tests/peers/numbers.py");
        let mut command = Command::new("python3");
        command.arg(script).args([&count.to_string(), &interval_s.to_string(), &silence_s.to_string(), last_word]);
        let mut child = command.stdout(Stdio::piped()).spawn().expect("python3 is there");
        let mut port = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut port).unwrap();
        Self { child, port: port.trim().to_owned() }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // A peer that has ended by itself cannot be killed, and need not.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A graph on a peer.
fn engine(peer: &Peer, graph: &str) -> Engine {
    let bench = format!(
        "devices.tcp.type = \"line_length\"\ndevices.tcp.address = \"127.0.0.1:{}\"\nbind.a = \"tcp\"",
        peer.port
    );
    let request = Request { bench_text: Some(bench), ..Request::text(graph) };
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    assert!(plan.is_live());
    Engine::new(plan)
}

/// Runs the graph on a peer; how it ended, and the steps and the ages [ms] of `count` after each tick.
fn run(peer: &Peer, duration: f64) -> (End, Vec<f64>, Vec<f64>) {
    let mut engine = engine(peer, GRAPH);
    let (mut steps, mut ages) = (Vec::new(), Vec::new());
    let options = RunOptions { duration: Some(duration), is_realtime: true, ..RunOptions::default() };
    let outcome = engine::run(&mut engine, &options, &mut |engine| {
        steps.push(engine.get("count.steps").copied().unwrap_or(0.0));
        ages.push(engine.mark("count.steps").stamp().age(engine.now()) as f64 * 1e-6);
    });
    (outcome.unwrap().end, steps, ages)
}

#[test]
fn every_sample_counts_once_and_silence_makes_it_old() {
    let peer = Peer::start(20, 0.02, 9.0, "0");
    let (end, steps, ages) = run(&peer, 1.5);
    assert_eq!(end, End::Duration);
    let last = *steps.last().unwrap();
    assert!((5.0..=20.0).contains(&last), "{last} of 20 samples; a late reader sees the newest only");
    assert!(steps.len() as f64 > last + 20.0, "a timer ticks on: {} ticks", steps.len());
    assert!(*ages.last().unwrap() > 200.0, "{ages:?}");
}

/// A driver whose samples are their own numbers, and the numbers of those that the newest commands answer.
struct Numbering {
    number: Output<Scalar>,
    answered: Output<Scalar>,
}

#[async_trait::async_trait]
impl Live for Numbering {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        for number in 0.. {
            let (stamp, answered) = (link.arrival(), link.commands().answers().map_or(-1.0, |number| number as f64));
            link.publish(|samples| {
                *samples.write(self.number, stamp, number) = number as f64;
                *samples.write(self.answered, stamp, number) = answered;
            });
            let stopped = link.stopped();
            tokio::select! {
                () = stopped => break,
                () = tokio::time::sleep(Duration::from_millis(1)) => {}
            }
        }
        Ok(())
    }
}

#[test]
fn a_driver_knows_which_sample_the_commands_answer() {
    let mut description = Description::every(0.001);
    let mut length = description.fills("length");
    let [number, answered] = ["value", "answered"].map(|name| length.output(name, ScalarShape::of(Unit::METRE)));
    let driver = Box::new(Numbering { number, answered });
    let mut graph = Attached::start("numbering", description, driver).unwrap();
    let newest = |graph: &mut Attached, output| {
        while !graph.receive() {
            std::thread::yield_now();
        }
        *graph.read(output).unwrap()
    };
    assert_eq!((newest(&mut graph, answered), newest(&mut graph, answered)), (-1.0, -1.0), "no command was sent");
    for _ in 0..100 {
        let seen = newest(&mut graph, number);
        // Samples that come later are not answered, even if the driver has published them already.
        std::thread::sleep(Duration::from_micros(1500));
        graph.send();
        let answers: Vec<f64> = std::iter::repeat_with(|| newest(&mut graph, answered)).take(3).collect();
        assert_eq!(answers[2], seen, "{answers:?}");
    }
    graph.stop("the test is over").unwrap();
}

/// A driver that panics.
#[derive(Describe)]
struct Brittle;

#[async_trait::async_trait]
impl Live for Brittle {
    async fn run(self: Box<Self>, _: Link) -> Result<(), DeviceError> {
        panic!("brittle")
    }
}

impl Device for Brittle {
    type Params = ();

    fn open((): ()) -> Result<Opened, Mistakes> {
        let mut description = Description::every(0.01);
        description.fills("length").output::<Scalar>("value", ScalarShape::of(Unit::METRE));
        Ok(Opened { description, driver: Driver::Live(Box::new(Self)) })
    }
}

#[test]
fn a_driver_that_panics_is_a_fault_of_its_device_and_is_not_started_again() {
    for reconnect in [false, true] {
        let (end, _) = run_device::<Brittle>("brittle", reconnect);
        let End::Fault(fault) = end else { panic!("{end:?}") };
        assert_eq!((fault.node.as_str(), fault.cause), ("b", Cause::Device("it panicked: brittle".into())));
    }
}

/// Runs a graph on a device of this type for a second.
fn run_device<D: Device>(name: &str, reconnect: bool) -> (End, Engine) {
    let bench = format!("devices.b = {{ type = '{name}', reconnect = {reconnect} }}\nbind.a = 'b'");
    let request = Request { bench_text: Some(bench), ..Request::text(GRAPH) };
    let plan =
        compile(&catalogue().device::<D>(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let options = RunOptions { duration: Some(1.0), ..RunOptions::default() };
    let outcome = engine::run(&mut engine, &options, &mut |_| {}).unwrap();
    (outcome.end, engine)
}

/// A driver that ends with an error after five samples, at its first two starts. With `ends`, it forbids another one.
struct Flaky {
    value: Output<Scalar>,
    attempt: usize,
    ends: bool,
}

#[async_trait::async_trait]
impl Live for Flaky {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        assert_eq!(link.commands().answers(), None, "it has not sampled yet");
        for number in 0.. {
            if self.attempt < 2 && number == 5 {
                if self.ends {
                    link.forbid_return();
                }
                return Err(DeviceError(format!("attempt {} failed", self.attempt)));
            }
            let stamp = link.arrival();
            link.publish(|samples| *samples.write(self.value, stamp, number) = self.attempt as f64);
            let stopped = link.stopped();
            tokio::select! {
                () = stopped => break,
                () = tokio::time::sleep(Duration::from_millis(10)) => {}
            }
        }
        Ok(())
    }
}

/// Opens a driver that is the `attempt`-th one.
fn open_flaky(attempt: usize, ends: bool) -> Opened {
    let mut description = Description::every(0.01);
    let value = description.fills("length").output::<Scalar>("value", ScalarShape::of(Unit::METRE));
    Opened { description, driver: Driver::Live(Box::new(Flaky { value, attempt, ends })) }
}

macro_rules! flaky {
    ($name:ident, $attempts:ident, $ends:expr) => {
        static $attempts: AtomicUsize = AtomicUsize::new(0);

        /// A device whose driver fails twice.
        #[derive(Describe)]
        struct $name;

        impl Device for $name {
            type Params = ();

            fn open((): ()) -> Result<Opened, Mistakes> {
                Ok(open_flaky($attempts.fetch_add(1, Ordering::SeqCst), $ends))
            }
        }
    };
}

flaky!(FailsTwice, FAILS_TWICE, false);
flaky!(FailsOnce, FAILS_ONCE, false);
flaky!(FailsForGood, FAILS_FOR_GOOD, true);

#[test]
fn a_driver_that_fails_is_started_again_where_the_bench_says_so() {
    let (end, engine) = run_device::<FailsTwice>("fails_twice", true);
    let causes: Vec<String> = engine.halts().iter().map(|halt| halt.fault.to_string()).collect();
    assert_eq!(end, End::Duration, "{causes:?}");
    assert!(causes.iter().any(|cause| cause.contains("attempt 0 failed")), "{causes:?}");
    assert_eq!(engine.counts().next(), Some(("b", &[("restarts", 2)][..])));
    assert_eq!(engine.get::<Scalar>("a.value"), Some(&2.0), "the third driver samples");
    assert!(engine.halts().iter().all(|halt| halt.until.is_some()), "{causes:?}");
}

#[test]
fn a_driver_that_fails_ends_the_run_without_reconnect_or_if_it_forbids_a_return() {
    for (end, _) in [run_device::<FailsOnce>("fails_once", false), run_device::<FailsForGood>("fails_for_good", true)] {
        let End::Fault(fault) = end else { panic!("{end:?}") };
        assert_eq!(fault.cause, Cause::Device("attempt 0 failed".into()));
    }
}

#[test]
fn a_driver_that_blocks_stops_neither_the_ticks_nor_the_other_drivers_nor_the_end_of_the_run() {
    let peer = Peer::start(50, 0.01, 9.0, "0");
    let bench_text = Some(format!(
        "devices.b.type = 'blocking'\nbind.a = 'b'\ndevices.tcp.type = 'line_length'\nbind.other = 'tcp'\n\
         devices.tcp.address = '127.0.0.1:{}'",
        peer.port
    ));
    let graph = GRAPH.replace("\na = \"length\"\n", "\na = \"length\"\nother = \"length\"\n");
    let request = Request { bench_text, ..Request::text(format!("{graph}\n[policy]\ndevice = \"hold\"\n")) };
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let begin = std::time::Instant::now();
    let options = RunOptions { duration: Some(0.5), is_realtime: true, ..RunOptions::default() };
    let mut engine = Engine::new(plan);
    let outcome = engine::run(&mut engine, &options, &mut |_| {}).unwrap();
    assert_eq!(outcome.end, End::Duration);
    assert!(outcome.ticks >= 10, "a timer ticks on: {} ticks", outcome.ticks);
    assert!(engine.get::<Scalar>("other.value").is_some(), "the other device is read");
    assert!(begin.elapsed().as_secs() < 10, "the end does not wait for the driver");
}

#[test]
fn a_clock_device_that_is_late_is_waited_for() {
    // Every 15 ms where 10 are nominal: late, but within the three periods of patience. A timer that does not wait would
    // tick once or twice between two samples. On a busy machine, some are later than that.
    let (_, steps, _) = run(&Peer::start(100, 0.015, 9.0, "0"), 1.4);
    let first = steps.iter().position(|count| *count > 0.0).expect("there are samples");
    let last = steps.iter().rposition(|count| *count < steps[steps.len() - 1]).expect("there are several") + 1;
    let (ticks, samples) = (last - first, steps[last] - steps[first]);
    let between = ticks as f64 - samples;
    assert!(samples >= 20.0 && between * 2.0 < samples, "{between} ticks of a timer and {samples} samples: {steps:?}");
}

#[test]
fn a_peer_that_hangs_up_or_talks_nonsense_is_a_fault_of_the_device() {
    for (last_word, message) in [("hang-up", "the peer hung up"), ("garbage", "`garbage` is not a number")] {
        let (end, ..) = run(&Peer::start(5, 0.01, 0.0, last_word), 5.0);
        let End::Fault(fault) = end else { panic!("{end:?}") };
        assert_eq!((fault.node.as_str(), fault.cause), ("tcp", Cause::Device(message.into())));
    }
}

#[test]
fn a_peer_that_hangs_up_is_held_and_told_when_the_graph_says_so() {
    let peer = Peer::start(5, 0.01, 0.0, "hang-up");
    let mut engine = engine(&peer, &format!("{GRAPH}\n[policy]\ndevice = \"hold\"\n"));
    let options = RunOptions { duration: Some(0.6), ..RunOptions::default() };
    let outcome = engine::run(&mut engine, &options, &mut |_| {}).unwrap();
    assert_eq!(outcome.end, End::Duration);
    assert!(outcome.ticks >= 20, "a timer ticks on without the clock device: {} ticks", outcome.ticks);
    // That the clock is silent may be seen first, so the device is the reason of this halt or of the next.
    let lost = engine.halts().iter().find(|halt| matches!(halt.fault.cause, Cause::Device(_)));
    let causes: Vec<String> = engine.halts().iter().map(|halt| halt.fault.to_string()).collect();
    let lost = lost.unwrap_or_else(|| panic!("{causes:?}"));
    assert_eq!((lost.fault.node.as_str(), &lost.fault.cause), ("tcp", &Cause::Device("the peer hung up".into())));
    assert_eq!(engine.halts().last().unwrap().until, None, "what is gone does not come back: {causes:?}");
}

#[test]
fn a_peer_that_is_not_there_is_a_fault_of_the_device() {
    let peer = Peer::start(1, 0.01, 0.0, "0");
    let nobody = Peer { port: "1".into(), child: Command::new("true").spawn().unwrap() };
    drop(peer);
    let (end, ..) = run(&nobody, 5.0);
    let End::Fault(fault) = end else { panic!("{end:?}") };
    assert!(matches!(&fault.cause, Cause::Device(message) if message.contains("127.0.0.1:1")), "{fault}");
}

/// Runs a graph on live devices, records it, and replays it without them. How the run ended.
fn recorded_and_replayed(plan: Compiled, request: &Request) -> End {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut engine = Engine::new(plan);
    let options = RunOptions { duration: Some(1.0), ..RunOptions::default() };
    let end = record_live(&mut engine, request, &path, &options);
    let ticks = ticks_of_replay(&path).unwrap_or_else(|why| panic!("{why}"));
    assert!(ticks >= 5, "{ticks} ticks");
    end
}

#[test]
fn a_live_device_is_recorded_by_the_tool_and_replayed_by_another_process() {
    let folder = tempfile::tempdir().unwrap();
    let [graph, run] = ["graph.toml", "run.mcap"].map(|name| folder.path().join(name));
    let peer = Peer::start(60, 0.02, 9.0, "0");
    let bench =
        format!("[bind]\na = 'tcp'\n[devices.tcp]\ntype = 'line_length'\naddress = '127.0.0.1:{}'\n", peer.port);
    std::fs::write(&graph, format!("{GRAPH}{bench}")).unwrap();
    let [graph, run] = [&graph, &run].map(|path| path.to_str().unwrap());
    let said = say(&["run", graph, "-q", "--for", "1s", "--record", run]);
    assert_eq!(said.code, 0, "{}", said.err);
    drop(peer);
    let said = say(&["replay", run, "-q"]);
    // A replay prints the halts of the run again.
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.out.ends_with(" ports: the same to the last bit\n"), "{}", said.out);
}

flaky!(FailsWhileRecorded, FAILS_WHILE_RECORDED, false);

#[test]
fn a_recorded_run_of_live_devices_comes_again_without_them() {
    let bench = "devices.b = { type = 'fails_while_recorded', reconnect = true }\nbind.a = 'b'";
    let request = Request { bench_text: Some(bench.into()), ..Request::text(GRAPH) };
    let plan = compile(&catalogue().device::<FailsWhileRecorded>(), &request);
    let plan = plan.unwrap_or_else(|report| panic!("{}", report.render(false)));
    assert_eq!(recorded_and_replayed(plan, &request), End::Duration);
    for (last_word, policy) in [("hang-up", "hold"), ("garbage", "fault"), ("0", "fault")] {
        let peer = Peer::start(30, 0.01, 0.3, last_word);
        let address = format!("devices.tcp.address = '127.0.0.1:{}'", peer.port);
        let bench = format!("devices.tcp.type = 'line_length'\n{address}\nbind.a = 'tcp'");
        let graph = format!("{GRAPH}\n[policy]\ndevice = \"{policy}\"\n");
        let request = Request { bench_text: Some(bench), ..Request::text(graph) };
        let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
        let end = recorded_and_replayed(plan, &request);
        assert_eq!(matches!(end, End::Fault(_)), last_word == "garbage", "{end:?}");
    }
}
