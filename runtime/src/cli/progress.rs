//! How far a long run is, and what it shows meanwhile: drawn in place on a terminal, and taken away afterwards.
//!
//! A thread of its own writes, so that a terminal that takes nothing more never makes a tick wait: what it cannot take
//! is not drawn.

use std::io::{IsTerminal, Write, stderr};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use super::prose::Look;

/// Nothing is shown of a run that is over before.
const PATIENCE: Duration = Duration::from_millis(500);
const EVERY: Duration = Duration::from_millis(100);
const WIDTH: usize = 30;

/// What is drawn while a run goes on; silent where nobody looks.
pub(super) struct Progress {
    start: Instant,
    shown: Option<Instant>,
    /// Time at which the run will be over [s], if that is known.
    end: Option<f64>,
    has_colour: bool,
    /// The way to the thread that writes; none where nobody looks.
    pen: Option<SyncSender<Stroke>>,
}

/// What the thread does next.
enum Stroke {
    Draw(String),
    /// Takes away what is drawn, and says so.
    Clear(SyncSender<()>),
}

impl Progress {
    pub(super) fn new(end: Option<f64>, is_quiet: bool, has_colour: bool) -> Self {
        let pen = (stderr().is_terminal() && !is_quiet).then(|| {
            let (pen, strokes) = sync_channel(1);
            std::thread::spawn(move || draw(&strokes));
            pen
        });
        Self { start: Instant::now(), shown: None, end, has_colour, pen }
    }

    /// The run is at `time` [s] and `ticks`; `live` draws what it shows.
    pub(super) fn show(&mut self, time: f64, ticks: u64, live: impl FnOnce(Look) -> Vec<String>) {
        // A look at the clock costs more than a tick: not in every one.
        let Some(pen) = self.pen.as_ref().filter(|_| ticks.is_multiple_of(16)) else { return };
        let now = Instant::now();
        let is_due = self.shown.map_or(now - self.start >= PATIENCE, |shown| now - shown >= EVERY);
        if is_due {
            self.shown = Some(now);
            let line = line(time, ticks, self.end, (now - self.start).as_secs_f64());
            let size = terminal_size::terminal_size_of(stderr());
            let [width, height] = size.map_or([0, 0], |(width, height)| [width.0, height.0].map(usize::from));
            let live = Look::of_width(width, self.has_colour).map(live).unwrap_or_default();
            // One that is still being written is the one that is seen.
            let _ = pen.try_send(Stroke::Draw(fitted(&live, &line, [width, height])));
        }
    }

    /// Takes away what is drawn.
    pub(super) fn clear(&self) {
        let Some(pen) = self.pen.as_ref().filter(|_| self.shown.is_some()) else { return };
        let (done, is_done) = sync_channel(1);
        if pen.send(Stroke::Clear(done)).is_ok() {
            // A thread that is gone has nothing on the terminal to wait for.
            let _ = is_done.recv();
        }
    }
}

/// Writes until the run is over. Where nothing can be written nobody misses it.
fn draw(strokes: &Receiver<Stroke>) {
    let mut drawn = 0;
    for stroke in strokes {
        let (text, done) = match stroke {
            Stroke::Draw(text) => (text, None),
            Stroke::Clear(done) => (String::new(), Some(done)),
        };
        let _ = stderr().lock().write_all(redrawn(drawn, &text).as_bytes());
        let _ = stderr().flush();
        drawn = text.lines().count();
        if let Some(done) = done {
            let _ = done.send(());
        }
    }
}

/// A text in the place of one of as many lines: each line is written over, so that nothing flickers, and none is broken
/// where the terminal ends, so that the lines are as many as they seem.
fn redrawn(lines: usize, text: &str) -> String {
    let up = if lines > 1 { format!("\x1b[{}A", lines - 1) } else { String::new() };
    format!(
        "\x1b[?7l\r{up}{}\x1b[J\x1b[?7h",
        text.lines().map(|line| format!("{line}\x1b[K")).collect::<Vec<_>>().join("\r\n")
    )
}

/// What is shown with the line of progress below: as many of its parts as there is room for.
fn fitted(live: &[String], line: &str, [width, height]: [usize; 2]) -> String {
    let line: String = line.chars().take(if width == 0 { usize::MAX } else { width.saturating_sub(1) }).collect();
    let with = |parts: &[String]| [parts, std::slice::from_ref(&line)].concat().join("\n");
    // The last row is left to the line that the shell begins afterwards.
    let fits = |text: &String| text.lines().count() < height;
    (1..=live.len()).rev().map(|count| with(&live[..count])).find(fits).unwrap_or_else(|| line.clone())
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

    #[test]
    fn what_has_no_room_is_left_out_and_the_line_is_cut() {
        let live = ["a\nb\n", "c\n"].map(String::from);
        assert_eq!(fitted(&live, "line", [80, 7]), "a\nb\n\nc\n\nline");
        assert_eq!(fitted(&live, "line", [80, 6]), "a\nb\n\nline");
        assert_eq!(fitted(&live, "line", [80, 4]), "line");
        assert_eq!(fitted(&[], "line", [80, 50]), "line");
        assert_eq!(fitted(&live, "a long line", [7, 4]), "a long");
        assert_eq!(fitted(&live, "a long line", [0, 0]), "a long line", "a terminal that does not tell its size");
    }

    #[test]
    fn a_text_is_drawn_over_the_one_before() {
        assert_eq!(redrawn(0, "a\nb"), "\x1b[?7l\ra\x1b[K\r\nb\x1b[K\x1b[J\x1b[?7h");
        assert_eq!(redrawn(2, "c"), "\x1b[?7l\r\x1b[1Ac\x1b[K\x1b[J\x1b[?7h");
        assert_eq!(redrawn(3, ""), "\x1b[?7l\r\x1b[2A\x1b[J\x1b[?7h");
    }
}
