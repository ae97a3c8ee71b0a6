//! One connection to the robot: its phases, its samples and its velocities.

use std::net::{IpAddr, SocketAddr};
use std::time::{Duration, Instant};

use tactflow_runtime::device::Link;
use tokio::net::TcpStream;
use tokio::time::{sleep_until, timeout};

use super::checks::of_controller;
use super::course::{Course, Phase};
use super::message;
use super::program::{Listeners, Reverse, Sending, is_from};
use super::recipe::{JOINTS, State};
use super::robot::Robot;
use super::rtde::Stream;
use super::status::{is_playing, is_stopped, runtime_name};

/// Longest time for which the first sample waits until the robot can be moved.
const MAX_FIRST_SAMPLE: Duration = Duration::from_secs(1);
/// Time for the state of the robot to show why its program has closed the connection.
const REASON: Duration = Duration::from_millis(50);
/// Time for the state of the robot to show that its program runs.
const PROGRAM_SHOWS: Duration = Duration::from_millis(500);
/// Longest time of a ramp at the end of a run.
const MAX_REST: Duration = Duration::from_millis(700);
/// Time for the program on the robot to end.
const MAX_LEAVE: Duration = Duration::from_millis(200);
/// Time in which what has arrived already is seen.
const ARRIVED: Duration = Duration::from_millis(10);
/// Connections of others, and those of the robot that are not expected.
const STRANGERS: &str = "connections that were not expected";
/// Longest time in which the velocity may have changed between two messages [s].
const MAX_STEP_S: f64 = 0.1;

/// One connection to the robot.
pub(super) struct Session<'a> {
    robot: &'a Robot,
    listeners: &'a Listeners,
    stream: Stream,
    /// Our address, as the robot sees it.
    host: String,
    /// The only address from which its program connects.
    peer: IpAddr,
    reverse: Option<Reverse>,
    connected: Instant,
    /// Whether the program was seen to run since it has connected.
    has_played: bool,
    /// When the program has closed its connection.
    closed: Option<Instant>,
    sending: Option<Sending>,
    phase: Phase,
    /// Epoch of the commands for which the robot was checked.
    checked: Option<u64>,
    /// Whether no velocity has moved the robot in this run.
    pub(super) is_first: bool,
    begin: Instant,
    heard: Instant,
    publishes: bool,
    /// The last velocity [rad/s], in the order of the controller, and the time of the robot then [s].
    sent: [f64; JOINTS],
    sent_at: f64,
    counted: u64,
    ending: Option<Instant>,
}

impl<'a> Session<'a> {
    /// The robot sees us at `host`, and its program connects from `peer`.
    pub(super) fn new(
        robot: &'a Robot,
        listeners: &'a Listeners,
        stream: Stream,
        (host, peer): (String, IpAddr),
        (phase, is_first): (Phase, bool),
    ) -> Self {
        let now = Instant::now();
        let publishes = !matches!(phase, Phase::Starting { .. });
        Self {
            robot,
            listeners,
            stream,
            host,
            peer,
            reverse: None,
            connected: now,
            has_played: false,
            closed: None,
            sending: None,
            phase,
            checked: None,
            is_first,
            begin: now,
            heard: now,
            publishes,
            sent: [0.0; JOINTS],
            sent_at: 0.0,
            counted: 0,
            ending: None,
        }
    }

    /// Publishes samples and sends velocities until the run ends.
    ///
    /// # Errors
    /// Why the connection is lost before.
    pub(super) async fn follow(&mut self, link: &mut Link) -> Result<(), String> {
        let silence = self.robot.silence;
        loop {
            let stopped = link.stopped();
            tokio::select! {
                biased;
                () = stopped, if self.ending.is_none() => self.ending = Some(Instant::now()),
                ready = self.stream.readable() => {
                    ready.map_err(|error| error.to_string())?;
                    self.cycle(link)?;
                    // What has arrived may contain no sample.
                    if self.heard.elapsed() > silence {
                        return Err(format!("no sample for {silence:?}"));
                    }
                }
                accepted = self.listeners.accept() => self.accept(link, accepted),
                () = closed(self.reverse.as_ref()) => self.disconnect(),
                () = sleep_until((self.heard + silence).into()) => {
                    // A process that was suspended sees its time run out before it sees what has arrived.
                    if timeout(ARRIVED, self.stream.readable()).await.is_err() {
                        return Err(format!("no sample for {silence:?}"));
                    }
                }
            }
            if self.ends() {
                self.leave(link.is_mute()).await;
                return Ok(());
            }
        }
    }

    /// Reads what has arrived: publishes the newest state, and sends one velocity.
    fn cycle(&mut self, link: &mut Link) -> Result<(), String> {
        let (mut newest, mut illegal, allowed) = (None, None, self.robot.allowed);
        let received = self.stream.receive(|state| {
            if illegal.is_none() {
                illegal = allowed.refusal(&state);
            }
            newest = Some(state);
        });
        let bad = self.stream.bad_packets - std::mem::replace(&mut self.counted, self.stream.bad_packets);
        link.count_each(&[("bad packets", bad), (STRANGERS, self.listeners.take_strangers())]);
        if let Some(state) = newest {
            self.heard = Instant::now();
            self.advance(link, &state, illegal);
            self.publish(link, &state);
            self.command(link, &state);
        } else {
            // The lease must be asked also when nothing is sent.
            link.commands();
        }
        received
    }

    /// Goes on to the next phase.
    fn advance(&mut self, link: &mut Link, state: &State, illegal: Option<String>) {
        let epoch = link.epoch();
        let resumes = match self.phase {
            // It checks in each cycle.
            Phase::Starting { .. } => false,
            Phase::Ready => self.checked != Some(epoch),
            Phase::Refused => !link.refuses(),
        };
        if resumes {
            // The operator has resumed. A program that runs goes on.
            self.phase = Phase::start();
        }
        let why = match self.phase {
            Phase::Starting { since, has_sent } => {
                illegal.or_else(|| self.start(state, since, has_sent, link.is_mute()))
            }
            Phase::Ready => illegal.or_else(|| self.trouble(state)),
            Phase::Refused => None,
        };
        if matches!(self.phase, Phase::Ready) {
            self.checked = Some(epoch);
        }
        if let Some(why) = why {
            self.phase = Phase::Refused;
            self.publishes = true;
            link.refuse(why);
        }
        // A program that is paused is to end when it goes on.
        self.has_played |= is_playing(state);
        if !is_playing(state) && (self.has_played || self.connected.elapsed() > PROGRAM_SHOWS) {
            self.abort();
        }
    }

    /// Brings the program on the robot to run. Returns why it does not.
    fn start(&mut self, state: &State, since: Instant, has_sent: bool, is_mute: bool) -> Option<String> {
        if self.sent != [0.0; JOINTS] {
            // The checks are those of a still robot.
            return None;
        }
        if let Err(why) = self.robot.checks.check(state, self.is_first) {
            return Some(why);
        }
        if let Some(why) = self.sending.as_mut().and_then(Sending::failure) {
            return Some(why);
        }
        if self.reverse.is_some() && is_playing(state) {
            self.phase = Phase::Ready;
            self.sending = None;
            return None;
        }
        if is_mute {
            // It is only listened to.
            return None;
        }
        // A program of an earlier run of ours ends by itself. Any other is replaced.
        let is_free = is_stopped(state) || is_playing(state) && since.elapsed() > PROGRAM_SHOWS;
        if self.robot.sends_program && !has_sent && self.reverse.is_none() && is_free {
            if is_playing(state) {
                tracing::warn!("a program runs on the robot: it is replaced");
            }
            let ports = self.robot.script_ports(&self.host, self.listeners);
            return match self.robot.script.program(&ports, self.stream.version) {
                Ok(program) => {
                    self.sending = Some(Sending::begin(self.robot.script_address.clone(), program));
                    self.phase = Phase::Starting { since, has_sent: true };
                    None
                }
                Err(why) => Some(why),
            };
        }
        (since.elapsed() > self.robot.start).then(|| self.why_not_started(state, has_sent))
    }

    fn why_not_started(&self, state: &State, has_sent: bool) -> String {
        let ([port, ..], host) = (self.listeners.ports(), &self.host);
        let (runtime, start) = (runtime_name(state), self.robot.start);
        if self.reverse.is_some() || !has_sent && self.robot.sends_program {
            return format!("the program on the robot is {runtime}: stop it, then resume");
        }
        if self.robot.sends_program {
            return format!(
                "the robot has not connected to {host}, port {port}, within {start:?}: switch it to remote control, and \
                 check `host` and the firewall"
            );
        }
        format!(
            "no program on the robot has connected to {host}, port {port}: press play on the pendant, and resume when the \
             program runs"
        )
    }

    /// Returns why a robot that was ready is not any more.
    fn trouble(&mut self, state: &State) -> Option<String> {
        if !is_playing(state) {
            return Some(format!("the program on the robot is {}", runtime_name(state)));
        }
        let closed = self.closed.filter(|at| at.elapsed() >= REASON);
        closed.map(|_| "the program on the robot has ended".to_owned())
    }

    fn publish(&mut self, link: &mut Link, state: &State) {
        let is_ready = matches!(self.phase, Phase::Ready);
        self.publishes |= is_ready || self.begin.elapsed() > MAX_FIRST_SAMPLE;
        if !self.publishes {
            return;
        }
        let stamp = link.stamp_of((state.time * 1e9).round() as i64);
        let sequence = (state.time * self.robot.rate_hz).round() as u64;
        self.robot.write(link, state, stamp, sequence, is_ready);
    }

    /// Sends the velocity that holds now.
    fn command(&mut self, link: &mut Link, state: &State) {
        // The lease must be asked in every cycle, also when nothing is connected.
        let held = of_controller(&self.robot.checks.order, link.commands().joints(self.robot.ports.velocity));
        // The operator may have resumed since `advance`. Then these commands are new, and nothing is checked yet.
        let (is_checked, is_refused) = (self.checked == Some(link.epoch()), link.refuses());
        let dt = (state.time - self.sent_at).clamp(1.0 / self.robot.rate_hz, MAX_STEP_S);
        self.sent_at = state.time;
        if link.is_mute() {
            return;
        }
        let Some(reverse) = &mut self.reverse else {
            self.sent = [0.0; JOINTS];
            return;
        };
        let course = Course::of(self.phase, is_checked, is_refused);
        let velocity = course.next(&self.sent, &held, self.robot.acceleration, dt);
        match reverse.send(&message::velocity(self.robot.timeout_ms, &velocity)) {
            Ok(true) => {
                self.sent = velocity;
                self.is_first &= velocity == [0.0; JOINTS];
            }
            Ok(false) => link.count("messages that the robot did not take"),
            Err(_) => self.disconnect(),
        }
    }

    fn accept(&mut self, link: &mut Link, accepted: std::io::Result<(TcpStream, SocketAddr)>) {
        let Ok((stream, from)) = accepted else { return };
        // Somebody has pressed play. Without a connection, the program ends.
        if link.is_mute() {
            return;
        }
        // With the maker's or our own program that we send, a connection is expected only then.
        let is_expected = match self.phase {
            Phase::Starting { has_sent, .. } => has_sent || !self.robot.sends_program,
            Phase::Refused => !self.robot.sends_program,
            Phase::Ready => false,
        };
        let is_robot = is_from(from, self.peer);
        if !is_robot || !is_expected || self.reverse.is_some() || self.ending.is_some() {
            link.count(STRANGERS);
            return;
        }
        if let Ok(reverse) = Reverse::new(stream) {
            self.reverse = Some(reverse);
            self.connected = Instant::now();
            self.has_played = false;
            self.closed = None;
        }
    }

    fn disconnect(&mut self) {
        self.reverse = None;
        self.sent = [0.0; JOINTS];
        self.closed = Some(Instant::now());
    }

    /// Closes the connection of the program, so that it ends.
    pub(super) fn abort(&mut self) {
        if let Some(reverse) = self.reverse.take() {
            reverse.abort();
            self.disconnect();
        }
    }

    /// Whether the run is over and the robot rests.
    fn ends(&self) -> bool {
        let rests = self.reverse.is_none() || self.sent == [0.0; JOINTS];
        self.ending.is_some_and(|since| rests || since.elapsed() > MAX_REST)
    }

    /// Ends the program on the robot, unless nothing may be sent.
    async fn leave(&mut self, is_mute: bool) {
        let Some(reverse) = self.reverse.as_mut().filter(|_| !is_mute) else { return };
        let end = Instant::now() + MAX_LEAVE;
        let message = message::end(self.robot.timeout_ms);
        while matches!(reverse.send(&message), Ok(false)) && Instant::now() < end {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        let _ = timeout(end.saturating_duration_since(Instant::now()), reverse.closed()).await;
    }
}

/// Waits until the program closes its connection; for ever if there is none.
async fn closed(reverse: Option<&Reverse>) {
    match reverse {
        Some(reverse) => reverse.closed().await,
        None => std::future::pending().await,
    }
}
