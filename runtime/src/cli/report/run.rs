//! A recorded run on the page: it is replayed once.

use std::time::Instant;

use super::lateness::Lateness;
use super::page::HtmlPage;
use crate::cli::draw::{graph_svg, modes_svg};
use crate::cli::run::summary::Summary;
use crate::cli::shell::panics::without_panic_messages;
use crate::cli::still::Still;
use crate::cli::text::number::{count_of, seconds};
use crate::cli::text::prose::PageStyle;
use crate::engine::{End, Engine, Outcome};
use crate::fault::Fault;
use crate::recording::{Replay, ReplayedTick};

/// Adds a run to the page. Returns how the replay differs from the recording, if it does.
pub(super) fn add(page: &mut HtmlPage, name: &str, mut replay: Replay) -> Result<Option<String>, String> {
    let begin = Instant::now();
    let mut summary = Summary::new(replay.engine(), false, None).without_hint();
    // A graph that shows nothing has no picture.
    let mut still = Still::new(name, replay.engine()).ok();
    let mut lateness = Lateness::default();
    let fault = without_panic_messages(|| {
        loop {
            match replay.step()? {
                ReplayedTick::Over => return Ok::<Option<Fault>, String>(None),
                ReplayedTick::Fault(fault) => return Ok(Some(*fault)),
                ReplayedTick::Ran(_) => {}
            }
            summary.add(replay.engine());
            still.iter_mut().for_each(|still| still.add(replay.engine()));
            lateness.add(replay.engine());
        }
    })?;
    let engine = replay.engine();
    page.heading(name);
    page.paragraph(&about(&replay));
    let end = fault.map_or(End::Finished, |fault| End::Fault(fault.into()));
    let (time, ticks, wall) = (engine.now(), engine.ticks(), begin.elapsed());
    let outcome = Outcome { end, signal: None, time, ticks, wall, late: 0 };
    let style = PageStyle::of_width(100, false).ok_or("the page is too narrow")?;
    page.listing(&summary.render(engine, &outcome, style));
    if let Some(still) = still {
        page.picture(&still.text(engine), "The strongest image, and what the graph shows over time.");
    }
    if let Some(caption) = lateness.caption() {
        page.picture(&lateness.picture(), &caption);
    }
    add_graph(page, name, &replay, engine);
    Ok(difference(&replay))
}

fn add_graph(page: &mut HtmlPage, name: &str, replay: &Replay, engine: &Engine) {
    let outline = replay.outline();
    if !outline.modes.is_empty() {
        page.picture(&modes_svg(outline, name.to_owned()), "The modes, and what leads from one to another.");
    }
    let ports = engine.ports().iter().map(|(port, _)| port);
    page.picture(&graph_svg(outline, ports, name.to_owned()), "The graph: roles, nodes, and what the wires carry.");
}

/// Describes a run in one paragraph.
fn about(replay: &Replay) -> String {
    let (recording, engine) = (replay.recording(), replay.engine());
    let about = recording.about();
    let bench = about.bench.iter().map(|bench| format!(" on {}", bench.display()));
    let set = about.set.iter().map(|set| format!(" --set {set}"));
    let seed = about.seed.iter().map(|seed| format!(", seed {seed}"));
    let time = if about.is_real { "real time" } else { "virtual time" };
    let end = recording.reason().map(|reason| format!("; {reason}"));
    let cut = (!recording.is_complete()).then(|| "; the file was cut".to_owned());
    let more: String = bench.chain(set).chain(seed).collect();
    let ticks = count_of(engine.ticks() as usize, "tick");
    let ended: String = end.into_iter().chain(cut).collect();
    let (now, version, hash) = (seconds(engine.now()), &about.tactflow, &about.hash);
    format!(
        "{}{more}: {ticks} in {now:.3} s of {time}{ended}. Recorded by tactflow {version}; files and options {hash}.",
        about.graph.display()
    )
}

fn difference(replay: &Replay) -> Option<String> {
    let all = &replay.differences().ports;
    let (port, first) = all.iter().min_by_key(|(_, difference)| difference.order)?;
    Some(format!("`{port}` differs from the recording from tick {} on", first.tick))
}
