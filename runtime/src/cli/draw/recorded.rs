//! The graph of a recording, and the time that each of its nodes takes: the recording is replayed once.

use std::collections::HashMap;

use super::picture::Picture;
use super::{DrawArgs, modes, wires};
use crate::cli::shell::Shell;
use crate::cli::shell::panics::without_panic_messages;
use crate::engine::Engine;
use crate::recording::{Replay, ReplayChanges, ReplayedTick};

/// Returns the picture of a recording.
pub(super) fn picture(args: &DrawArgs, shell: &Shell) -> Result<Picture, u8> {
    if args.graph_args.is_given() {
        return Err(shell.refuse("a recording has its own bench and values: leave out `--bench` and `--set`"));
    }
    let mut replay = shell.open_replay(&args.graph, &ReplayChanges::default())?;
    let title = args.graph.display().to_string();
    if args.modes {
        return Ok(modes::picture(replay.outline(), title));
    }
    run(&mut replay).map_err(|message| shell.refuse(format_args!("{title}: {message}")))?;
    let engine = replay.engine();
    let ports = engine.ports().iter().map(|(port, _)| port);
    Ok(wires::picture(replay.outline(), ports, &times(engine), title))
}

/// Replays until the end or a fault of the recording.
fn run(replay: &mut Replay) -> Result<(), String> {
    without_panic_messages(|| {
        while matches!(replay.step()?, ReplayedTick::Ran(_)) {}
        Ok(())
    })
}

/// Returns a line of text with the time of each node.
fn times(engine: &Engine) -> HashMap<String, String> {
    let timing = engine.timing();
    let timed = engine.order().zip(&timing.nodes).map(|(name, time)| {
        let mean = time.total.as_secs_f64() * 1e6 / timing.ticks.max(1) as f64;
        let longest = time.longest.as_secs_f64() * 1e6;
        (name.to_owned(), format!("{mean:.1} µs, at most {longest:.1} µs"))
    });
    timed.collect()
}
