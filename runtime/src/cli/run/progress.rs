//! The progress and the live view of a run, drawn in place on a terminal and removed at the end.
//!
//! The thread of standard error writes to the terminal, so that a slow terminal never delays a tick. Drawings that it
//! cannot keep up with are dropped.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use crate::cli::shell::stream::OutStream;
use crate::cli::text::prose::PageStyle;

/// Shorter runs show no progress.
const MIN_RUN: Duration = Duration::from_millis(500);
/// Time between two drawings.
const INTERVAL: Duration = Duration::from_millis(100);
/// Width of the bar [characters].
const BAR_WIDTH: usize = 30;

/// Draws the progress of a run, if standard error is a terminal.
pub(crate) struct Progress {
    start: Instant,
    /// Time of the last drawing.
    drawn: Option<Instant>,
    /// Expected end of the run [s], if it is known.
    end: Option<f64>,
    has_colour: bool,
    /// Standard error; `None` without a terminal.
    terminal: Option<OutStream>,
}

impl Progress {
    pub(crate) fn new(end: Option<f64>, err: Option<&OutStream>, has_colour: bool) -> Self {
        let terminal = err.filter(|_| stderr().is_terminal()).cloned();
        Self { start: Instant::now(), drawn: None, end, has_colour, terminal }
    }

    /// Draws the progress at `time` [s] and `ticks` below the parts of the view that `live` returns.
    pub(crate) fn show(&mut self, time: f64, ticks: u64, live: impl FnOnce(PageStyle) -> Vec<String>) {
        // Reading the clock costs more than a tick, so most ticks skip it.
        let Some(terminal) = self.terminal.as_ref().filter(|_| ticks.is_multiple_of(16)) else { return };
        let now = Instant::now();
        let is_due = self.drawn.map_or(now - self.start >= MIN_RUN, |drawn| now - drawn >= INTERVAL);
        if is_due && terminal.has_drawn() {
            self.drawn = Some(now);
            let line = line(time, ticks, self.end, (now - self.start).as_secs_f64());
            let size = terminal_size::terminal_size_of(stderr());
            let [width, height] = size.map_or([0, 0], |(width, height)| [width.0, height.0].map(usize::from));
            let live = PageStyle::of_width(width, self.has_colour).map(live).unwrap_or_default();
            terminal.draw(fitted(&live, &line, [width, height]));
        }
    }

    /// Removes the drawing.
    pub(crate) fn clear(&self) {
        if let Some(terminal) = self.terminal.as_ref().filter(|_| self.drawn.is_some()) {
            terminal.draw(String::new());
        }
    }
}

/// Puts as many parts of the live view above the line of progress as fit on the terminal.
fn fitted(live: &[String], line: &str, [width, height]: [usize; 2]) -> String {
    let line: String = line.chars().take(if width == 0 { usize::MAX } else { width.saturating_sub(1) }).collect();
    let with = |parts: &[String]| [parts, std::slice::from_ref(&line)].concat().join("\n");
    // The last row is left for the prompt of the shell.
    let fits = |text: &String| text.lines().count() < height;
    (1..=live.len()).rev().map(|count| with(&live[..count])).find(fits).unwrap_or_else(|| line.clone())
}

/// Writes the line of progress.
fn line(time: f64, ticks: u64, end: Option<f64>, wall: f64) -> String {
    let speed = time / wall.max(1e-9);
    match end {
        Some(end) => {
            let done = (time / end).clamp(0.0, 1.0);
            let full = (done * BAR_WIDTH as f64) as usize;
            let bar = format!("{}{}", "#".repeat(full), "-".repeat(BAR_WIDTH - full));
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

    #[test]
    fn parts_that_do_not_fit_are_left_out_and_the_line_is_cut() {
        let live = ["a\nb\n", "c\n"].map(String::from);
        assert_eq!(fitted(&live, "line", [80, 7]), "a\nb\n\nc\n\nline");
        assert_eq!(fitted(&live, "line", [80, 6]), "a\nb\n\nline");
        assert_eq!(fitted(&live, "line", [80, 4]), "line");
        assert_eq!(fitted(&[], "line", [80, 50]), "line");
        assert_eq!(fitted(&live, "a long line", [7, 4]), "a long");
        assert_eq!(fitted(&live, "a long line", [0, 0]), "a long line", "a terminal of unknown size");
    }
}
