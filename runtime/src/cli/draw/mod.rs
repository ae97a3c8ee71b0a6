//! `draw`: a graph as a picture, with a frame around each part, or its modes.

mod dot;
mod layout;
mod mermaid;
mod modes;
mod picture;
#[cfg(feature = "mcap")]
mod recorded;
mod svg;
mod wires;

use std::collections::HashMap;
use std::path::PathBuf;

use clap::ValueEnum;

use picture::Picture;

use super::shell::Shell;
use super::shell::command::GraphArgs;
use crate::graph::{Outline, PlannedPort, compile};

/// Draw a graph: its roles, nodes and wires, with a frame around each part, or its modes
#[derive(clap::Parser)]
#[command(
    name = "draw",
    after_help = "The picture goes to the standard output. Each wire has its port, its kind, its unit and its frames. Dashed
arrows between modes are `fail` and `on_lost`. In the place of a graph, a recording (.mcap) shows the graph that ran, with
the time of each node, measured on this machine while the recording is replayed.

Examples:
  tactflow draw graphs/hybrid.toml > hybrid.svg
  tactflow draw graphs/hybrid.toml --modes > modes.svg
  tactflow draw run.mcap > times.svg
  tactflow draw graphs/hybrid.toml --format mermaid     for a Markdown page
  tactflow draw graphs/hybrid.toml --format dot | dot -Tpdf > hybrid.pdf"
)]
pub(crate) struct DrawArgs {
    /// The graph file, or a recording of a run (.mcap)
    graph: PathBuf,
    #[command(flatten)]
    graph_args: GraphArgs,
    /// Draw the modes and what leads from one to another
    #[arg(long)]
    modes: bool,
    /// Leave out the text on the arrows
    #[arg(long)]
    plain: bool,
    /// Format of the picture
    #[arg(long, value_enum, default_value_t = DrawFormat::Svg, value_name = "FORMAT")]
    format: DrawFormat,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum DrawFormat {
    /// A picture for a browser or a paper.
    Svg,
    /// A diagram in the language of Mermaid.
    Mermaid,
    /// A graph in the language of Graphviz.
    Dot,
}

/// Returns the picture of a graph with these ports, as SVG.
pub(crate) fn graph_svg<'p>(
    outline: &'p Outline,
    ports: impl Iterator<Item = &'p PlannedPort>,
    title: String,
) -> String {
    svg::text(&wires::picture(outline, ports, &HashMap::new(), title))
}

/// Returns the picture of the modes of a graph, as SVG.
pub(crate) fn modes_svg(outline: &Outline, title: String) -> String {
    svg::text(&modes::picture(outline, title))
}

pub(crate) fn draw(args: DrawArgs, shell: &Shell) -> u8 {
    let mut picture = match picture(&args, shell) {
        Ok(picture) if picture.boxes.is_empty() && args.modes => return shell.refuse("the graph has no modes to draw"),
        Ok(picture) => picture,
        Err(code) => return code,
    };
    if args.plain {
        picture.arrows.iter_mut().for_each(|arrow| arrow.lines.clear());
    }
    let text = match args.format {
        DrawFormat::Svg => svg::text(&picture),
        DrawFormat::Mermaid => mermaid::text(&picture),
        DrawFormat::Dot => dot::text(&picture),
    };
    shell.say(text.trim_end());
    0
}

fn picture(args: &DrawArgs, shell: &Shell) -> Result<Picture, u8> {
    #[cfg(feature = "mcap")]
    if super::shell::replays::is_recording(&args.graph) {
        return recorded::picture(args, shell);
    }
    let request = args.graph_args.request(args.graph.clone());
    let plan = compile(shell.catalogue(), &request).map_err(|report| shell.reject(&report))?;
    let title = args.graph.display().to_string();
    Ok(match args.modes {
        true => modes::picture(plan.outline(), title),
        false => wires::picture(plan.outline(), plan.ports(), &HashMap::new(), title),
    })
}
