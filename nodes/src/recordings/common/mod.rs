//! What all formats share: recordings, refusals, hints, and tools for texts and archives.

pub(super) mod fields;
mod format;
mod hints;
mod recording;
pub(super) mod reel;
mod refusal;
pub mod text;
pub(super) mod units;
pub(super) mod zip;

pub use format::{FileFormat, FileHead, HEAD_BYTES, Parser};
pub use hints::{Assumed, Hints, TIME_UNITS};
pub use recording::{Frame, MAX_CELLS, Recording, Window};
pub use refusal::{Refusal, TextError};
