//! A ring buffer between the tick and a thread that writes.

use rtrb::{Consumer, Producer, RingBuffer};

/// Creates a ring, and writes every element of it once, so that no tick waits for the operating system to provide the
/// memory.
pub(crate) fn touched_ring<T: Copy + Default>(capacity: usize) -> (Producer<T>, Consumer<T>) {
    let (mut ring, mut drain) = RingBuffer::new(capacity);
    let blanks = [T::default(); 1 << 12];
    while ring.slots() > 0 {
        let _ = ring.push_partial_slice(&blanks);
    }
    if let Ok(chunk) = drain.read_chunk(drain.slots()) {
        chunk.commit_all();
    }
    (ring, drain)
}
