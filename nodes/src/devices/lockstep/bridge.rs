//! The turns of a run: each frame is shown, answered and followed by the next; and how the arm is left at rest.

use std::time::{Duration, Instant};

use tactflow_runtime::device::{Command, Commands, DeviceError, Output, Report, Samples, Stepped};
use tactflow_runtime::signal::{Image, Joints, Pose};

use super::message::{self, Hello, Message, Obs, Sizes};
use super::socket::Socket;

/// The ports of the pad and the arm.
pub(super) struct Ports {
    pub(super) image: Output<Image>,
    pub(super) position: Output<Joints>,
    pub(super) equilibrium: Output<Joints>,
    pub(super) velocity: Command,
    pub(super) contact: Report<Pose>,
}

/// A simulator that is being run with.
pub(super) struct Bridge {
    ports: Ports,
    socket: Socket,
    address: String,
    sizes: Sizes,
    is_lockstep: bool,
    /// Time between two frames [ns].
    period: i64,
    /// Greatest acceleration of a joint [rad/s²].
    acceleration: f64,
    /// Time of the simulator at the first frame [s].
    begin: Option<f64>,
    /// Number and time [s] of the frame that came last.
    newest: Option<(u64, f64)>,
    /// Frame that came and is not due yet.
    pending: Option<(i64, Obs)>,
    /// Stamp of the frame that was shown last [ns].
    shown: Option<i64>,
    /// Frame that was shown and waits for its answer.
    open: Option<u64>,
    /// What was commanded last [rad/s].
    commanded: Vec<f64>,
    is_over: bool,
}

impl Bridge {
    pub(super) fn new(
        ports: Ports,
        socket: Socket,
        address: String,
        sizes: Sizes,
        hello: &Hello,
        acceleration: f64,
    ) -> Self {
        Self {
            ports,
            socket,
            address,
            sizes,
            is_lockstep: hello.is_lockstep,
            period: ((hello.dt * 1e9).round() as i64).max(1),
            acceleration,
            begin: None,
            newest: None,
            pending: None,
            shown: None,
            open: None,
            commanded: vec![0.0; sizes.joints],
            is_over: false,
        }
    }

    /// A turn: answers the frame that was shown last, and shows the next when it is due.
    fn turn(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), String> {
        if self.pending.is_none() {
            if let Some(seq) = self.open.take() {
                let est = commands.report(self.ports.contact).map(|pose| pose.0.translation.vector.into());
                self.answer(seq, commands.joints(self.ports.velocity), est)?;
            }
            if !self.is_over {
                self.pending = self.next_frame()?;
            }
        }
        // A frame that is a little ahead is shown at once: the simulator's clock need not beat exactly.
        if let Some((stamp, obs)) = self.pending.take_if(|(stamp, _)| *stamp < now.saturating_add(self.period)) {
            self.show(stamp, &obs, samples);
        }
        Ok(())
    }

    fn answer(&mut self, seq: u64, dq: &[f64], est: Option<[f64; 3]>) -> Result<(), String> {
        self.commanded.copy_from_slice(dq);
        let said = self.socket.say(&message::cmd(seq, dq, est));
        // It may have ended the run before it closed, without having waited for this.
        if said.is_err() && self.has_ended() {
            self.is_over = true;
            return Ok(());
        }
        said
    }

    /// Whether the last that the simulator said is that it ends.
    fn has_ended(&mut self) -> bool {
        while let Ok(Some(line)) = self.socket.line_within(Duration::ZERO) {
            if message::message(&line, self.sizes) == Ok(Message::End) {
                return true;
            }
        }
        false
    }

    /// Waits for the next frame; of a simulator that does not wait, the newest one that is there. None at the end.
    fn next_frame(&mut self) -> Result<Option<(i64, Obs)>, String> {
        let line = self.socket.line()?;
        let mut frame = self.frame(&line)?;
        while !self.is_lockstep && frame.is_some() {
            let Some(line) = self.socket.line_at_hand()? else { break };
            frame = self.frame(&line)?;
        }
        self.is_over = frame.is_none();
        Ok(frame)
    }

    /// A frame and its stamp [ns]; none at the end.
    fn frame(&mut self, line: &str) -> Result<Option<(i64, Obs)>, String> {
        let message = message::message(line, self.sizes).map_err(|why| self.in_line(why))?;
        let Message::Obs(obs) = message else { return Ok(None) };
        let wrong = |why: String| Err(self.in_line(format!("obs {}: {why}", obs.seq)));
        if let Some((seq, t)) = self.newest {
            if obs.seq <= seq {
                return wrong(format!("`seq` is {} after {seq}, but it grows with every frame", obs.seq));
            }
            if obs.t < t {
                return wrong(format!("`t` is {} after {t}: the clock of a simulator does not go back", obs.t));
            }
        }
        let begin = *self.begin.get_or_insert(obs.t);
        self.newest = Some((obs.seq, obs.t));
        Ok(Some((((obs.t - begin) * 1e9).round() as i64, obs)))
    }

    fn in_line(&self, why: String) -> String {
        format!("line {}: {why}", self.socket.lines)
    }

    fn show(&mut self, stamp: i64, obs: &Obs, samples: &mut Samples) {
        let cells = samples.write(self.ports.image, stamp, obs.seq).cells_mut();
        cells.iter_mut().zip(&obs.img).for_each(|(cell, counts)| *cell = *counts as f32);
        samples.write(self.ports.position, stamp, obs.seq).0.copy_from_slice(&obs.q);
        samples.write(self.ports.equilibrium, stamp, obs.seq).0.copy_from_slice(&obs.q_eq);
        (self.shown, self.open) = (Some(stamp), Some(obs.seq));
    }

    /// Brings the arm to rest as far as the simulator still listens, whatever it says, and ends.
    fn leave(&mut self, why: &str) {
        /// How long to wait for a frame that is to be answered.
        const LISTEN: Duration = Duration::from_millis(50);
        /// How long a ramp may take in all.
        const LONGEST: Duration = Duration::from_secs(5);
        let end = Instant::now() + LONGEST;
        // A frame that cannot be read still counts, and its simulator waits for the answer.
        let mut seq = self.open.unwrap_or_else(|| self.newest.map_or(0, |(seq, _)| seq + 1));
        loop {
            let is_still = self.slow_down(Instant::now() >= end);
            if self.socket.say(&message::cmd(seq, &self.commanded, None)).is_err() || is_still {
                break;
            }
            match self.socket.line_within(LISTEN) {
                Ok(Some(line)) => seq = message::seq_of(&line).unwrap_or(seq + 1),
                Ok(None) => {}
                // What is no line is one to answer; what is closed does not take it.
                Err(_) => seq += 1,
            }
        }
        self.bid_farewell(why);
    }

    /// The command one frame nearer to zero, as the joints bear it, or there at once; whether it is zero.
    fn slow_down(&mut self, at_once: bool) -> bool {
        let most = self.acceleration * self.period as f64 * 1e-9;
        let greatest = self.commanded.iter().fold(0.0_f64, |greatest, dq| greatest.max(dq.abs()));
        let left = if at_once || greatest <= most { 0.0 } else { 1.0 - most / greatest };
        self.commanded.iter_mut().for_each(|dq| *dq = if left == 0.0 { 0.0 } else { *dq * left });
        left == 0.0
    }

    fn bid_farewell(&mut self, reason: &str) {
        if !std::mem::replace(&mut self.is_over, true) && self.socket.say(&message::end(reason)).is_ok() {
            self.socket.hang_up();
        }
    }
}

impl Stepped for Bridge {
    fn next(&self) -> Option<i64> {
        let next = match (&self.pending, self.shown) {
            (Some((stamp, _)), _) => *stamp,
            (None, Some(shown)) => shown + self.period,
            (None, None) => 0,
        };
        (!self.is_over).then_some(next)
    }

    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        if self.is_over {
            return Ok(());
        }
        self.turn(now, commands, samples).map_err(|why| {
            let why = format!("the simulator at `{}`: {why}", self.address);
            self.leave(&why);
            DeviceError(why)
        })
    }

    fn finish(&mut self, reason: &str) {
        self.bid_farewell(reason);
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        // A graph that was only checked; one that ran has said so.
        self.bid_farewell("the graph does not run");
    }
}
