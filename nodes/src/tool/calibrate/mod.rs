//! `tactflow calibrate`: the curves of a pad from logs, its mount on the arm, and the weight of the tool.

mod average;
mod contact;
mod mount;
mod mount_text;
mod pad;
mod payload;
mod tool;

use tactflow_runtime::cli::Shell;
use tactflow_runtime::cli::clap::{self, Parser, Subcommand};

/// Calibrate a pad from logs with a reference force, its mount on the arm, or the weight of the tool
#[derive(Parser)]
#[command(name = "calibrate", args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(disable_help_subcommand = true, subcommand_value_name = "tool|mount")]
#[command(
    after_help = "A log is a recording with a force [N] for each frame: a CSV file with the columns time, force and the tactels, \
or an .npz file with images and force. It starts unloaded. See docs/calibration.md.

Examples:
  tactflow calibrate press.csv                          prints the report only
  tactflow calibrate press.csv -o pad.toml --svg pad.svg
  tactflow calibrate bladder1.npz bladder2.npz --load uniform --curve piecewise -o pad.toml
  tactflow calibrate mount cell.toml                    the pad touches one point in four postures
  tactflow calibrate tool cell.toml                     the tool is held still in four postures

Exit codes: 0 success; 1 a device failed, or the measurement cannot be right; 2 a log or a file cannot be used."
)]
pub(super) struct CalibrateArgs {
    #[command(flatten)]
    pad: pad::PadArgs,
    #[command(subcommand)]
    guided: Option<Guided>,
}

/// What a person measures with an arm that is guided by hand.
#[derive(Subcommand)]
enum Guided {
    Tool(tool::ToolArgs),
    Mount(mount::MountArgs),
}

pub(super) fn run(args: CalibrateArgs, shell: &Shell) -> Result<u8, u8> {
    match args.guided {
        None => pad::run(args.pad, shell),
        Some(Guided::Tool(args)) => tool::run(&args, shell),
        Some(Guided::Mount(args)) => mount::run(&args, shell),
    }
}
