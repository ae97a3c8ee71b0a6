//! `diff`: which ports differ between two recordings, from when, and by how much.

use std::path::PathBuf;

use super::difference_table;
use crate::cli::shell::{FAULTED, Shell};
use crate::cli::text::number::count_of;
use crate::recording;
use crate::source::quoted;

/// Compare two recordings: which ports differ, from which tick, by how much at most
#[derive(clap::Parser)]
#[command(
    name = "diff",
    after_help = "Example:
  tactflow diff yesterday.mcap today.mcap

The exit code is 0 if all ports are the same, and 1 if not."
)]
pub(super) struct DiffArgs {
    /// The first recording, a .mcap file
    first: PathBuf,
    /// The second recording
    second: PathBuf,
}

pub(super) fn diff(args: DiffArgs, shell: &Shell) -> u8 {
    let diff = match recording::diff(&args.first, &args.second) {
        Ok(diff) => diff,
        Err(message) => return shell.refuse(message),
    };
    let names = [&args.first, &args.second].map(|path| path.display().to_string());
    for (name, only) in names.iter().zip(&diff.only).filter(|(_, only)| !only.is_empty()) {
        shell.say(&format!("only in {name}: {}", quoted(only)));
    }
    let [first, second] = diff.ticks;
    if first != second {
        shell.say(&format!("{} has {first} ticks, and {} has {second}", names[0], names[1]));
    }
    let ports = count_of(diff.ports, "port");
    let differing = diff.differences.ports.len();
    if differing > 0 {
        shell.say(difference_table(diff.differences.ports.iter()).trim_end());
        shell.say(&format!("{differing} of {ports} differ"));
    } else {
        let ticks = count_of(first.min(second) as usize, "tick");
        shell.say(&format!("{ticks}, {ports}: the same to the last bit"));
    }
    if diff.is_empty() { 0 } else { FAULTED }
}
