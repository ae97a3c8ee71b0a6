//! A Universal Robots e-Series, from the side of the controller: RTDE for its state, a port for scripts, and the reverse
//! interface for commands.
//!
//! A script that arrives is not interpreted. The controller takes the sockets that it opens, dials them, and does what
//! such a script does: it reads messages of eight `i32` BE from the reverse interface, each with the time that the next
//! one may take, and follows speedj. When a message is late, it stops with stopj(4.0), and the program ends.

mod kinematics;
mod program;
mod rtde;
mod values;

use std::io::{self, ErrorKind, Read};
use std::net::{Ipv4Addr, TcpListener, TcpStream};

use serde_json::{Value, json};

use self::kinematics::tcp_pose;
use self::program::{Program, State};
use self::rtde::Rtde;
use self::values::Values;
use super::ArmWire;
use super::log::Log;
use super::simulation::Posture;

const JOINTS: usize = 6;
/// Time between two beats of an e-Series [s].
const PERIOD: f64 = 0.002;
/// Bytes of the longest script.
const MAX_SCRIPT: usize = 1 << 20;
/// Share of its maximum speed that a joint may be asked to exceed.
const MARGIN: f64 = 1.02;
const SAFETY_NORMAL: i32 = 1;
const SAFETY_PROTECTIVE_STOP: i32 = 3;

/// The controller.
pub(super) struct Ur {
    rtde: Rtde,
    scripts: TcpListener,
    /// Scripts that are on their way.
    arriving: Vec<(TcpStream, Vec<u8>)>,
    reverse: Option<String>,
    /// Acceleration of speedj [rad/s²].
    acceleration: f64,
    /// Maximum speed of each joint [rad/s].
    speeds: Vec<f64>,
    program: Option<Program>,
    velocity: [f64; JOINTS],
    safety_mode: i32,
    counts: Counts,
}

#[derive(Default)]
struct Counts {
    scripts: u64,
    programs: u64,
    messages: u64,
    timeouts: u64,
    stops: u64,
    faults: u64,
    last_fault: String,
}

impl Ur {
    /// Listens on the ports of RTDE and of scripts.
    ///
    /// # Errors
    /// If a port is taken, or the arm has not six joints.
    pub(super) fn open(
        [rtde, script]: [u16; 2],
        reverse: Option<String>,
        acceleration: f64,
        speeds: Vec<f64>,
    ) -> io::Result<Self> {
        if speeds.len() != JOINTS {
            return Err(io::Error::other(format!("a UR has {JOINTS} joints, but the bench has {}", speeds.len())));
        }
        let scripts = TcpListener::bind((Ipv4Addr::LOCALHOST, script))?;
        scripts.set_nonblocking(true)?;
        Ok(Self {
            rtde: Rtde::open(rtde)?,
            scripts,
            arriving: Vec::new(),
            reverse,
            acceleration,
            speeds,
            program: None,
            velocity: [0.0; JOINTS],
            safety_mode: SAFETY_NORMAL,
            counts: Counts::default(),
        })
    }

    /// Takes the scripts that have arrived. The last one runs.
    fn take_scripts(&mut self) {
        while let Ok((stream, _)) = self.scripts.accept() {
            if stream.set_nonblocking(true).is_ok() && self.arriving.len() < 4 {
                self.arriving.push((stream, Vec::new()));
            }
        }
        let mut complete = Vec::new();
        self.arriving.retain_mut(|(stream, text)| {
            let mut bytes = [0; 8192];
            let is_open = loop {
                match stream.read(&mut bytes) {
                    Ok(0) => break false,
                    Ok(count) => text.extend_from_slice(&bytes[..count]),
                    Err(error) => break error.kind() == ErrorKind::WouldBlock,
                }
                if text.len() > MAX_SCRIPT {
                    text.clear();
                    break false;
                }
            };
            if is_complete(text) {
                complete.push(std::mem::take(text));
            }
            is_open
        });
        for script in complete {
            self.counts.scripts += 1;
            match Program::start(&String::from_utf8_lossy(&script), self.reverse.as_deref()) {
                Ok(program) => {
                    self.counts.programs += 1;
                    self.program = Some(program);
                }
                Err(error) => self.counts.last_fault = format!("the script cannot open its sockets: {error}"),
            }
        }
    }

    /// Follows the program, and returns the velocities until the next beat [rad/s].
    fn follow(&mut self, log: &mut Log) -> io::Result<Vec<f64>> {
        let (mut target, mut acceleration) = ([0.0; JOINTS], program::STOP_ACCELERATION);
        if let Some(program) = &mut self.program {
            self.counts.messages += program.receive(log)?;
            match program.state() {
                State::Moves(velocity) => (target, acceleration) = (velocity, self.acceleration),
                State::Late => {
                    self.counts.timeouts += 1;
                    self.counts.last_fault = "no message in time".into();
                    self.program = None;
                }
                State::Ended => {
                    self.counts.stops += 1;
                    self.program = None;
                }
            }
        }
        let is_too_fast = |(v, limit): (&f64, &f64)| v.abs() > MARGIN * limit;
        if let Some(joint) = target.iter().zip(&self.speeds).position(is_too_fast) {
            self.counts.faults += 1;
            self.counts.last_fault = format!("joint {} is asked for {:.3} rad/s", joint + 1, target[joint]);
            self.safety_mode = SAFETY_PROTECTIVE_STOP;
            self.program = None;
            target = [0.0; JOINTS];
        }
        let step = acceleration * PERIOD;
        for (v, target) in self.velocity.iter_mut().zip(target) {
            *v += (target - *v).clamp(-step, step);
        }
        Ok(self.velocity.to_vec())
    }

    fn values(&self, posture: &Posture) -> Values {
        let six = |list: &[f64]| std::array::from_fn(|i| list.get(i).copied().unwrap_or(0.0));
        let position: [f64; JOINTS] = six(&posture.position);
        // The load presses against the z of the pad; the axes are those of the base.
        let force = posture.sensor.rotation * nalgebra::Vector3::new(0.0, 0.0, -posture.force);
        Values {
            timestamp: posture.time,
            actual_q: position,
            actual_qd: six(&posture.speed),
            target_q: six(&posture.equilibrium),
            target_qd: self.velocity,
            tcp_pose: tcp_pose(&position),
            tcp_force: [force.x, force.y, force.z, 0.0, 0.0, 0.0],
            safety_mode: self.safety_mode,
            runtime_state: if self.program.is_some() { 2 } else { 1 },
        }
    }
}

/// Whether a script has its last line.
fn is_complete(text: &[u8]) -> bool {
    text.ends_with(b"\nend\n") || text.ends_with(b"\nend\r\n")
}

impl ArmWire for Ur {
    fn beat(&mut self, posture: &Posture, log: &mut Log) -> io::Result<Vec<f64>> {
        self.take_scripts();
        let velocity = self.follow(log)?;
        self.rtde.serve(&self.values(posture))?;
        Ok(velocity)
    }

    fn period(&self) -> f64 {
        PERIOD
    }

    fn place(&self) -> Value {
        let script = self.scripts.local_addr().map(|address| address.port()).ok();
        json!({ "wire": "ur", "rtde_port": self.rtde.port(), "script_port": script })
    }

    fn counts(&self) -> Value {
        let Counts { scripts, programs, messages, timeouts, stops, faults, last_fault } = &self.counts;
        json!({
            "scripts": scripts, "programs": programs, "messages": messages, "timeouts": timeouts, "stops": stops,
            "faults": faults, "last_fault": last_fault, "is_running": self.program.is_some(),
            "safety_mode": self.safety_mode, "rtde_packets": self.rtde.packets(),
        })
    }
}
