//! `send`: a word that stops, for a run.

use super::RunArg;
use crate::cli::shell::Shell;
use crate::socket::Ask;

/// Stop a graph that runs
#[derive(clap::Parser)]
#[command(
    name = "send",
    after_help = "Examples:
  tactflow send stop         every command goes to zero
  tactflow send left.stop    only those of the task `left`

Only words that stop can be sent. Whoever sends `resume` or starts a motion must see the robot, so these are typed in the
terminal of the run, with `run --listen`."
)]
pub(super) struct SendArgs {
    /// `stop`, or `TASK.stop`
    word: String,
    #[command(flatten)]
    run: RunArg,
}

pub(super) fn send(args: SendArgs, shell: &Shell) -> Result<u8, u8> {
    let refuse = |message: String| shell.refuse(message);
    let mut client = args.run.connect().map_err(refuse)?;
    let sent: String = client.ask(&Ask::Send { word: args.word }).map_err(refuse)?;
    shell.say(&sent);
    Ok(0)
}
