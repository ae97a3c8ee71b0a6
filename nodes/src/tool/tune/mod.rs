//! `tactflow tune`: measures how the features answer, and proposes gains with margins.

mod amplitudes;
mod bode;
mod cases;
mod climb;
mod contact_tables;
mod course;
mod experiment;
mod fit;
mod gain_keys;
mod identify;
mod lift;
mod limited;
mod load;
mod page;
mod play;
mod propose;
mod ranges;
mod save;
mod settled;
mod signal;
mod spectrum;
mod stay;
mod step;
mod still;
mod target;
mod task;
mod trial;
mod tuned;

use std::path::{Path, PathBuf};

use tactflow_runtime::cli::clap::{self, ValueEnum};
use tactflow_runtime::cli::{GraphArgs, Shell};
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Compiled, Request, compile};

use super::arguments::{may_draw, write};
use super::control::chain::{Chain, chain, smallest};
use super::control::choose::Wanted;
use super::control::collect::law;
use super::control::contacts::Contact;
use super::control::nodes::{Index, Nodes};
use cases::{Case, cases};
use propose::Measurement;
use ranges::Range;
use settled::{Settled, compare};
use signal::Pace;
use target::{adder, controlled};
use trial::Trial;
use tuned::Tuned;

/// Measure how the features answer the motion, and propose gains with margins
#[derive(clap::Parser)]
#[command(
    name = "tune",
    after_help = "It runs the task and moves the robot. For each feature that the mode controls, it halves the gains, moves the sensor to and
fro with sines of 0.2 to 8 Hz, one after the other, and moves further and further. This takes 75 s for each of four
amplitudes. All limits of the graph hold. From the answers it fits a gain, a resonance and a latency, and
proposes the largest gains that keep the margins over all contacts. Where friction hides the answers, it compares gains
by steps of the setpoint instead, for 55 s each. Then it runs the task with the old and the new gains, and compares.
What moves the sensor along the object rests meanwhile.

Examples:
  tactflow tune graphs/force.toml
  tactflow tune graphs/force.toml --with graphs/benches/pen.toml --with graphs/benches/toy_box.toml
  tactflow tune graphs/force.toml --also nodes.error.setpoint.pressure=0.05  at another setpoint too
  tactflow tune graphs/edge.toml --svg bode.svg  draw the loops as a Bode plot
  tactflow tune graphs/force.toml --save        write the gains into the graph, and the contacts into the benches

Exit codes: 0 success; 1 no gains are proposed for a feature; 2 the graph does not load, or has nothing to tune; 130
interrupted."
)]
pub(super) struct TuneArgs {
    /// The graph file
    graph: PathBuf,
    #[command(flatten)]
    graph_args: GraphArgs,
    /// Measure on this bench too, for an object of another stiffness; may be repeated
    #[arg(long = "with", value_name = "FILE")]
    others: Vec<PathBuf>,
    /// Name of the object that the arm touches; needed where the bench states several contacts
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Measure with this setting too, on each bench, for example with another setpoint; may be repeated
    #[arg(long = "also", value_name = "KEY=VALUE")]
    also: Vec<String>,
    /// The role of the arm that is tuned; the first one if not given
    #[arg(long, value_name = "ROLE")]
    arm: Option<String>,
    /// The mode that is tuned; the one with the most features if not given
    #[arg(long)]
    mode: Option<String>,
    /// The feature that is tuned; all of the mode if not given; may be repeated
    #[arg(long = "feature", value_name = "NAME")]
    features: Vec<String>,
    /// Largest peak of the sensitivity
    #[arg(long, value_name = "FACTOR", default_value_t = Wanted::default().peak, value_parser = peak)]
    peak: f64,
    /// Smallest gain margin [dB]
    #[arg(long, value_name = "DB", default_value_t = Wanted::default().gain_db, value_parser = margin)]
    gain_margin: f64,
    /// Smallest phase margin [deg]
    #[arg(long, value_name = "DEG", default_value_t = Wanted::default().phase_deg, value_parser = margin)]
    phase_margin: f64,
    /// Write the gains into the graph or the file of its part, and the contacts into the benches; comments stay
    #[arg(long)]
    save: bool,
    /// Draw the loops with the proposed gains as a Bode plot, with the measured frequencies
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Text, value_name = "FORMAT")]
    format: Format,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For a terminal.
    Text,
    /// For a program.
    Json,
}

/// Why nothing is tuned.
enum Stop {
    Refused(String),
    Interrupted,
}

impl From<String> for Stop {
    fn from(message: String) -> Self {
        Self::Refused(message)
    }
}

pub(super) fn run(args: TuneArgs, shell: &Shell) -> Result<u8, u8> {
    args.svg.as_deref().map_or(Ok(()), writable).map_err(|message| shell.refuse(message))?;
    let request = args.graph_args.request(args.graph.clone());
    // Each run opens the devices by itself, and most devices can be open once.
    let compiled = compile(shell.catalogue(), &request).map_err(|report| shell.reject(&report))?;
    compiled.warnings().iter().for_each(|report| shell.show(report));
    let outline = compiled.outline().clone();
    let tuned = match tune(&args, shell, &request, compiled) {
        Ok(tuned) => tuned,
        Err(Stop::Interrupted) => return Ok(130),
        Err(Stop::Refused(message)) => return Err(shell.refuse(message)),
    };
    let outline = tuned.task.outline(&outline);
    let is_whole =
        tuned.features.iter().all(|feature| feature.new.is_some()) && tuned.settled.iter().all(Settled::is_good);
    match args.format {
        Format::Json => shell.say_json(&tuned),
        // What is saved is shown when it is written.
        Format::Text if args.save && is_whole => shell.say(page::text(&tuned).trim_end()),
        Format::Text => shell.say((page::text(&tuned) + &page::lines(&tuned, &outline)).trim_end()),
    }
    if args.save && is_whole {
        let written = save::save(&args, &outline, &tuned, shell).map_err(|message| shell.refuse(message))?;
        match args.format {
            Format::Json => shell.say_beside(&written),
            Format::Text => shell.say(&written),
        }
    } else if args.save {
        shell.warning("nothing is written: not all features have gains that hold");
    }
    if let Some(path) = &args.svg {
        write(path, &bode::svg(&tuned)).map_err(|message| shell.refuse(message))?;
        shell.say_beside(&format!("wrote {}", path.display()));
    }
    Ok(u8::from(!is_whole))
}

/// Reads the largest peak of the sensitivity, which no loop has below 1.
fn peak(text: &str) -> Result<f64, String> {
    let peak = text.parse().map_err(|error| format!("{error}"))?;
    (peak > 1.0).then_some(peak).ok_or_else(|| "it must be more than 1, as 1.7 is".to_owned())
}

/// Reads a margin.
fn margin(text: &str) -> Result<f64, String> {
    let margin: f64 = text.parse().map_err(|error| format!("{error}"))?;
    (margin >= 0.0 && margin.is_finite()).then_some(margin).ok_or_else(|| "it must be 0 or more".to_owned())
}

/// Checks before the long measurement that a picture can be written. It leaves no new file behind.
fn writable(path: &Path) -> Result<(), String> {
    may_draw(path)?;
    let is_new = path.symlink_metadata().is_err();
    let opened = std::fs::OpenOptions::new().append(true).create(true).open(path).map(drop);
    let checked = opened.and_then(|()| if is_new { std::fs::remove_file(path) } else { Ok(()) });
    checked.map_err(|error| format!("cannot write `{}`: {error}", path.display()))
}

/// Measures the features of one mode, proposes gains, and tries them.
fn tune(args: &TuneArgs, shell: &Shell, request: &Request, compiled: Compiled) -> Result<Tuned, Stop> {
    let whole = compiled.outline().clone();
    cases::answers(&whole)?;
    let command = target::command(&whole, args.arm.as_deref())?;
    let index = Index::new(&whole);
    let Chain { twist, .. } = chain(&Nodes::new(&index, None), command.port)?;
    let task = target::task(&index, &twist, command.arm)?;
    let ranges = if task.file().is_none() { Range::all(&Engine::new(compiled)) } else { Vec::new() };
    let request = task.with(request, ranges.iter().flat_map(Range::opened));
    let outline = &task.outline(&whole);
    let command = target::command(outline, Some(command.arm))?;
    let index = Index::new(outline);
    let Chain { limits, twist, mounts } = chain(&Nodes::new(&index, None), command.port)?;
    target::is_unturned(&mounts, &twist)?;
    let (mode, controlled) = controlled(args, &index, &twist)?;
    if args.save {
        save::is_possible(&whole, &task, mode, &controlled)?;
    }
    let adder = adder(&index, &twist)?;
    let nodes = Nodes::new(&index, Some(mode));
    let (resting, still) = still::settings(&nodes, mode, &law(&nodes, &twist));
    resting.iter().for_each(|node| shell.say_beside(&format!("`{node}` rests meanwhile")));
    let request = task.with(&request, still);
    let wanted = Wanted { peak: args.peak, gain_db: args.gain_margin, phase_deg: args.phase_margin };
    let cases: Vec<Case> = cases((args, command.arm), &request, &task, shell)?;
    let pace = Pace::all(|key| smallest(&nodes, &limits, key));
    let measurement = Measurement { shell, task: &task, outline, mode, adder: &adder, cases: &cases, pace, wanted };
    let mut contacts: Vec<Contact> = cases.iter().map(Case::contact).collect();
    let mut features = Vec::new();
    for feature in &controlled {
        let (found, answered) = measurement.proposal(feature, &contacts)?;
        contacts = answered;
        features.push(found);
    }
    let arm = command.arm.to_owned();
    let benches = cases.iter().map(|case| case.stated.clone()).collect();
    let ranges = ranges.iter().filter_map(|range| range.beyond(&features)).collect();
    let (name, settled) = (mode.name.clone(), Vec::new());
    let mut tuned = Tuned { task, mode: name, resting, arm, wanted, contacts, benches, features, ranges, settled };
    for (i, case) in cases.iter().enumerate() {
        let trial = Trial::new(shell.catalogue(), &tuned.task, case, (mode, &adder));
        tuned.settled.extend(compare(&trial, &tuned.features, (i, &case.object))?);
    }
    Ok(tuned)
}
