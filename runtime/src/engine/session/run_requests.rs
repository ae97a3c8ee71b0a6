//! Stops and tares that other threads request. A stop is a flag for each task, so that none waits, and none is lost.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::engine::Engine;
use super::task_run::TaskRun;

/// Takes which zeros are taken anew, or why none is.
pub type TareAnswer = Box<dyn FnOnce(Result<String, String>) + Send>;

/// Requests of other threads to stop the tasks of a run, and to take the zeros of its sensors anew.
pub struct RunRequests {
    /// The word that stops each task: `stop` for the graph itself, and `left.stop` for a part.
    words: Vec<String>,
    is_requested: Vec<AtomicBool>,
    is_any: AtomicBool,
    /// Who waits for a tare. The tick looks at it only after a request.
    tares: Mutex<Vec<TareAnswer>>,
}

impl fmt::Debug for RunRequests {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunRequests").field("words", &self.words).finish_non_exhaustive()
    }
}

impl RunRequests {
    /// Creates the requests for the tasks of an engine.
    #[must_use]
    pub fn of(engine: &Engine) -> Arc<Self> {
        let word =
            |task: &TaskRun| if task.name().is_empty() { "stop".into() } else { format!("{}.stop", task.name()) };
        let words: Vec<String> = engine.tasks().iter().map(word).collect();
        let is_requested = words.iter().map(|_| AtomicBool::new(false)).collect();
        Arc::new(Self { words, is_requested, is_any: AtomicBool::new(false), tares: Mutex::default() })
    }

    /// Returns the words that stop tasks, that of the whole graph first.
    #[must_use]
    pub fn words(&self) -> &[String] {
        &self.words
    }

    /// Requests a stop with one of [`words`](Self::words), in upper or lower case. Returns whether the word is one.
    pub fn request(&self, word: &str) -> bool {
        let found = self.words.iter().position(|known| known.eq_ignore_ascii_case(word));
        if let Some(at) = found {
            self.is_requested[at].store(true, Ordering::Relaxed);
            self.is_any.store(true, Ordering::Release);
        }
        found.is_some()
    }

    /// Requests a tare. `answer` is called between two ticks.
    pub fn request_tare(&self, answer: TareAnswer) {
        self.tares.lock().unwrap_or_else(PoisonError::into_inner).push(answer);
        self.is_any.store(true, Ordering::Release);
    }

    /// Sends the requested stops to the engine, and then a tare. `report` gets the reason why one has no effect.
    pub(super) fn carry_out(&self, engine: &mut Engine, report: impl Fn(Result<(), String>)) {
        if !self.is_any.load(Ordering::Relaxed) || !self.is_any.swap(false, Ordering::Acquire) {
            return;
        }
        for (word, is_requested) in self.words.iter().zip(&self.is_requested) {
            if is_requested.swap(false, Ordering::Relaxed) {
                report(engine.send(word));
            }
        }
        let waiting = std::mem::take(&mut *self.tares.lock().unwrap_or_else(PoisonError::into_inner));
        if !waiting.is_empty() {
            let tared = engine.tare();
            waiting.into_iter().for_each(|answer| answer(tared.clone()));
        }
    }
}
