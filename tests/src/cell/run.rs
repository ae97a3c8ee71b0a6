//! The loop of a cell: it steps the simulation with the clock, sends images and beats of the robot, and writes down
//! what arrives.

use std::io::{self, BufRead, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use signal_hook::consts::SIGTERM;
use signal_hook::flag;

use super::flexitac::Flexitac;
use super::log::{Log, fastest};
use super::lwr::{Lwr, Script};
use super::myrmex::{Identity, Myrmex};
use super::setup::{ArmSetup, PadSetup, Setup};
use super::simulation::Simulation;
use super::tcp_pad::TcpPad;
use super::ur::Ur;
use super::{ArmWire, PadWire};

/// Delay from which on the cell's own time stands still, because the machine is too slow.
const MAX_DELAY: Duration = Duration::from_millis(50);
/// Longest sleep, so that the end is seen.
const MAX_SLEEP: Duration = Duration::from_millis(20);

/// Runs a cell to its end. The first line of `out` says where it is served, the last one has its figures.
///
/// # Errors
/// What cannot be read or served, and a failure of the simulation.
pub fn run(setup: &Setup, out: &mut dyn Write) -> Result<(), String> {
    let simulation = Simulation::open(&setup.bench, &setup.set)?;
    let text = |error: io::Error| error.to_string();
    let pad = pad(&setup.pad).map_err(|error| format!("the pad: {error}"))?;
    let arm = arm(&setup.arm, &simulation).map_err(|error| format!("the arm: {error}"))?;
    let words = Words::listen().map_err(text)?;
    writeln!(out, "{}", json!({ "pad": pad.place(), "arm": arm.place() })).and_then(|()| out.flush()).map_err(text)?;
    let begin = Instant::now();
    let log = Log::begin(setup.log.as_deref(), simulation.joints().len(), begin).map_err(text)?;
    let mut cell = Cell { simulation, pad, arm, log, begin, delayed: Duration::ZERO, velocity: Vec::new() };
    let ended = cell.follow(setup.for_s, &words, out);
    let figures = cell.figures().map_err(text)?;
    // Whoever has started the cell may be gone.
    let _ = writeln!(out, "{figures}").and_then(|()| out.flush());
    ended
}

fn pad(setup: &PadSetup) -> io::Result<Box<dyn PadWire>> {
    Ok(match setup.clone() {
        PadSetup::Flexitac { full_scale, link } => Box::new(Flexitac::open(link.as_deref(), full_scale)?),
        PadSetup::Myrmex { full_scale, link, uid, stamp_unit_us, serial } => {
            let identity = Identity { uid, serial, stamp_unit_us, full_scale };
            Box::new(Myrmex::open(link.as_deref(), identity)?)
        }
        PadSetup::Tcp { full_scale, port } => Box::new(TcpPad::open(port, full_scale)?),
    })
}

fn arm(setup: &ArmSetup, simulation: &Simulation) -> io::Result<Box<dyn ArmWire>> {
    let speeds: Vec<f64> = simulation.joints().iter().map(|joint| joint.speed).collect();
    Ok(match setup.clone() {
        ArmSetup::Lwr { to, period_ms, start_s, good_per_level, missed_per_level, restarts, offset_rad } => {
            let script = Script { start_s, good_per_level, missed_per_level, restarts, offset: offset_rad };
            Box::new(Lwr::open(&to, period_ms * 1e-3, script, speeds)?)
        }
        ArmSetup::Ur { rtde_port, script_port, reverse, acceleration } => {
            Box::new(Ur::open([rtde_port, script_port], reverse, acceleration, speeds)?)
        }
    })
}

/// What is written to the standard input of the cell.
struct Words {
    /// Whether it has ended, or SIGTERM has come.
    is_ending: Arc<AtomicBool>,
    /// Its lines, each with the time at which it came.
    lines: Receiver<(Instant, String)>,
}

impl Words {
    /// Listens to SIGTERM and to the standard input.
    fn listen() -> io::Result<Self> {
        let is_ending = Arc::new(AtomicBool::new(false));
        flag::register(SIGTERM, Arc::clone(&is_ending))?;
        let at_end = Arc::clone(&is_ending);
        let (send, lines) = channel();
        thread::Builder::new().name("input".into()).spawn(move || {
            for line in io::stdin().lock().lines().map_while(Result::ok) {
                // Whoever follows the cell may have ended.
                let _ = send.send((Instant::now(), line));
            }
            at_end.store(true, Ordering::SeqCst);
        })?;
        Ok(Self { is_ending, lines })
    }

    fn is_ending(&self) -> bool {
        self.is_ending.load(Ordering::SeqCst)
    }
}

struct Cell {
    simulation: Simulation,
    pad: Box<dyn PadWire>,
    arm: Box<dyn ArmWire>,
    log: Log,
    /// Moment at which the simulation's time was zero, as far as it has kept up.
    begin: Instant,
    /// By how much it has not kept up.
    delayed: Duration,
    /// Velocity of the joints until the next beat of the arm [rad/s].
    velocity: Vec<f64>,
}

impl Cell {
    fn follow(&mut self, for_s: Option<f64>, words: &Words, out: &mut dyn Write) -> Result<(), String> {
        let period = (self.arm.period() * 1e9).round() as i64;
        let end = for_s.map_or(i64::MAX, |end| (end * 1e9) as i64);
        self.velocity = vec![0.0; self.simulation.joints().len()];
        let mut beat = 0;
        while !words.is_ending() {
            self.answer(words, out).map_err(|error| error.to_string())?;
            let Some(image) = self.simulation.next_image() else { return Ok(()) };
            let now = image.min(beat);
            if now > end {
                return Ok(());
            }
            if !self.wait_for(now, words) {
                return Ok(());
            }
            self.simulation.step(now, &self.velocity)?;
            let posture = self.simulation.posture(now);
            if now == beat {
                beat += period;
                self.velocity = self.arm.beat(&posture, &mut self.log).map_err(|error| format!("the arm: {error}"))?;
                self.log.beat(posture.time, &self.velocity).map_err(|error| format!("the log: {error}"))?;
            }
            self.pad.serve().map_err(|error| format!("the pad: {error}"))?;
            if now == image {
                let is_sent = self.pad.send(self.simulation.counts(), posture.time);
                let is_sent = is_sent.map_err(|error| format!("the pad: {error}"))?;
                self.log.image(Instant::now(), is_sent, &posture).map_err(|error| format!("the log: {error}"))?;
            }
        }
        Ok(())
    }

    /// Sleeps until a time of the simulation [ns]. A cell that is too slow moves its start instead. Returns whether the
    /// cell goes on.
    fn wait_for(&mut self, time: i64, words: &Words) -> bool {
        let due = self.begin + Duration::from_nanos(time as u64);
        loop {
            let now = Instant::now();
            if now >= due {
                let delay = now - due;
                if delay > MAX_DELAY {
                    self.begin += delay;
                    self.delayed += delay;
                    self.log.begin_at(self.begin);
                }
                return true;
            }
            if words.is_ending() {
                return false;
            }
            thread::sleep((due - now).min(MAX_SLEEP));
        }
    }

    /// Answers each line of the standard input with the time at which it came, and how fast the arm moves now.
    fn answer(&self, words: &Words, out: &mut dyn Write) -> io::Result<()> {
        for (at, line) in words.lines.try_iter() {
            let time = at.saturating_duration_since(self.begin).as_secs_f64();
            writeln!(out, "{}", json!({ "told": line, "t_s": time, "speed_rad_s": fastest(&self.velocity) }))?;
            out.flush()?;
        }
        Ok(())
    }

    fn figures(&mut self) -> io::Result<Value> {
        let mut figures = self.log.end()?;
        figures["delayed_s"] = json!(self.delayed.as_secs_f64());
        figures["pad"] = self.pad.counts();
        figures["arm"] = self.arm.counts();
        Ok(figures)
    }
}
