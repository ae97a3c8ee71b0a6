//! `watch`: the values of ports of a run, as lines of JSON.

use super::RunArg;
use crate::cli::shell::{FAULTED, Shell};
use crate::socket::{Ask, Sample};

/// Print values of ports of a graph that runs, one line of JSON for each tick in which one of them is new
#[derive(clap::Parser)]
#[command(
    name = "watch",
    after_help = "Examples:
  tactflow watch touch.x
  tactflow watch 'touch.*' pid.control -n 100

`t` is the time of the tick in the graph's clock [s]. A value is null while the port is absent. If the output is read too
slowly, samples are lost, and `lost` in the next line is their number. The run waits for nobody."
)]
pub(super) struct WatchArgs {
    /// A port, a number of a port, or a pattern in which `*` stands for any text
    #[arg(required = true, value_name = "PORT")]
    ports: Vec<String>,
    /// End after this number of lines
    #[arg(short = 'n', long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    #[command(flatten)]
    run: RunArg,
}

pub(super) fn watch(args: WatchArgs, shell: &Shell) -> Result<u8, u8> {
    let refuse = |message: String| shell.refuse(message);
    let mut client = args.run.connect().map_err(refuse)?;
    client.ask::<()>(&Ask::Watch { ports: args.ports, count: args.count }).map_err(refuse)?;
    client.wait_for_ever().map_err(refuse)?;
    let mut lines = 0;
    while let Sample::Line(line) = client.line().map_err(refuse)? {
        shell.say(line.trim_end());
        lines += 1;
        if shell.is_out_closed() {
            return Ok(0);
        }
    }
    if args.count.is_some_and(|count| lines < count) {
        shell.error(format_args!("the run has ended after {lines} lines"));
        return Ok(FAULTED);
    }
    Ok(0)
}
