//! Makes a calibration from logs, and reports how good it is.

use std::fmt::Write;

use tactflow_runtime::signal::Unit;

use super::curve::KINDS;
use super::fit::Points;
use super::log::{Log, MAX_UNLOADED};
use super::samples::{Load, Sample, Samples};
use super::{Calibration, Curve, Kind, Tactel};

/// Settings of a calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How the pad was loaded.
    pub load: Load,
    /// Kind of the curves; `None` for the simplest that is good enough.
    pub curve: Option<Kind>,
    /// Minimum response of a live tactel; `None` for a fraction of the maximum [reading].
    pub dead_below: Option<f64>,
    /// Number of tactels that share a uniform load; `None` for the live ones.
    pub bearing: Option<usize>,
}

/// Whether a tactel can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// It has a curve.
    Good,
    /// It does not respond.
    Dead,
    /// It has too few samples.
    Few,
    /// No rising curve fits its samples.
    Unfit,
}

/// The result for one tactel.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Checks whether it can be used.
    pub state: State,
    /// Number of loaded samples.
    pub samples: usize,
    /// Whether it stays at its extreme reading while the force increases. Those samples are not used.
    pub is_saturated: bool,
    /// 1 if the reading rises with the force, -1 if it falls.
    pub sign: f32,
    /// Standard deviation of the unloaded reading [reading].
    pub noise: f64,
    /// Residual of each kind of curve over the loaded samples, root mean square [N].
    pub rms: [f64; 3],
    /// Maximum distance of the branches as a fraction of the range; `None` for a single branch.
    pub hysteresis: Option<f64>,
    /// Its points; `None` if there are too few.
    pub points: Option<Points>,
}

/// A calibration with its quality.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// The curves.
    pub calibration: Calibration,
    /// The result for each tactel, row by row.
    pub findings: Vec<Finding>,
    /// Residual of each kind of curve over all samples, root mean square [N].
    pub rms: [f64; 3],
    /// Maximum force on one tactel [N].
    pub most: f64,
}

/// A kind of curve is good enough if no other has a residual below this fraction of its own.
const GOOD_ENOUGH: f64 = 0.9;

/// Minimum number of samples at the extreme reading for a saturation.
const MIN_SATURATED_SAMPLES: usize = 5;
/// Minimum range of force of these samples, as a fraction of the maximum force.
const MIN_SATURATED_RANGE: f64 = 0.05;

/// Makes a calibration from logs of one array.
///
/// # Errors
/// If no tactel can be calibrated.
pub fn calibrate(logs: &[Log], settings: &Settings) -> Result<Report, String> {
    let first = logs.first().ok_or("there is no log")?;
    let samples = Samples::new(logs, settings.load, settings.dead_below, settings.bearing);
    if samples.is_shared {
        let message = "most tactels respond alike to most presses, so the force is not on one tactel at a time: for a \
                       load on all of them, add `--load uniform`";
        return Err(message.into());
    }
    let ceilings = ceilings(logs);
    let mut findings = Vec::new();
    let mut curves: Vec<Option<[Curve; 3]>> = Vec::new();
    let (mut squares, mut count) = ([0.0; 3], 0);
    for i in 0..first.tactels() {
        let (finding, fitted) = examine(&samples, i, ceilings);
        if fitted.is_some() {
            let add = |(sum, rms): (&mut f64, &f64)| *sum += rms * rms * finding.samples as f64;
            squares.iter_mut().zip(&finding.rms).for_each(add);
            count += finding.samples;
        }
        findings.push(finding);
        curves.push(fitted);
    }
    if count == 0 {
        return Err(no_tactel(&findings, settings));
    }
    let rms = squares.map(|sum| (sum / count as f64).sqrt());
    let best = rms.iter().fold(f64::INFINITY, |best, rms| best.min(*rms));
    let is_good_enough = |kind: &Kind| rms[*kind as usize] * GOOD_ENOUGH <= best;
    let kind = settings.curve.or_else(|| KINDS.into_iter().find(is_good_enough)).unwrap_or(Kind::Piecewise);
    let tactels = curves.into_iter().zip(&samples.answers).map(|(curves, answer)| {
        let curve = curves?.into_iter().find(|curve| curve.kind() == kind)?;
        Some(Tactel { offset: answer.offset, curve })
    });
    let tactels = tactels.collect();
    let Log { rows, cols, unit: reading, .. } = *first;
    let calibration = Calibration { kind, rows, cols, reading, unit: Unit::NEWTON, tactels };
    Ok(Report { calibration, findings, rms, most: samples.most * samples.share })
}

/// Fits all kinds of curves to one tactel.
fn examine(samples: &Samples<'_>, i: usize, [lowest, highest]: [f32; 2]) -> (Finding, Option<[Curve; 3]>) {
    let answer = &samples.answers[i];
    let mut finding = Finding {
        state: State::Dead,
        samples: 0,
        is_saturated: false,
        sign: answer.sign,
        noise: answer.noise,
        rms: [0.0; 3],
        hysteresis: None,
        points: None,
    };
    if answer.is_dead {
        return (finding, None);
    }
    let (most, unloaded) = (samples.most * samples.share, MAX_UNLOADED * samples.most * samples.share);
    let mut own = samples.of(i);
    let end = if answer.sign > 0.0 { highest } else { lowest };
    let forces = own.iter().filter(|(_, reading)| *reading == end).map(|(sample, _)| sample.force);
    let (low, high) =
        forces.clone().fold((f64::INFINITY, 0.0), |(a, b), force| (f64::min(a, force), f64::max(b, force)));
    finding.is_saturated = forces.count() >= MIN_SATURATED_SAMPLES && high - low > MIN_SATURATED_RANGE * most;
    if finding.is_saturated {
        own.retain(|(_, reading)| *reading != end);
    }
    let own: Vec<Sample> = own.into_iter().map(|(sample, _)| sample).collect();
    finding.samples = own.iter().filter(|sample| sample.force > unloaded).count();
    let Some(points) = Points::new(&own, unloaded) else {
        finding.state = State::Few;
        return (finding, None);
    };
    let curves = [points.linear(answer.sign), points.rational(answer.sign), points.piecewise(answer.sign)];
    finding.state = State::Unfit;
    if curves.iter().any(|curve| curve.flaw().is_some()) {
        return (finding, None);
    }
    finding.state = State::Good;
    for (rms, curve) in finding.rms.iter_mut().zip(&curves) {
        let error = |sample: &Sample| f64::from(curve.force(sample.s as f32 * answer.sign)) - sample.force;
        let squares: f64 =
            own.iter().filter(|sample| sample.force > unloaded).map(|sample| error(sample) * error(sample)).sum();
        *rms = (squares / finding.samples as f64).sqrt();
    }
    finding.hysteresis = points.hysteresis();
    finding.points = Some(points);
    (finding, Some(curves))
}

/// Returns the minimum and the maximum of all readings.
fn ceilings(logs: &[Log]) -> [f32; 2] {
    let cells = logs.iter().flat_map(|log| &log.cells);
    cells.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], cell| [low.min(*cell), high.max(*cell)])
}

fn no_tactel(findings: &[Finding], settings: &Settings) -> String {
    let count = |state| findings.iter().filter(|finding| finding.state == state).count();
    let (dead, few, unfit) = (count(State::Dead), count(State::Few), count(State::Unfit));
    let what = format!("{dead} tactels do not respond, {few} have too few samples, {unfit} have no rising curve");
    let question = match settings.load {
        Load::Probe => "is the log of a probe on one tactel at a time, or is the load uniform?",
        Load::Uniform => "is the log of a uniform load, or of a probe on one tactel at a time?",
    };
    format!("no tactel can be calibrated: {what}; {question}")
}

impl Report {
    /// Returns the kind of the curves.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        self.calibration.kind
    }

    /// Returns the median over the tactels of the residual, as a fraction of the maximum force.
    #[must_use]
    pub fn typical_residual(&self) -> f64 {
        let good = self.findings.iter().filter(|finding| finding.state == State::Good);
        middle(&sorted(good.map(|finding| finding.part(self.kind() as usize))))
    }

    /// Returns the tactels in a state, as `[row, column]`.
    #[must_use]
    pub fn in_state(&self, state: State) -> Vec<[usize; 2]> {
        self.places(|finding| finding.state == state)
    }

    fn places(&self, is_meant: impl Fn(&Finding) -> bool) -> Vec<[usize; 2]> {
        let cols = self.calibration.cols;
        (0..self.findings.len()).filter(|i| is_meant(&self.findings[*i])).map(|i| [i / cols, i % cols]).collect()
    }

    /// Returns the report as text, with a line for `each` tactel or only for the worst.
    #[must_use]
    pub fn text(&self, each: bool) -> String {
        let Calibration { rows, cols, reading, .. } = &self.calibration;
        let good: Vec<&Finding> = self.findings.iter().filter(|finding| finding.state == State::Good).collect();
        let mut text = format!(
            "{} of {rows} x {cols} tactels calibrated, readings in {reading}, forces up to {:.3} N a tactel\n\n",
            good.len(),
            self.most
        );
        text.push_str("residual (RMS)     all samples   median tactel    worst tactel   median of range\n");
        for kind in KINDS {
            let k = kind as usize;
            let rms = sorted(good.iter().map(|finding| finding.rms[k]));
            let parts = sorted(good.iter().map(|finding| finding.part(k)));
            let mark = if kind == self.kind() { "*" } else { " " };
            line(
                &mut text,
                format_args!(
                    "{mark} {kind:<12} {:>13} {:>15} {:>15} {:>17}",
                    newton(self.rms[k]),
                    newton(middle(&rms)),
                    newton(last(&rms)),
                    percent(middle(&parts))
                ),
            );
        }
        line(&mut text, format_args!("* chosen\n"));
        let hysteresis = sorted(good.iter().filter_map(|finding| finding.hysteresis));
        let noise = sorted(good.iter().map(|finding| finding.noise));
        match hysteresis.is_empty() {
            true => line(&mut text, format_args!("hysteresis   not measured: the force does not rise and fall")),
            false => line(
                &mut text,
                format_args!(
                    "hysteresis   median {}, maximum {} of the range of the reading",
                    percent(middle(&hysteresis)),
                    percent(last(&hysteresis))
                ),
            ),
        }
        line(
            &mut text,
            format_args!(
                "noise        median {:.2} {reading}, maximum {:.2} {reading}, unloaded",
                middle(&noise),
                last(&noise)
            ),
        );
        let groups = [
            ("dead", "do not respond", self.in_state(State::Dead)),
            (
                "saturated",
                "stay at the extreme reading; calibrated below it",
                self.places(|finding| finding.is_saturated),
            ),
            ("too few", "have too few samples; left out", self.in_state(State::Few)),
            ("unfit", "have no rising curve; left out", self.in_state(State::Unfit)),
        ];
        for (name, what, places) in groups {
            line(&mut text, format_args!("{name:<12} {}", listed(&places, what)));
        }
        self.table(&mut text, each);
        text
    }

    fn table(&self, text: &mut String, each: bool) {
        let k = self.kind() as usize;
        let good = |i: &usize| self.findings[*i].state == State::Good;
        let mut order: Vec<usize> = (0..self.findings.len()).filter(good).collect();
        if !each {
            order.sort_by(|a, b| self.findings[*b].rms[k].total_cmp(&self.findings[*a].rms[k]));
            order.truncate(WORST_SHOWN);
        }
        let title = if each { "every tactel" } else { "the worst tactels" };
        let reading = self.calibration.reading;
        line(text, format_args!("\n{title}, {} curve", self.kind()));
        let unit = format!("[{reading}]");
        line(
            text,
            format_args!(
                "      at   samples   force [N] {:>15}   RMS [N]   RMS [%]   hysteresis [%]",
                format!("range {unit}")
            ),
        );
        for i in order {
            let finding = &self.findings[i];
            let Some(points) = &finding.points else { continue };
            let at = format!("[{}, {}]", i / self.calibration.cols, i % self.calibration.cols);
            let hysteresis = finding.hysteresis.map_or_else(|| "-".into(), |part| format!("{:.1}", 100.0 * part));
            line(
                text,
                format_args!(
                    "{at:>8} {:>9} {:>11.3} {:>15.1} {:>9.4} {:>9.2} {hysteresis:>16}",
                    finding.samples,
                    points.most,
                    points.range,
                    finding.rms[k],
                    100.0 * finding.part(k)
                ),
            );
        }
    }
}

/// Number of the worst tactels that are shown.
const WORST_SHOWN: usize = 5;

impl Finding {
    /// Returns the residual of a kind of curve as a fraction of the maximum force.
    fn part(&self, k: usize) -> f64 {
        self.points.as_ref().map_or(0.0, |points| self.rms[k] / points.most)
    }
}

fn line(text: &mut String, line: std::fmt::Arguments<'_>) {
    writeln!(text, "{line}").expect("writing to a string cannot fail");
}

fn sorted(numbers: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_unstable_by(f64::total_cmp);
    numbers
}

fn middle(sorted: &[f64]) -> f64 {
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

fn last(sorted: &[f64]) -> f64 {
    sorted.last().copied().unwrap_or(0.0)
}

fn newton(force: f64) -> String {
    format!("{force:.4} N")
}

fn percent(part: f64) -> String {
    format!("{:.1} %", 100.0 * part)
}

/// Lists the first places and the number of all.
fn listed(places: &[[usize; 2]], what: &str) -> String {
    const MAX_SHOWN: usize = 8;
    if places.is_empty() {
        return "none".into();
    }
    let mut list: Vec<String> = places.iter().take(MAX_SHOWN).map(|[i, j]| format!("[{i}, {j}]")).collect();
    if places.len() > MAX_SHOWN {
        list.push(format!("and {} more", places.len() - MAX_SHOWN));
    }
    format!("{} {what}: {}", places.len(), list.join(", "))
}
