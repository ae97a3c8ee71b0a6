//! The driver of a pad: it opens the link, publishes each image, and opens the link again when it is gone.

use std::time::{Duration, Instant};

use async_trait::async_trait;
use tactflow_runtime::device::{DeviceError, Link, Live, Output};
use tactflow_runtime::signal::{Image, VectorImage};
use tokio::time::{sleep_until, timeout};

use super::plan::Plan;
use super::reader::{Reader, Tally};
use crate::devices::link::{Backoff, Connection, RECEIVED_BYTES};

/// Time that a pad has for its first frame: many boards start anew when their port is opened.
const FIRST_FRAME_TIME: Duration = Duration::from_secs(3);
/// Time of silence after which the link is opened again. Opening it more often would keep such a board from starting.
const REOPEN_TIME: Duration = Duration::from_secs(6);
/// Longest time for the bytes at the end of a run to be sent.
const STOP_TIME: Duration = Duration::from_millis(300);
/// Time for an answer, at least; then the question is asked again.
const REPLY_TIME: Duration = Duration::from_millis(200);
/// Shortest time without bytes that is a pause.
const MIN_PAUSE: Duration = Duration::from_millis(1);

/// A pad that is described and ready to run.
pub(super) struct PadDriver {
    image: Output<Image>,
    /// The vector image of a pad with three axes.
    vectors: Option<Output<VectorImage>>,
    reader: Reader,
    /// The newest image.
    cells: Vec<f32>,
    received: Vec<u8>,
    is_lost: bool,
    /// Number of bytes since the last frame.
    strange: u64,
    /// Number of frames that were rejected since the last frame.
    rejected: u64,
}

#[async_trait]
impl Live for PadDriver {
    async fn run(mut self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let (mut backoff, mut was_open) = (Backoff::new(), false);
        loop {
            let (stopped, plan) = (link.stopped(), self.plan());
            let opened = tokio::select! {
                biased;
                () = stopped => return Ok(()),
                opened = Connection::open(&plan.address, plan.baud, plan.from) => opened,
            };
            let why = match opened {
                Ok(mut connection) => {
                    if std::mem::replace(&mut was_open, true) {
                        link.count("reconnects");
                    }
                    match self.follow(&mut connection, &mut link, &mut backoff).await {
                        Ok(()) => {
                            // Nothing can be done if the pad does not take it.
                            let _ = timeout(STOP_TIME, connection.send(&self.plan().stop)).await;
                            return Ok(());
                        }
                        Err(why) => why,
                    }
                }
                Err(why) => why,
            };
            self.lose(&mut link, &why);
            if !backoff.pause(&link).await {
                return Ok(());
            }
        }
    }
}

impl PadDriver {
    pub(super) fn new(image: Output<Image>, vectors: Option<Output<VectorImage>>, plan: Plan) -> Self {
        let reader = Reader::new(plan);
        let (cells, received) = (reader.cells(), Vec::with_capacity(RECEIVED_BYTES));
        Self { image, vectors, reader, cells, received, is_lost: false, strange: 0, rejected: 0 }
    }

    const fn plan(&self) -> &Plan {
        &self.reader.plan
    }

    /// Publishes images until the run ends.
    ///
    /// # Errors
    /// Why the connection has ended before.
    async fn follow(
        &mut self,
        connection: &mut Connection,
        link: &mut Link,
        backoff: &mut Backoff,
    ) -> Result<(), String> {
        self.reader.forget();
        connection.send(&self.plan().start).await?;
        let pause = (self.plan().period / 4).max(MIN_PAUSE);
        let (mut heard, mut read, mut poll_at) = (Instant::now(), Instant::now(), Instant::now());
        // When a question that has no answer is asked again.
        let mut again = Instant::now();
        let mut patience = self.plan().timeout.max(FIRST_FRAME_TIME);
        let stopped = link.stopped();
        tokio::pin!(stopped);
        loop {
            let ask_at = if self.reader.is_waiting() { poll_at.max(again) } else { poll_at };
            let limit = heard + if self.is_lost { REOPEN_TIME } else { patience };
            tokio::select! {
                biased;
                () = &mut stopped => return Ok(()),
                // Before the bytes: a flood of them must not keep the clock from running.
                () = sleep_until(ask_at.into()), if self.plan().poll.is_some() => {
                    poll_at = (poll_at + self.plan().period).max(Instant::now());
                    again = Instant::now() + (5 * self.plan().period).max(REPLY_TIME);
                    self.ask(connection).await?;
                }
                () = sleep_until(limit.into()) => {
                    let why = self.silence(heard.elapsed());
                    if self.is_lost {
                        return Err(why);
                    }
                    self.lose(link, &why);
                    // A pad that was without power waits for this again.
                    connection.send(&self.plan().start).await?;
                }
                received = connection.receive(&mut self.received) => {
                    received?;
                    let is_after_pause = read.elapsed() > pause;
                    read = Instant::now();
                    if self.read(connection, link, is_after_pause) {
                        (heard, patience) = (Instant::now(), self.plan().timeout);
                        backoff.reset();
                    }
                }
            }
        }
    }

    /// Asks for a frame.
    async fn ask(&mut self, connection: &mut Connection) -> Result<(), String> {
        self.reader.ask();
        connection.send(self.plan().poll.as_deref().unwrap_or_default()).await
    }

    /// Publishes the images in what was received. Returns whether there is one.
    fn read(&mut self, connection: &mut Connection, link: &mut Link, is_after_pause: bool) -> bool {
        self.strange += self.received.len() as u64;
        self.reader.push(&self.received, is_after_pause);
        let mut has_image = false;
        while let Some(read) = self.reader.next(&mut self.cells) {
            (has_image, self.strange, self.is_lost) = (true, 0, false);
            self.rejected = 0;
            let stamp = match read.time {
                Some(time) => link.stamp_of(time),
                None => link.arrival(),
            };
            link.publish(|samples| {
                samples.write(self.image, stamp, read.number).cells_mut().copy_from_slice(&self.cells);
                if let Some(vectors) = self.vectors {
                    samples.write(vectors, stamp, read.number).cells_mut().copy_from_slice(&self.reader.vectors);
                }
            });
        }
        if has_image {
            connection.accept_sender();
        }
        self.count(link, connection.take_foreign());
        has_image
    }

    /// Adds to the counts of the run.
    fn count(&mut self, link: &mut Link, foreign: u64) {
        self.rejected += self.reader.tally.rejected;
        let Tally { frames, rejected, resyncs, skipped, repeated, lost, late } = std::mem::take(&mut self.reader.tally);
        let counts = [
            ("frames", frames),
            ("rejected frames", rejected),
            ("resyncs", resyncs),
            ("skipped bytes", skipped),
            ("repeated frames", repeated),
            ("lost frames", lost),
            ("late frames", late),
            ("foreign datagrams", foreign),
        ];
        link.count_each(&counts);
    }

    fn lose(&mut self, link: &mut Link, why: &str) {
        self.is_lost = true;
        link.lost(self.image, format!("{}: {why}", self.plan().address));
        if let Some(vectors) = self.vectors {
            link.lost(vectors, format!("{}: {why}", self.plan().address));
        }
    }

    /// Says why there is no frame.
    fn silence(&self, since: Duration) -> String {
        let silent = format!("no frame for {} ms", since.as_millis());
        if self.strange == 0 {
            let is_asked = !self.plan().start.is_empty() || self.plan().poll.is_some();
            let asked = match is_asked {
                true => " and does not answer: check `baud`, and whether `start` or `poll` must end with a line break",
                false => ": check `baud`, and whether the pad waits for a `start` or a `poll`",
            };
            return format!("{silent}: the pad sends nothing{asked}");
        }
        if self.reader.is_ambiguous() {
            return format!(
                "{silent}: the data has the `mark` at the same place in every frame; a longer `mark`, a `check` or \
                 `plausible` identifies the right one"
            );
        }
        if self.rejected > 0 && self.plan().has_check {
            return format!(
                "{silent}: {} bytes came with {} frames that have no right checksum; check `check`, `check_from` and \
                 `check_order`, and that `length` and `mark` are right",
                self.strange, self.rejected
            );
        }
        format!(
            "{silent}: {} bytes came, and none of them is a frame; check `baud`, `frame`, `mark`, `length` and `offset`",
            self.strange
        )
    }
}
