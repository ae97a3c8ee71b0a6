//! Readers for files of tactile and pressure sensors: bytes in, a [`Recording`] or a [`Refusal`] out.
//!
//! A format is one file here and one line in [`FORMATS`]. Nothing in this module opens a file or knows a device.
//! [`Hints`] give what a file does not; where both give a value, they must agree. Memory follows the bytes that are in
//! the file, never a number in a header. No mistake is repaired silently.

mod archive;
mod common;
mod csv;
mod footscan;
mod formats;
#[cfg(feature = "mcap")]
mod mcap;
mod novel_asc;
mod novel_lst;
mod npy;
mod read;
mod tekscan;
mod xsensor;
mod zebris;

#[cfg(test)]
mod testing;

pub use common::{
    Assumed, FileFormat, FileHead, Frame, HEAD_BYTES, Hints, MAX_CELLS, Parser, Recording, Refusal, TIME_UNITS,
    TextError, Window, text,
};
pub use formats::{FORMATS, list, recognise};
pub use read::read;
