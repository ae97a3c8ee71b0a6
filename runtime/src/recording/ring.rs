//! The ring between the tick and the thread that writes: frames of bytes, and what is lost when it is full.

use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::Duration;

use rtrb::{Consumer, Producer};

/// Interval at which a run in virtual time looks for space.
const POLL_INTERVAL: Duration = Duration::from_millis(1);

/// The types of frames in the ring: each is its length (u32), its type, and its bytes.
pub(super) const INPUTS_FRAME: u8 = b'I';
pub(super) const PORTS_FRAME: u8 = b'S';
/// Bytes before those of a frame: length and type.
pub(super) const FRAME_HEAD: usize = 5;
/// Bytes before the inputs in their frame: epoch, number and time of the tick.
pub(super) const INPUTS_HEAD: usize = 24;

/// What is lost of a recording.
#[derive(Debug, Default)]
pub(super) struct Losses {
    /// Ticks whose inputs are lost.
    pub(super) inputs: AtomicU64,
    /// Number of the first of them; 0 if there is none.
    pub(super) first: AtomicU64,
    /// Ticks whose ports are lost.
    pub(super) ports: AtomicU64,
    /// Whether the run has ended by itself, and not by an unwinding.
    pub(super) has_end: AtomicBool,
}

/// Adds a frame to the ring if `spare` bytes are left behind it. Returns whether there was room.
pub(super) fn push(
    ring: &mut Producer<u8>,
    (kind, head): (u8, &[u8]),
    bytes: &[u8],
    (spare, may_wait): (usize, &dyn Fn() -> bool),
) -> bool {
    let length = head.len() + bytes.len();
    while ring.slots() < length + FRAME_HEAD + spare {
        if ring.is_abandoned() || !may_wait() {
            return false;
        }
        std::thread::sleep(POLL_INTERVAL);
    }
    let mut start = [0; FRAME_HEAD];
    start[..4].copy_from_slice(&(length as u32).to_le_bytes());
    start[4] = kind;
    [&start, head, bytes].iter().all(|part| ring.push_entire_slice(part).is_ok())
}

/// Takes the next frame, if all of it is there. `head` keeps the length and the type of one that is not.
pub(super) fn next_frame(ring: &mut Consumer<u8>, head: &mut Option<(usize, u8)>, frame: &mut Vec<u8>) -> bool {
    if head.is_none() {
        let mut start = [0; FRAME_HEAD];
        if ring.pop_entire_slice(&mut start).is_err() {
            return false;
        }
        let [a, b, c, d, kind] = start;
        *head = Some((u32::from_le_bytes([a, b, c, d]) as usize, kind));
    }
    let Some((length, _)) = head else { return false };
    if ring.slots() < *length {
        return false;
    }
    frame.resize(*length, 0);
    ring.pop_entire_slice(frame).is_ok()
}
