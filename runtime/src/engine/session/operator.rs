//! Operator words: those scheduled before the run, and those typed on the standard input during it.

use std::collections::VecDeque;
use std::io::{IsTerminal, stdin};
use std::sync::{Arc, Mutex, PoisonError};

use super::engine::Engine;
use super::line_reader::{LineReader, stops};
use super::outcome::RunOptions;
use super::run_requests::RunRequests;
use super::task_run::TaskRun;

/// Maximum number of words from the standard input that one tick carries out.
const MAX_WORDS: usize = 8;

/// The words that the operator sends to a run.
pub(crate) struct OperatorInput {
    /// Time [ns] and word, in order of time.
    scheduled: VecDeque<(i64, String)>,
    /// The names of the tasks.
    tasks: Vec<String>,
    /// The standard input; `None` if it is not read or has ended.
    reader: Option<LineReader>,
    /// What other threads request.
    requests: Option<Arc<RunRequests>>,
    warnings: Warnings,
}

impl OperatorInput {
    /// Takes the scheduled words, the requested stops and, if the run listens, the lines of the standard input.
    ///
    /// # Errors
    /// If there can be no thread that reads.
    pub(crate) fn new(options: &RunOptions, engine: &Engine) -> std::io::Result<Self> {
        let mut scheduled: Vec<(i64, String)> =
            options.sends.iter().map(|(seconds, word)| ((seconds * 1e9) as i64, word.clone())).collect();
        scheduled.sort_by_key(|(at, _)| *at);
        let tasks: Vec<String> = engine.tasks().iter().skip(1).map(TaskRun::name).map(str::to_owned).collect();
        let reader = options.listens.then(|| typed(tasks.clone())).transpose()?;
        let requests = options.requests.clone();
        Ok(Self { scheduled: scheduled.into(), tasks, reader, requests, warnings: Warnings::default() })
    }

    /// Sends the words that are due at `now` [ns] to the engine, each stop before all others.
    pub(crate) fn carry_out(&mut self, engine: &mut Engine, now: i64) {
        let due = self.scheduled.partition_point(|(at, _)| *at <= now);
        let due = self.scheduled.drain(..due).map(|(_, word)| word);
        let (stop, others): (Vec<String>, Vec<String>) = due.partition(|word| stops(word, &self.tasks));
        stop.iter().for_each(|word| warn(engine.send(word)));
        if let Some(requests) = &self.requests {
            requests.carry_out(engine, warn);
        }
        self.carry_out_lines(engine, now);
        others.iter().for_each(|word| warn(engine.send(word)));
    }

    /// Sends what has been read from the standard input.
    fn carry_out_lines(&mut self, engine: &mut Engine, now: i64) {
        let Some(reader) = &self.reader else { return };
        let (mut words, mut dropped) = (Vec::new(), 0);
        let is_open = reader.look(|inbox| {
            // A stop voids the words that were read before it is carried out: they are all sent now, and refused.
            let count = if inbox.stops.is_empty() { MAX_WORDS.min(inbox.lines.len()) } else { inbox.lines.len() };
            words.extend(inbox.stops.drain(..).map(Ok));
            words.extend(inbox.lines.drain(..count));
            dropped = std::mem::take(&mut inbox.dropped);
        });
        if !is_open {
            self.reader = None;
        }
        self.warnings.begin(now);
        for word in words {
            if let Err(message) = word.and_then(|word| engine.send(&word)) {
                self.warnings.add(message);
            }
        }
        self.warnings.drop_lines(dropped);
    }

    /// Whether another word can still arrive.
    pub(crate) fn is_open(&self) -> bool {
        self.reader.is_some() || !self.scheduled.is_empty()
    }

    /// Prints the warnings that were held back.
    pub(crate) fn finish(&mut self) {
        self.warnings.finish();
    }
}

/// Returns the reader of the standard input. The process has one, because nothing ends a thread that reads from a
/// terminal. A further run gets only what is typed from now on.
fn typed(tasks: Vec<String>) -> std::io::Result<LineReader> {
    static READER: Mutex<Option<LineReader>> = Mutex::new(None);
    let mut reader = READER.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(reader) = &*reader {
        reader.begin(tasks);
        return Ok(reader.clone());
    }
    Ok(reader.insert(LineReader::start(stdin(), tasks, is_back_later)?).clone())
}

/// Whether the standard input can be read again later: in the background, a terminal cannot be read.
fn is_back_later(error: &std::io::Error) -> bool {
    const EIO: i32 = 5;
    error.raw_os_error() == Some(EIO) && stdin().is_terminal()
}

fn warn(sent: Result<(), String>) {
    if let Err(message) = sent {
        tracing::warn!("{message}");
    }
}

/// Warnings about the words: a few at once, and then one in each second.
#[derive(Debug, Default)]
struct Warnings {
    /// The second of the graph's time in which the last warning was printed.
    second: i64,
    /// Number of warnings that have been printed at most one second after another.
    burst: u64,
    /// Number of warnings that were held back.
    held_back: u64,
    /// Number of lines that were dropped, and not reported yet.
    dropped: u64,
}

impl Warnings {
    /// Number of warnings that may follow each other without a pause.
    const MAX_BURST: u64 = 8;

    /// Begins the words at `now` [ns].
    fn begin(&mut self, now: i64) {
        let second = now / 1_000_000_000;
        if second > self.second {
            self.burst = self.burst.saturating_sub((second - self.second) as u64);
            self.second = second;
            self.report();
        }
    }

    fn add(&mut self, message: String) {
        if self.burst < Self::MAX_BURST {
            self.burst += 1;
            tracing::warn!("{message}");
        } else {
            self.held_back += 1;
        }
    }

    fn drop_lines(&mut self, count: u64) {
        self.dropped += count;
    }

    /// Prints how many warnings were held back, and how many lines were dropped.
    fn report(&mut self) {
        if self.burst >= Self::MAX_BURST {
            return;
        }
        let counts = [
            (std::mem::take(&mut self.held_back), "lines from standard input were no words that have an effect"),
            (
                std::mem::take(&mut self.dropped),
                "lines from standard input were dropped, because too many came at once",
            ),
        ];
        for (count, what) in counts.into_iter().filter(|(count, _)| *count > 0) {
            self.burst += 1;
            tracing::warn!("{count} more {what}");
        }
    }

    fn finish(&mut self) {
        self.burst = 0;
        self.report();
    }
}
