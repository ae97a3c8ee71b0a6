//! Standard output and standard error: a queue for each, and a thread that writes it.
//!
//! A run in real time never waits for who reads them: a paused pager, a stopped terminal or a full disk costs lines,
//! which are counted, and no time.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::patience::Patience;

/// Size of a queue from which on the lines of a log are lost, or who writes them waits [bytes].
const MAX_QUEUED_BYTES: usize = 1 << 20;
/// Size of one write, so that a slow reader shows progress [bytes].
const PIECE_BYTES: usize = 4096;
/// Interval at which a stream that takes nothing is tried again.
const RETRY_INTERVAL: Duration = Duration::from_millis(5);

/// One of the two streams.
#[derive(Clone)]
pub(crate) struct OutStream(Arc<Shared>);

struct Shared {
    state: Mutex<State>,
    /// Notified when there is something to write, and when the queue has become shorter.
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// The stream, until the thread takes it.
    file: Option<File>,
    texts: VecDeque<String>,
    /// Size of all texts in the queue [bytes].
    queued: usize,
    /// The drawing that replaces the one on the terminal.
    drawing: Option<String>,
    /// Number of lines that are being written; `None` while the thread waits.
    writing: Option<u64>,
    patience: Patience,
    /// Number of bytes that were written.
    progress: u64,
    lost: Lost,
    /// Whether nothing can be written any more: the reader is gone, or it was given up.
    is_closed: bool,
}

/// What a stream has lost, and why.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Lost {
    /// Number of lines that were not written.
    pub(crate) lines: u64,
    /// The first error. Without one, the stream was not read in time.
    pub(crate) error: Option<String>,
    /// Whether the reader closed the stream, as `head` does.
    pub(crate) is_closed_by_reader: bool,
}

impl OutStream {
    /// Creates a stream that writes to a file. An error is reported as that of the first line.
    pub(crate) fn new(file: io::Result<File>) -> Self {
        let mut state = State::default();
        match file {
            Ok(file) => state.file = Some(file),
            Err(error) => state.fail(&error),
        }
        Self(Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new() }))
    }

    /// Sets whether to wait for the reader when the queue is full.
    pub(crate) fn set_patience(&self, patience: Patience) {
        self.lock().patience = patience;
    }

    /// Writes a text of a command. It is never dropped because the queue is full.
    pub(crate) fn print(&self, text: String) {
        let state = self.wait_for_room();
        self.push(state, text);
    }

    /// Writes lines of a log. They are lost if the queue is full and the run does not wait.
    pub(crate) fn log(&self, text: &str) {
        let mut state = self.wait_for_room();
        if state.queued >= MAX_QUEUED_BYTES {
            state.lost.lines += line_count(text);
        } else {
            self.push(state, text.to_owned());
        }
    }

    /// Replaces the drawing on the terminal. The next text removes it.
    pub(crate) fn draw(&self, text: String) {
        let mut state = self.lock();
        state.drawing = Some(text);
        self.start(&mut state);
    }

    /// Whether the last drawing has been written, so that another one is worth the work.
    pub(crate) fn has_drawn(&self) -> bool {
        let state = self.lock();
        state.drawing.is_none() && state.writing.is_none()
    }

    /// Whether everything is written or lost.
    pub(crate) fn is_idle(&self) -> bool {
        let state = self.lock();
        state.is_closed || (state.texts.is_empty() && state.drawing.is_none() && state.writing.is_none())
    }

    /// Whether nothing can be written any more.
    pub(crate) fn is_closed(&self) -> bool {
        self.lock().is_closed
    }

    /// Returns the number of bytes that were written.
    pub(crate) fn progress(&self) -> u64 {
        self.lock().progress
    }

    /// Returns what is lost so far.
    pub(crate) fn lost(&self) -> Lost {
        self.lock().lost.clone()
    }

    /// Gives up what is not written yet.
    pub(crate) fn give_up(&self) {
        if !self.is_idle() {
            let mut state = self.lock();
            state.lost.lines += state.writing.unwrap_or(0);
            state.close();
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock()
    }

    /// Waits while the queue is full, if the run may wait.
    fn wait_for_room(&self) -> MutexGuard<'_, State> {
        let mut state = self.lock();
        while state.queued >= MAX_QUEUED_BYTES && !state.is_closed && state.patience.may_wait() {
            state = self.0.wait(state, RETRY_INTERVAL);
        }
        state
    }

    fn push(&self, mut state: MutexGuard<'_, State>, text: String) {
        if state.is_closed {
            state.lost.lines += line_count(&text);
            return;
        }
        state.queued += text.len();
        state.texts.push_back(text);
        self.start(&mut state);
    }

    /// Starts the thread, the first time, and wakes it.
    fn start(&self, state: &mut State) {
        if let Some(file) = state.file.take() {
            let shared = self.0.clone();
            let thread = std::thread::Builder::new().name("output".into()).spawn(move || shared.write_all(file));
            if let Err(error) = thread {
                state.fail(&error);
            }
        }
        self.0.changed.notify_all();
    }
}

impl State {
    /// Stops writing, because of an error.
    fn fail(&mut self, error: &io::Error) {
        self.note(error);
        self.close();
    }

    /// Keeps the first error.
    fn note(&mut self, error: &io::Error) {
        self.lost.error.get_or_insert_with(|| error.to_string());
        self.lost.is_closed_by_reader |= error.kind() == ErrorKind::BrokenPipe;
    }

    /// Stops writing. The queue is lost.
    fn close(&mut self) {
        self.is_closed = true;
        self.lost.lines += self.texts.drain(..).map(|text| line_count(&text)).sum::<u64>();
        (self.queued, self.drawing) = (0, None);
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'s>(&'s self, state: MutexGuard<'s, State>, time: Duration) -> MutexGuard<'s, State> {
        self.changed.wait_timeout(state, time).unwrap_or_else(PoisonError::into_inner).0
    }

    /// Writes what is in the queue, until the process ends or the reader is gone.
    fn write_all(&self, mut file: File) {
        // Number of lines of the drawing on the terminal.
        let mut drawn = 0;
        loop {
            let mut state = self.lock();
            state.writing = None;
            while state.texts.is_empty() && state.drawing.is_none() && !state.is_closed {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
            if state.is_closed {
                return;
            }
            let text = state.texts.pop_front();
            state.writing = Some(text.as_deref().map_or(0, line_count));
            state.queued -= text.as_ref().map_or(0, String::len);
            let drawing = if text.is_none() { state.drawing.take() } else { None };
            drop(state);
            self.changed.notify_all();
            if let Some(drawing) = drawing {
                // What a drawing shows comes again with the next one, so its errors are ignored.
                let _ = self.write(&mut file, redrawn(drawn, &drawing).as_bytes());
                drawn = drawing.lines().count();
            }
            let Some(text) = text else { continue };
            let erased = if drawn > 0 { redrawn(drawn, "") } else { String::new() };
            drawn = 0;
            if let Err((written, error)) = self.write(&mut file, format!("{erased}{text}").as_bytes()) {
                let written = text.floor_char_boundary(written.saturating_sub(erased.len()));
                self.lose(&text[written..], &error);
            }
        }
    }

    /// Counts a text as lost. Later texts are still tried: a disk can have room again.
    fn lose(&self, text: &str, error: &io::Error) {
        let mut state = self.lock();
        if state.is_closed {
            return;
        }
        state.lost.lines += line_count(text);
        state.note(error);
        if error.kind() == ErrorKind::BrokenPipe {
            state.close();
        }
    }

    /// Writes bytes. On an error, returns how many were written before.
    fn write(&self, file: &mut File, bytes: &[u8]) -> Result<(), (usize, io::Error)> {
        let mut done = 0;
        while done < bytes.len() {
            let piece = &bytes[done..bytes.len().min(done + PIECE_BYTES)];
            match file.write(piece) {
                Ok(0) => return Err((done, ErrorKind::WriteZero.into())),
                Ok(count) => {
                    done += count;
                    self.lock().progress += count as u64;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                // Another process that shares the terminal or the pipe can set `O_NONBLOCK` on it.
                Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(RETRY_INTERVAL),
                Err(error) => return Err((done, error)),
            }
        }
        Ok(())
    }
}

/// Returns the number of lines of a text; the end of one counts as a line.
fn line_count(text: &str) -> u64 {
    text.lines().count().max(1) as u64
}

/// Returns the text with the escape codes that draw it over a text of `lines` lines.
///
/// Each line is overwritten, which avoids flicker. Wrapping is off, so that the number of lines on the terminal is
/// known.
fn redrawn(lines: usize, text: &str) -> String {
    let up = if lines > 1 { format!("\x1b[{}A", lines - 1) } else { String::new() };
    format!(
        "\x1b[?7l\r{up}{}\x1b[J\x1b[?7h",
        text.lines().map(|line| format!("{line}\x1b[K")).collect::<Vec<_>>().join("\r\n")
    )
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_drawn_over_the_last_one() {
        assert_eq!(redrawn(0, "a\nb"), "\x1b[?7l\ra\x1b[K\r\nb\x1b[K\x1b[J\x1b[?7h");
        assert_eq!(redrawn(2, "c"), "\x1b[?7l\r\x1b[1Ac\x1b[K\x1b[J\x1b[?7h");
        assert_eq!(redrawn(3, ""), "\x1b[?7l\r\x1b[2A\x1b[J\x1b[?7h");
    }

    #[test]
    fn a_queue_that_nobody_empties_is_bounded_and_what_is_lost_is_counted() {
        let (reader, writer) = io::pipe().expect("a pipe");
        let stream = OutStream::new(Ok(std::os::fd::OwnedFd::from(writer).into()));
        let interrupt = crate::engine::Interrupt::catch().expect("handlers of signals");
        stream.set_patience(Patience::Limited(Arc::new(interrupt)));
        let line = "x".repeat(999) + "\n";
        (0..5000).for_each(|_| stream.log(&line));
        let lost = stream.lost();
        assert!(lost.lines > 3500 && lost.lines < 4000 && lost.error.is_none(), "{lost:?}");
        while stream.progress() == 0 {
            std::thread::sleep(RETRY_INTERVAL);
        }
        stream.give_up();
        let given_up = stream.lost().lines;
        // A pipe on Linux holds 64 KiB.
        assert!((5000 - 66..5000).contains(&given_up), "{given_up}");
        drop(reader);
    }

    #[test]
    fn a_reader_that_is_gone_costs_lines_and_nothing_else() {
        let (reader, writer) = io::pipe().expect("a pipe");
        let stream = OutStream::new(Ok(std::os::fd::OwnedFd::from(writer).into()));
        drop(reader);
        stream.print("one\ntwo\n".into());
        while !stream.is_idle() {
            std::thread::sleep(RETRY_INTERVAL);
        }
        stream.log("three\n");
        let lost = stream.lost();
        assert_eq!((lost.lines, lost.is_closed_by_reader), (3, true), "{lost:?}");
    }
}
