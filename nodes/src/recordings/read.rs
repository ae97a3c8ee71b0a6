//! Reads a file of any format, or the file in an archive.

use super::archive;
use super::common::{FileHead, Hints, Recording, Refusal};
use super::formats::{FORMATS, recognise};

/// Reads a file, or the file in an archive.
///
/// A hint names the format; without one the content decides. Only the ending of `name` matters.
///
/// # Errors
/// Why it is refused.
pub fn read(bytes: &[u8], name: &str, hints: &Hints) -> Result<Recording, Refusal> {
    match archive::unpack(bytes, name, hints)? {
        Some((unpacked, name)) => read_plain(&unpacked, &name, hints),
        None => read_plain(bytes, name, hints),
    }
}

fn read_plain(bytes: &[u8], name: &str, hints: &Hints) -> Result<Recording, Refusal> {
    let format = match &hints.format {
        Some(name) => FORMATS.iter().find(|format| format.name == name),
        None => recognise(&FileHead::new(bytes, name)),
    };
    let format = format.ok_or(Refusal::Stranger)?;
    if hints.time_unit.is_some() && format.name != "csv" {
        let message = format!("only a `csv` file can have times without a unit, and this one is `{}`", format.name);
        return Err(Refusal::Contradicted { hint: "time_unit", message });
    }
    if hints.force.is_some() && format.name != "mcap" {
        let message = format!("only a recording of a whole run has ports, and this file is `{}`", format.name);
        return Err(Refusal::Contradicted { hint: "force", message });
    }
    format.read(bytes, hints)
}
