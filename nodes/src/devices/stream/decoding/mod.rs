//! Decoding: from the bytes of a frame to its numbers. It is pure: it reads and writes nothing else.

pub(crate) mod cell;
pub(crate) mod clock;
pub(crate) mod decoder;
pub(crate) mod order;
pub(crate) mod parts;
pub(crate) mod words;
