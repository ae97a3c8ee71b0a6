//! `tactflow tune`: measures how the features answer, and proposes gains with margins.

mod bode;
mod cases;
mod course;
mod experiment;
mod fit;
mod lift;
mod page;
mod ranges;
mod save;
mod stay;
mod step;
mod target;
mod trial;
mod ways;

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tactflow_runtime::cli::clap::{self, ValueEnum};
use tactflow_runtime::cli::{GraphArgs, Shell};
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Outline, Request, compile};

use super::arguments::{may_draw, write};
use super::control::chain::chain;
use super::control::choose::{Wanted, factor};
use super::control::contacts::{Answer, Contact};
use super::control::digits::{floored_to_two_digits, rounded_to_three_digits};
use super::control::law::Feature;
use super::control::margins::{Margins, margins};
use super::control::response::Loop;
use super::control::settings::{self, Index, Nodes};
use crate::motion::COMPONENTS;
use cases::{Case, Stated, arm_of, cases};
use experiment::{Experiment, HALF, Line};
use fit::{ENOUGH, Fit, fit};
use ranges::Range;
use target::{adder, controlled};
use trial::{Settled, Trial};
use ways::{Response, agreed};

/// Measure how the features answer the motion, and propose gains with margins
#[derive(clap::Parser)]
#[command(
    name = "tune",
    after_help = "It runs the task and moves the robot. For each feature that the mode controls, it halves the gains, moves the sensor to and
fro with sines of 0.2 to 8 Hz, one after the other, and moves further and further. This takes 75 s for each of four
ways. All limits of the graph hold. From the answers it fits a gain, a resonance and a latency, and
proposes the largest gains that keep the margins over all contacts. Then it runs the task with them, and compares.

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
    /// Measure with this setting too, on each bench, for example with another setpoint; may be repeated
    #[arg(long = "also", value_name = "KEY=VALUE")]
    also: Vec<String>,
    /// The mode that is tuned; the one with the most features if not given
    #[arg(long)]
    mode: Option<String>,
    /// The feature that is tuned; all of the mode if not given; may be repeated
    #[arg(long = "feature", value_name = "NAME")]
    features: Vec<String>,
    /// Largest peak of the sensitivity
    #[arg(long, value_name = "FACTOR", default_value_t = Wanted::default().peak)]
    peak: f64,
    /// Smallest gain margin [dB]
    #[arg(long, value_name = "DB", default_value_t = Wanted::default().gain_db)]
    gain_margin: f64,
    /// Smallest phase margin [deg]
    #[arg(long, value_name = "DEG", default_value_t = Wanted::default().phase_deg)]
    phase_margin: f64,
    /// Write the gains into the graph, and the contacts into the benches; comments stay
    #[arg(long)]
    save: bool,
    /// Draw the loops as a Bode plot: what is measured, and the fit with the proposed gains
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

/// What `tune` has found.
#[derive(Debug, Serialize)]
struct Tuned {
    mode: String,
    /// Name of the role of the arm.
    arm: String,
    wanted: Wanted,
    contacts: Vec<Contact>,
    /// The bench of each contact, and what it has stated before.
    #[serde(skip)]
    benches: Vec<Stated>,
    features: Vec<TunedFeature>,
    /// The ranges of `[live]` that do not hold the proposed gains, as wide as they must be.
    #[serde(skip)]
    ranges: Vec<Range>,
    /// How the task holds its features with the old and with the new gains, for each bench.
    settled: Vec<Settled>,
}

/// One feature, over all contacts.
#[derive(Debug, Serialize)]
struct TunedFeature {
    name: String,
    /// The answers, for each contact.
    answers: Vec<Found>,
    /// Proportional, integral and derivative gain of the graph.
    old: [f64; 3],
    /// The gains that are proposed, rounded down to two digits; `None` if the margins do not hold with any.
    new: Option<[f64; 3]>,
    /// The margins of the new gains, for each contact.
    margins: Vec<Margins>,
    #[serde(skip)]
    feature: Feature,
    /// The loops with the new gains, or with those of the graph if there are no new ones, each with its contact.
    #[serde(skip)]
    loops: Vec<(usize, Loop)>,
}

/// The answer of a feature over one contact.
#[derive(Debug, Serialize)]
struct Found {
    object: String,
    /// For each component that moves the feature: its name, and the fit.
    fits: Vec<(&'static str, Fit)>,
    /// What was measured, for each component.
    #[serde(skip)]
    lines: Vec<Vec<Line>>,
    /// The answer to the largest motion as a multiple of that to the one before, if no two motions agree [1].
    #[serde(skip_serializing_if = "Option::is_none")]
    growth: Option<f64>,
    /// Why there is no fit.
    refused: Option<String>,
    /// Whether a test signal has ended the mode.
    #[serde(skip)]
    is_lost: bool,
}

impl Tuned {
    /// Returns what each bench states now: what was measured, and what it has stated of other features and objects.
    fn stated(&self) -> Vec<Stated> {
        let mut benches: Vec<Stated> = Vec::new();
        for (bench, measured) in self.benches.iter().zip(&self.contacts).filter(|(_, it)| !it.features.is_empty()) {
            if benches.iter().all(|known| known.file != bench.file) {
                benches.push(bench.clone());
            }
            let known = benches.iter_mut().find(|known| known.file == bench.file);
            let Some(Stated { contacts, .. }) = known else { continue };
            match contacts.iter_mut().find(|contact| contact.object == measured.object) {
                Some(contact) => contact.features.extend(measured.features.clone()),
                None => contacts.push(measured.clone()),
            }
        }
        benches
    }
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
    let outline = compiled.outline().clone();
    let ranges = Range::all(&Engine::new(compiled));
    let opened = ranges.iter().flat_map(Range::opened);
    let request = Request { set: request.set.iter().cloned().chain(opened).collect(), ..request };
    let tuned = match tune(&args, shell, &request, &outline) {
        Ok(tuned) => tuned,
        Err(Stop::Interrupted) => return Ok(130),
        Err(Stop::Refused(message)) => return Err(shell.refuse(message)),
    };
    let ranges = ranges.iter().filter_map(|range| range.beyond(&tuned.features)).collect();
    let tuned = Tuned { ranges, ..tuned };
    match args.format {
        Format::Json => shell.say_json(&tuned),
        Format::Text => shell.say(page::text(&tuned).trim_end()),
    }
    let is_whole =
        tuned.features.iter().all(|feature| feature.new.is_some()) && tuned.settled.iter().all(Settled::is_good);
    if args.save && is_whole {
        let written = save::save(&args, &outline, &tuned, shell).map_err(|message| shell.refuse(message))?;
        shell.say(&written);
    } else if args.save {
        shell.warning("nothing is written: not all features have gains that hold");
    }
    if let Some(path) = &args.svg {
        write(path, &bode::svg(&tuned)).map_err(|message| shell.refuse(message))?;
        shell.say_beside(&format!("wrote {}", path.display()));
    }
    Ok(u8::from(!is_whole))
}

/// Checks before the long measurement that a picture can be written.
fn writable(path: &Path) -> Result<(), String> {
    may_draw(path)?;
    let opened = std::fs::OpenOptions::new().append(true).create(true).open(path);
    opened.map(drop).map_err(|error| format!("cannot write `{}`: {error}", path.display()))
}

fn tune(args: &TuneArgs, shell: &Shell, request: &Request, outline: &Outline) -> Result<Tuned, Stop> {
    let (_, port) = settings::commands(outline).next().ok_or("no role is an arm, so nothing moves".to_owned())?;
    let index = Index::new(outline);
    let (_, twist) = chain(&Nodes::new(&index, None), port)?;
    let (mode, controlled) = controlled(args, &index, &twist)?;
    let adder = adder(&index, &twist)?;
    let wanted = Wanted { peak: args.peak, gain_db: args.gain_margin, phase_deg: args.phase_margin };
    let cases: Vec<Case> = cases(args, request, shell)?;
    let mut contacts: Vec<Contact> = cases.iter().map(Case::contact).collect();
    let mut features = Vec::new();
    for feature in &controlled {
        let measure = |share: f64| -> Result<(TunedFeature, Vec<Contact>), Stop> {
            let mut contacts = contacts.clone();
            let found = cases.iter().zip(&mut contacts).map(|(case, contact)| {
                let (catalogue, component, period) = (shell.catalogue(), 0, outline.period_s);
                let (request, adder) = (&case.request, &*adder);
                let experiment =
                    Experiment { catalogue, request, outline, mode, adder, feature, component, period, share };
                let found = identify(&experiment, &case.object, period, shell)?;
                if found.refused.is_none() {
                    let quantity = quantity(feature);
                    contact.features.insert(quantity.clone(), answer(&quantity, &found.fits));
                }
                Ok(found)
            });
            let found = found.collect::<Result<Vec<Found>, Stop>>()?;
            Ok((propose(feature.clone(), found, &contacts, wanted, outline.period_s), contacts))
        };
        let say = |gains: &str| shell.say_beside(&format!("`{}`: again, with {gains}", feature.name));
        let mut found = measure(HALF)?;
        if found.0.answers.iter().any(|found| found.is_lost) {
            // A loop that hardly holds the contact loses it with a test signal.
            say("an eighth of its gains");
            found = measure(HALF * QUARTER)?;
        }
        // A stiff loop holds the contact against the test signal, and friction then hides more of the motion. A soft one
        // has not settled when the signal begins.
        if let Some(factor) = found.0.factor().filter(|factor| !NEAR.contains(factor)) {
            say("a quarter of the gains that were found");
            let again = measure(QUARTER * factor)?;
            found = if again.0.new.is_some() { again } else { found };
        }
        let (found, answered) = found;
        contacts = answered;
        features.push(found);
    }
    let arm = arm_of(outline).unwrap_or_default().to_owned();
    let benches = cases.iter().map(|case| case.stated.clone()).collect();
    let (name, ranges, settled) = (mode.name.clone(), Vec::new(), Vec::new());
    let mut tuned = Tuned { mode: name, arm, wanted, contacts, benches, features, ranges, settled };
    for case in &cases {
        let mut request = case.request.clone();
        request.set.extend(lift::settings(outline, mode, &adder, experiment::measured(outline.period_s)));
        // With another setting, the mode and its setpoints may be others.
        let outline = &case.outline;
        let mode = outline.modes.iter().find(|one| one.name == mode.name).unwrap_or(mode);
        let trial = Trial { catalogue: shell.catalogue(), request: &request, outline, mode };
        tuned.settled.extend(trial.compare(&tuned.features, &case.object)?);
    }
    Ok(tuned)
}

/// Returns the name of what a feature measures.
fn quantity(feature: &Feature) -> String {
    feature.quantity().unwrap_or(&feature.name).to_owned()
}

/// Proposed gains, as a multiple of those of the graph, with which a loop is not measured again [1].
const NEAR: RangeInclusive<f64> = 0.83..=3.0;
/// Share of the proposed gains with which it is measured again [1].
const QUARTER: f64 = 0.25;

impl TunedFeature {
    /// Returns the proposed gains as a multiple of those of the graph.
    fn factor(&self) -> Option<f64> {
        self.new.map(|new| new[0] / self.old[0])
    }
}

/// Part of the answer by geometry below which a contact sticks [1].
const LEAST_SLIDE: f64 = 0.5;

/// Part of the response that a fit may leave unexplained [1].
const MAX_RESIDUAL: f64 = 0.3;
/// The same for a place of which no two test signals say the same: each motion has another friction [1].
const MAX_RESIDUAL_SLIDING: f64 = 0.2;

/// Measures how a feature answers each component that moves it.
fn identify(experiment: &Experiment<'_>, object: &str, period: f64, shell: &Shell) -> Result<Found, Stop> {
    let feature = experiment.feature;
    let mut found = Found {
        object: object.to_owned(),
        fits: Vec::new(),
        lines: Vec::new(),
        growth: None,
        refused: None,
        is_lost: false,
    };
    for component in (0..6).filter(|i| feature.column[*i] != 0.0) {
        let response = agreed(&Experiment { component, ..experiment.clone() }, shell)?;
        let is_lost = response.as_ref().err().is_some_and(|refusal| refusal.is_lost);
        let fitted = response
            .map_err(|refusal| refusal.why)
            .and_then(|response| Ok((fitted(feature, component, period, &response)?, response)));
        match fitted {
            Ok((fit, Response { lines, growth })) => {
                found.fits.push((COMPONENTS[component], fit));
                found.lines.push(lines);
                found.growth = growth.or(found.growth);
            }
            Err(why) => {
                (found.refused, found.is_lost) = (Some(why), is_lost);
                break;
            }
        }
    }
    Ok(found)
}

/// Fits the response to one component.
///
/// # Errors
/// If noise or friction leave it unknown.
fn fitted(feature: &Feature, component: usize, period: f64, response: &Response) -> Result<Fit, String> {
    let quantity = quantity(feature);
    let fit = fit(&response.lines, known(feature, component, period)).map_err(|few| {
        let all = response.lines.len();
        format!("only {few} of {all} frequencies stand out of the noise, and a fit needs {ENOUGH}")
    })?;
    let slides = response.growth.is_some() && Answer::of_geometry(&quantity).is_some();
    let (most, also) = match slides {
        true => (MAX_RESIDUAL_SLIDING, ", and no two test signals agree"),
        false => (MAX_RESIDUAL, ""),
    };
    let percent = 100.0 * fit.residual;
    if fit.residual > most {
        return Err(format!(
            "a gain, a resonance and a latency leave {percent:.0} % of the response unexplained{also}"
        ));
    }
    if sticks(&quantity, component, &fit) {
        return Err(format!("friction holds the contact: it follows {:.0} % of the motion", 100.0 * fit.gain.abs()));
    }
    Ok(fit)
}

/// Returns whether a feature follows a motion by less than half of what geometry says, or the wrong way.
fn sticks(quantity: &str, component: usize, fit: &Fit) -> bool {
    let slides = Answer::of_geometry(quantity).unwrap_or_default().row()[component];
    slides != 0.0 && fit.gain / slides < LEAST_SLIDE
}

/// Returns the response of what the graph states, at half of the gains and for one component alone.
fn known(feature: &Feature, component: usize, period: f64) -> impl Fn(f64) -> nalgebra::Complex<f64> {
    let around = Loop::new(feature, &Answer::default(), 0.0, period).times(HALF);
    let column = feature.column[component];
    move |omega| around.known(omega) * column
}

/// Returns the answer of a feature to all components. The resonance and the latency are those of the first one.
///
/// A contact that sticks follows a small motion only in part. It can slide at any time, so what geometry says counts if
/// it is more.
fn answer(quantity: &str, fits: &[(&'static str, Fit)]) -> Answer {
    let geometry = Answer::of_geometry(quantity).unwrap_or_default().row();
    let mut answer = Answer::default();
    for (component, fit) in fits {
        let entry = match *component {
            "vx" => &mut answer.vx,
            "vy" => &mut answer.vy,
            "vz" => &mut answer.vz,
            "wx" => &mut answer.wx,
            "wy" => &mut answer.wy,
            _ => &mut answer.wz,
        };
        let index = COMPONENTS.iter().position(|name| name == component);
        let slides = index.map_or(0.0, |i| geometry[i]);
        *entry = Some(if slides.abs() > fit.gain.abs() { slides } else { rounded_to_three_digits(fit.gain) });
    }
    let Some((_, main)) = fits.first() else { return answer };
    answer.resonance_hz = main.resonance.map(|(hz, _)| rounded_to_three_digits(hz));
    answer.damping_ratio = main.resonance.map(|(_, damping)| rounded_to_three_digits(damping));
    answer.latency_ms = Some((main.latency * 1e4).round() / 10.0);
    answer
}

fn propose(feature: Feature, answers: Vec<Found>, contacts: &[Contact], wanted: Wanted, period: f64) -> TunedFeature {
    let old = [feature.kp, feature.ki, feature.kd];
    let is_measured = answers.iter().all(|found| found.refused.is_none());
    let loops = contacts.iter().enumerate();
    let loops: Vec<(usize, Loop)> =
        loops.filter_map(|(i, contact)| Some((i, Loop::over(&feature, contact, period)?))).collect();
    // A fit smooths what friction does near the crossover, so the margins must hold for the measured response too.
    let measured = |(i, around): &(usize, Loop)| match (&answers[*i].fits[..], &answers[*i].lines[..]) {
        ([(component, fit)], [lines]) => {
            let component = COMPONENTS.iter().position(|name| name == component)?;
            Some(around.measured(fit.missed(lines, known(&feature, component, period))))
        }
        _ => None,
    };
    let each: Vec<Loop> = loops.iter().filter_map(measured).chain(loops.iter().map(|(_, one)| one.clone())).collect();
    let factor = factor(&each, wanted).filter(|_| is_measured && loops.len() == contacts.len());
    // Rounded down, so that the margins hold.
    let factor = factor.map(|factor| floored_to_two_digits(feature.kp * factor) / feature.kp);
    let new = factor.map(|factor| old.map(|gain| rounded_to_three_digits(gain * factor)));
    let loops: Vec<(usize, Loop)> =
        loops.into_iter().map(|(i, around)| (i, around.times(factor.unwrap_or(1.0)))).collect();
    let margins = new.map(|_| loops.iter().map(|(_, around)| margins(around)).collect()).unwrap_or_default();
    TunedFeature { name: feature.name.clone(), answers, old, new, margins, feature, loops }
}
