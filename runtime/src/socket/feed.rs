//! The ring between the tick and the thread of the socket. The tick writes only what is wanted: the ports that somebody
//! watches, and now and then everything.

use std::fmt::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use rtrb::Producer;

use super::frames::{FeedReader, HEAD, NO_MODE, WATCHED, WHOLE, Width, extend_with_pairs};
use crate::engine::{Engine, TaskEnd, TaskRun};
use crate::graph::PlannedPort;
use crate::node::PortId;
use crate::record::touched_ring;
use crate::signal::{Image, Kind, Signal, VectorImage};

/// Words of a watched port before its values: its number, whether it is present, and its stamp.
const PORT_HEAD: usize = 3;
/// Smallest number of words in the ring.
const MIN_WORDS: usize = 1 << 16;
/// Frames of all numbers, and of all images, for which the ring has room at least.
const MIN_FRAMES: usize = 8;
const MIN_IMAGES: usize = 2;
/// Longest reason of a halt or an end [bytes].
const MAX_REASON: usize = 512;

/// What the thread of the socket wants from the tick.
#[derive(Debug)]
pub(super) struct Wishes {
    /// Whether everything is wanted once.
    whole: AtomicBool,
    /// Whether a port is watched.
    is_any_watched: AtomicBool,
    /// Whether each port is watched.
    watched: Vec<AtomicBool>,
    /// Whether each watched port is wanted at once, also if it has not changed.
    at_once: Vec<AtomicBool>,
    /// Frames of watched ports for which the ring had no room.
    lost: AtomicU64,
}

impl Wishes {
    /// Asks for a frame with everything.
    pub(super) fn want_whole(&self) {
        self.whole.store(true, Ordering::Release);
    }

    /// Sets which ports are watched.
    pub(super) fn watch(&self, is_watched: impl Fn(usize) -> bool) {
        let mut is_any = false;
        for (port, watched) in self.watched.iter().enumerate() {
            watched.store(is_watched(port), Ordering::Relaxed);
            is_any |= is_watched(port);
        }
        self.is_any_watched.store(is_any, Ordering::Release);
    }

    /// Asks for the value of a watched port at once.
    pub(super) fn want_at_once(&self, port: usize) {
        self.at_once[port].store(true, Ordering::Release);
    }

    /// Takes the number of frames that were lost.
    pub(super) fn take_lost(&self) -> u64 {
        self.lost.swap(0, Ordering::Relaxed)
    }
}

/// A port with numbers, or an image.
struct FedPort {
    id: PortId,
    kind: Kind,
    width: Width,
}

/// Why the commands of a task are held, or why it has ended.
#[derive(Default)]
struct Reason {
    /// The halts and the end that it is of.
    of: (usize, bool),
    text: String,
}

/// The end of the ring in the tick.
pub struct Feed {
    ports: Vec<FedPort>,
    /// Of each task.
    reasons: Vec<Reason>,
    /// The numbers of one port.
    row: Vec<f64>,
    frame: Vec<u64>,
    ring: Producer<u64>,
    wishes: Arc<Wishes>,
}

/// Whether a port has numbers or is an image: masks, regions and Jacobians are neither.
pub(super) fn is_fed(port: &PlannedPort) -> bool {
    Width::of(&port.shape).words() > 0
}

/// Creates the ring of an engine.
pub(super) fn feed(engine: &Engine) -> (Feed, FeedReader, Arc<Wishes>) {
    let ports = engine.ports().iter().filter(|(port, _)| is_fed(port));
    let port = |(port, id): &(PlannedPort, PortId)| FedPort {
        id: *id,
        kind: port.shape.kind(),
        width: Width::of(&port.shape),
    };
    let ports: Vec<FedPort> = ports.map(port).collect();
    let widths: Vec<Width> = ports.iter().map(|port| port.width).collect();
    let (tasks, live) = (engine.tasks().len(), engine.live_values().count());
    let words = |is_of_whole: bool| {
        let widths = widths.iter().filter(|width| width.is_of_whole() == is_of_whole);
        widths.map(|width| width.words() + PORT_HEAD).sum::<usize>()
    };
    let (numbers, images) = (HEAD + tasks * (4 + MAX_REASON / 8) + 2 * live + words(true), words(false));
    let (ring, drain) = touched_ring(MIN_WORDS.max(MIN_FRAMES * numbers + MIN_IMAGES * images));
    let wishes = Arc::new(Wishes {
        whole: AtomicBool::new(false),
        is_any_watched: AtomicBool::new(false),
        watched: ports.iter().map(|_| AtomicBool::new(false)).collect(),
        at_once: ports.iter().map(|_| AtomicBool::new(false)).collect(),
        lost: AtomicU64::new(0),
    });
    let longest = widths.iter().filter(|width| width.is_of_whole()).map(|width| width.words()).max();
    let feed = Feed {
        reasons: std::iter::repeat_with(Reason::default).take(tasks).collect(),
        row: vec![0.0; longest.unwrap_or(0)],
        frame: Vec::with_capacity(numbers + images),
        ports,
        ring,
        wishes: Arc::clone(&wishes),
    };
    (feed, FeedReader::new(widths, [tasks, live], drain), wishes)
}

impl Feed {
    /// Writes what is wanted of the last tick. Without room in the ring, it is lost. It neither allocates nor waits nor
    /// calls the operating system; only the reason of a halt that has just begun is allocated.
    pub fn publish(&mut self, engine: &Engine) {
        if self.wishes.whole.load(Ordering::Relaxed) && self.wishes.whole.swap(false, Ordering::Acquire) {
            self.publish_whole(engine);
        }
        if self.wishes.is_any_watched.load(Ordering::Relaxed) {
            self.publish_watched(engine);
        }
    }

    fn begin(&mut self, kind: u64, engine: &Engine) {
        self.frame.clear();
        let epoch = engine.began().map_or(0, |began| began.wall - began.time);
        self.frame.extend_from_slice(&[0, kind, engine.ticks(), engine.now().cast_unsigned(), epoch.cast_unsigned()]);
    }

    /// Passes the frame on. Returns whether there was room.
    fn push(&mut self) -> bool {
        self.frame[0] = self.frame.len() as u64;
        self.ring.push_entire_slice(&self.frame).is_ok()
    }

    fn publish_whole(&mut self, engine: &Engine) {
        self.begin(WHOLE, engine);
        for (task, reason) in engine.tasks().iter().zip(&mut self.reasons) {
            let flags = u64::from(task.is_halted()) | u64::from(task.end().is_some()) << 1;
            let mode = task.mode_number().map_or(NO_MODE, |mode| mode as u64);
            let halts = task.halts().len() as u64 + task.unlisted_halts();
            let text = reason.text_of(task);
            self.frame.extend_from_slice(&[mode, flags, halts, text.len() as u64]);
            self.frame.extend(text.chunks(8).map(|bytes| {
                let mut word = [0; 8];
                word[..bytes.len()].copy_from_slice(bytes);
                u64::from_le_bytes(word)
            }));
        }
        for live in engine.live_values() {
            self.frame.extend_from_slice(&[live.value.to_bits(), live.target.to_bits()]);
        }
        for port in 0..self.ports.len() {
            if self.ports[port].width.is_of_whole() {
                self.frame.push(u64::from(engine.bus().mark(self.ports[port].id).is_present()));
                self.add(port, engine);
            }
        }
        if !self.push() {
            // The next tick tries again.
            self.wishes.whole.store(true, Ordering::Relaxed);
        }
    }

    fn publish_watched(&mut self, engine: &Engine) {
        self.begin(WATCHED, engine);
        for port in 0..self.ports.len() {
            if !self.wishes.watched[port].load(Ordering::Relaxed) {
                continue;
            }
            let mark = engine.bus().mark(self.ports[port].id);
            let at_once = &self.wishes.at_once[port];
            let is_wanted = at_once.load(Ordering::Relaxed) && at_once.swap(false, Ordering::Acquire);
            if is_wanted || mark.changed_in(engine.ticks()) {
                let stamp = mark.stamp();
                let stamp = if stamp.is_timeless() { engine.now() } else { stamp.nanos };
                self.frame.extend_from_slice(&[port as u64, u64::from(mark.is_present()), stamp.cast_unsigned()]);
                self.add(port, engine);
            }
        }
        if self.frame.len() > HEAD && !self.push() {
            self.wishes.lost.fetch_add(1, Ordering::Relaxed);
            // A value that never changes would not come again.
            self.wishes.at_once.iter().zip(&self.wishes.watched).for_each(|(at_once, is_watched)| {
                at_once.fetch_or(is_watched.load(Ordering::Relaxed), Ordering::Relaxed);
            });
        }
    }

    /// Adds the values of a port.
    fn add(&mut self, port: usize, engine: &Engine) {
        let FedPort { id, kind, width } = self.ports[port];
        let arenas = &engine.bus().arenas;
        match width {
            Width::Numbers(numbers) => {
                arenas.read_scalars(kind, id.slot, 0, &mut self.row);
                self.frame.extend(self.row[..numbers].iter().map(|number| number.to_bits()));
            }
            Width::Cells(_) if kind == Kind::VectorImage => {
                let cells = VectorImage::arena(arenas)[id.slot as usize].cells();
                extend_with_pairs(&mut self.frame, cells.iter().flatten().copied());
            }
            Width::Cells(_) => {
                let cells = Image::arena(arenas)[id.slot as usize].cells();
                extend_with_pairs(&mut self.frame, cells.iter().copied());
            }
        }
    }
}

impl Reason {
    /// Returns why the commands of the task are held, or why it has failed.
    fn text_of(&mut self, task: &TaskRun) -> &[u8] {
        let of = (task.halts().len(), task.end().is_some());
        if self.of != of {
            self.of = of;
            self.text.clear();
            // Writing to a string cannot fail.
            let _ = match (task.end(), task.halts().last()) {
                (Some(TaskEnd::Failed(fault)), _) => write!(self.text, "{fault}"),
                (Some(TaskEnd::Done), _) | (None, None) => Ok(()),
                (None, Some(halt)) => write!(self.text, "{}", halt.fault),
            };
            self.text.truncate(self.text.floor_char_boundary(MAX_REASON));
        }
        let is_over = task.end().is_none() && task.halts().last().is_none_or(|halt| halt.until.is_some());
        if is_over { &[] } else { self.text.as_bytes() }
    }
}
