//! The commands that know sensors; the runtime's own know none.

mod calibrate;
mod features;

use std::str::FromStr;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::cli::{Tool, derived};

/// The whole tool, on a catalogue that has this crate's in it.
#[must_use]
pub fn tool(catalogue: Catalogue) -> Tool {
    Tool::new(catalogue).command(derived(features::features)).command(derived(calibrate::run))
}

/// Two of a kind, as 5x5 or 5,5: a parser for arguments.
fn pair<T: FromStr>(text: &str) -> Result<[T; 2], String> {
    let two = text.split_once(['x', ',']).ok_or("expected two numbers, as 5x5")?;
    let read = |text: &str| text.trim().parse().map_err(|_| format!("`{text}` is no number that can stand here"));
    Ok([read(two.0)?, read(two.1)?])
}

/// A number greater than 0: a parser for arguments.
fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| *number > 0.0 && number.is_finite());
    number.ok_or_else(|| format!("`{text}` is not a number greater than 0"))
}
