//! The exchange of frames and commands with a simulator, and how the arm is brought to rest at the end.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use tactflow_runtime::device::{Commands, DeviceError, Output, Samples, Stepped};
use tactflow_runtime::signal::Image;
use tactflow_runtime::signal::line::approach;

use super::Params;
use super::frames::Frames;
use super::message::{self, Hello, Obs, Reply};
use super::socket::Socket;
use crate::devices::arm::ArmPorts;

/// A simulator that runs with the graph.
pub(super) struct Bridge {
    image: Output<Image>,
    arm: ArmPorts,
    socket: Socket,
    frames: Frames,
    params: Params,
    /// Time of the simulator at the first frame [s].
    begin: Option<f64>,
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
            begin: None,
            pending: None,
            shown: None,
            unanswered: None,
            commanded: vec![0.0; hello.joints.len()],
            is_over: false,
            frames: Frames::new(hello),
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
        if let Some((stamp, obs)) = self.pending.take_if(|(stamp, _)| *stamp < now.saturating_add(self.frames.period()))
        {
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
            if message::message(&line, &self.frames.hello) == Ok(None) {
                return true;
            }
        }
        false
    }

    /// Waits for the next frame. Returns it with its stamp [ns], or `None` at the end of the run.
    fn next_frame(&mut self) -> Result<Option<(i64, Obs)>, String> {
        let line = self.socket.line()?;
        let frame = self.frames.read(&line, self.socket.lines())?;
        self.is_over = frame.is_none();
        let begin = frame.as_ref().map_or(0.0, |obs| *self.begin.get_or_insert(obs.t));
        Ok(frame.map(|obs| (((obs.t - begin) * 1e9).round() as i64, obs)))
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
        let mut seq = self.unanswered.unwrap_or_else(|| self.frames.newest.map_or(0, |(seq, _)| seq + 1));
        loop {
            let deceleration = if Instant::now() >= end { f64::INFINITY } else { self.params.acceleration };
            let is_still = slow_down(&mut self.commanded, deceleration, self.frames.hello.dt);
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

    /// Sends the end of the run, if it has not ended yet.
    fn end_run(&mut self, reason: &str) {
        if !std::mem::replace(&mut self.is_over, true) && self.socket.send(&Reply::End { reason }.line()).is_ok() {
            self.socket.close();
        }
    }
}

/// Reduces a command [rad/s] by what the joints can decelerate [rad/s²] in `dt` [s]. Returns whether it is zero.
fn slow_down(commanded: &mut [f64], deceleration: f64, dt: f64) -> bool {
    let decelerations = vec![deceleration; commanded.len()];
    approach(commanded, |_| 0.0, &decelerations, dt)
}

impl Stepped for Bridge {
    fn next(&self) -> Option<i64> {
        let next = match (&self.pending, self.shown) {
            (Some((stamp, _)), _) => *stamp,
            (None, Some(shown)) => shown + self.frames.period(),
            (None, None) => 0,
        };
        (!self.is_over).then_some(next)
    }

    fn watch(&mut self, is_ending: &'static AtomicBool) {
        self.socket.watch(is_ending);
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
