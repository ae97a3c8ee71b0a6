//! Reads lines from an input on a thread of its own: bounded lines, a bounded queue, and stops that overtake the rest.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read};
use std::sync::{Arc, Mutex, PoisonError, RwLock, TryLockError};
use std::time::Duration;

/// Maximum length of a line [bytes].
const MAX_LINE: usize = 256;
/// Maximum number of lines that wait for a tick.
const MAX_LINES: usize = 64;
/// Number of bytes that are read at once, as many as a pipe holds.
const CHUNK: usize = 1 << 16;

/// What has been read since the last look.
#[derive(Debug, Default)]
pub(crate) struct Inbox {
    /// The words that stop tasks, each once: `stop` and `left.stop`.
    pub(crate) stops: Vec<String>,
    /// Words, and what is wrong with lines that are none. At most [`MAX_LINES`].
    pub(crate) lines: VecDeque<Result<String, String>>,
    /// Number of lines for which there was no room.
    pub(crate) dropped: u64,
    /// Whether nothing more will come.
    is_closed: bool,
}

/// Reads an input. The thread ends with the input or with the process.
#[derive(Clone)]
pub(crate) struct LineReader(Arc<Shared>);

/// What the reading thread and the ticks share.
struct Shared {
    inbox: Mutex<Inbox>,
    /// The names of the tasks that can be stopped.
    tasks: RwLock<Vec<String>>,
}

impl LineReader {
    /// Starts to read. A word that stops one of the tasks gets through however many others are read. `is_back_later`
    /// tells whether an input with an error can be read again later.
    ///
    /// # Errors
    /// If there can be no further thread.
    pub(crate) fn start(
        input: impl Read + Send + 'static,
        tasks: Vec<String>,
        is_back_later: impl Fn(&std::io::Error) -> bool + Send + 'static,
    ) -> std::io::Result<Self> {
        let shared = Arc::new(Shared { inbox: Mutex::default(), tasks: RwLock::new(tasks) });
        let theirs = Arc::clone(&shared);
        let read = move || read(input, &theirs, &is_back_later);
        std::thread::Builder::new().name("words".into()).spawn(read)?;
        Ok(Self(shared))
    }

    /// Begins anew for a run with other tasks: what was read before it is forgotten.
    pub(crate) fn begin(&self, tasks: Vec<String>) {
        *self.0.tasks.write().unwrap_or_else(PoisonError::into_inner) = tasks;
        let mut inbox = self.0.inbox.lock().unwrap_or_else(PoisonError::into_inner);
        *inbox = Inbox { is_closed: inbox.is_closed, ..Inbox::default() };
    }

    /// Calls `take` with what has been read, and returns whether more can come. It never waits for the reading thread: if
    /// that is handing something over, there is nothing yet.
    pub(crate) fn look(&self, take: impl FnOnce(&mut Inbox)) -> bool {
        let mut inbox = match self.0.inbox.try_lock() {
            Ok(inbox) => inbox,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return true,
        };
        take(&mut inbox);
        !(inbox.is_closed && inbox.lines.is_empty() && inbox.stops.is_empty())
    }
}

impl Inbox {
    /// Adds what was found, in as far as there is room. Returns whether there was room for all.
    fn add(&mut self, found: &mut Self) -> bool {
        let dropped = self.dropped;
        for stop in found.stops.drain(..) {
            self.stop(&stop);
        }
        let room = MAX_LINES - self.lines.len();
        self.dropped += found.dropped + found.lines.len().saturating_sub(room) as u64;
        self.lines.extend(found.lines.drain(..).take(room));
        found.dropped = 0;
        self.dropped == dropped
    }

    fn stop(&mut self, word: &str) {
        if self.stops.iter().all(|known| known != word) {
            self.stops.push(word.to_owned());
        }
    }
}

/// Reads an input to its end. All lines that are read at once are handed over at once, so a `resume` in the same write
/// as a `stop` is never taken for a later one.
fn read(mut input: impl Read, shared: &Shared, is_back_later: &dyn Fn(&std::io::Error) -> bool) {
    /// A flood leaves the processor to the ticks for this time after each chunk.
    const REST: Duration = Duration::from_millis(1);
    const WAIT: Duration = Duration::from_millis(100);
    let inbox = || shared.inbox.lock().unwrap_or_else(PoisonError::into_inner);
    let tasks = || shared.tasks.read().unwrap_or_else(PoisonError::into_inner);
    let hand_over = |found: &mut Inbox| inbox().add(found);
    let (mut chunk, mut was_away, mut splitter) = (vec![0; CHUNK], false, Splitter::default());
    loop {
        match input.read(&mut chunk) {
            Ok(0) => break,
            Ok(size) => {
                was_away = false;
                splitter.split(&chunk[..size], &tasks());
                if !hand_over(&mut splitter.found) || size == CHUNK {
                    std::thread::sleep(REST);
                }
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(WAIT),
            Err(error) => {
                let is_away = is_back_later(&error);
                if !was_away {
                    let way_out = if is_away { "; bring the run to the foreground to send words" } else { "" };
                    let message = format!("cannot read words from standard input: {error}{way_out}");
                    splitter.found.lines.push_back(Err(message));
                    hand_over(&mut splitter.found);
                }
                was_away = true;
                if !is_away {
                    break;
                }
                std::thread::sleep(WAIT);
            }
        }
    }
    splitter.end_line(&tasks());
    hand_over(&mut splitter.found);
    inbox().is_closed = true;
}

/// Splits bytes into lines.
#[derive(Default)]
struct Splitter {
    /// The line so far.
    line: Vec<u8>,
    is_too_long: bool,
    found: Inbox,
}

impl Splitter {
    fn split(&mut self, bytes: &[u8], tasks: &[String]) {
        let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
        for piece in bytes.split_inclusive(is_end) {
            let (text, ends) = match piece.split_last() {
                Some((last, text)) if is_end(last) => (text, true),
                _ => (piece, false),
            };
            let room = MAX_LINE - self.line.len();
            self.is_too_long |= text.len() > room;
            self.line.extend_from_slice(&text[..text.len().min(room)]);
            if ends {
                self.end_line(tasks);
            }
        }
    }

    fn end_line(&mut self, tasks: &[String]) {
        let found = &mut self.found;
        let has_room = found.lines.len() < MAX_LINES;
        match std::str::from_utf8(&self.line).map(|line| line.trim_start_matches('\u{feff}').trim()) {
            Ok("") if !self.is_too_long => {}
            Ok(word) if !self.is_too_long && stops(word, tasks) => {
                found.stop(&(word[..word.len() - STOP.len()].to_owned() + STOP));
            }
            _ if !has_room => found.dropped += 1,
            Ok(word) if !self.is_too_long => found.lines.push_back(Ok(printable(word))),
            Ok(_) => {
                let start = printable(&String::from_utf8_lossy(&self.line[..40]));
                found.lines.push_back(Err(format!("a line of more than {MAX_LINE} bytes is not a word: `{start}…`")));
            }
            Err(_) => {
                let line = printable(&String::from_utf8_lossy(&self.line));
                let message = if self.is_too_long { "too long, and not UTF-8" } else { "not UTF-8" };
                found.lines.push_back(Err(format!("a line is {message}: `{line}`")));
            }
        }
        self.line.clear();
        self.is_too_long = false;
    }
}

const STOP: &str = "stop";

/// Whether a word stops a task: `stop` or `left.stop`, the last word in any case.
pub(crate) fn stops(word: &str, tasks: &[String]) -> bool {
    let at = word.len().checked_sub(STOP.len()).filter(|at| word.is_char_boundary(*at));
    let Some((task, stop)) = at.map(|at| word.split_at(at)) else { return false };
    let is_task = || task.strip_suffix('.').is_some_and(|task| tasks.iter().any(|known| known == task));
    stop.eq_ignore_ascii_case(STOP) && (task.is_empty() || is_task())
}

/// Replaces the characters that would control a terminal.
fn printable(text: &str) -> String {
    text.trim().chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use std::io::{self, Cursor};

    use super::*;

    /// What is found in an input, which is read to its end.
    fn found(input: impl Read + Send + 'static) -> Inbox {
        let reader = LineReader::start(input, vec!["left".into()], |error| error.raw_os_error() == Some(5)).unwrap();
        let mut inbox = Inbox::default();
        loop {
            let mut is_closed = false;
            reader.look(|found| {
                is_closed = found.is_closed;
                if is_closed {
                    inbox = std::mem::take(found);
                }
            });
            if is_closed {
                return inbox;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn words(inbox: &Inbox) -> Vec<&str> {
        inbox.lines.iter().map(|line| line.as_ref().map_or_else(String::as_str, String::as_str)).collect()
    }

    #[test]
    fn lines_become_words() {
        let inbox = found(&b"  go \n\r\n\xef\xbb\xbfresume\r\n\nb\x1bc\nlast"[..]);
        assert_eq!(words(&inbox), ["go", "resume", "b\u{fffd}c", "last"]);
        assert!(inbox.stops.is_empty() && inbox.dropped == 0);
    }

    #[test]
    fn a_stop_gets_through_whatever_stands_before_it() {
        for (before, stop, expected) in [
            (vec![b'y'; 10_000_000], "\nstop\n", Some("stop")),
            (b"y\n".repeat(1_000_000), "STOP", Some("stop")),
            (b"\xff\xfe\n".repeat(1000), "left.Stop\r\n", Some("left.stop")),
            (vec![0xff; 1000], "\n stop", Some("stop")),
            (vec![], "right.stop\n", None),
            (vec![], "nonstop\n", None),
            (vec![b'y'; 1000], "stop\n", None),
            (vec![0xff], "stop\n", None),
        ] {
            let inbox = found(Cursor::new(before).chain(Cursor::new(stop)));
            assert_eq!(inbox.stops.first().map(String::as_str), expected, "{stop}");
            assert!(inbox.stops.len() <= 1 && inbox.lines.len() <= MAX_LINES);
        }
    }

    #[test]
    fn lines_that_are_no_words_are_reported_and_reading_goes_on() {
        let long = [&[b'x'; 300][..], b"\n\xffsto\x00p\ngo\n"].concat();
        let x = "x".repeat(40);
        let expected = [
            &format!("a line of more than 256 bytes is not a word: `{x}…`"),
            "a line is not UTF-8: `\u{fffd}sto\u{fffd}p`",
            "go",
        ];
        assert_eq!(words(&found(Cursor::new(long))), expected);
    }

    #[test]
    fn a_further_run_forgets_what_was_typed_and_has_its_own_tasks() {
        let (mut ours, theirs) = std::io::pipe().map(|(read, write)| (write, read)).unwrap();
        let reader = LineReader::start(theirs, vec!["left".into()], |_| false).unwrap();
        let mut typed = |text: &[u8]| {
            io::Write::write_all(&mut ours, text).unwrap();
            let mut found = (Vec::new(), Vec::new());
            while found.0.is_empty() {
                std::thread::sleep(Duration::from_millis(1));
                reader.look(|inbox| found = (inbox.lines.iter().flatten().cloned().collect(), inbox.stops.clone()));
            }
            found
        };
        let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        assert_eq!(
            typed(b"right.stop\nleft.stop\nresume\n"),
            (words(&["right.stop", "resume"]), words(&["left.stop"]))
        );
        reader.begin(vec!["right".into()]);
        assert_eq!(typed(b"right.stop\ngo\n"), (words(&["go"]), words(&["right.stop"])));
        drop(ours);
        while reader.look(|inbox| *inbox = Inbox { is_closed: inbox.is_closed, ..Inbox::default() }) {
            std::thread::sleep(Duration::from_millis(1));
        }
        reader.begin(Vec::new());
        assert!(!reader.look(|_| {}), "a further run knows that nothing more comes");
    }

    #[test]
    fn what_does_not_fit_is_counted() {
        let inbox = found(Cursor::new(b"word\n".repeat(100_000)));
        assert_eq!((inbox.lines.len(), inbox.dropped), (MAX_LINES, 100_000 - MAX_LINES as u64));
    }

    /// An input that fails now and then.
    struct Flaky(VecDeque<Result<&'static [u8], io::Error>>);

    impl Read for Flaky {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let bytes = self.0.pop_front().unwrap_or(Ok(b""))?;
            buffer[..bytes.len()].copy_from_slice(bytes);
            Ok(bytes.len())
        }
    }

    #[test]
    fn an_input_that_can_be_read_again_later_is_read_on() {
        let error = |code| Err(io::Error::from_raw_os_error(code));
        let busy = || Err(ErrorKind::WouldBlock.into());
        let interrupted = || Err(ErrorKind::Interrupted.into());
        let away = Flaky([Ok(&b"a\nb"[..]), error(5), error(5), busy(), interrupted(), Ok(b"c\n")].into());
        let lines = found(away);
        let [a, why, bc] = words(&lines)[..] else { panic!("{lines:?}") };
        assert_eq!((a, bc), ("a", "bc"));
        assert!(why.starts_with("cannot read words from standard input: "), "{why}");
        let broken = Flaky([Ok(&b"a\n"[..]), error(9), Ok(b"b\n")].into());
        assert_eq!(found(broken).lines.len(), 2, "the word and the error");
    }
}
