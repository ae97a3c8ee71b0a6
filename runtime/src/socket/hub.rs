//! What the clients of a run share: the end of the ring, and a bounded queue for each watcher.

use std::cell::{Cell, RefCell};
use std::fmt::Write;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use tokio::sync::{Notify, mpsc, oneshot};
use tokio::time::{sleep, timeout};

use super::asks::{PortFacts, RunEnd, WalkAnswer};
use super::described::Described;
use super::feed::Wishes;
use super::follower::Follower;
use super::frames::{Content, FedValue, FeedReader, Frame, Whole};
use crate::engine::{ChangeRequest, RunRequests, Walk};
use crate::record::seconds_text;

/// Interval at which the ring is read while something is wanted.
const LOOK: Duration = Duration::from_millis(5);
/// Longest wait for a tick.
const MAX_TICK: Duration = Duration::from_secs(2);
/// Longest wait for the check of a change.
const MAX_CHECK: Duration = Duration::from_secs(20);
/// Longest time between two lines of a follower [ms].
const MAX_PERIOD_MS: f64 = 10_000.0;
/// Number of samples that wait for a watcher.
const MAX_WAITING: usize = 256;

/// A frame with everything, as those who wait for it get it.
type WholeFrame = Rc<(Frame, Whole)>;

/// What the clients share. All of them run on one thread.
pub(super) struct Hub {
    pub(super) described: Described,
    requests: Arc<RunRequests>,
    changes: SyncSender<ChangeRequest>,
    wishes: Arc<Wishes>,
    reader: RefCell<FeedReader>,
    watchers: RefCell<Vec<Watcher>>,
    followers: RefCell<Vec<Follower>>,
    /// Time of the last tick that was read, in the graph's clock [ns].
    now: Cell<i64>,
    waiting: RefCell<Vec<oneshot::Sender<WholeFrame>>>,
    is_wanted: Notify,
    /// Number of clients that have not read all samples.
    watching: Cell<usize>,
}

/// Counts a client that has not read all samples.
pub(super) struct Watching<'h>(&'h Cell<usize>);

impl Drop for Watching<'_> {
    fn drop(&mut self) {
        self.0.set(self.0.get() - 1);
    }
}

/// A client that watches.
struct Watcher {
    /// Columns, in their order, each with the name under which it is sent.
    columns: Vec<(usize, String)>,
    queue: mpsc::Sender<String>,
    /// Samples that it has lost since the last line that it was sent.
    lost: u64,
    /// Samples until it ends.
    left: Option<u64>,
}

impl Hub {
    pub(super) fn new(
        described: Described,
        (wishes, reader): (Arc<Wishes>, FeedReader),
        requests: Arc<RunRequests>,
        changes: SyncSender<ChangeRequest>,
    ) -> Self {
        Self {
            described,
            requests,
            changes,
            wishes,
            reader: RefCell::new(reader),
            watchers: RefCell::default(),
            followers: RefCell::default(),
            now: Cell::new(0),
            waiting: RefCell::default(),
            is_wanted: Notify::new(),
            watching: Cell::new(0),
        }
    }

    /// Reads the ring while something is wanted, for ever.
    pub(super) async fn work(&self) {
        loop {
            let is_followed = !self.followers.borrow().is_empty();
            if self.watchers.borrow().is_empty() && self.waiting.borrow().is_empty() && !is_followed {
                self.is_wanted.notified().await;
            }
            sleep(LOOK).await;
            self.drain();
        }
    }

    /// Passes on what is in the ring.
    pub(super) fn drain(&self) {
        while let Some(frame) = self.next_frame() {
            match frame {
                Frame { content: Content::Whole(whole), tick, now, epoch } => {
                    let frame = Frame { tick, now, epoch, content: Content::Watched(Vec::new()) };
                    let both = Rc::new((frame, whole));
                    for waiting in self.waiting.borrow_mut().drain(..) {
                        // Who waits no longer needs no answer.
                        let _ = waiting.send(Rc::clone(&both));
                    }
                }
                Frame { content: Content::Watched(values), now, epoch, .. } => {
                    self.now.set(now);
                    self.send_sample(now, &values);
                    self.followers.borrow_mut().iter_mut().for_each(|follower| follower.take(epoch, &values));
                }
            }
        }
        let lost = self.wishes.take_lost();
        self.watchers.borrow_mut().iter_mut().for_each(|watcher| watcher.lost += lost);
        let (at, now) = (Instant::now(), self.now.get());
        self.followers.borrow_mut().iter_mut().for_each(|follower| follower.send(at, now));
        self.forget(|watcher| watcher.queue.is_closed() || watcher.left == Some(0));
    }

    fn next_frame(&self) -> Option<Frame> {
        self.reader.borrow_mut().next()
    }

    fn send_sample(&self, now: i64, values: &[FedValue]) {
        for watcher in self.watchers.borrow_mut().iter_mut().filter(|watcher| watcher.left != Some(0)) {
            let new = watcher.columns.iter().filter_map(|(column, name)| {
                let column = &self.described.columns[*column];
                let value = values.iter().find(|value| value.port == column.port)?;
                Some((name.as_str(), value.row.as_ref().and_then(|row| row.number(column.index))))
            });
            let new: Vec<(&str, Option<f64>)> = new.collect();
            if new.is_empty() {
                continue;
            }
            match watcher.queue.try_reserve() {
                Ok(place) => {
                    place.send(sample(now, std::mem::take(&mut watcher.lost), &new));
                    watcher.left = watcher.left.map(|left| left - 1);
                }
                Err(_) => watcher.lost += 1,
            }
        }
    }

    /// Removes watchers, and followers that are gone. Their queues end.
    fn forget(&self, is_gone: impl Fn(&Watcher) -> bool) {
        let (mut watchers, mut followers) = (self.watchers.borrow_mut(), self.followers.borrow_mut());
        let before = watchers.len() + followers.len();
        watchers.retain(|watcher| !is_gone(watcher));
        followers.retain(|follower| !follower.is_gone());
        if watchers.len() + followers.len() != before {
            self.wish(&watchers, &followers);
        }
    }

    /// Sets which ports the tick writes.
    fn wish(&self, watchers: &[Watcher], followers: &[Follower]) {
        let columns = || watchers.iter().flat_map(|watcher| &watcher.columns);
        let is_watched = |port| columns().any(|(column, _)| self.described.columns[*column].port == port);
        self.wishes.watch(|port| is_watched(port) || followers.iter().any(|follower| follower.follows(port)));
    }

    /// Returns the values of the next tick.
    pub(super) async fn whole(&self) -> Result<WholeFrame, String> {
        let (sender, receiver) = oneshot::channel();
        self.waiting.borrow_mut().push(sender);
        self.wishes.want_whole();
        self.is_wanted.notify_one();
        match timeout(MAX_TICK, receiver).await {
            Ok(Ok(frame)) => Ok(frame),
            Ok(Err(_)) => Err("the run has ended".into()),
            Err(_) => Err(format!("no tick within {} s: the run is starting, ends or hangs", MAX_TICK.as_secs())),
        }
    }

    /// Changes parameters.
    pub(super) async fn set(&self, values: Vec<(String, f64)>) -> Result<Vec<WalkAnswer>, String> {
        if values.is_empty() {
            return Err("name a parameter and its value: {\"pid.gains.x.kp\": 3}".into());
        }
        let (sender, receiver) = oneshot::channel();
        let names: Vec<String> = values.iter().map(|(name, _)| name.clone()).collect();
        let answer = Box::new(move |result| {
            // Who waits no longer needs no answer.
            let _ = sender.send(result);
        });
        let busy = |_| "too many changes wait for their check, or the run ends: try again".to_owned();
        self.changes.try_send(ChangeRequest { values, answer }).map_err(busy)?;
        match timeout(MAX_CHECK, receiver).await {
            Ok(Ok(walks)) => {
                let walk = |(name, walk): (String, Walk)| WalkAnswer {
                    name,
                    from: walk.from,
                    to: walk.to,
                    seconds: walk.seconds,
                };
                walks.map(|walks| names.into_iter().zip(walks).map(walk).collect())
            }
            Ok(Err(_)) => Err("the run has ended".into()),
            Err(_) => {
                Err(format!("the check takes more than {} s; `get` shows what became of it", MAX_CHECK.as_secs()))
            }
        }
    }

    /// Sends a word, if it stops.
    pub(super) fn send(&self, word: &str) -> Result<String, String> {
        if self.requests.request(word) {
            Ok(self.described.stopped(word))
        } else {
            Err(self.described.refused(word, self.requests.words()))
        }
    }

    /// Takes the zeros of the sensors anew. Returns what does, or why nothing can.
    pub(super) async fn tare(&self) -> Result<String, String> {
        let (answer, answered) = oneshot::channel();
        // Who waits no longer needs no answer.
        self.requests.request_tare(Box::new(move |tared| drop(answer.send(tared))));
        answered.await.unwrap_or_else(|_| Err("the run has ended".into()))
    }

    /// Adds a watcher. Returns its queue.
    pub(super) fn watch(&self, ports: &[String], count: Option<u64>) -> Result<mpsc::Receiver<String>, String> {
        let columns = self.described.find_all(ports)?;
        if count == Some(0) {
            return Err("`count` must be greater than 0".into());
        }
        let (queue, receiver) = mpsc::channel(MAX_WAITING);
        let mut watchers = self.watchers.borrow_mut();
        watchers.push(Watcher { columns, queue, lost: 0, left: count });
        self.wish(&watchers, &self.followers.borrow());
        self.is_wanted.notify_one();
        Ok(receiver)
    }

    /// Adds a follower. Returns what does not change of its ports, and its queue.
    pub(super) fn follow(
        &self,
        ports: &[String],
        period_ms: f64,
    ) -> Result<(Vec<PortFacts>, mpsc::Receiver<String>), String> {
        if !(0.0..=MAX_PERIOD_MS).contains(&period_ms) {
            return Err(format!("`period_ms` must be from 0 to {MAX_PERIOD_MS}"));
        }
        let found = self.described.find_ports(ports)?;
        let names = found.iter().map(|(port, facts)| (*port, facts.name.clone())).collect();
        let (follower, lines) = Follower::new(names, Duration::from_secs_f64(period_ms * 1e-3));
        let mut followers = self.followers.borrow_mut();
        followers.push(follower);
        self.wish(&self.watchers.borrow(), &followers);
        found.keys().for_each(|port| self.wishes.want_at_once(*port));
        self.is_wanted.notify_one();
        Ok((found.into_values().collect(), lines))
    }

    /// Counts a client until it has read all samples.
    pub(super) fn begin_watching(&self) -> Watching<'_> {
        self.watching.set(self.watching.get() + 1);
        Watching(&self.watching)
    }

    /// Whether a client has not read all samples.
    pub(super) fn is_watched(&self) -> bool {
        self.watching.get() > 0
    }

    /// Passes on what is left of a run that has ended, and ends all queues. Followers get how it has ended.
    pub(super) fn end(&self, end: Option<&RunEnd>) {
        self.drain();
        self.followers.borrow_mut().drain(..).for_each(|follower| follower.end(self.now.get(), end));
        self.forget(|_| true);
        self.waiting.borrow_mut().clear();
    }
}

/// Writes a sample as a line.
fn sample(now: i64, lost: u64, values: &[(&str, Option<f64>)]) -> String {
    let mut line = format!("{{\"t\":{}", seconds_text(now));
    // Writing to a string cannot fail.
    if lost > 0 {
        let _ = write!(line, ",\"lost\":{lost}");
    }
    for (name, value) in values {
        // A number that is not finite is null.
        let value = value.map_or(serde_json::Value::Null, serde_json::Value::from);
        let _ = write!(line, ",{}:{value}", serde_json::Value::from(*name));
    }
    line + "}\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_a_line_of_json() {
        let values = [("touch.x", Some(0.5)), ("touch.y", None), ("a.b", Some(f64::NAN))];
        assert_eq!(sample(1_500_000_000, 0, &values), "{\"t\":1.5,\"touch.x\":0.5,\"touch.y\":null,\"a.b\":null}\n");
        assert_eq!(sample(0, 7, &values[..1]), "{\"t\":0.0,\"lost\":7,\"touch.x\":0.5}\n");
    }
}
