//! `tare`: the zeros of the sensors of a run.

use super::RunArg;
use crate::cli::shell::Shell;
use crate::socket::Ask;

/// Take the zeros of the pads of a graph that runs anew
#[derive(clap::Parser)]
#[command(
    name = "tare",
    after_help = "Examples:
  tactflow send stop
  tactflow tare

The task must be halted, its arm at rest, and nothing may touch a pad; otherwise nothing changes, and the message says why.
Each pad repeats its self-test. The run goes on with `resume`, which is typed in its terminal."
)]
pub(super) struct TareArgs {
    #[command(flatten)]
    run: RunArg,
}

pub(super) fn tare(args: TareArgs, shell: &Shell) -> Result<u8, u8> {
    let refuse = |message: String| shell.refuse(message);
    let mut client = args.run.connect().map_err(refuse)?;
    let tared: String = client.ask(&Ask::Tare {}).map_err(refuse)?;
    shell.say(&tared);
    Ok(0)
}
