//! How far a long run is, on one line of a terminal that takes no room afterwards.

use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

/// Nothing is shown of a run that is over before.
const PATIENCE: Duration = Duration::from_millis(500);
const EVERY: Duration = Duration::from_millis(100);
const WIDTH: usize = 30;

/// A line of progress; silent where nobody looks.
pub(super) struct Progress {
    start: Instant,
    shown: Option<Instant>,
    /// Time at which the run will be over [s], if that is known.
    end: Option<f64>,
    is_watched: bool,
}

impl Progress {
    pub(super) fn new(end: Option<f64>) -> Self {
        Self { start: Instant::now(), shown: None, end, is_watched: stderr().is_terminal() }
    }

    /// The run is at `time` [s] and `ticks`.
    pub(super) fn show(&mut self, time: f64, ticks: u64) {
        // A look at the clock costs more than a tick: not in every one.
        if !self.is_watched || !ticks.is_multiple_of(16) {
            return;
        }
        let now = Instant::now();
        let is_due = self.shown.map_or(now - self.start >= PATIENCE, |shown| now - shown >= EVERY);
        if is_due {
            self.shown = Some(now);
            // Where the line cannot be written nobody misses it.
            let _ = write!(stderr(), "\r{}\x1b[K", line(time, ticks, self.end, (now - self.start).as_secs_f64()));
            let _ = stderr().flush();
        }
    }

    /// Takes the line away.
    pub(super) fn clear(&self) {
        if self.shown.is_some() {
            let _ = write!(stderr(), "\r\x1b[K");
        }
    }
}

fn line(time: f64, ticks: u64, end: Option<f64>, wall: f64) -> String {
    let speed = time / wall.max(1e-9);
    match end {
        Some(end) => {
            let done = (time / end).clamp(0.0, 1.0);
            let full = (done * WIDTH as f64) as usize;
            let bar = format!("{}{}", "#".repeat(full), "-".repeat(WIDTH - full));
            format!("[{bar}] {:3.0} %  {time:.1} of {end:.1} s, tick {ticks}, {speed:.0}x real time", done * 100.0)
        }
        None => format!("{time:.1} s, tick {ticks}, {speed:.0}x real time; Ctrl-C ends the run"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_with_and_without_an_end() {
        assert_eq!(
            line(15.0, 150, Some(30.0), 0.5),
            "[###############---------------]  50 %  15.0 of 30.0 s, tick 150, 30x real time"
        );
        assert_eq!(line(2.0, 500, None, 1.0), "2.0 s, tick 500, 2x real time; Ctrl-C ends the run");
    }
}
