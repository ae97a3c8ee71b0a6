//! A simulator that runs by its own clock and does not wait for commands.

use std::io::ErrorKind;
use std::time::{Duration, Instant};

use async_trait::async_trait;
use tactflow_runtime::device::{DeviceError, Link, Live, Output};
use tactflow_runtime::signal::Image;
use tokio::net::TcpStream;

use super::Params;
use super::frames::Frames;
use super::lines::Lines;
use super::message::{Hello, Obs, Reply};
use super::socket::{Socket, broken, closed};
use crate::devices::arm::ArmPorts;

/// Time without a command after which such a simulator sets the velocity to zero.
pub(super) const COMMAND_TIMEOUT: Duration = Duration::from_millis(100);
/// Number of bytes that are received at once.
const RECEIVED_BYTES: usize = 1 << 16;
/// Maximum time between two commands.
const KEEP_ALIVE: Duration = Duration::from_millis(40);

/// Longest time to wait for a simulator that does not read.
const MOMENT: Duration = Duration::from_millis(200);

/// The device before the run: it has read the hello message.
pub(super) struct FreeRunning {
    pub(super) image: Output<Image>,
    pub(super) arm: ArmPorts,
    /// `None` once the run has begun.
    pub(super) socket: Option<Socket>,
    pub(super) hello: Hello,
    pub(super) params: Params,
}

#[async_trait]
impl Live for FreeRunning {
    async fn run(mut self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let socket = self.socket.take().expect("a device runs once");
        let (stream, mut arrived, lines) = socket.into_parts()?;
        arrived.reserve(RECEIVED_BYTES);
        let mut session = Session {
            image: self.image,
            arm: self.arm,
            stream: TcpStream::from_std(stream)?,
            arrived,
            lines,
            outbox: Vec::new(),
            frames: Frames::new(self.hello.clone()),
            begin: None,
            sent: vec![0.0; self.hello.joints.len()],
            answered: None,
            sent_at: Instant::now(),
        };
        let silence = Duration::from_secs_f64(self.params.reply_s.min(1e6));
        match session.follow(&mut link, silence).await {
            Ok(End::Simulator) => {
                link.finish();
                Ok(())
            }
            Ok(End::Graph) => {
                // The last command must not be lost because the one before still waits here.
                session.drain().await;
                session.send(&mut link);
                session.leave(&link.reason()).await;
                Ok(())
            }
            Err(why) => {
                let why = format!("the simulator at `{}`: {why}", self.params.address);
                session.rest(&mut link, &why).await;
                session.leave(&why).await;
                Err(DeviceError(why))
            }
        }
    }
}

impl Drop for FreeRunning {
    fn drop(&mut self) {
        // After a check without a run.
        if let Some(mut socket) = self.socket.take()
            && socket.send(&Reply::End { reason: "the graph does not run" }.line()).is_ok()
        {
            socket.close();
        }
    }
}

/// Who has ended a run.
enum End {
    Simulator,
    Graph,
}

/// The exchange of frames and commands.
struct Session {
    image: Output<Image>,
    arm: ArmPorts,
    stream: TcpStream,
    /// Bytes that have arrived and are not read yet.
    arrived: Vec<u8>,
    lines: Lines,
    /// The rest of a command that the connection has not taken yet.
    outbox: Vec<u8>,
    frames: Frames,
    /// Time of the simulator at the first frame [s].
    begin: Option<f64>,
    /// The last command [rad/s], the frame that it answered, and when it was sent.
    sent: Vec<f64>,
    answered: Option<u64>,
    sent_at: Instant,
}

impl Session {
    /// Publishes frames and sends commands until one side ends the run.
    ///
    /// # Errors
    /// What the simulator does wrong.
    async fn follow(&mut self, link: &mut Link, silence: Duration) -> Result<End, String> {
        let mut heard = Instant::now();
        loop {
            if !self.read(link)? {
                return Ok(End::Simulator);
            }
            let (stopped, commanded) = (link.stopped(), link.commanded());
            tokio::select! {
                biased;
                () = stopped => return Ok(End::Graph),
                () = commanded => self.send(link),
                ready = self.stream.readable() => {
                    ready.map_err(broken)?;
                    self.receive()?;
                    heard = Instant::now();
                }
            }
            if heard.elapsed() > silence {
                return Err(format!("the simulator has sent nothing for {} s", silence.as_secs_f64()));
            }
        }
    }

    /// Receives the bytes that have arrived.
    fn receive(&mut self) -> Result<(), String> {
        match self.stream.try_read_buf(&mut self.arrived) {
            Ok(0) => Err(closed(&self.lines)),
            Ok(_) => Ok(()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(()),
            Err(error) => Err(broken(error)),
        }
    }

    /// Reads the frames that have arrived, and publishes the newest. Returns whether the run goes on.
    fn read(&mut self, link: &mut Link) -> Result<bool, String> {
        let (mut newest, mut taken, mut goes_on) = (None, 0, true);
        while goes_on && taken < self.arrived.len() {
            let (count, line) = self.lines.feed(&self.arrived[taken..]);
            taken += count;
            let Some(line) = line? else { continue };
            let Some(obs) = self.frames.read(&line, self.lines.count)? else {
                goes_on = false;
                continue;
            };
            let begin = *self.begin.get_or_insert(obs.t);
            newest = Some((link.stamp_of(((obs.t - begin) * 1e9).round() as i64), obs));
        }
        self.arrived.clear();
        if let Some((stamp, obs)) = newest {
            self.publish(link, stamp, &obs);
        }
        Ok(goes_on)
    }

    fn publish(&mut self, link: &mut Link, stamp: i64, obs: &Obs) {
        link.publish(|samples| {
            let cells = samples.write(self.image, stamp, obs.seq).cells_mut();
            cells.iter_mut().zip(&obs.img).for_each(|(cell, counts)| *cell = *counts as f32);
            self.arm.write(samples, stamp, obs.seq, [&obs.q, &obs.q_eq]);
        });
    }

    /// Sends the command that holds now, if it answers a frame, differs from the last one, or keeps the simulator from
    /// its timeout.
    fn send(&mut self, link: &mut Link) {
        let commands = link.commands();
        let (seq, dq) = (commands.answers(), commands.joints(self.arm.velocity));
        let is_due = self.answered != seq || self.sent != dq || self.sent_at.elapsed() >= KEEP_ALIVE;
        let Some(seq) = seq.filter(|_| is_due) else { return };
        let est = commands.report(self.arm.contact).map(|pose| pose.0.translation.vector.into());
        let line = Reply::Cmd { seq, dq, est }.line();
        if self.flush() {
            self.sent.copy_from_slice(dq);
            self.put(&line);
            (self.answered, self.sent_at) = (Some(seq), Instant::now());
        }
    }

    fn put(&mut self, line: &str) {
        self.outbox.extend_from_slice(line.as_bytes());
        self.flush();
    }

    /// Sends the rest of the last message. Returns whether the connection has taken all of it. No other message is made
    /// before, so at most one waits here.
    fn flush(&mut self) -> bool {
        if let Ok(count) = self.stream.try_write(&self.outbox) {
            self.outbox.drain(..count);
        }
        self.outbox.is_empty()
    }

    /// Waits until the connection has taken the last message, for a moment at most.
    async fn drain(&mut self) {
        let end = Instant::now() + MOMENT;
        while !self.flush() && Instant::now() < end {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    /// Brings the arm to rest after a failure, for as long as the simulator takes commands.
    async fn rest(&mut self, link: &mut Link, why: &str) {
        /// Longest time of the ramp; then the command is zero at once.
        const MAX_RAMP: Duration = Duration::from_secs(3);
        const MAX_REST: Duration = Duration::from_millis(3200);
        link.refuse(why);
        let begin = Instant::now();
        let seq = self.frames.newest.map_or(0, |(seq, _)| seq);
        while begin.elapsed() < MAX_REST {
            self.sent.copy_from_slice(link.commands().joints(self.arm.velocity));
            if begin.elapsed() > MAX_RAMP {
                self.sent.fill(0.0);
            }
            if self.flush() {
                let line = Reply::Cmd { seq, dq: &self.sent, est: None }.line();
                self.put(&line);
                if self.sent.iter().all(|dq| *dq == 0.0) {
                    return;
                }
            }
            tokio::time::sleep(Duration::from_secs_f64(self.frames.hello.dt).min(KEEP_ALIVE)).await;
        }
    }

    /// Sends the end of the run, and gives the simulator a moment to read it.
    async fn leave(&mut self, reason: &str) {
        self.put(&Reply::End { reason }.line());
        self.drain().await;
        let mut rest = [0; 4096];
        // A connection that is dropped while the simulator still sends could lose the last message.
        let _ = tokio::time::timeout(MOMENT, async {
            while tokio::io::AsyncWriteExt::shutdown(&mut self.stream).await.is_ok()
                && tokio::io::AsyncReadExt::read(&mut self.stream, &mut rest).await.is_ok_and(|count| count > 0)
            {
            }
        })
        .await;
    }
}
