//! Operator words: those scheduled before the run, and those typed on the standard input during it.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// The words that the operator sends to a run.
pub(crate) struct OperatorInput {
    /// Time [ns] and word, in order of time.
    scheduled: VecDeque<(i64, String)>,
    /// Lines of the standard input; `None` if it is not read or has ended.
    lines: Option<Receiver<String>>,
}

impl OperatorInput {
    /// Takes words scheduled in the graph's time [s] and, if `reads_stdin`, the lines of the standard input.
    pub(crate) fn new(scheduled: &[(f64, String)], reads_stdin: bool) -> Self {
        let mut scheduled: Vec<(i64, String)> =
            scheduled.iter().map(|(seconds, word)| ((seconds * 1e9) as i64, word.clone())).collect();
        scheduled.sort_by_key(|(at, _)| *at);
        Self { scheduled: scheduled.into(), lines: reads_stdin.then(|| read_lines(std::io::stdin())) }
    }

    /// Returns the next word that is due at `now` [ns].
    pub(crate) fn next(&mut self, now: i64) -> Option<String> {
        let line = self.lines.as_ref().map(Receiver::try_recv);
        if line == Some(Err(TryRecvError::Disconnected)) {
            self.lines = None;
        }
        line.and_then(Result::ok).or_else(|| self.scheduled.pop_front_if(|(at, _)| *at <= now).map(|(_, word)| word))
    }

    /// Whether another word can still arrive.
    pub(crate) fn is_open(&self) -> bool {
        self.lines.is_some() || !self.scheduled.is_empty()
    }
}

/// Reads the lines of an input on a thread, which ends with the input or with the process.
fn read_lines(input: impl Read + Send + 'static) -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in BufReader::new(input).lines().map_while(Result::ok) {
            let word = line.trim();
            if !word.is_empty() && sender.send(word.to_owned()).is_err() {
                break;
            }
        }
    });
    receiver
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scheduled_words_are_sent_in_order_of_time() {
        let mut input = OperatorInput::new(&[(0.2, "b".into()), (0.1, "a".into())], false);
        assert_eq!(input.next(99_999_999), None);
        assert_eq!(input.next(250_000_000).as_deref(), Some("a"));
        assert_eq!(input.next(250_000_000).as_deref(), Some("b"));
        assert!(input.next(i64::MAX).is_none() && !input.is_open());
    }

    #[test]
    fn the_input_closes_after_its_last_line() {
        let lines = read_lines(&b"  stop \n\nresume"[..]);
        let mut input = OperatorInput { scheduled: VecDeque::new(), lines: Some(lines) };
        let mut words = Vec::new();
        while input.is_open() {
            words.extend(input.next(0));
        }
        assert_eq!(words, ["stop", "resume"]);
    }
}
