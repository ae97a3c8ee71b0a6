//! The driver: it receives the measurements of the controller, answers each, and publishes each once.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

use async_trait::async_trait;
use nalgebra::IsometryMatrix3;
use tactflow_runtime::device::{DeviceError, Link, Live};
use tactflow_runtime::signal::Twist;
use tokio::net::UdpSocket;
use tokio::time::timeout;

use super::intake::{Arrival, Intake, Stated};
use super::permit::{accepts_flags, is_in_command, obstacle, sample_time, takes_positions};
use super::target::Target;
use super::wire::{Answer, CMD_BYTES, Impedance, Joints, Krl, MSR_BYTES, Report};
use crate::arm::chain::Chain;
use crate::devices::arm::ArmPorts;
use crate::devices::start::{StartCheck, StartReport};
use crate::devices::wrench::{ToolWeight, WrenchPorts, moved};

/// Time that the controller has for its first datagram.
const FIRST_DATAGRAM: Duration = Duration::from_secs(2);
/// Number of sample times without a datagram after which the controller is lost, and the shortest such time.
const LOST_SAMPLES: f64 = 10.0;
const MIN_LOST: Duration = Duration::from_millis(100);
/// Time that the KRL program has at the end of a run to leave the state command.
const LEAVE: Duration = Duration::from_millis(500);
/// Difference between the sample times of the controller and of the bench, as a fraction, that is worth a warning [1].
const SAMPLE_TIME_ERROR: f64 = 0.01;
/// Datagrams that are read at once, at most. The operating system keeps fewer.
const MAX_QUEUED: usize = 256;

/// What the bench says of the connection.
pub(super) struct Settings {
    pub(super) port: u16,
    /// Time between two measurements, as the bench states it [s].
    pub(super) sample_time: f64,
    pub(super) impedance: Impedance,
    /// Integers for the KRL program, each with its place from 0 on, and those at the end of the run.
    pub(super) krl_ints: Vec<(usize, i32)>,
    pub(super) krl_ints_at_end: Vec<(usize, i32)>,
    /// Time that the controller has to reach the state command [s].
    pub(super) wait_s: f64,
    /// Pose of the controller's tool in the frame of the tip.
    pub(super) tool: IsometryMatrix3<f64>,
    pub(super) weight: ToolWeight,
}

/// The driver of an arm.
pub(super) struct Fri {
    settings: Settings,
    ports: ArmPorts,
    force: WrenchPorts,
    target: Target,
    check: StartCheck,
    /// The chain to the tip, and its columns.
    chain: Chain,
    columns: Vec<Twist>,
    intake: Intake,
    /// Number of the last answer.
    answered: u16,
    /// The values for the KRL program.
    krl: Option<Krl>,
    phase: Phase,
    /// Whether the arm has followed commands in this run, if only those of rest.
    has_followed: bool,
    /// Whether a command has moved the arm in this run.
    has_moved: bool,
    /// When the controller sent its first measurement.
    first: Option<Instant>,
    /// Time between two measurements: the longer one of those that the bench and the controller state [s].
    sample_time: f64,
    /// Whether the answers set the impedance.
    sets_impedance: bool,
    /// Whether the last answer could not be sent.
    is_unsent: bool,
    /// Epoch of the commands for which the arm was checked.
    checked: Option<u64>,
    /// How far the measured posture was from the commanded one when the arm followed commands last in this session [rad].
    held: Option<Joints>,
    notes: Notes,
}

/// The newest measurement of those that came together.
struct Newest {
    report: Report,
    from: SocketAddr,
    /// Whether a session begins with it, or with one that it replaces.
    is_first: bool,
    /// Measurements before it that are lost, or that it replaces.
    lost: u16,
}

/// What the controller does with positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// It commands a posture of its own.
    Mirrored,
    /// It takes positions, but the checks before the first command have not passed.
    Unchecked,
    /// It takes positions, and the arm may follow commands.
    Checked,
}

/// What was written to the log, so that it is written once.
#[derive(Default)]
struct Notes {
    waits_for: Option<String>,
    has_stranger: bool,
    has_bad_datagram: bool,
    has_sample_time: bool,
}

#[async_trait]
impl Live for Fri {
    async fn run(mut self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let port = self.settings.port;
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port)).await;
        let socket = socket.map_err(|error| DeviceError(format!("cannot listen on the UDP port {port}: {error}")))?;
        let stopped = link.stopped();
        tokio::select! {
            error = self.follow(&socket, &mut link) => return Err(error.into()),
            () = stopped => {}
        }
        // The arm is at rest.
        if !link.is_mute() {
            let _ = timeout(LEAVE, self.leave(&socket)).await;
        }
        Ok(())
    }
}

impl Fri {
    pub(super) fn new(
        settings: Settings,
        ports: ArmPorts,
        force: WrenchPorts,
        target: Target,
        check: StartCheck,
        chain: Chain,
        allowed: Option<IpAddr>,
    ) -> Self {
        let columns = vec![Twist::default(); chain.joints().len()];
        let (intake, sample_time) = (Intake::new(allowed), settings.sample_time);
        Self {
            settings,
            ports,
            force,
            target,
            check,
            chain,
            columns,
            intake,
            answered: 0,
            krl: None,
            phase: Phase::Mirrored,
            has_followed: false,
            has_moved: false,
            first: None,
            sample_time,
            sets_impedance: false,
            is_unsent: false,
            checked: None,
            held: None,
            notes: Notes::default(),
        }
    }

    /// Answers measurements. Returns the error that ends this.
    async fn follow(&mut self, socket: &UdpSocket, link: &mut Link) -> std::io::Error {
        // One byte more than a measurement, so that a longer datagram is not taken for one.
        let mut datagram = [0; MSR_BYTES + 1];
        let (mut heard, mut is_lost) = (Instant::now(), false);
        loop {
            let patience = self.patience();
            match timeout(patience, socket.recv_from(&mut datagram)).await {
                Ok(Ok((length, from))) => {
                    let mut newest = None;
                    let mut is_heard = self.take(&datagram[..length], from, &mut newest, socket, link);
                    // After this process was stopped, old measurements wait: only the newest says where the arm is.
                    for _ in 1..MAX_QUEUED {
                        let Ok((length, from)) = socket.try_recv_from(&mut datagram) else { break };
                        is_heard |= self.take(&datagram[..length], from, &mut newest, socket, link);
                    }
                    if let Some(newest) = newest {
                        self.act(&newest, socket, link);
                    }
                    if is_heard {
                        (heard, is_lost) = (Instant::now(), false);
                    }
                }
                Ok(Err(error)) => return error,
                Err(_) => {}
            }
            if heard.elapsed() >= patience && !is_lost {
                is_lost = true;
                self.lose(link, patience);
            }
            if is_lost {
                // So that the ramp of the lease goes on.
                link.commands();
            }
        }
    }

    /// Returns the time without a datagram after which the controller is lost.
    fn patience(&self) -> Duration {
        match self.first {
            Some(_) => Duration::from_secs_f64(LOST_SAMPLES * self.sample_time).max(MIN_LOST),
            None => FIRST_DATAGRAM,
        }
    }

    /// Makes the ports absent, because the controller sends nothing.
    fn lose(&mut self, link: &mut Link, silence: Duration) {
        let ms = silence.as_millis();
        let why = match self.intake.controller() {
            Some(controller) => format!("the controller at {controller} has sent nothing for {ms} ms"),
            None => format!(
                "no datagram of FRI 1.0 has come on the UDP port {} for {ms} ms: start the KRL program, and check the \
                 address that it sends to",
                self.settings.port
            ),
        };
        (self.phase, self.held) = (Phase::Mirrored, None);
        if self.has_followed {
            link.refuse(why.clone());
        }
        self.ports.lose(link, &why);
        self.force.lose(link, &why);
    }

    /// Takes a datagram: a new measurement becomes the `newest`. Returns whether it is a measurement of the controller.
    fn take(
        &mut self,
        datagram: &[u8],
        from: SocketAddr,
        newest: &mut Option<Newest>,
        socket: &UdpSocket,
        link: &mut Link,
    ) -> bool {
        let Some(report) = Report::decode(datagram) else {
            link.count("bad datagrams");
            if !std::mem::replace(&mut self.notes.has_bad_datagram, true) {
                let length = datagram.len();
                tracing::warn!("a datagram of {length} bytes from {from} is no valid measurement of FRI 1.0");
            }
            return false;
        };
        let now = Instant::now();
        let Report { sequence, time, sample_time, .. } = report;
        match self.intake.take(from, Stated { sequence, time, sample_time }, now) {
            Arrival::Stranger => {
                link.count("datagrams of a second controller");
                if !std::mem::replace(&mut self.notes.has_stranger, true) {
                    self.warn_of_stranger(from);
                }
                return false;
            }
            Arrival::Implausible => {
                link.count("late datagrams");
                return false;
            }
            arrival @ (Arrival::Repeated | Arrival::Late) => {
                link.count(if arrival == Arrival::Late { "late datagrams" } else { "repeated datagrams" });
                if newest.is_none() {
                    self.answer(sequence, from, socket, link);
                }
            }
            Arrival::First => {
                let lost = newest.take().map_or(0, |replaced| replaced.lost.saturating_add(1));
                *newest = Some(Newest { report, from, is_first: true, lost });
            }
            Arrival::Next { lost } => {
                let (is_first, before) =
                    newest.take().map_or((false, 0), |replaced| (replaced.is_first, replaced.lost.saturating_add(1)));
                *newest = Some(Newest { report, from, is_first, lost: lost.saturating_add(before) });
            }
        }
        true
    }

    /// Moves by the newest measurement, answers it and publishes it.
    fn act(&mut self, newest: &Newest, socket: &UdpSocket, link: &mut Link) {
        let (report, now) = (&newest.report, Instant::now());
        if newest.is_first {
            self.begin_session(report, now, link);
        }
        let follows = self.advance(report, now, link);
        self.step(report, now, link);
        self.answer(report.sequence, newest.from, socket, link);
        self.publish(report, newest.lost, follows, link);
    }

    fn warn_of_stranger(&self, from: SocketAddr) {
        match self.intake.controller() {
            Some(controller) => {
                tracing::warn!("{from} sends measurements too, but {controller} is the controller: they are ignored");
            }
            None => tracing::warn!("{from} sends measurements, but it is not the `controller` of the bench"),
        }
    }

    /// Notes that the controller has begun a session.
    fn begin_session(&mut self, report: &Report, now: Instant, link: &mut Link) {
        if self.has_followed {
            link.refuse("its controller has begun a new session");
        }
        (self.phase, self.held) = (Phase::Mirrored, None);
        if self.first.is_none() {
            // An earlier run may have left the controller in the state command, with other flags.
            self.sets_impedance = !is_in_command(report);
        }
        self.first.get_or_insert(now);
        self.sample_time = self.settings.sample_time.max(sample_time(report));
        let (stated, expected) = (report.sample_time, self.settings.sample_time);
        let is_other = (stated - expected).abs() > SAMPLE_TIME_ERROR * expected;
        if is_other && !std::mem::replace(&mut self.notes.has_sample_time, true) {
            let [stated, expected] = [stated, expected].map(|time| time * 1e3);
            tracing::warn!(
                "the controller measures every {stated:.3} ms, and not every {expected:.3} ms: write `sample_ms = {stated:.3}`"
            );
        }
    }

    /// Goes on to the next phase, and mirrors the posture of the controller unless the arm moves. Returns whether the arm
    /// follows commands.
    fn advance(&mut self, report: &Report, now: Instant, link: &mut Link) -> bool {
        let mut krl = report.krl.clone();
        self.settings.krl_ints.iter().for_each(|(place, value)| krl.set_int(*place, *value));
        self.krl = Some(krl);
        // What is not sent must not move the target.
        let takes = takes_positions(report) && !link.is_mute();
        self.sets_impedance |= accepts_flags(report);
        let epoch = link.epoch();
        if self.phase == Phase::Checked && self.checked != Some(epoch) {
            // The operator has resumed.
            self.phase = Phase::Unchecked;
        }
        let mut why = obstacle(report, !self.settings.impedance.is_none()).or_else(|| self.unset_impedance());
        if !takes {
            self.target.mirror(&report.commanded);
            self.phase = Phase::Mirrored;
            // An arm that is only listened to never gets as far as the first command.
            let is_listened_to = link.is_mute() && !self.has_followed;
            if let Some(fault) = self.fault_at_start(report).filter(|_| is_listened_to) {
                link.refuse(fault);
            }
        } else if self.phase != Phase::Checked {
            // The arm rests where the controller is, and the first step begins there.
            self.target.mirror(&report.commanded);
            why = why.or_else(|| self.fault_at_start(report));
            (self.phase, self.checked) = (if why.is_none() { Phase::Checked } else { Phase::Unchecked }, Some(epoch));
        } else if let Some(fault) = self.target.fault_of_following(&report.commanded, self.sample_time) {
            self.target.mirror(&report.commanded);
            self.phase = Phase::Unchecked;
            why = why.or(Some(fault));
        }
        let follows = why.is_none();
        self.has_followed |= follows && self.phase == Phase::Checked;
        if follows && self.phase == Phase::Checked && !link.refuses() {
            self.held = Some(std::array::from_fn(|i| report.measured[i] - report.commanded[i]));
        }
        if let Some(why) = why {
            self.refuse(why, report, now, link);
        }
        follows
    }

    /// Moves the target by the commands for a sample time, while the arm may follow them.
    fn step(&mut self, report: &Report, now: Instant, link: &mut Link) {
        let held = link.commands().joints(self.ports.velocity);
        let velocity: Joints = std::array::from_fn(|i| held[i]);
        // The operator may have resumed since `advance`. Then these commands are new, and nothing is checked yet.
        let is_checked = self.phase == Phase::Checked && self.checked == Some(link.epoch());
        if !is_checked || self.is_unsent {
            return;
        }
        self.has_moved |= velocity.iter().any(|v| *v != 0.0);
        if self.target.step(&velocity, sample_time(report), now) {
            link.count("shortened steps");
        }
    }

    /// Refuses commands. Before the arm has followed any, it waits for the state command instead.
    fn refuse(&mut self, why: String, report: &Report, now: Instant, link: &mut Link) {
        let waited = self.first.map_or(0.0, |first| (now - first).as_secs_f64());
        // Without answers, the controller does not reach the state command.
        let may_wait = link.is_mute() || waited < self.settings.wait_s;
        let is_waiting = !self.has_followed && !is_in_command(report) && may_wait;
        if !is_waiting {
            link.refuse(why);
        } else if self.notes.waits_for.as_ref() != Some(&why) {
            tracing::warn!("the arm rests until its controller follows commands: {why}");
            self.notes.waits_for = Some(why);
        }
    }

    /// Returns why the arm must not move if its impedance is not that of the bench: flags change only in the state monitor.
    fn unset_impedance(&self) -> Option<String> {
        let is_unset = !self.settings.impedance.is_none() && !self.sets_impedance;
        let why = "it was in the state command before this run could set its impedance: let the KRL program stop and start FRI";
        is_unset.then(|| why.to_owned())
    }

    /// Returns what differs before the first command.
    fn fault_at_start(&self, report: &Report) -> Option<String> {
        let start = StartReport {
            measured: &report.measured,
            commanded: &report.commanded,
            target: self.target.position(),
            held: self.held.as_ref().map(|held| &held[..]),
            tip: Some(report.pose),
            is_first: !self.has_moved,
        };
        self.check.check(&start).err().map(|error| error.0)
    }

    /// Sends the posture that holds now.
    fn answer(&mut self, reflected: u16, to: SocketAddr, socket: &UdpSocket, link: &mut Link) {
        if link.is_mute() {
            return;
        }
        let Some(bytes) = self.next_answer(reflected, true) else { return };
        self.is_unsent = socket.try_send_to(&bytes, to).is_err();
        if self.is_unsent {
            link.count("unsent answers");
        }
    }

    /// Returns the next answer. Without `is_driving`, its flags are cleared.
    fn next_answer(&mut self, reflected: u16, is_driving: bool) -> Option<[u8; CMD_BYTES]> {
        self.answered = self.answered.wrapping_add(1);
        let impedance = if self.sets_impedance { self.settings.impedance } else { Impedance::default() };
        let (krl, position) = (self.krl.as_ref()?, self.target.position());
        Some(Answer { sequence: self.answered, reflected, krl, position, impedance }.encode(is_driving))
    }

    fn publish(&mut self, report: &Report, lost: u16, follows: bool, link: &mut Link) {
        let tip = self.chain.forward(&report.measured, &mut self.columns).0;
        let wrench = moved(&report.wrench, &self.settings.tool);
        let wrench = self.settings.weight.without(&wrench, &tip.rotation);
        let (stamp, number) = (link.stamp_of(self.intake.time()), self.intake.number);
        let postures: [&[f64]; 2] = [&report.measured, self.target.position()];
        link.publish(|samples| {
            if lost > 0 {
                samples.count_by("lost datagrams", u64::from(lost));
            }
            self.ports.write_with_safety(samples, stamp, number, postures, follows);
            self.force.write(samples, stamp, number, &wrench);
        });
    }

    /// Leaves the controller: while it takes positions, the answers hold the posture and ask the KRL program to stop.
    /// Then one answer clears the flags, which may change only now.
    async fn leave(&mut self, socket: &UdpSocket) {
        let mut datagram = [0; MSR_BYTES + 1];
        loop {
            let (length, from) = match socket.recv_from(&mut datagram).await {
                Ok(received) => received,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(_) => return,
            };
            let Some(report) = Report::decode(&datagram[..length]).filter(|_| self.intake.controller() == Some(from))
            else {
                continue;
            };
            let takes = takes_positions(&report);
            if takes && self.settings.krl_ints_at_end.is_empty() {
                return;
            }
            if !takes || self.phase == Phase::Mirrored {
                self.target.mirror(&report.commanded);
            }
            let mut krl = report.krl;
            let ints = self.settings.krl_ints.iter().chain(&self.settings.krl_ints_at_end);
            ints.for_each(|(place, value)| krl.set_int(*place, *value));
            self.krl = Some(krl);
            if let Some(bytes) = self.next_answer(report.sequence, takes) {
                let _ = socket.try_send_to(&bytes, from);
            }
            if !takes {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests;
