//! `export`: a recording as a table, or as numpy arrays with its images.

use std::path::PathBuf;

use crate::cli::run::target::refuse_other;
use crate::cli::shell::Shell;
use crate::cli::text::number::count_of;
use crate::recording;

/// Write a recording as a table, or as numpy arrays with its images
#[derive(clap::Parser)]
#[command(
    name = "export",
    after_help = "Examples:
  tactflow export run.mcap run.csv
  tactflow export run.mcap run.npz

A .csv file has the rows and columns of `run --out`. A .npz file has an array for each of these columns,
the images of each port (ticks, rows, columns), and `about`, a text in JSON with units, modes and versions."
)]
pub(super) struct ExportArgs {
    /// The recording, a .mcap file
    recording: PathBuf,
    /// The new file, .csv or .npz
    out: PathBuf,
}

pub(super) fn export(args: ExportArgs, shell: &Shell) -> u8 {
    if let Err(message) = refuse_other(&args.out, &[b"# time [s]", b"PK\x03\x04"], "an export") {
        return shell.refuse(message);
    }
    match recording::export(&args.recording, &args.out) {
        Ok(exported) => {
            let (ticks, columns) = (count_of(exported.ticks as usize, "tick"), count_of(exported.columns, "column"));
            let images = match exported.images {
                0 => String::new(),
                ports => format!(", and the images of {}", count_of(ports, "port")),
            };
            shell.say(&format!("wrote {}: {ticks}, {columns}{images}", args.out.display()));
            0
        }
        Err(message) => shell.refuse(message),
    }
}
