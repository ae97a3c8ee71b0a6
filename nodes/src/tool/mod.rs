//! The commands that know sensors; the runtime's own know none.

mod features;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::cli::{Tool, derived};

use crate::calibration;

/// The whole tool, on a catalogue that has this crate's in it.
#[must_use]
pub fn tool(catalogue: Catalogue) -> Tool {
    Tool::new(catalogue).command(derived(features::features)).command(calibration::command::command())
}
