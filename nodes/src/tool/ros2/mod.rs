//! `tactflow ros2`: what a run shows to programs of ROS 2.

mod publish;
mod statuses;

use tactflow_runtime::cli::Shell;
use tactflow_runtime::cli::clap::{self, Parser, Subcommand};

/// Show a run to programs of ROS 2
#[derive(Parser)]
#[command(name = "ros2", after_help = "Example:\n  tactflow ros2 publish pad.image 'touch.*'")]
pub(super) struct Ros2Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Publish(publish::PublishArgs),
}

pub(super) fn run(args: Ros2Args, shell: &Shell) -> Result<u8, u8> {
    match args.command {
        Command::Publish(args) => publish::run(&args, shell),
    }
}
