//! Makes a calibration from logs, and reports how good it is.

use tactflow_runtime::signal::Unit;

use super::curve::KINDS;
use super::fit::Points;
use super::log::{Log, MAX_UNLOADED};
use super::samples::{LoadKind, LogAnalysis, TactelSample};
use super::{Calibration, CurveKind, ForceCurve, Tactel};

/// Settings of a calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How the pad was loaded.
    pub load: LoadKind,
    /// Kind of the curves; `None` for the simplest that is good enough.
    pub curve: Option<CurveKind>,
    /// Minimum response of a live tactel; `None` for a fraction of the maximum [reading].
    pub dead_below: Option<f64>,
    /// Number of tactels that share a uniform load; `None` for the live ones.
    pub bearing: Option<usize>,
}

/// Whether a tactel can be used.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum TactelStatus {
    /// It has a curve.
    Good,
    /// It does not respond.
    #[default]
    Dead,
    /// It has too few samples.
    Few,
    /// No rising curve fits its samples.
    Unfit,
}

/// The result for one tactel.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TactelFinding {
    /// Whether it can be used.
    pub status: TactelStatus,
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
    /// Its points; `None` if it has no curve.
    pub points: Option<Points>,
}

/// A calibration with its quality.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationReport {
    /// The curves.
    pub calibration: Calibration,
    /// The result for each tactel, row by row.
    pub findings: Vec<TactelFinding>,
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
pub fn calibrate(logs: &[Log], settings: &Settings) -> Result<CalibrationReport, String> {
    let first = logs.first().ok_or("there is no log")?;
    let samples = LogAnalysis::new(logs, settings.load, settings.dead_below, settings.bearing);
    if samples.is_shared {
        let message = "most tactels respond equally to most presses, so the force is not on one tactel at a time: for a \
                       uniform load on all tactels, add `--load uniform`";
        return Err(message.into());
    }
    let extremes = extremes(logs);
    let (findings, curves): (Vec<TactelFinding>, Vec<Option<[ForceCurve; 3]>>) =
        (0..first.tactels()).map(|i| examine(&samples, i, extremes)).unzip();
    let good = || findings.iter().filter(|finding| finding.status == TactelStatus::Good);
    let count: usize = good().map(|finding| finding.samples).sum();
    if count == 0 {
        return Err(no_tactel(&findings, settings));
    }
    let square = |finding: &TactelFinding, k: usize| finding.rms[k] * finding.rms[k] * finding.samples as f64;
    let rms = [0, 1, 2].map(|k| (good().map(|finding| square(finding, k)).sum::<f64>() / count as f64).sqrt());
    let best = rms.iter().fold(f64::INFINITY, |best, rms| best.min(*rms));
    let is_good_enough = |kind: &CurveKind| rms[*kind as usize] * GOOD_ENOUGH <= best;
    let kind = settings.curve.or_else(|| KINDS.into_iter().find(is_good_enough)).unwrap_or(CurveKind::Piecewise);
    let tactels = curves.into_iter().zip(&samples.answers).map(|(curves, answer)| {
        let curve = curves?.into_iter().find(|curve| curve.kind() == kind)?;
        Some(Tactel { offset: answer.offset, curve })
    });
    let Log { rows, cols, unit: reading, .. } = *first;
    let calibration = Calibration { kind, rows, cols, reading, unit: Unit::NEWTON, tactels: tactels.collect() };
    Ok(CalibrationReport { calibration, findings, rms, most: samples.most * samples.share })
}

/// Fits all kinds of curves to one tactel.
fn examine(
    samples: &LogAnalysis<'_>,
    i: usize,
    [lowest, highest]: [f32; 2],
) -> (TactelFinding, Option<[ForceCurve; 3]>) {
    let answer = &samples.answers[i];
    let mut finding = TactelFinding { sign: answer.sign, noise: answer.noise, ..TactelFinding::default() };
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
    let own: Vec<TactelSample> = own.into_iter().map(|(sample, _)| sample).collect();
    let loaded = || own.iter().filter(|sample| sample.force > unloaded);
    finding.samples = loaded().count();
    let Some(points) = Points::new(&own, unloaded) else {
        finding.status = TactelStatus::Few;
        return (finding, None);
    };
    let curves = [points.linear(answer.sign), points.rational(answer.sign), points.piecewise(answer.sign)];
    finding.status = TactelStatus::Unfit;
    if curves.iter().any(|curve| curve.flaw().is_some()) {
        return (finding, None);
    }
    finding.status = TactelStatus::Good;
    for (rms, curve) in finding.rms.iter_mut().zip(&curves) {
        let error = |sample: &TactelSample| f64::from(curve.force(sample.s as f32 * answer.sign)) - sample.force;
        let squares: f64 = loaded().map(|sample| error(sample) * error(sample)).sum();
        *rms = (squares / finding.samples as f64).sqrt();
    }
    finding.hysteresis = points.hysteresis();
    finding.points = Some(points);
    (finding, Some(curves))
}

/// Returns the minimum and the maximum of all readings.
fn extremes(logs: &[Log]) -> [f32; 2] {
    let cells = logs.iter().flat_map(|log| &log.cells);
    cells.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], cell| [low.min(*cell), high.max(*cell)])
}

fn no_tactel(findings: &[TactelFinding], settings: &Settings) -> String {
    let count = |state| findings.iter().filter(|finding| finding.status == state).count();
    let (dead, few, unfit) = (count(TactelStatus::Dead), count(TactelStatus::Few), count(TactelStatus::Unfit));
    let what = format!("{dead} tactels do not respond, {few} have too few samples, {unfit} have no rising curve");
    let question = match settings.load {
        LoadKind::Probe => "if the load was uniform, add `--load uniform`",
        LoadKind::Uniform => "if a probe loaded one tactel at a time, remove `--load uniform`",
    };
    format!("no tactel can be calibrated: {what}; {question}")
}

impl CalibrationReport {
    /// Returns the kind of the curves.
    #[must_use]
    pub const fn kind(&self) -> CurveKind {
        self.calibration.kind
    }

    /// Returns the median over the tactels of the residual, as a fraction of the maximum force.
    #[must_use]
    pub fn typical_residual(&self) -> f64 {
        let kind = self.kind();
        median_and_max(self.calibrated().map(|(_, finding, points, _)| finding.part(kind, points)))[0]
    }

    /// Returns the tactels in a status, as `[row, column]`.
    #[must_use]
    pub fn with_status(&self, status: TactelStatus) -> Vec<[usize; 2]> {
        self.places(|finding| finding.status == status)
    }

    /// Returns each calibrated tactel: its index, its result, its points and its curve.
    pub(super) fn calibrated(&self) -> impl Iterator<Item = (usize, &TactelFinding, &Points, &Tactel)> + Clone {
        let tactels = self.findings.iter().zip(&self.calibration.tactels).enumerate();
        tactels.filter_map(|(i, (finding, tactel))| Some((i, finding, finding.points.as_ref()?, tactel.as_ref()?)))
    }

    /// Returns the residual of each calibrated tactel as a fraction of the maximum force on it.
    #[cfg(feature = "cli")]
    pub(super) fn parts(&self) -> Vec<(usize, f64)> {
        let kind = self.kind();
        self.calibrated().map(|(i, finding, points, _)| (i, finding.part(kind, points))).collect()
    }

    fn place(&self, i: usize) -> [usize; 2] {
        [i / self.calibration.cols, i % self.calibration.cols]
    }

    fn places(&self, is_in: impl Fn(&TactelFinding) -> bool) -> Vec<[usize; 2]> {
        (0..self.findings.len()).filter(|i| is_in(&self.findings[*i])).map(|i| self.place(i)).collect()
    }

    /// Returns the report as text, with a line for `each` tactel or only for the worst.
    #[must_use]
    pub fn text(&self, each: bool) -> String {
        let Calibration { rows, cols, reading, .. } = &self.calibration;
        let mut lines = vec![
            format!(
                "{} of {rows} x {cols} tactels calibrated, readings in {reading}, forces up to {:.3} N a tactel\n",
                self.calibrated().count(),
                self.most
            ),
            "residual (RMS)     all samples   median tactel    worst tactel   median of range".into(),
        ];
        lines.extend(KINDS.map(|kind| self.residuals(kind)));
        lines.push("* chosen\n".into());
        let hysteresis = self.calibrated().filter_map(|(_, finding, ..)| finding.hysteresis);
        let [median, max] = median_and_max(hysteresis.clone()).map(percent);
        lines.push(match hysteresis.count() {
            0 => "hysteresis   not measured: it needs a log in which the force rises and falls".into(),
            _ => format!("hysteresis   median {median}, maximum {max} of the range of the reading"),
        });
        let [median, max] = median_and_max(self.calibrated().map(|(_, finding, ..)| finding.noise));
        lines.push(format!("noise        median {median:.2} {reading}, maximum {max:.2} {reading}, unloaded"));
        let saturated = self.places(|finding| finding.is_saturated);
        let groups = [
            ("dead", "do not respond", self.with_status(TactelStatus::Dead)),
            ("saturated", "stay at the extreme reading; calibrated below it", saturated),
            ("too few", "have too few samples; left out", self.with_status(TactelStatus::Few)),
            ("unfit", "have no rising curve; left out", self.with_status(TactelStatus::Unfit)),
        ];
        lines.extend(groups.map(|(name, what, places)| format!("{name:<12} {}", listed(&places, what))));
        lines.extend(self.table(each));
        lines.join("\n") + "\n"
    }

    /// Returns the line of a kind of curve.
    fn residuals(&self, kind: CurveKind) -> String {
        let newton = |force: f64| format!("{force:.4} N");
        let mark = if kind == self.kind() { "*" } else { " " };
        let all = newton(self.rms[kind as usize]);
        let tactels = self.calibrated().map(|(_, finding, ..)| finding.rms[kind as usize]);
        let [median, worst] = median_and_max(tactels).map(newton);
        let parts = self.calibrated().map(|(_, finding, points, _)| finding.part(kind, points));
        let part = percent(median_and_max(parts)[0]);
        format!("{mark} {kind:<12} {all:>13} {median:>15} {worst:>15} {part:>17}")
    }

    /// Returns the lines of the table of `each` tactel, or of the worst ones.
    fn table(&self, each: bool) -> Vec<String> {
        let kind = self.kind();
        let rms = |finding: &TactelFinding| finding.rms[kind as usize];
        let mut tactels: Vec<_> = self.calibrated().collect();
        if !each {
            tactels.sort_by(|(_, a, ..), (_, b, ..)| rms(b).total_cmp(&rms(a)));
            tactels.truncate(WORST_SHOWN);
        }
        let title = if each { "every tactel" } else { "the worst tactels" };
        let range = format!("range [{}]", self.calibration.reading);
        let head = format!("      at   samples   force [N] {range:>15}   RMS [N]   RMS [%]   hysteresis [%]");
        let row = |(i, finding, points, _): (usize, &TactelFinding, &Points, &Tactel)| {
            let hysteresis = finding.hysteresis.map_or_else(|| "-".into(), |part| format!("{:.1}", 100.0 * part));
            format!(
                "{:>8} {:>9} {:>11.3} {:>15.1} {:>9.4} {:>9.2} {hysteresis:>16}",
                format!("{:?}", self.place(i)),
                finding.samples,
                points.most,
                points.range,
                rms(finding),
                100.0 * finding.part(kind, points)
            )
        };
        [format!("\n{title}, {kind} curve"), head].into_iter().chain(tactels.into_iter().map(row)).collect()
    }
}

/// Number of the worst tactels that are shown.
const WORST_SHOWN: usize = 5;

impl TactelFinding {
    /// Returns the residual of a kind of curve as a fraction of the maximum force.
    fn part(&self, kind: CurveKind, points: &Points) -> f64 {
        self.rms[kind as usize] / points.most
    }
}

/// Returns the upper median and the maximum, or zeros without numbers.
fn median_and_max(numbers: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_unstable_by(f64::total_cmp);
    [numbers.get(numbers.len() / 2), numbers.last()].map(|number| number.copied().unwrap_or(0.0))
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
    let mut list: Vec<String> = places.iter().take(MAX_SHOWN).map(|place| format!("{place:?}")).collect();
    if places.len() > MAX_SHOWN {
        list.push(format!("and {} more", places.len() - MAX_SHOWN));
    }
    format!("{} {what}: {}", places.len(), list.join(", "))
}
