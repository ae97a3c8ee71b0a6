//! The list of formats, and how one is recognised.

use super::common::{FileFormat, FileHead};
use super::{csv, footscan, novel_asc, novel_lst, npy, tekscan, xsensor, zebris};

/// All formats, those with the strictest recognition first.
pub const FORMATS: &[FileFormat] = &[
    #[cfg(feature = "mcap")]
    super::mcap::FORMAT,
    npy::NPY,
    npy::NPZ,
    tekscan::FORMAT,
    novel_lst::FORMAT,
    novel_asc::FORMAT,
    zebris::FORMAT,
    xsensor::FORMAT,
    footscan::FORMAT,
    csv::FORMAT,
];

/// Returns the format of a file with this beginning.
#[must_use]
pub fn recognise(head: &FileHead<'_>) -> Option<&'static FileFormat> {
    FORMATS.iter().find(|format| (format.recognises)(head))
}

/// Returns all formats by name, for messages.
#[must_use]
pub fn list() -> String {
    let lines = FORMATS.iter().map(|format| format!("\n  `{}`: {}", format.name, format.title));
    format!("known formats, also in a `.zip` or `.gz`:{}", lines.collect::<String>())
}
