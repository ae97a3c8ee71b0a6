//! Words from outside: those that were given beforehand for a time of the graph, and those that come in while it runs.

use std::collections::VecDeque;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, channel};

/// Where words come from.
pub(super) struct Words {
    /// When [ns], and which; in the order of the times.
    planned: VecDeque<(i64, String)>,
    heard: Option<Receiver<String>>,
}

impl Words {
    /// Words for times of the graph [s], and, if asked, the lines of the standard input.
    pub(super) fn new(planned: &[(f64, String)], listens: bool) -> Self {
        let mut planned: Vec<(i64, String)> =
            planned.iter().map(|(seconds, word)| ((seconds * 1e9) as i64, word.clone())).collect();
        planned.sort_by_key(|(at, _)| *at);
        Self { planned: planned.into(), heard: listens.then(listen) }
    }

    /// The next word that is due at `now` [ns].
    pub(super) fn next(&mut self, now: i64) -> Option<String> {
        let heard = self.heard.as_ref().and_then(|heard| heard.try_recv().ok());
        heard.or_else(|| self.planned.pop_front_if(|(at, _)| *at <= now).map(|(_, word)| word))
    }

    /// Whether another word can come.
    pub(super) fn may_come(&self) -> bool {
        self.heard.is_some() || !self.planned.is_empty()
    }
}

/// The lines of the standard input, read by a thread that ends with the process.
fn listen() -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
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
}
