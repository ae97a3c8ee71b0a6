//! A run in virtual time that pauses, shows what it does, and goes on at a word from standard input.

use std::io::BufRead;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use super::time::duration;
use crate::engine::{Interrupt, RunOptions};

/// What may be typed.
const WORDS: &str = "Enter or n: on to the next pause; a time such as 100ms: on for it; c: on without a pause; p: pause, or \
                     on; q: end the run";
/// Interval at which a paused run looks for a signal.
const LOOK: Duration = Duration::from_millis(50);

/// When a run pauses.
pub(super) struct Stepping {
    words: Receiver<String>,
    /// Time from pause to pause [s]; 0 for each tick.
    every: f64,
    /// Time of the graph from which on the run pauses [s].
    next: f64,
    /// Ends the run.
    end: Arc<AtomicBool>,
    interrupt: Arc<Interrupt>,
    /// What was typed before a pause.
    ahead: Option<String>,
    has_explained: bool,
}

impl Stepping {
    /// Makes a run pause after the first tick, and then as `--step` says; `None` without it.
    ///
    /// # Errors
    /// If there is no thread to read standard input.
    pub(super) fn of(
        step: Option<Option<f64>>,
        options: &mut RunOptions,
        interrupt: &Arc<Interrupt>,
    ) -> Result<Option<Self>, String> {
        let Some(every) = step else { return Ok(None) };
        let (typed, words) = channel();
        // It waits in a call that nothing ends, so it ends with the process.
        let read = move || std::io::stdin().lock().lines().map_while(Result::ok).try_for_each(|line| typed.send(line));
        let thread = std::thread::Builder::new().name("steps".into()).spawn(read);
        thread.map_err(|error| format!("cannot read standard input: {error}"))?;
        let stepping = Self::new(words, every.unwrap_or(0.0), Arc::clone(interrupt));
        options.cancel = Some(Arc::clone(&stepping.end));
        Ok(Some(stepping))
    }

    fn new(words: Receiver<String>, every: f64, interrupt: Arc<Interrupt>) -> Self {
        let (next, end) = (f64::NEG_INFINITY, Arc::new(AtomicBool::new(false)));
        Self { words, every, next, end, interrupt, ahead: None, has_explained: false }
    }

    /// Called after the tick at `now` [s]: pauses if it is time. `show` shows what the run does.
    pub(super) fn after(&mut self, now: f64, mut show: impl FnMut(&str)) {
        if self.ahead.is_none() {
            self.ahead = self.words.try_recv().ok();
        }
        if now < self.next {
            // Any other word is for the next pause.
            if let Some(word) = self.ahead.take_if(|word| ["p", "q"].contains(&word.trim())) {
                self.take(&word, now, &mut show);
            } else if self.next == f64::INFINITY {
                self.ahead = None;
            }
        }
        if now >= self.next {
            show(if std::mem::replace(&mut self.has_explained, true) { "" } else { WORDS });
            self.wait(now, &mut show);
        }
    }

    /// Waits for a word that lets the run go on.
    fn wait(&mut self, now: f64, show: &mut impl FnMut(&str)) {
        while !self.interrupt.is_requested() && !self.end.load(Ordering::Relaxed) && now >= self.next {
            let typed = self.ahead.take().map_or_else(|| self.words.recv_timeout(LOOK), Ok);
            match typed {
                Ok(word) => self.take(&word, now, show),
                Err(RecvTimeoutError::Timeout) => {}
                // Nothing would let a paused run go on.
                Err(RecvTimeoutError::Disconnected) => self.next = f64::INFINITY,
            }
        }
    }

    fn take(&mut self, word: &str, now: f64, show: &mut impl FnMut(&str)) {
        // The next pause is at the first tick that is not before it.
        let after = |time: f64| now + time.max(f64::EPSILON * now.max(1.0));
        match word.trim() {
            "" | "n" => self.next = after(self.every),
            "c" => self.next = f64::INFINITY,
            "p" => self.next = if now < self.next { now } else { f64::INFINITY },
            "q" => self.end.store(true, Ordering::Relaxed),
            time => match duration(time) {
                Ok(time) => self.next = after(time),
                Err(_) => show(&format!("`{time}` is no word here. {WORDS}")),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs ticks of 4 ms with the words that are typed before the run. Returns the ticks after which it paused, and
    /// whether it was ended.
    fn pauses(every: f64, words: &[&str]) -> (Vec<u32>, bool) {
        let (typed, words_of_run) = channel();
        words.iter().for_each(|word| typed.send((*word).to_owned()).expect("the run is there"));
        drop(typed);
        let interrupt = Arc::new(Interrupt::catch().expect("signals can be caught"));
        let mut stepping = Stepping::new(words_of_run, every, interrupt);
        stepping.has_explained = true;
        let mut shown = Vec::new();
        for tick in 1..=100 {
            stepping.after(f64::from(tick) * 0.004, |_| shown.push(tick));
            if stepping.end.load(Ordering::Relaxed) {
                return (shown, true);
            }
        }
        (shown, false)
    }

    #[test]
    fn it_pauses_after_each_tick_or_each_time_and_goes_on_when_nobody_types() {
        assert_eq!(pauses(0.0, &["", "", ""]), (vec![1, 2, 3, 4], false));
        assert_eq!(pauses(0.1, &["", ""]), (vec![1, 26, 51], false));
        assert_eq!(pauses(0.0, &["1s", "p", "q"]), (vec![1, 2], true));
        assert_eq!(pauses(0.0, &["n", "p"]), (vec![1, 2], false));
        assert_eq!(pauses(0.0, &["42ms", "n", "q"]), (vec![1, 12, 13], true));
        // It ends a run that goes on, too.
        assert_eq!(pauses(0.0, &["42ms", "q"]), (vec![1], true));
        assert_eq!(pauses(0.0, &["c"]), (vec![1], false));
        assert_eq!(pauses(0.0, &["c", "", "q"]), (vec![1], true));
        assert_eq!(pauses(0.0, &["what", "q"]).0[..2], [1, 1], "it says what it knows, and waits");
    }
}
