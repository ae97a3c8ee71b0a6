//! The driver of an arm: it hears joint states, checks what else is on the topics, and sends what the arm is to do.

use std::time::{Duration, Instant};

use async_trait::async_trait;
use rustdds::GUID;
use tactflow_runtime::device::{DeviceError, Link, Live};
use tokio::time::{sleep, sleep_until};

use super::beyond::Beyond;
use super::clock::Agreement;
use super::course::Course;
use super::domain::Domain;
use super::message::JointState;
use super::output::{Commanded, Output, Said, wall_clock};
use super::place::Site;
use crate::devices::arm::ArmPorts;
use crate::devices::start::{StartCheck, StartReport};

/// Time between two looks at who else is on the topics.
const LOOK: Duration = Duration::from_millis(100);
/// Longest time at the end of a run in which the arm comes to rest.
const MAX_REST: Duration = Duration::from_secs(2);
/// How long a second publisher of the joints is remembered.
const MEMORY: Duration = Duration::from_secs(1);

/// An arm that is described and ready to run.
pub(super) struct ArmDriver {
    pub(super) ports: ArmPorts,
    pub(super) site: Site,
    pub(super) states: String,
    pub(super) command: String,
    pub(super) names: Vec<String>,
    /// The limits of the joints, where another program computes their velocities.
    pub(super) beyond: Option<Beyond>,
    pub(super) start: StartCheck,
    /// Maximum difference between the measured and the commanded position of a joint [rad].
    pub(super) deflection: f64,
    pub(super) acceleration: f64,
    pub(super) timeout: Duration,
    pub(super) commanded: Commanded,
}

#[async_trait]
impl Live for ArmDriver {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let domain = self.site.join().map_err(DeviceError)?;
        let mut states = domain.read::<JointState>(&self.states).map_err(DeviceError)?;
        let output = Output::open(&domain, &self.command, &self.commanded).map_err(DeviceError)?;
        let mut session = Session::new(*self, domain, output);
        let (stopped, commanded) = (link.stopped(), link.commanded());
        tokio::pin!(stopped, commanded);
        let mut ending: Option<Instant> = None;
        loop {
            // Messages come last: a flood of them must not keep the arm from its commands.
            tokio::select! {
                biased;
                () = &mut stopped, if ending.is_none() => ending = Some(Instant::now()),
                () = &mut commanded => commanded.set(link.commanded()),
                () = sleep_until((session.looked + LOOK).into()) => session.look(),
                message = states.next() => {
                    session.hear(&mut link, message);
                    continue;
                }
            }
            session.judge(&mut link);
            session.send(&mut link);
            if ending.is_some_and(|since| session.course.rests() || since.elapsed() > MAX_REST) {
                session.leave(&link).await;
                return Ok(());
            }
        }
    }
}

/// What the arm may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// It may move when everything holds.
    Waiting { since: Instant },
    /// It follows the commands of an epoch.
    Ready { epoch: u64 },
    /// It may not move until the operator resumes.
    Refused,
}

struct Session {
    arm: ArmDriver,
    domain: Domain,
    output: Output,
    course: Course,
    phase: Phase,
    begin: Instant,
    agreement: Agreement,
    /// The newest posture [rad].
    position: Vec<f64>,
    /// When it came, and who wrote it.
    heard: Option<(Instant, GUID)>,
    /// When somebody else wrote the same joints.
    second: Option<Instant>,
    /// Why the last message was not used.
    bad: Option<String>,
    is_lost: bool,
    number: u64,
    /// What is wrong on the topics, as of the last look.
    topics: Option<String>,
    looked: Instant,
    sent: Instant,
    /// Whether no command has moved the arm in this run.
    is_first: bool,
    /// Whether the last message that was sent ends a motion.
    has_ended: bool,
    /// Until when an arm comes to rest that stops by itself.
    stops_until: Option<Instant>,
}

impl Session {
    fn new(arm: ArmDriver, domain: Domain, output: Output) -> Self {
        let now = Instant::now();
        let joints = arm.names.len();
        Self {
            course: Course::new(joints, arm.acceleration),
            agreement: Agreement::new(arm.commanded.clock_bound, now),
            phase: Phase::Waiting { since: now },
            begin: now,
            position: vec![0.0; joints],
            heard: None,
            second: None,
            bad: None,
            is_lost: false,
            number: 0,
            topics: Some("nobody has looked at the topics yet".to_owned()),
            looked: now,
            sent: now,
            is_first: true,
            has_ended: true,
            stops_until: None,
            arm,
            domain,
            output,
        }
    }

    /// Takes a message of joint states.
    fn hear(&mut self, link: &mut Link, message: Result<(JointState, GUID), String>) {
        let taken = message.and_then(|(message, writer)| self.take(&message).map(|is_ours| (message, writer, is_ours)));
        match taken {
            Ok((message, writer, true)) => self.publish(link, &message, writer),
            // Those of other joints, such as a gripper's.
            Ok((_, _, false)) => {}
            Err(why) => {
                link.count("bad messages");
                self.bad = Some(why);
            }
        }
    }

    /// Takes the positions of our joints out of a message. Returns whether it has any.
    fn take(&mut self, message: &JointState) -> Result<bool, String> {
        let (states, names) = (&self.arm.states, &message.name);
        if names.len() != message.position.len() {
            return Err(format!("`{states}` has {} names and {} positions", names.len(), message.position.len()));
        }
        let missing = |name: &&String| !names.contains(name);
        if self.arm.names.iter().all(|name| missing(&name)) {
            self.bad = Some(format!("`{states}` has the joints `{}`, and none of ours", names.join("`, `")));
            return Ok(false);
        }
        if let Some(name) = self.arm.names.iter().find(missing) {
            return Err(format!("`{states}` lacks the joint `{name}`; it has `{}`", names.join("`, `")));
        }
        if let Some(name) = self.arm.names.iter().find(|ours| names.iter().filter(|name| name == ours).count() > 1) {
            return Err(format!("`{states}` has the joint `{name}` more than once in a message"));
        }
        for (name, position) in names.iter().zip(&message.position) {
            if let Some(i) = self.arm.names.iter().position(|ours| ours == name) {
                self.position[i] = *position;
            }
        }
        Ok(true)
    }

    fn publish(&mut self, link: &mut Link, message: &JointState, writer: GUID) {
        let now = Instant::now();
        if self.heard.is_some_and(|(at, last)| last != writer && now - at < self.arm.timeout) {
            self.second = Some(now);
        }
        let stamp = message.header.stamp.nanos();
        if stamp != 0 {
            self.agreement.hear(now, wall_clock(), stamp);
        }
        self.stops_until.take_if(|until| now >= *until);
        if self.course.rests() && self.stops_until.is_none() && !self.is_ready() {
            self.course.reference.copy_from_slice(&self.position);
        }
        if let Some(beyond) = &mut self.arm.beyond {
            beyond.hear(now, &self.position);
        }
        self.heard = Some((now, writer));
        (self.is_lost, self.bad, self.number) = (false, None, self.number + 1);
        let is_ready = self.is_ready();
        // A graph that is held because the arm is not ready yet would wait for the operator.
        if !is_ready && !link.is_mute() && self.begin.elapsed() < self.arm.site.patience {
            return;
        }
        let stamp = if stamp == 0 { link.arrival() } else { link.stamp_of(stamp) };
        let equilibrium = if self.arm.commanded.ends_at_rest() { &self.course.reference } else { &self.position };
        let (ports, number) = (self.arm.ports, self.number);
        link.publish(|samples| {
            ports.write_with_safety(samples, stamp, number, [&self.position, equilibrium], is_ready);
        });
    }

    /// Whether the arm follows commands.
    const fn is_ready(&self) -> bool {
        matches!(self.phase, Phase::Ready { .. })
    }

    /// Looks who else is on the topics.
    fn look(&mut self) {
        self.looked = Instant::now();
        self.topics = self.output.trouble(&self.domain, &self.arm.command);
    }

    /// Returns why the arm may not move.
    fn why_not(&self) -> Option<String> {
        let states = &self.arm.states;
        let Some((at, _)) = self.heard.filter(|(at, _)| at.elapsed() <= self.arm.timeout) else {
            return Some(self.bad.clone().unwrap_or_else(|| self.domain.why_silent::<JointState>(states)));
        };
        if self.second.is_some_and(|second| at.saturating_duration_since(second) < MEMORY) {
            return Some(format!("two programs publish our joints on `{states}`"));
        }
        let commanded = &self.arm.commanded;
        let clocks = || commanded.has_time().then(|| self.agreement.why_not(states)).flatten();
        let astray = || commanded.ends_at_rest().then(|| self.why_astray()).flatten();
        let beyond = || self.arm.beyond.as_ref().and_then(Beyond::why);
        clocks().or_else(astray).or_else(beyond).or_else(|| self.topics.clone())
    }

    /// Says which joint does not follow: a controller that is not active takes messages, and moves nothing.
    fn why_astray(&self) -> Option<String> {
        let bound = self.arm.deflection;
        let joints = self.arm.names.iter().zip(self.course.reference.iter().zip(&self.position));
        let (name, (to, at)) = joints.filter(|_| self.is_ready()).find(|(_, (to, at))| (*to - *at).abs() > bound)?;
        Some(format!(
            "joint `{name}` is at {at:.4} rad, and is commanded to {to:.4} rad: they differ by more than {bound} rad. Check \
             that the controller is active and can move the arm, or raise `start_bounds.deflection`"
        ))
    }

    /// Decides whether the arm may move.
    fn judge(&mut self, link: &mut Link) {
        let why = self.why_not();
        let is_silent = self.heard.is_none_or(|(at, _)| at.elapsed() > self.arm.timeout);
        let has_waited = self.heard.is_some() || self.begin.elapsed() > self.arm.site.patience;
        if is_silent && has_waited && !self.is_lost {
            self.is_lost = true;
            let why = why.clone().unwrap_or_default();
            self.arm.ports.lose(link, &why);
        }
        let epoch = link.epoch();
        self.phase = match (self.phase, why) {
            // It is ready where it rests, and that is not known yet.
            (waiting @ Phase::Waiting { .. }, None) if self.stops_until.is_some() => waiting,
            (Phase::Waiting { .. }, None) => match self.check() {
                Ok(()) => Phase::Ready { epoch },
                Err(why) => refused(link, why),
            },
            (Phase::Waiting { since }, Some(why)) if since.elapsed() > self.arm.site.patience => refused(link, why),
            (Phase::Ready { epoch: last }, None) if last != epoch => Phase::Waiting { since: Instant::now() },
            (Phase::Ready { .. }, Some(_)) if is_silent => Phase::Waiting { since: Instant::now() },
            (Phase::Ready { .. }, Some(why)) => refused(link, why),
            (Phase::Refused, _) if !link.refuses() => Phase::Waiting { since: Instant::now() },
            (phase, _) => phase,
        };
    }

    /// Compares the posture with where the arm should be before it is moved.
    fn check(&mut self) -> Result<(), String> {
        if !self.course.rests() {
            return Ok(());
        }
        let report = StartReport {
            measured: &self.position,
            commanded: &self.course.reference,
            target: &self.course.reference,
            held: None,
            tip: None,
            is_first: self.is_first,
        };
        self.arm.start.check(&report).map_err(|error| error.0)
    }

    /// Sends what holds now.
    fn send(&mut self, link: &mut Link) {
        // The stamp is older than the commands: if the process is suspended from here on, they are too old when they leave.
        let made = wall_clock();
        // The lease must be asked in every cycle, also when nothing is sent.
        let commands = link.commands().joints(self.arm.ports.velocity).to_vec();
        let dt = self.sent.elapsed().as_secs_f64();
        self.sent = Instant::now();
        // Without a message for so long, the arm stops by itself, and does not get where the commands were going.
        let is_too_long = dt > self.arm.commanded.lifespan || link.is_mute();
        if is_too_long && !self.course.rests() {
            self.course.halt();
            self.has_ended = true;
            self.stops_until = Some(self.sent + Duration::from_secs_f64(self.arm.commanded.silence));
            self.phase = Phase::Waiting { since: Instant::now() };
        }
        if link.is_mute() || self.stops_until.is_some() {
            return;
        }
        // The operator may have resumed since it was judged. Then these commands are new, and nothing is checked yet.
        let is_checked = self.phase == Phase::Ready { epoch: link.epoch() };
        if self.heard.is_none() {
            return;
        }
        self.course.advance(is_checked.then_some(commands.as_slice()), dt);
        let rests = self.course.rests();
        self.is_first &= rests;
        // At rest, an arm that follows trajectories needs no message. One that follows velocities gets zeros.
        let is_due = !(rests && self.has_ended) || is_checked && !self.arm.commanded.ends_at_rest();
        if is_due {
            let is_sent = self.say(made);
            self.has_ended = rests && is_sent;
            if !is_sent {
                link.count("commands that were not sent");
            }
        }
    }

    /// Sends the course, as it was made at a time [ns, wall clock]. Returns whether it was taken.
    fn say(&self, made: i64) -> bool {
        let (names, position) = (&self.arm.names, &self.position);
        self.output.say(&Said { course: &self.course, names, position, made })
    }

    /// Repeats at the end of a run that an arm that follows velocities is to rest, in case a message was lost.
    ///
    /// A trajectory ends at rest by itself. Another one would move an arm that has stopped on its own, as while this process
    /// was suspended, back to where it was last commanded.
    async fn leave(&mut self, link: &Link) {
        if self.arm.commanded.ends_at_rest() {
            return;
        }
        self.course.halt();
        for _ in 0..3 {
            if link.is_mute() || self.is_first {
                return;
            }
            self.say(wall_clock());
            sleep(Duration::from_millis(10)).await;
        }
    }
}

fn refused(link: &mut Link, why: String) -> Phase {
    link.refuse(why);
    Phase::Refused
}
