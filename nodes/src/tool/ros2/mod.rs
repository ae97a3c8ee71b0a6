//! `tactflow ros2`: what a run shows to programs of ROS 2, and what they offer.

mod domain;
mod publish;
mod statuses;
mod topics;

use tactflow_runtime::cli::Shell;
use tactflow_runtime::cli::clap::{self, Parser, Subcommand};

/// Show a run to programs of ROS 2, or list their topics
#[derive(Parser)]
#[command(name = "ros2", after_help = "Examples:\n  tactflow ros2 topics\n  tactflow ros2 publish pad.image 'touch.*'")]
pub(super) struct Ros2Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Publish(publish::PublishArgs),
    Topics(topics::TopicsArgs),
}

pub(super) fn run(args: Ros2Args, shell: &Shell) -> Result<u8, u8> {
    match args.command {
        Command::Publish(args) => publish::run(&args, shell),
        Command::Topics(args) => topics::run(&args, shell),
    }
}
