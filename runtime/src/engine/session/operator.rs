//! Words from outside: those that were given beforehand for a time of the graph, and those that come in while it runs.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Where words come from.
pub(crate) struct Words {
    /// When [ns], and which; in the order of the times.
    planned: VecDeque<(i64, String)>,
    heard: Option<Receiver<String>>,
}

impl Words {
    /// Words for times of the graph [s], and, if asked, the lines of the standard input.
    pub(crate) fn new(planned: &[(f64, String)], listens: bool) -> Self {
        let mut planned: Vec<(i64, String)> =
            planned.iter().map(|(seconds, word)| ((seconds * 1e9) as i64, word.clone())).collect();
        planned.sort_by_key(|(at, _)| *at);
        Self { planned: planned.into(), heard: listens.then(|| listen(std::io::stdin())) }
    }

    /// The next word that is due at `now` [ns].
    pub(crate) fn next(&mut self, now: i64) -> Option<String> {
        let heard = self.heard.as_ref().map(Receiver::try_recv);
        if heard == Some(Err(TryRecvError::Disconnected)) {
            self.heard = None;
        }
        heard.and_then(Result::ok).or_else(|| self.planned.pop_front_if(|(at, _)| *at <= now).map(|(_, word)| word))
    }

    /// Whether another word can come.
    pub(crate) fn may_come(&self) -> bool {
        self.heard.is_some() || !self.planned.is_empty()
    }
}

/// The lines of an input, read by a thread that ends with it, or with the process.
fn listen(input: impl Read + Send + 'static) -> Receiver<String> {
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
    fn words_come_in_the_order_of_their_times() {
        let mut words = Words::new(&[(0.2, "b".into()), (0.1, "a".into())], false);
        assert_eq!(words.next(99_999_999), None);
        assert_eq!(words.next(250_000_000).as_deref(), Some("a"));
        assert_eq!(words.next(250_000_000).as_deref(), Some("b"));
        assert!(words.next(i64::MAX).is_none() && !words.may_come());
    }

    #[test]
    fn an_input_that_has_ended_gives_no_more_words() {
        let mut words = Words { planned: VecDeque::new(), heard: Some(listen(&b"  stop \n\nresume"[..])) };
        let mut heard = Vec::new();
        while words.may_come() {
            heard.extend(words.next(0));
        }
        assert_eq!(heard, ["stop", "resume"]);
    }
}
