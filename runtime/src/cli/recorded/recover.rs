//! `recover`: writes a whole, indexed file from a recording that was cut.

use std::path::PathBuf;

use crate::cli::shell::{NOT_LOADED, Shell};
use crate::recording;

/// Write a whole, indexed file from a recording that was cut
#[derive(clap::Parser)]
#[command(
    name = "recover",
    after_help = "Example:
  tactflow recover cut.mcap whole.mcap"
)]
pub(super) struct RecoverArgs {
    /// The recording, a .mcap file
    recording: PathBuf,
    /// The new file
    out: PathBuf,
}

pub(super) fn recover(args: RecoverArgs, shell: &Shell) -> u8 {
    match recording::recover(&args.recording, &args.out) {
        Ok(recovered) => {
            let what = if recovered.was_complete { "the recording was whole" } else { "the recording was cut" };
            shell.say(&format!("{what}; wrote {} with {} messages", args.out.display(), recovered.messages));
            0
        }
        Err(message) => {
            shell.error(message);
            NOT_LOADED
        }
    }
}
