//! A KUKA LWR 4+ with the Fast Research Interface 1.0, from the side of the controller.
//!
//! It sends its state (MSR, 916 bytes) in every period, and expects an answer (CMD, 376 bytes) within it. Answers in
//! time raise the quality of the connection, and missing ones lower it. The program on the robot waits in monitor mode
//! until the quality is perfect, and then calls friStart. In command mode the commanded joint positions move the
//! equilibrium of the compliant arm. A connection that is less than ok, and a step that is faster than a joint, take it
//! back to monitor mode, where the arm rests.

mod kinematics;
mod wire;

use std::io;
use std::net::{Ipv4Addr, SocketAddr, ToSocketAddrs, UdpSocket};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;
use std::time::Instant;

use serde_json::{Value, json};

use self::kinematics::flange;
use self::wire::{CMD_BYTES, Cmd, MSR_BYTES, MSR_ID, Msr};
use super::ArmWire;
use super::log::Log;
use super::simulation::Posture;

const JOINTS: usize = 7;
/// Flag of a CMD with joint positions.
const HAS_POSITION: u32 = 1;
/// Difference between a mirrored posture and the commanded one that the controller accepts: what 32 bits resolve [rad].
const MIRRORED: f64 = 1e-5;
/// Difference at friStart from which on the controller reports an interpolation error [rad].
const INTERPOLATION: f64 = 1e-3;
/// Share of its maximum speed that a joint may be asked to exceed, for the rounding of 32 bits.
const MARGIN: f64 = 1.02;
/// Answers that may wait to be read.
const MAX_WAITING: usize = 256;
/// Stiffness of the joints, which turns their lead into a torque [N m/rad].
const STIFFNESS: f64 = 200.0;
const PERFECT: u16 = 3;
const OK: u16 = 2;

/// What the program on the robot does.
pub(super) struct Script {
    /// Time with a perfect connection after which it calls friStart [s].
    pub(super) start_s: f64,
    /// Answers in time that raise the quality by one.
    pub(super) good_per_level: u32,
    /// Missing answers in a row that lower it by one.
    pub(super) missed_per_level: u32,
    /// Whether it calls friStart again after a drop.
    pub(super) restarts: bool,
    /// FRI joint offset [rad].
    pub(super) offset: f64,
}

/// An answer of the driver.
struct Answer {
    arrived: Instant,
    bytes: Vec<u8>,
}

/// The controller.
pub(super) struct Lwr {
    socket: UdpSocket,
    to: SocketAddr,
    answers: Receiver<Answer>,
    period: f64,
    script: Script,
    /// Maximum speed of each joint [rad/s].
    speeds: Vec<f64>,
    connection: Connection,
    is_commanding: bool,
    has_commanded: bool,
    /// Time since which the connection is perfect [s].
    perfect_since: Option<f64>,
    /// Joint positions of the last command [rad].
    target: Option<Vec<f64>>,
    /// Whether a command has come since the last beat, in time or late.
    has_command: bool,
    /// Velocity that the last command meant [rad/s].
    velocity: Vec<f64>,
    /// The KRL variables of the last answer, which come back to the driver.
    krl: [u8; 132],
    /// Flags of the last answer.
    flags: Option<u32>,
    counts: Counts,
}

/// The quality of the connection, from 0 (unacceptable) to 3 (perfect).
#[derive(Default)]
struct Connection {
    quality: u16,
    sequence: u16,
    reflected: u16,
    good: u32,
    missed: u32,
    has_answer: bool,
}

#[derive(Default)]
struct Counts {
    messages: u64,
    answers: u64,
    late: u64,
    missed: u64,
    rejected: u64,
    starts: u64,
    drops: u64,
    faults: u64,
    unmirrored: u64,
    interpolation_errors: u64,
    changed_flags: u64,
    last_fault: String,
}

impl Lwr {
    /// Opens the controller's socket. It sends its state to `to`.
    ///
    /// # Errors
    /// If `to` is no address, or there is no socket.
    pub(super) fn open(to: &str, period: f64, script: Script, speeds: Vec<f64>) -> io::Result<Self> {
        if speeds.len() != JOINTS {
            return Err(io::Error::other(format!("an LWR has {JOINTS} joints, but the bench has {}", speeds.len())));
        }
        let to = to.to_socket_addrs()?.next().ok_or_else(|| io::Error::other("`to` is no address"))?;
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        let listening = socket.try_clone()?;
        let (send, answers) = sync_channel(MAX_WAITING);
        thread::Builder::new().name("answers".into()).spawn(move || {
            // One byte more than an answer, so that a longer one is not taken for one.
            let mut bytes = [0; CMD_BYTES + 1];
            loop {
                // An error says that nobody listened to the last message.
                let Ok((count, from)) = listening.recv_from(&mut bytes) else { continue };
                if from == to {
                    // What does not fit is lost, as on a network.
                    let _ = send.try_send(Answer { arrived: Instant::now(), bytes: bytes[..count].to_vec() });
                }
            }
        })?;
        Ok(Self {
            socket,
            to,
            answers,
            period,
            script,
            speeds,
            connection: Connection::default(),
            is_commanding: false,
            has_commanded: false,
            perfect_since: None,
            target: None,
            has_command: false,
            velocity: vec![0.0; JOINTS],
            krl: [0; 132],
            flags: None,
            counts: Counts::default(),
        })
    }

    /// Reads the answers since the last beat.
    fn receive(&mut self, log: &mut Log) -> io::Result<()> {
        (self.connection.has_answer, self.has_command) = (false, false);
        while let Ok(answer) = self.answers.try_recv() {
            let Some(cmd) = Cmd::read(&answer.bytes) else {
                self.counts.rejected += 1;
                continue;
            };
            self.counts.answers += 1;
            self.connection.reflected = cmd.sequence;
            // A late answer moves the arm, but it does not make the connection better.
            let is_in_time = cmd.reflected == self.connection.sequence;
            self.counts.late += u64::from(!is_in_time);
            self.connection.has_answer |= is_in_time;
            self.krl.copy_from_slice(&answer.bytes[8..140]);
            if self.flags.is_some_and(|flags| flags != cmd.flags) && self.is_commanding {
                self.counts.changed_flags += 1;
            }
            self.flags = Some(cmd.flags);
            if cmd.flags & HAS_POSITION != 0 {
                let asked: Vec<f64> = match &self.target {
                    Some(target) => cmd.position.iter().zip(target).map(|(q, last)| (q - last) / self.period).collect(),
                    None => vec![0.0; JOINTS],
                };
                log.command(answer.arrived, self.is_commanding, &asked)?;
                self.target = Some(cmd.position);
                self.has_command = true;
            }
        }
        self.connection.judge(&self.script);
        self.counts.missed += u64::from(!self.connection.has_answer);
        Ok(())
    }

    /// Follows the program on the robot, and returns the velocities until the next beat [rad/s].
    fn follow(&mut self, posture: &Posture) -> Vec<f64> {
        let mirrored = self.target.as_ref().filter(|_| self.connection.has_answer);
        let off = mirrored.map(|target| farthest(target, &posture.equilibrium));
        if !self.is_commanding {
            self.counts.unmirrored += u64::from(off.is_some_and(|off| off > MIRRORED));
            self.monitor(posture.time, off);
        } else if self.connection.quality < OK {
            self.drop_to_monitor("the quality of the connection is below ok");
        }
        if !self.is_commanding {
            self.velocity = vec![0.0; JOINTS];
            return self.velocity.clone();
        }
        if let (true, Some(target)) = (self.has_command, &self.target) {
            let asked = target.iter().zip(&posture.equilibrium).map(|(target, q)| (target - q) / self.period);
            self.velocity = asked.collect();
        } else if self.connection.missed > 1 {
            // A single missing answer is extrapolated.
            self.velocity = vec![0.0; JOINTS];
        }
        let is_too_fast = |(v, limit): (&f64, &f64)| !v.is_finite() || v.abs() > MARGIN * limit;
        if let Some(joint) = self.velocity.iter().zip(&self.speeds).position(is_too_fast) {
            let speed = self.velocity[joint];
            self.counts.faults += 1;
            self.drop_to_monitor(&format!("joint {} is asked for {speed:.3} rad/s", joint + 1));
            self.velocity = vec![0.0; JOINTS];
        }
        self.velocity.clone()
    }

    /// Waits for a perfect connection, and calls friStart.
    fn monitor(&mut self, time: f64, off: Option<f64>) {
        if self.connection.quality < PERFECT || (self.has_commanded && !self.script.restarts) {
            self.perfect_since = None;
            return;
        }
        let since = *self.perfect_since.get_or_insert(time);
        let Some(off) = off.filter(|_| time - since >= self.script.start_s) else { return };
        if off > INTERPOLATION {
            self.counts.interpolation_errors += 1;
            self.counts.last_fault = format!("FRI interpolation error: the target is {off:.4} rad off");
            self.perfect_since = None;
            self.has_commanded = true;
        } else {
            (self.is_commanding, self.has_commanded) = (true, true);
            self.counts.starts += 1;
        }
    }

    fn drop_to_monitor(&mut self, why: &str) {
        self.is_commanding = false;
        self.perfect_since = None;
        self.counts.drops += 1;
        self.counts.last_fault = why.to_owned();
    }

    fn message(&self, posture: &Posture) -> [u8; MSR_BYTES] {
        let mut msr = Msr([0; MSR_BYTES]);
        msr.u16s(0, &[self.connection.sequence, self.connection.reflected, MSR_BYTES as u16, MSR_ID]);
        msr.0[8..140].copy_from_slice(&self.krl);
        msr.f32s(140, &[posture.time]);
        msr.u16s(144, &[1 + u16::from(self.is_commanding), self.connection.quality]);
        let answered = self.counts.answers as f64 / self.counts.messages.max(1) as f64;
        msr.f32s(148, &[self.period, self.period, 0.0, answered, self.period / 2.0, 0.0, 1.0 - answered]);
        msr.u32(176, self.counts.missed as u32);
        // All drives are on, joint impedance control.
        msr.u16s(180, &[0x7F, 3, 0, 0]);
        msr.f32s(188, &[40.0; JOINTS]);
        msr.f32s(216, &posture.position);
        let commanded: Vec<f64> = posture.equilibrium.iter().map(|q| q - self.script.offset).collect();
        let pose: Vec<f64> = flange(&posture.position).to_matrix().transpose().as_slice()[..12].to_vec();
        msr.f32s(244, &pose);
        msr.f32s(292, &commanded);
        msr.f32s(320, &[self.script.offset; JOINTS]);
        msr.f32s(348, &pose);
        let torque: Vec<f64> =
            posture.equilibrium.iter().zip(&posture.position).map(|(target, q)| STIFFNESS * (target - q)).collect();
        msr.f32s(444, &torque);
        msr.f32s(472, &torque);
        // The load presses against the z of the pad. In the order Fx, Fy, Fz, Tz, Ty, Tx.
        let force = posture.sensor.rotation * nalgebra::Vector3::new(0.0, 0.0, -posture.force);
        let force = posture.tip.rotation.inverse() * force;
        let arm = posture.tip.inverse() * posture.sensor;
        let torque = arm.translation.vector.cross(&force);
        msr.f32s(500, &[force.x, force.y, force.z, torque.z, torque.y, torque.x]);
        msr.0
    }
}

impl Connection {
    /// Raises or lowers the quality after a period.
    fn judge(&mut self, script: &Script) {
        if self.has_answer {
            (self.good, self.missed) = (self.good + 1, 0);
            if self.good >= script.good_per_level {
                (self.quality, self.good) = ((self.quality + 1).min(PERFECT), 0);
            }
        } else {
            (self.good, self.missed) = (0, self.missed.saturating_add(1));
            if self.missed.is_multiple_of(script.missed_per_level) {
                self.quality = self.quality.saturating_sub(1);
            }
        }
    }
}

/// Returns the largest difference between two postures [rad].
fn farthest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

impl ArmWire for Lwr {
    fn beat(&mut self, posture: &Posture, log: &mut Log) -> io::Result<Vec<f64>> {
        if self.counts.messages > 0 {
            self.receive(log)?;
        }
        let velocity = self.follow(posture);
        self.connection.sequence = self.connection.sequence.wrapping_add(1);
        self.counts.messages += 1;
        // A driver that does not listen yet is no failure.
        let _ = self.socket.send_to(&self.message(posture), self.to);
        Ok(velocity)
    }

    fn period(&self) -> f64 {
        self.period
    }

    fn place(&self) -> Value {
        json!({ "wire": "lwr", "to": self.to.to_string() })
    }

    fn counts(&self) -> Value {
        let Counts { messages, answers, late, missed, rejected, starts, drops, .. } = &self.counts;
        let Counts { faults, unmirrored, interpolation_errors, changed_flags, last_fault, .. } = &self.counts;
        json!({
            "messages": messages, "answers": answers, "late": late, "missed": missed, "rejected": rejected,
            "starts": starts, "drops": drops, "faults": faults, "unmirrored": unmirrored,
            "interpolation_errors": interpolation_errors, "changed_flags": changed_flags, "last_fault": last_fault,
            "is_commanding": self.is_commanding, "quality": self.connection.quality,
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::IsometryMatrix3;

    use super::*;

    fn posture(time: f64, equilibrium: f64) -> Posture {
        Posture {
            time,
            position: vec![equilibrium - 0.01; JOINTS],
            speed: vec![0.0; JOINTS],
            equilibrium: vec![equilibrium; JOINTS],
            tip: IsometryMatrix3::translation(0.1, 0.2, 0.3),
            sensor: IsometryMatrix3::identity(),
            force: 0.0,
            centre: None,
            pressure: None,
        }
    }

    fn script() -> Script {
        Script { start_s: 0.0, good_per_level: 1, missed_per_level: 3, restarts: false, offset: 0.0 }
    }

    fn answer(msr: &[u8], position: f32) -> Vec<u8> {
        let mut cmd = vec![0; CMD_BYTES];
        cmd[..2].copy_from_slice(&[9, 0]);
        cmd[2..4].copy_from_slice(&msr[..2]);
        cmd[4..8].copy_from_slice(&[0x78, 0x01, 0x05, 0x10]);
        cmd[140] = 1;
        for i in 0..JOINTS {
            cmd[144 + 4 * i..148 + 4 * i].copy_from_slice(&position.to_le_bytes());
        }
        cmd
    }

    /// One beat, and the answer of a driver that commands this position.
    fn beat(lwr: &mut Lwr, driver: &UdpSocket, log: &mut Log, posture: &Posture, position: Option<f32>) -> Vec<u8> {
        lwr.beat(posture, log).unwrap();
        let mut msr = vec![0; 2000];
        let (count, from) = driver.recv_from(&mut msr).unwrap();
        msr.truncate(count);
        if let Some(position) = position {
            driver.send_to(&answer(&msr, position), from).unwrap();
            // The loop of the cell sleeps here; a test waits for the thread that receives.
            thread::sleep(std::time::Duration::from_millis(20));
        }
        msr
    }

    fn state(msr: &[u8]) -> [u16; 2] {
        [144, 146].map(|at| u16::from_le_bytes([msr[at], msr[at + 1]]))
    }

    #[test]
    fn the_first_header_is_that_of_the_protocol_and_every_field_is_at_its_offset() {
        let driver = UdpSocket::bind("127.0.0.1:0").unwrap();
        let to = driver.local_addr().unwrap().to_string();
        let mut lwr = Lwr::open(&to, 0.004, script(), vec![2.0; JOINTS]).unwrap();
        let mut log = Log::begin(None, JOINTS, Instant::now()).unwrap();
        let msr = beat(&mut lwr, &driver, &mut log, &posture(1.5, 0.5), None);
        assert_eq!(msr.len(), MSR_BYTES);
        assert_eq!(msr[..8], [1, 0, 0, 0, 0x94, 0x03, 0x06, 0x20]);
        let float = |at: usize| f32::from_le_bytes([msr[at], msr[at + 1], msr[at + 2], msr[at + 3]]);
        assert_eq!([140, 148, 216, 292, 320].map(float), [1.5, 0.004, 0.49, 0.5, 0.0]);
        // Three rows of four: the last of each is the position.
        let pose = flange(&[0.49; JOINTS]);
        let at = pose.translation.vector;
        let expected = [pose.rotation[(0, 0)], at.x, at.y, at.z].map(|value| value as f32);
        assert_eq!([244, 256, 272, 288].map(float), expected);
        assert_eq!(state(&msr), [1, 0]);
    }

    #[test]
    fn answers_in_time_lead_to_command_mode_and_silence_leads_back() {
        let driver = UdpSocket::bind("127.0.0.1:0").unwrap();
        let to = driver.local_addr().unwrap().to_string();
        let mut lwr = Lwr::open(&to, 0.1, script(), vec![2.0; JOINTS]).unwrap();
        let mut log = Log::begin(None, JOINTS, Instant::now()).unwrap();
        let mut states = Vec::new();
        for i in 0..5 {
            states.push(state(&beat(&mut lwr, &driver, &mut log, &posture(f64::from(i) * 0.1, 0.5), Some(0.5))));
        }
        assert_eq!(states, [[1, 0], [1, 1], [1, 2], [2, 3], [2, 3]]);
        // It moves by what is commanded: 0.05 rad in 0.1 s.
        beat(&mut lwr, &driver, &mut log, &posture(0.5, 0.5), Some(0.55));
        let velocity = lwr.beat(&posture(0.6, 0.5), &mut log).unwrap();
        assert!(velocity.iter().all(|v| (v - 0.5).abs() < 1e-5), "{velocity:?}");
        // One missing answer is extrapolated, the next stops the motion, and more end the command mode.
        let speeds: Vec<f64> =
            (0..8).map(|i| lwr.beat(&posture(0.7 + 0.1 * f64::from(i), 0.55), &mut log).unwrap()[0]).collect();
        assert!((speeds[0] - 0.5).abs() < 1e-5 && speeds[1..].iter().all(|v| *v == 0.0), "{speeds:?}");
        assert!(!lwr.is_commanding);
        assert_eq!((lwr.counts.starts, lwr.counts.drops), (1, 1));
    }

    #[test]
    fn a_step_that_no_joint_can_make_ends_the_command_mode() {
        let driver = UdpSocket::bind("127.0.0.1:0").unwrap();
        let to = driver.local_addr().unwrap().to_string();
        let mut lwr = Lwr::open(&to, 0.1, script(), vec![2.0; JOINTS]).unwrap();
        let mut log = Log::begin(None, JOINTS, Instant::now()).unwrap();
        for i in 0..5 {
            beat(&mut lwr, &driver, &mut log, &posture(f64::from(i) * 0.1, 0.5), Some(0.5));
        }
        assert!(lwr.is_commanding);
        beat(&mut lwr, &driver, &mut log, &posture(0.5, 0.5), Some(0.9));
        assert_eq!(lwr.beat(&posture(0.6, 0.5), &mut log).unwrap(), [0.0; JOINTS]);
        assert!(!lwr.is_commanding && lwr.counts.faults == 1);
    }
}
