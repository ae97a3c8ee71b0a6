//! Parsers for arguments, and the guard of files that a command writes.

use std::path::Path;
use std::str::FromStr;

/// Parses two values, as 5x5 or 5,5: a parser for arguments.
pub(super) fn pair<T: FromStr>(text: &str) -> Result<[T; 2], String> {
    let two = text.split_once(['x', ',']).ok_or("expected two numbers, as 5x5")?;
    let read = |text: &str| text.trim().parse().map_err(|_| format!("`{text}` is not a valid number here"));
    Ok([read(two.0)?, read(two.1)?])
}

/// Parses a number greater than 0: a parser for arguments.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| *number > 0.0 && number.is_finite());
    number.ok_or_else(|| format!("`{text}` is not a number greater than 0"))
}

/// Refuses to replace a file of another kind.
pub(super) fn may_replace(path: &Path, what: &str, is_one: impl Fn(&str) -> bool) -> Result<(), String> {
    match std::fs::read(path) {
        Ok(bytes) if str::from_utf8(&bytes).is_ok_and(is_one) => Ok(()),
        Ok(_) => {
            Err(format!("`{}` exists and is not {what}, so it is not replaced: write to another file", path.display()))
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(format!("cannot write `{}`: {error}", path.display())),
    }
}

/// Refuses to replace a file that is no SVG picture. An empty file may be replaced.
pub(super) fn may_draw(path: &Path) -> Result<(), String> {
    may_replace(path, "an SVG picture", |text| text.trim().is_empty() || text.trim_start().starts_with("<svg"))
}

/// Writes a file.
pub(super) fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("cannot write `{}`: {error}", path.display()))
}
