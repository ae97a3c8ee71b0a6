//! Clocks of devices: a simulator with a clock of its own, how old its frames are for the graph and how soon each is
//! answered; and clocks that start late or come late.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tactflow_runtime::device::{Description, Device, DeviceError, Driver, Link, Live, Opened, Output};
use tactflow_runtime::engine::{self, Engine, Halt, RunOptions};
use tactflow_runtime::fault::Cause;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::node::{Describe, Mistakes, Param};
use tactflow_runtime::signal::{Joints, Scalar, ScalarShape, Unit};
use tactflow_tests::{catalogue, workspace};

/// The smallest delay of a frame.
const DELAY: Duration = Duration::from_millis(2);
/// What frame `i` adds to the first joint, by which it is recognised [rad].
const MARK: f64 = 1e-7;
const START: [f64; 7] = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0];

/// A simulator, and how its frames travel.
#[derive(Debug, Clone, Copy)]
struct Peer {
    /// How much faster its clock runs [1].
    drift: f64,
    /// Largest additional delay of a frame.
    jitter: Duration,
    /// Number of frames that arrive together.
    burst: u32,
    /// Number of frames of each 250 that it does not send.
    silent: u32,
    frames: u32,
    /// Time between two frames.
    period: Duration,
}

/// When a frame was measured, when it was sent, and when it was answered.
struct Frame {
    measured: Instant,
    sent: Instant,
    answered: Option<Instant>,
}

impl Peer {
    fn hello(self) -> Value {
        let names: Vec<String> =
            ["a1", "a2", "e1", "a3", "a4", "a5", "a6"].iter().map(|name| format!("lwr_{name}_joint")).collect();
        json!({
            "type": "hello", "proto": 1, "dt": self.period.as_secs_f64(), "lockstep": false, "task": "nothing", "joints": names,
            "q_min": vec![-2.9; 7], "q_max": vec![2.9; 7], "dq_max": vec![1.9; 7], "urdf": "lwr4p", "tip": "lwr_7_link",
            "T_es": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.03, 0, 0, 0, 1], "rows": 4, "cols": 4, "pitch": 0.005,
            "counts_per_unit": 100, "newton_per_unit": 0.1, "threshold_units": 0.15,
        })
    }

    /// Serves one graph. Returns the frames that were sent, each with its number.
    fn serve(self, mut stream: TcpStream) -> Vec<(u32, Frame)> {
        stream.set_nodelay(true).unwrap();
        writeln!(stream, "{}", self.hello()).unwrap();
        let answers = BufReader::new(stream.try_clone().unwrap());
        let commanded = Arc::new(Mutex::new([0.0; 7]));
        let command = Arc::clone(&commanded);
        let answers = thread::spawn(move || {
            let mut seen = Vec::new();
            for line in answers.lines().map_while(Result::ok) {
                let message: Value = serde_json::from_str(&line).unwrap();
                seen.extend(message["seq"].as_u64().map(|seq| (seq as u32, Instant::now())));
                let velocities = message["dq"].as_array().into_iter().flatten().filter_map(Value::as_f64);
                command.lock().unwrap().iter_mut().zip(velocities).for_each(|(command, velocity)| *command = velocity);
            }
            seen
        });
        let begin = Instant::now() + Duration::from_millis(100);
        let mut frames = Vec::new();
        // The arm is held, and its springs yield as they are commanded.
        let mut equilibrium = START;
        for i in (1..=self.frames).filter(|i| i % 250 >= self.silent) {
            let measured = begin + self.period * i;
            // A number from 0 to 1, the same in each run.
            let random = f64::from(i.wrapping_mul(2_654_435_769) >> 8) / f64::from(1 << 24);
            let held = self.period * (self.burst - 1 - i % self.burst);
            let due = measured + DELAY + held + self.jitter.mul_f64(random);
            thread::sleep(due.saturating_duration_since(Instant::now()));
            let t = 500.0 + self.period.as_secs_f64() * f64::from(i) * (1.0 + self.drift);
            let mut q = START;
            q[0] += MARK * f64::from(i);
            for (joint, command) in equilibrium.iter_mut().zip(*commanded.lock().unwrap()) {
                *joint += command * self.period.as_secs_f64();
            }
            let frame = json!({"type": "obs", "seq": i, "t": t, "q": q, "dq": vec![0.0; 7], "q_eq": equilibrium, "img": vec![0; 16]});
            let sent = Instant::now();
            if writeln!(stream, "{frame}").is_err() {
                break;
            }
            frames.push((i, Frame { measured, sent, answered: None }));
        }
        let _ = writeln!(stream, "{}", json!({"type": "end"}));
        let _ = stream.shutdown(std::net::Shutdown::Write);
        for (seq, at) in answers.join().unwrap() {
            // Later answers to the same frame carry newer commands.
            let frame = frames.iter_mut().find(|(i, _)| *i == seq);
            frame.map(|(_, frame)| frame.answered.get_or_insert(at));
        }
        frames
    }
}

/// What a run shows, after the first five seconds: the errors of the ages, and the times from a frame to its command [s],
/// both from the smallest to the largest.
struct Seen {
    errors: Vec<f64>,
    answers: Vec<f64>,
    /// Number of frames that were answered, from the start.
    answered: usize,
    halts: Vec<Halt>,
}

fn run(peer: Peer) -> Seen {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let peer = thread::spawn(move || peer.serve(listener.accept().unwrap().0));
    let graphs = workspace().join("graphs");
    let request = Request::file(graphs.join("hybrid.toml")).bench(graphs.join("benches/lockstep.toml"));
    let request = request.set(format!("devices.bench.address={address}"));
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let (mut epoch, mut stamps) = (None::<Instant>, Vec::new());
    let options = RunOptions { sends: vec![(1e6, "stop".into())], ..RunOptions::default() };
    engine::run(&mut engine, &options, &mut |engine| {
        // The tick began at least this long ago.
        let zero = Instant::now() - Duration::from_nanos(engine.now() as u64);
        epoch = Some(epoch.map_or(zero, |epoch| epoch.min(zero)));
        if let Some(Joints(q)) = engine.get::<Joints>("arm.position") {
            stamps.push((((q[0] - START[0]) / MARK).round() as u32, engine.mark("arm.position").stamp().nanos));
        }
    })
    .unwrap();
    stamps.dedup();
    let (frames, epoch) = (peer.join().unwrap(), epoch.unwrap());
    let answered = frames.iter().filter(|(_, frame)| frame.answered.is_some()).count();
    let late = frames[0].1.measured + Duration::from_secs(5);
    let frames: Vec<&(u32, Frame)> = frames.iter().filter(|(_, frame)| frame.measured > late).collect();
    let error = |(number, stamp): &(u32, i64)| {
        let (_, frame) = frames.iter().find(|(i, _)| i == number)?;
        let stamp = epoch + Duration::from_nanos(*stamp as u64);
        let truth = frame.measured + DELAY;
        Some((stamp - truth.min(stamp)).max(truth - stamp.min(truth)).as_secs_f64())
    };
    let sorted = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values
    };
    // Of several frames that arrive together, the newest is answered.
    let answer = |(_, frame): &&(u32, Frame)| Some((frame.answered? - frame.sent).as_secs_f64());
    Seen {
        answered,
        halts: engine.halts().to_vec(),
        errors: sorted(stamps.iter().filter_map(error).collect()),
        answers: sorted(frames.iter().copied().filter_map(|frame| answer(&frame)).collect()),
    }
}

/// Returns the value below which a share of the values is.
fn quantile(values: &[f64], share: f64) -> f64 {
    values[((values.len() - 1) as f64 * share) as usize]
}

#[test]
fn ages_are_true_and_frames_are_answered_at_once_whatever_the_clock_of_the_simulator_does() {
    let steady =
        Peer { drift: 0.0, jitter: Duration::ZERO, burst: 1, silent: 0, frames: 900, period: Duration::from_millis(8) };
    let peers = [
        Peer { drift: 1e-4, ..steady },
        Peer { drift: 0.05, jitter: Duration::from_millis(5), ..steady },
        Peer { drift: -0.05, jitter: Duration::from_millis(5), silent: 60, ..steady },
        Peer { drift: -0.005, burst: 3, ..steady },
    ];
    let runs: Vec<_> = peers.map(|peer| (peer, thread::spawn(move || run(peer)))).into_iter().collect();
    for (peer, run) in runs {
        let seen = run.join().unwrap();
        assert!(seen.errors.len() > 50, "{peer:?}: {} frames, halts {:?}", seen.errors.len(), seen.halts);
        let [error, answer] =
            [&seen.errors, &seen.answers].map(|values| [0.5, 0.99].map(|share| quantile(values, share)));
        // Half of them, since a busy machine delays both sides.
        assert!(error[0] < 0.001, "{peer:?}: {error:?} s");
        assert!(answer[0] < 2.0 * peer.period.as_secs_f64(), "{peer:?}: {answer:?} s");
    }
}

/// A length that begins late, and then comes in intervals of its own; its period is 10 ms.
#[derive(Describe)]
#[describe(name = "late_length")]
struct Late {
    value: Output<Scalar>,
    start: Duration,
    interval: Duration,
}

/// Parameters of `late_length`.
#[derive(Debug, Clone, Param)]
struct LateParams {
    /// Time of the first sample.
    #[param(unit = "ms")]
    start_ms: f64,
    /// Time between two samples.
    #[param(unit = "ms", default = 10.0)]
    interval_ms: f64,
}

impl Device for Late {
    type Params = LateParams;

    fn open(params: LateParams) -> Result<Opened, Mistakes> {
        let mut description = Description::every(0.01);
        let value = description.fills("length").output("value", ScalarShape::of(Unit::METRE));
        let [start, interval] = [params.start_ms, params.interval_ms].map(|ms| Duration::from_secs_f64(ms * 1e-3));
        Ok(Opened { description, driver: Driver::Live(Box::new(Self { value, start, interval })) })
    }
}

#[async_trait::async_trait]
impl Live for Late {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let mut next = Instant::now() + self.start;
        for number in 1.. {
            let stopped = link.stopped();
            tokio::select! {
                () = tokio::time::sleep_until(next.into()) => {}
                () = stopped => break,
            }
            let stamp = link.arrival();
            link.publish(|samples| *samples.write(self.value, stamp, number) = number as f64);
            next += self.interval;
        }
        Ok(())
    }
}

/// Runs a graph whose clock is a late length. `observe` is called after each tick.
fn run_late(params: &str, seconds: f64, observe: &mut dyn FnMut(&Engine)) -> Engine {
    let graph = "graph.clock = 'a'\nroles.a = 'length'\nnodes.count = { type = 'count', in.value = 'a.value' }\n";
    let bench = format!("bind.a = 'late'\ndevices.late = {{ type = 'late_length', {params} }}\n");
    let request = Request { bench_text: Some(bench), ..Request::text(graph) };
    let plan =
        compile(&catalogue().device::<Late>(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let options = RunOptions { duration: Some(seconds), ..RunOptions::default() };
    engine::run(&mut engine, &options, observe).unwrap();
    engine
}

#[test]
fn a_live_clock_that_starts_slowly_holds_nothing_and_one_that_never_starts_is_named() {
    let engine = run_late("start_ms = 1000", 1.4, &mut |_| {});
    assert!(engine.halts().is_empty(), "{:?}", engine.halts());
    assert!(engine.get::<Scalar>("count.steps").is_some_and(|steps| *steps > 5.0));
    let engine = run_late("start_ms = 1e6", 2.4, &mut |_| {});
    let halt = &engine.halts()[0];
    assert!(matches!(halt.fault.cause, Cause::NeverSampled | Cause::SilentClock), "{halt:?}");
    assert!((2_000_000_000..2_300_000_000).contains(&halt.fault.time), "{halt:?}");
}

#[test]
fn the_tick_of_a_timer_does_not_take_the_place_of_a_sample() {
    // A timer ticks 30 ms after the last sample, and the sample comes one to three milliseconds later.
    for interval in [31.0, 32.0, 33.0] {
        let (mut ages, mut last) = (Vec::new(), 0.0);
        run_late(&format!("start_ms = 0, interval_ms = {interval:.1}"), 1.2, &mut |engine| {
            let steps = engine.get::<Scalar>("count.steps").copied().unwrap_or(0.0);
            if steps > last {
                ages.push(engine.mark("a.value").stamp().age(engine.now()) as f64 * 1e-9);
                last = steps;
            }
        });
        ages.sort_by(f64::total_cmp);
        assert!(ages.len() > 25, "{interval} ms: {} samples", ages.len());
        // The next tick of the timer is 10 ms later.
        assert!(quantile(&ages, 0.5) < 0.005, "{interval} ms: {ages:?}");
    }
}

#[test]
fn a_slow_simulator_keeps_its_lease_and_a_flood_of_frames_keeps_no_command_back() {
    let slow = Peer {
        drift: 0.0,
        jitter: Duration::ZERO,
        burst: 1,
        silent: 0,
        frames: 25,
        period: Duration::from_millis(100),
    };
    let seen = run(slow);
    // A peer that takes long to end is silent after its last frame, which makes the 26th tick.
    let halts: Vec<_> = seen.halts.iter().filter(|halt| halt.fault.tick <= 25).collect();
    assert!(halts.is_empty(), "{halts:?}");
    assert!(seen.answered > 12, "{} of 25 frames are answered", seen.answered);
    // Frames whose times say 8 ms come as fast as the connection takes them.
    let flood = Peer { frames: 20_000, period: Duration::from_micros(1), ..slow };
    let seen = run(flood);
    assert!(seen.answered > 100, "{} frames are answered", seen.answered);
}
