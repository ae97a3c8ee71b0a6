//! A client that follows ports: it gets their newest values, at most one line in each period.
//!
//! A client that reads slowly gets fewer lines, and the newest values in each of them.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde::Serialize;
use tokio::sync::mpsc;

use super::asks::RunEnd;
use super::frames::{FedValue, Row};
use crate::record::file_seconds;

/// Lines that wait for the client. Two places are kept for the last values and the end of the run.
const MAX_WAITING: usize = 4;
const KEPT: usize = 2;

/// A client that follows ports.
pub(super) struct Follower {
    /// The names of the ports, by their numbers in the feed.
    ports: BTreeMap<usize, String>,
    /// The newest values that have not been sent.
    pending: BTreeMap<usize, Newest>,
    /// Shortest time between two lines.
    period: Duration,
    /// When the next line is due.
    due: Instant,
    queue: mpsc::Sender<String>,
}

#[derive(Serialize)]
struct Newest {
    /// Wall clock [ns since 1970].
    stamp_ns: i64,
    values: Option<Row>,
}

/// A line of values.
#[derive(Serialize)]
struct Line<'l> {
    t: f64,
    ports: BTreeMap<&'l str, &'l Newest>,
}

/// The last line of a run.
#[derive(Serialize)]
struct LastLine {
    end: RunEnd,
}

impl Follower {
    /// Follows ports. Returns the queue of the lines.
    pub(super) fn new(ports: BTreeMap<usize, String>, period: Duration) -> (Self, mpsc::Receiver<String>) {
        let (queue, lines) = mpsc::channel(MAX_WAITING);
        (Self { ports, pending: BTreeMap::new(), period, due: Instant::now(), queue }, lines)
    }

    /// Whether it follows a port.
    pub(super) fn follows(&self, port: usize) -> bool {
        self.ports.contains_key(&port)
    }

    /// Whether the client is gone.
    pub(super) fn is_gone(&self) -> bool {
        self.queue.is_closed()
    }

    /// Takes the new values of a tick. `epoch` is the wall clock at time zero of the graph [ns since 1970].
    pub(super) fn take(&mut self, epoch: i64, values: &[FedValue]) {
        for FedValue { port, stamp, row } in values.iter().filter(|value| self.ports.contains_key(&value.port)) {
            let stamp_ns = epoch.saturating_add(*stamp);
            self.pending.insert(*port, Newest { stamp_ns, values: row.clone() });
        }
    }

    /// Sends the newest values if they are due, and the client reads. `now` is the time of the last tick [ns].
    pub(super) fn send(&mut self, at: Instant, now: i64) {
        if at >= self.due && self.queue.capacity() > KEPT && !self.pending.is_empty() {
            self.due = at + self.period;
            self.say(now);
        }
    }

    fn say(&mut self, now: i64) {
        if self.pending.is_empty() {
            return;
        }
        let named = |(port, newest)| Some((self.ports.get(port)?.as_str(), newest));
        let line = Line { t: file_seconds(now), ports: self.pending.iter().filter_map(named).collect() };
        // A client that is gone needs no line.
        let _ = self.queue.try_send(text(&line));
        self.pending.clear();
    }

    /// Sends what is left of a run, and how it has ended.
    pub(super) fn end(mut self, now: i64, end: Option<&RunEnd>) {
        self.say(now);
        if let Some(end) = end {
            let _ = self.queue.try_send(text(&LastLine { end: end.clone() }));
        }
    }
}

fn text(line: &impl Serialize) -> String {
    serde_json::to_string(line).expect("every key is a string") + "\n"
}

#[cfg(test)]
mod tests {
    use super::super::asks::Followed;
    use super::*;

    const MS: i64 = 1_000_000;

    fn value(port: usize, stamp: i64, number: f64) -> FedValue {
        FedValue { port, stamp, row: Some(Row::Numbers(vec![number])) }
    }

    type Values = Option<Vec<Option<f64>>>;

    fn numbers(line: &str) -> Vec<(String, i64, Values)> {
        let line: Followed = serde_json::from_str(line).unwrap();
        line.ports.into_iter().map(|(name, sample)| (name, sample.stamp_ns, sample.values)).collect()
    }

    #[test]
    fn a_line_has_the_newest_values_and_comes_once_in_each_period() {
        let (mut follower, mut lines) = Follower::new([(3, "a.x".to_owned())].into(), Duration::from_millis(20));
        let begin = Instant::now();
        for tick in 0..7 {
            follower.take(1000 * MS, &[value(3, tick * 4 * MS, tick as f64), value(5, 0, 1.0)]);
            follower.send(begin + Duration::from_millis(4 * tick as u64), tick * 4 * MS);
        }
        let said = |tick: i64| vec![("a.x".to_owned(), (1000 + 4 * tick) * MS, Some(vec![Some(tick as f64)]))];
        assert_eq!(numbers(&lines.try_recv().unwrap()), said(0));
        assert_eq!(numbers(&lines.try_recv().unwrap()), said(5));
        // The last value is not lost when no other comes.
        follower.send(begin + Duration::from_millis(40), 24 * MS);
        assert_eq!(numbers(&lines.try_recv().unwrap()), said(6));
        assert!(lines.try_recv().is_err());
    }

    #[test]
    fn a_client_that_does_not_read_gets_the_newest_values_and_the_end() {
        let (mut follower, mut lines) = Follower::new([(0, "a.x".to_owned())].into(), Duration::ZERO);
        for tick in 0..100 {
            follower.take(0, &[value(0, tick, tick as f64)]);
            follower.send(Instant::now(), tick);
        }
        let end = RunEnd { reason: "done".into(), is_fault: false };
        follower.end(100, Some(&end));
        let mut all = Vec::new();
        while let Ok(line) = lines.try_recv() {
            all.push(line);
        }
        assert_eq!(all.len(), MAX_WAITING);
        assert_eq!(numbers(&all[2])[0].1, 99);
        assert_eq!(serde_json::from_str::<Followed>(&all[3]).unwrap().end, Some(end));
    }

    #[test]
    fn what_is_absent_or_no_number_is_null() {
        let (mut follower, mut lines) =
            Follower::new([(0, "a".to_owned()), (1, "b".to_owned())].into(), Duration::ZERO);
        let image = FedValue { port: 1, stamp: 0, row: Some(Row::Cells(vec![0.1, f32::NAN])) };
        follower.take(0, &[FedValue { port: 0, stamp: 0, row: None }, image]);
        follower.send(Instant::now(), 0);
        let line = lines.try_recv().unwrap();
        let expected = "{\"t\":0.0,\"ports\":{\"a\":{\"stamp_ns\":0,\"values\":null},\
                        \"b\":{\"stamp_ns\":0,\"values\":[0.1,null]}}}\n";
        assert_eq!(line, expected);
        assert_eq!(numbers(&line)[1].2, Some(vec![Some(0.1), None]));
    }
}
