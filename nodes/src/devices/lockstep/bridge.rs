//! The exchange of frames and commands with a simulator, and how the arm is brought to rest at the end.

use std::time::{Duration, Instant};

use tactflow_runtime::device::{Commands, DeviceError, Output, Samples, Stepped};
use tactflow_runtime::signal::Image;

use super::Params;
use super::message::{self, Hello, Obs, Reply};
use super::socket::Socket;
use crate::devices::arm::ArmPorts;

/// A simulator that runs with the graph.
pub(super) struct Bridge {
    image: Output<Image>,
    arm: ArmPorts,
    socket: Socket,
    hello: Hello,
    params: Params,
    /// Time between two frames [ns].
    period: i64,
    /// Time of the simulator at the first frame [s].
    begin: Option<f64>,
    /// Number and time [s] of the last frame.
    newest: Option<(u64, f64)>,
    /// The next frame, with its stamp [ns].
    pending: Option<(i64, Obs)>,
    /// Stamp of the last frame that was shown [ns].
    shown: Option<i64>,
    /// Number of the frame that was shown and waits for its answer.
    unanswered: Option<u64>,
    /// Last command [rad/s].
    commanded: Vec<f64>,
    is_over: bool,
}

impl Bridge {
    pub(super) fn new(image: Output<Image>, arm: ArmPorts, socket: Socket, hello: Hello, params: Params) -> Self {
        Self {
            image,
            arm,
            socket,
            params,
            period: ((hello.dt * 1e9).round() as i64).max(1),
            begin: None,
            newest: None,
            pending: None,
            shown: None,
            unanswered: None,
            commanded: vec![0.0; hello.joints.len()],
            is_over: false,
            hello,
        }
    }

    /// Answers the last frame that was shown, and shows the next one when it is due.
    fn take_turn(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), String> {
        if self.pending.is_none() {
            if let Some(seq) = self.unanswered.take() {
                let est = commands.report(self.arm.contact).map(|pose| pose.0.translation.vector.into());
                self.answer(seq, commands.joints(self.arm.velocity), est)?;
            }
            if !self.is_over {
                self.pending = self.next_frame()?;
            }
        }
        // A frame that is less than a period ahead is shown at once, because the clock of a simulator may jitter.
        if let Some((stamp, obs)) = self.pending.take_if(|(stamp, _)| *stamp < now.saturating_add(self.period)) {
            self.show(stamp, &obs, samples);
        }
        Ok(())
    }

    fn answer(&mut self, seq: u64, dq: &[f64], est: Option<[f64; 3]>) -> Result<(), String> {
        self.commanded.copy_from_slice(dq);
        let sent = self.socket.send(&Reply::Cmd { seq, dq, est }.line());
        // The simulator may have ended the run and closed the connection without waiting for this command.
        self.is_over = sent.is_err() && self.has_ended();
        if self.is_over { Ok(()) } else { sent }
    }

    /// Returns whether the simulator has sent that it ends the run.
    fn has_ended(&mut self) -> bool {
        while let Ok(Some(line)) = self.socket.line_within(Duration::ZERO) {
            if message::message(&line, &self.hello) == Ok(None) {
                return true;
            }
        }
        false
    }

    /// Waits for the next frame. If the simulator does not wait for commands, returns the newest frame that has
    /// arrived. Returns `None` at the end of the run.
    fn next_frame(&mut self) -> Result<Option<(i64, Obs)>, String> {
        let line = self.socket.line()?;
        let mut frame = self.frame(&line)?;
        while !self.hello.is_lockstep && frame.is_some() {
            let Some(line) = self.socket.line_if_ready()? else { break };
            frame = self.frame(&line)?;
        }
        self.is_over = frame.is_none();
        Ok(frame)
    }

    /// Reads a frame. Returns it with its stamp [ns], or `None` at the end of the run.
    fn frame(&mut self, line: &str) -> Result<Option<(i64, Obs)>, String> {
        let frame = message::message(line, &self.hello).map_err(|why| self.in_line(why))?;
        let Some(obs) = frame else { return Ok(None) };
        let wrong = |why: String| Err(self.in_line(format!("obs {}: {why}", obs.seq)));
        if let Some((seq, t)) = self.newest {
            if obs.seq <= seq {
                return wrong(format!(
                    "`seq` is {} after a frame with {seq}, but it must increase with every frame",
                    obs.seq
                ));
            }
            if obs.t < t {
                return wrong(format!("`t` is {} s after a frame at {t} s: the time must not go back", obs.t));
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
        let cells = samples.write(self.image, stamp, obs.seq).cells_mut();
        cells.iter_mut().zip(&obs.img).for_each(|(cell, counts)| *cell = *counts as f32);
        self.arm.write(samples, stamp, obs.seq, [&obs.q, &obs.q_eq]);
        (self.shown, self.unanswered) = (Some(stamp), Some(obs.seq));
    }

    /// Brings the arm to rest if the simulator still listens, whatever it sends, and ends the run. After `max_ramp`, the
    /// command is zero at once.
    fn stop(&mut self, why: &str, max_ramp: Duration) {
        /// Maximum time to wait for a frame.
        const FRAME_TIMEOUT: Duration = Duration::from_millis(50);
        let end = Instant::now() + max_ramp;
        // A frame that cannot be read still counts, and the simulator waits for the answer.
        let mut seq = self.unanswered.unwrap_or_else(|| self.newest.map_or(0, |(seq, _)| seq + 1));
        loop {
            let is_still = self.slow_down(Instant::now() >= end);
            if self.socket.send(&Reply::Cmd { seq, dq: &self.commanded, est: None }.line()).is_err() || is_still {
                break;
            }
            match self.socket.line_within(FRAME_TIMEOUT) {
                Ok(Some(line)) => seq = message::seq_of(&line).unwrap_or(seq + 1),
                Ok(None) => {}
                // A bad line is also a frame to answer. If the connection is closed, the answer fails and the loop ends.
                Err(_) => seq += 1,
            }
        }
        self.end_run(why);
    }

    /// Reduces the command by what the joints can decelerate in a frame, or to zero at once. Returns whether it is
    /// zero.
    fn slow_down(&mut self, at_once: bool) -> bool {
        let step = self.params.acceleration * self.period as f64 * 1e-9;
        let speed = self.commanded.iter().fold(0.0_f64, |speed, dq| speed.max(dq.abs()));
        let is_still = at_once || speed <= step;
        self.commanded.iter_mut().for_each(|dq| *dq = if is_still { 0.0 } else { *dq * (1.0 - step / speed) });
        is_still
    }

    /// Sends the end of the run, if it has not ended yet.
    fn end_run(&mut self, reason: &str) {
        if !std::mem::replace(&mut self.is_over, true) && self.socket.send(&Reply::End { reason }.line()).is_ok() {
            self.socket.close();
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
        /// Maximum duration of the ramp after a failure.
        const MAX_RAMP: Duration = Duration::from_secs(3);
        if self.is_over {
            return Ok(());
        }
        self.take_turn(now, commands, samples).map_err(|why| {
            let why = format!("the simulator at `{}`: {why}", self.params.address);
            self.stop(&why, MAX_RAMP);
            DeviceError(why)
        })
    }

    fn finish(&mut self, reason: &str) {
        /// Maximum duration of what is left of the ramp.
        const MAX_REST: Duration = Duration::from_millis(500);
        // A frame that was not due yet leaves the last commands of the graph's ramp unsent.
        if !self.is_over && self.commanded.iter().any(|dq| *dq != 0.0) {
            self.stop(reason, MAX_REST);
        }
        self.end_run(reason);
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        // After a check without a run. A run has sent its own reason.
        self.end_run("the graph does not run");
    }
}
