//! `plot`: ports of a recorded run over time, as one figure.

mod figure;

use std::path::{Path, PathBuf};

use super::run::target::refuse_other;
use super::shell::Shell;
use super::text::number::count_of;
use super::text::svg::Svg;
use crate::record::{RecordFormat, RunRows};

/// Draw ports of a recorded run over time, as one figure
#[derive(clap::Parser)]
#[command(
    name = "plot",
    after_help = "Ports with the same unit share a panel. Curves differ in colour and in dashes, so that the figure can be read
without colours. The modes of the graph are bands.

Examples:
  tactflow run graphs/hybrid.toml --record run.mcap
  tactflow plot run.mcap touch.moments.x touch.moments.y touch.pressure.value --out contact.svg
  tactflow run graphs/hybrid.toml --out run.csv
  tactflow plot run.csv pid.control --from 2s --for 1s --out control.svg

Exit codes: 0 success; 2 a file cannot be read, or has no such port."
)]
pub(super) struct PlotArgs {
    /// The run: a .mcap file of `--record`, or a .csv or .ndjson file of `--out`
    run: PathBuf,
    /// Ports, or columns of ports: all components of a vector, or one, as `pid.control.x`
    #[arg(required = true, value_name = "PORT")]
    ports: Vec<String>,
    /// Write the figure to an .svg file
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// Begin at this time of the run: 2s, 500ms
    #[arg(long, value_name = "TIME", value_parser = super::run::duration)]
    from: Option<f64>,
    /// Draw this much time
    #[arg(long = "for", value_name = "TIME", value_parser = super::run::duration)]
    duration: Option<f64>,
}

pub(super) fn plot(args: PlotArgs, shell: &Shell) -> u8 {
    match make(&args) {
        Ok(drawn) => {
            shell.say(&format!("wrote {}: {drawn}", args.out.display()));
            0
        }
        Err(message) => shell.refuse(message),
    }
}

fn make(args: &PlotArgs) -> Result<String, String> {
    let out = &args.out;
    if out.extension().is_none_or(|ending| ending != "svg") {
        let svg = out.with_extension("svg");
        return Err(format!(
            "`{}` does not end in .svg: write `--out {}`; browsers and Inkscape make a PNG or a PDF of it",
            out.display(),
            svg.display()
        ));
    }
    refuse_other(out, &[Svg::START.as_bytes()], "an SVG picture")?;
    let rows = read(&args.run)?;
    let mut columns: Vec<&_> = Vec::new();
    for port in &args.ports {
        columns.extend(rows.port(port)?);
    }
    let from = args.from.unwrap_or(0.0);
    let span = [from, args.duration.map_or(f64::INFINITY, |duration| from + duration)];
    let shown = rows.times.iter().filter(|time| (span[0]..=span[1]).contains(*time)).count();
    if shown == 0 {
        let last = rows.times.last().map_or_else(|| "has no rows".into(), |last| format!("ends at {last} s"));
        return Err(format!("there is nothing to draw: `{}` {last}", args.run.display()));
    }
    let title = args.run.display().to_string();
    let text = figure::draw(&title, &rows, &columns, span);
    std::fs::write(out, text).map_err(|error| format!("cannot write `{}`: {error}", out.display()))?;
    Ok(format!("{} over {}", count_of(columns.len(), "curve"), count_of(shown, "tick")))
}

fn read(path: &Path) -> Result<RunRows, String> {
    #[cfg(feature = "mcap")]
    if super::shell::replays::is_recording(path) {
        return crate::recording::rows(path);
    }
    if RecordFormat::of(path).is_none() {
        let name = path.display();
        return Err(format!("`{name}` is no recorded run: give a .mcap, .csv or .ndjson file that `run` has written"));
    }
    RunRows::read(path)
}
