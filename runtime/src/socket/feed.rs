//! The ring between the tick and the thread of the socket. The tick writes only what is wanted: the ports that somebody
//! watches, and now and then everything.
//!
//! A frame is a list of 64-bit words: its length, its type, the number and the time of the tick, and the values. A port is
//! one word that says whether it is present, and one for each of its numbers.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use rtrb::{Consumer, Producer};

use crate::engine::Engine;
use crate::graph::PlannedPort;
use crate::node::PortId;
use crate::record::touched_ring;
use crate::signal::Kind;

/// Types of frames.
const WATCHED: u64 = 1;
const WHOLE: u64 = 2;
/// Words before the values of a frame.
const HEAD: usize = 4;
/// Smallest number of words in the ring.
const MIN_WORDS: usize = 1 << 16;
/// Frames of all values for which the ring has room at least.
const MIN_FRAMES: usize = 8;
/// The mode of a task without modes.
const NO_MODE: u64 = u64::MAX;

/// What the thread of the socket wants from the tick.
#[derive(Debug)]
pub(super) struct Wishes {
    /// Whether everything is wanted once.
    whole: AtomicBool,
    /// Whether a port is watched.
    is_any_watched: AtomicBool,
    /// Whether each port is watched.
    watched: Vec<AtomicBool>,
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

    /// Takes the number of frames that were lost.
    pub(super) fn take_lost(&self) -> u64 {
        self.lost.swap(0, Ordering::Relaxed)
    }
}

/// A port with numbers.
struct FedPort {
    id: PortId,
    kind: Kind,
    width: usize,
}

/// The end of the ring in the tick.
pub struct Feed {
    ports: Vec<FedPort>,
    /// The numbers of one port.
    row: Vec<f64>,
    frame: Vec<u64>,
    ring: Producer<u64>,
    wishes: Arc<Wishes>,
}

/// The other end of the ring.
pub(super) struct FeedReader {
    widths: Vec<usize>,
    tasks: usize,
    live: usize,
    ring: Consumer<u64>,
    frame: Vec<u64>,
}

/// What a tick has written.
#[derive(Debug)]
pub(super) struct Frame {
    pub(super) tick: u64,
    /// Time of the tick [ns].
    pub(super) now: i64,
    pub(super) content: Content,
}

#[derive(Debug)]
pub(super) enum Content {
    /// The watched ports that have changed: the number of each, and its numbers if it is present.
    Watched(Vec<(usize, Option<Vec<f64>>)>),
    /// Everything.
    Whole(Whole),
}

/// The state of a task.
#[derive(Debug)]
pub(super) struct FedTask {
    /// Number of its mode; none in a task without modes.
    pub(super) mode: Option<usize>,
    pub(super) is_halted: bool,
    pub(super) has_ended: bool,
}

/// Everything that a run shows.
#[derive(Debug)]
pub(super) struct Whole {
    pub(super) tasks: Vec<FedTask>,
    /// The value and the target of each live parameter.
    pub(super) live: Vec<[f64; 2]>,
    /// The numbers of each port, if it is present.
    pub(super) ports: Vec<Option<Vec<f64>>>,
}

/// Whether a port has numbers: images, masks, regions and Jacobians have none.
pub(super) fn is_fed(port: &PlannedPort) -> bool {
    !port.shape.scalars().is_empty()
}

/// Creates the ring of an engine.
pub(super) fn feed(engine: &Engine) -> (Feed, FeedReader, Arc<Wishes>) {
    let ports = engine.ports().iter().filter(|(port, _)| is_fed(port));
    let port = |(port, id): &(PlannedPort, PortId)| FedPort {
        id: *id,
        kind: port.shape.kind(),
        width: port.shape.scalars().len(),
    };
    let ports: Vec<FedPort> = ports.map(port).collect();
    let widths: Vec<usize> = ports.iter().map(|port| port.width).collect();
    let (tasks, live) = (engine.tasks().len(), engine.live_values().count());
    // A port that is watched has its number too.
    let longest = HEAD + 2 * tasks + 2 * live + widths.iter().map(|width| width + 2).sum::<usize>();
    let (ring, drain) = touched_ring(MIN_WORDS.max(MIN_FRAMES * longest));
    let wishes = Arc::new(Wishes {
        whole: AtomicBool::new(false),
        is_any_watched: AtomicBool::new(false),
        watched: ports.iter().map(|_| AtomicBool::new(false)).collect(),
        lost: AtomicU64::new(0),
    });
    let row = vec![0.0; widths.iter().copied().max().unwrap_or(0)];
    let feed = Feed { ports, row, frame: Vec::with_capacity(longest), ring, wishes: Arc::clone(&wishes) };
    (feed, FeedReader { widths, tasks, live, ring: drain, frame: Vec::new() }, wishes)
}

impl Feed {
    /// Writes what is wanted of the last tick. Without room in the ring, it is lost. It neither allocates nor waits nor
    /// calls the operating system.
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
        self.frame.extend_from_slice(&[0, kind, engine.ticks(), engine.now().cast_unsigned()]);
    }

    /// Passes the frame on. Returns whether there was room.
    fn push(&mut self) -> bool {
        self.frame[0] = self.frame.len() as u64;
        self.ring.push_entire_slice(&self.frame).is_ok()
    }

    fn publish_whole(&mut self, engine: &Engine) {
        self.begin(WHOLE, engine);
        for task in engine.tasks() {
            let flags = u64::from(task.is_halted()) | u64::from(task.end().is_some()) << 1;
            self.frame.extend_from_slice(&[task.mode_number().map_or(NO_MODE, |mode| mode as u64), flags]);
        }
        for live in engine.live_values() {
            self.frame.extend_from_slice(&[live.value.to_bits(), live.target.to_bits()]);
        }
        for port in 0..self.ports.len() {
            self.add(port, engine);
        }
        if !self.push() {
            // The next tick tries again.
            self.wishes.whole.store(true, Ordering::Relaxed);
        }
    }

    fn publish_watched(&mut self, engine: &Engine) {
        self.begin(WATCHED, engine);
        for port in 0..self.ports.len() {
            let is_new = || engine.bus().mark(self.ports[port].id).changed_in(engine.ticks());
            if self.wishes.watched[port].load(Ordering::Relaxed) && is_new() {
                self.frame.push(port as u64);
                self.add(port, engine);
            }
        }
        if self.frame.len() > HEAD && !self.push() {
            self.wishes.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Adds whether a port is present, and its numbers.
    fn add(&mut self, port: usize, engine: &Engine) {
        let FedPort { id, kind, width } = self.ports[port];
        let bus = engine.bus();
        self.frame.push(u64::from(bus.mark(id).is_present()));
        bus.arenas.read_scalars(kind, id.slot, 0, &mut self.row);
        self.frame.extend(self.row[..width].iter().map(|number| number.to_bits()));
    }
}

impl FeedReader {
    /// Takes the next frame, if there is one.
    pub(super) fn next(&mut self) -> Option<Frame> {
        let length = *self.ring.peek().ok()? as usize;
        self.frame.resize(length, 0);
        self.ring.pop_entire_slice(&mut self.frame).ok()?;
        let [_, kind, tick, now] = *self.frame.first_chunk::<HEAD>()?;
        let mut words = self.frame[HEAD..].iter().copied();
        let content = if kind == WATCHED {
            let mut ports = Vec::new();
            while let Some(port) = words.next() {
                let port = port as usize;
                ports.push((port, take_port(&mut words, *self.widths.get(port)?)?));
            }
            Content::Watched(ports)
        } else {
            let mut pair = || Some([words.next()?, words.next()?]);
            let task = |[mode, flags]: [u64; 2]| FedTask {
                mode: (mode != NO_MODE).then_some(mode as usize),
                is_halted: flags & 1 != 0,
                has_ended: flags & 2 != 0,
            };
            let tasks = (0..self.tasks).map(|_| pair().map(task)).collect::<Option<_>>()?;
            let live = (0..self.live).map(|_| pair().map(|both| both.map(f64::from_bits))).collect::<Option<_>>()?;
            let ports = self.widths.iter().map(|width| take_port(&mut words, *width)).collect::<Option<_>>()?;
            Content::Whole(Whole { tasks, live, ports })
        };
        Some(Frame { tick, now: now.cast_signed(), content })
    }
}

/// Takes the numbers of a port. The outer `None` is a frame that is too short.
fn take_port(words: &mut impl Iterator<Item = u64>, width: usize) -> Option<Option<Vec<f64>>> {
    let is_present = words.next()? != 0;
    let numbers = (0..width).map(|_| words.next().map(f64::from_bits)).collect::<Option<Vec<f64>>>()?;
    Some(is_present.then_some(numbers))
}
