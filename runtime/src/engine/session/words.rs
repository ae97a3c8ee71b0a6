//! What an operator word does: which tasks it reaches, and why a task refuses it.

use super::engine::Engine;
use super::tare::TARE;
use super::task_run::TaskRun;
use super::trouble::Trouble;
use crate::graph::{Policy, WORDS};
use crate::source::suggestion;

/// What a word does in a task.
enum Effect {
    Done,
    /// Why it has none. The text follows the word.
    Refused(String),
    /// The task does not know the word.
    Unknown,
}

const STOPPED: &str = "has no effect while the commands are stopped: send `resume` first";

impl Engine {
    /// Sends an operator word, in upper or lower case. `stop` halts the commands, `resume` ends the halt, and `tare` takes
    /// the zeros of the sensors anew. Other words go to the modes. A bare word reaches all tasks, and `left.stop` only the
    /// task `left` and those in it.
    ///
    /// A `stop` takes effect in the next tick. It voids every word before that tick, sent before it or after it.
    ///
    /// # Errors
    /// Returns a message if no mode has a condition on the word, if the commands wait for `resume`, or if the trouble
    /// that stopped them is not over at `resume`.
    pub fn send(&mut self, word: &str) -> Result<(), String> {
        if word.eq_ignore_ascii_case(TARE) && !self.tasks.iter().any(|task| task.words().any(|known| known == word)) {
            return self.tare().map(drop);
        }
        if let Some(log) = &mut self.inputs {
            log.word(word);
        }
        let (to, bare) = self.addressee(word);
        let (mut is_done, mut refusal) = (false, None);
        for task in 0..self.tasks.len() {
            if !self.reaches(to, task) {
                continue;
            }
            match self.carry_out(task, bare) {
                Effect::Done => is_done = true,
                Effect::Refused(why) => refusal = refusal.or(Some(why)),
                Effect::Unknown => {}
            }
        }
        // Whoever resumes all tasks must know of the one that does not.
        if let Some(why) = refusal.filter(|_| !is_done || bare.eq_ignore_ascii_case("resume")) {
            return Err(format!("`{word}` {why}"));
        }
        if is_done {
            Ok(())
        } else if self.tasks[to].end.is_some() {
            Err(format!("`{word}` has no effect: the task has ended"))
        } else {
            let known = self.words();
            let known = suggestion(word, known.iter().map(String::as_str), "words");
            Err(format!("no mode has a condition on `{word}`: {known}"))
        }
    }

    /// Whether a word for the task `to` reaches a task.
    fn reaches(&self, to: usize, task: usize) -> bool {
        let mut around = std::iter::successors(Some(task), |task| self.tasks[*task].parent);
        let has_end = self.tasks[task].end.is_some();
        // Without commands and modes, only a graph with no other task has something to stop.
        let is_empty = !self.tasks[task].is_active && self.tasks.len() > 1;
        !has_end && !is_empty && around.any(|around| around == to)
    }

    /// Sends a word to a task.
    fn carry_out(&mut self, number: usize, word: &str) -> Effect {
        let task = &mut self.tasks[number];
        let is_stopping = matches!(task.trouble, Some((_, Trouble::Operator)));
        if word.eq_ignore_ascii_case("stop") {
            task.halts.resumes = false;
            task.sent = None;
            task.trouble = Some((Policy::Stop, Trouble::Operator));
            return Effect::Done;
        }
        if word.eq_ignore_ascii_case("resume") {
            if is_stopping {
                return Effect::Refused("has no effect: it came before `stop` was carried out".into());
            }
            let lasting = task.lasting.filter(|_| task.is_halted());
            return match lasting.and_then(|trouble| self.refusal(trouble)) {
                Some(why) => Effect::Refused(why),
                None => {
                    self.tasks[number].halts.resumes = true;
                    Effect::Done
                }
            };
        }
        if !task.words().any(|known| known == word) {
            Effect::Unknown
        } else if is_stopping || task.is_stopped() {
            Effect::Refused(STOPPED.into())
        } else {
            task.sent = Some(word.to_owned());
            Effect::Done
        }
    }

    /// Returns why `resume` is refused during a trouble, and what to do instead. A `stop` and a lost lease last for
    /// one tick, and are no reason.
    #[cold]
    pub(super) fn refusal(&self, trouble: Trouble) -> Option<String> {
        let way_out = match trouble {
            Trouble::Operator | Trouble::Lease(_) => return None,
            Trouble::Device(_) => "a device that has failed is not called again: end the run, and start it again",
            _ => "send it again when this is over",
        };
        Some(format!("is refused: {}; {way_out}", self.describe(trouble)))
    }

    /// Returns the task that a word is for, and the word without the name of the task.
    fn addressee<'w>(&self, word: &'w str) -> (usize, &'w str) {
        let named =
            |(number, task): (usize, &TaskRun)| Some((number, word.strip_prefix(task.name())?.strip_prefix('.')?));
        if self.tasks.iter().any(|task| task.words().any(|known| known == word)) {
            return (0, word);
        }
        let named = self.tasks.iter().enumerate().skip(1).filter_map(named);
        named.min_by_key(|(_, rest)| rest.len()).unwrap_or((0, word))
    }

    /// Returns the operator words that the graph accepts, each once and in the order of the alphabet.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        // A part is stopped and resumed alone, and tared with all others.
        let own = || WORDS.into_iter().filter(|word| *word != TARE);
        let mut words: Vec<String> =
            WORDS.into_iter().chain(self.tasks.iter().flat_map(TaskRun::words)).map(str::to_owned).collect();
        for task in self.tasks.iter().skip(1) {
            words.extend(own().chain(task.words()).map(|word| format!("{}.{word}", task.name())));
        }
        words.sort();
        words.dedup();
        words
    }
}
