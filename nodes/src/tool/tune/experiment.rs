//! One run with a test signal: the frequency response of a loop, measured while it is closed.

use std::f64::consts::PI;

use nalgebra::Complex;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{Outline, OutlinedMode, Request, compile};
use tactflow_runtime::record::PortColumns;
use tactflow_runtime::source::{Code, Report};

use super::lift;
use super::stay::Stay;
use crate::motion::COMPONENTS;
use crate::tool::control::law::Feature;
use crate::tool::control::shape::turn;

/// Frequencies of the test signal [Hz].
const FREQUENCIES_HZ: [f64; 11] = [0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0];
/// Time after the begin of the mode until the test signal begins [s].
const BEGIN_S: f64 = 6.0;
/// Time for the response to a frequency to become periodic [s], and at least one period.
const SETTLING_S: f64 = 1.0;
/// Time in which a frequency is measured [s], and at least three periods.
const MEASURING_S: f64 = 2.0;
/// Largest speed of the test signal along each component [m/s], [rad/s]. Ceilings of force let a pad move no faster into
/// an object. Along the object it must overcome friction.
const FASTEST: [f64; 6] = [0.015, 0.015, 0.006, 0.3, 0.3, 0.3];
/// Time for the approach [s].
const APPROACH_S: f64 = 20.0;
/// Beginning of the names of the nodes that make the test signal.
const SIGNAL: &str = "tune";

/// One sine of the test signal.
#[derive(Debug, Clone, Copy)]
struct Sine {
    /// Number of ticks in a period.
    ticks: usize,
    /// Tick at which it begins, counted from the begin of the mode.
    begin: usize,
    /// Number of periods for the response to settle.
    settling: usize,
    /// Number of periods that are measured.
    measured: usize,
}

impl Sine {
    /// Returns the sines of a test signal, one after the other, for ticks of `period` [s].
    fn all(period: f64) -> Vec<Self> {
        let mut begin = (BEGIN_S / period).round() as usize;
        let mut sine = |hz: f64| {
            let ticks = (1.0 / (hz * period)).round().max(4.0) as usize;
            let periods = |seconds: f64| (seconds / (ticks as f64 * period)).ceil() as usize;
            let sine =
                Self { ticks, begin, settling: periods(SETTLING_S).max(1), measured: periods(MEASURING_S).max(3) };
            begin = sine.end();
            sine
        };
        FREQUENCIES_HZ.map(&mut sine).into()
    }

    /// Returns the tick after its last one.
    const fn end(&self) -> usize {
        self.begin + (self.settling + self.measured) * self.ticks
    }

    /// Returns its amplitude as a speed, for a way [m] or [rad].
    fn speed(&self, way: f64, fastest: f64, period: f64) -> f64 {
        (2.0 * PI * way / (self.ticks as f64 * period)).min(fastest)
    }
}

/// The loop that an experiment opens with its signal.
#[derive(Clone)]
pub(super) struct Experiment<'a> {
    pub(super) catalogue: &'a Catalogue,
    pub(super) request: &'a Request,
    pub(super) outline: &'a Outline,
    pub(super) mode: &'a OutlinedMode,
    /// The node that adds the test signal to the motion.
    pub(super) adder: &'a str,
    pub(super) feature: &'a Feature,
    /// The component of the twist that is moved.
    pub(super) component: usize,
    /// Period of the graph [s].
    pub(super) period: f64,
    /// Share of the gains of the graph with which it is measured [1].
    pub(super) share: f64,
}

/// Share of the gains for which the response holds, and with which a loop is measured first [1].
pub(super) const HALF: f64 = 0.5;

/// The response at one frequency.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    /// Circular frequency [rad/s].
    pub(super) omega: f64,
    /// The response around the loop: L, with half of the gains of the graph.
    pub(super) open: Complex<f64>,
    /// Amplitude of the whole motion [m] or [rad].
    pub(super) way: f64,
    /// Standard deviation of the response by noise, as the periods differ, relative to the response [1].
    pub(super) error: f64,
}

/// Largest error of a response that counts [1].
const MAX_ERROR: f64 = 0.3;
/// Motions that are as large, as a fraction of the largest one [1].
const AS_LARGE: f64 = 0.8;

impl Line {
    /// Returns whether noise leaves the response known.
    pub(super) fn counts(&self) -> bool {
        self.error <= MAX_ERROR
    }

    /// Returns the mean of the responses of several runs to each frequency, over the runs that have moved as far as any.
    pub(super) fn mean(runs: &[Vec<Self>]) -> Vec<Self> {
        let of = |i: usize| {
            let all = || runs.iter().filter_map(move |lines| lines.get(i));
            let most = all().map(|line| line.way).fold(0.0, f64::max);
            let far: Vec<&Self> = all().filter(|line| line.way >= AS_LARGE * most).collect();
            let number = far.len() as f64;
            let open = far.iter().map(|line| line.open).sum::<Complex<f64>>() / number;
            let variance = far.iter().map(|line| (line.open.norm() * line.error).powi(2)).sum::<f64>();
            Self { omega: far[0].omega, open, way: most, error: variance.sqrt() / number / open.norm() }
        };
        (0..runs.first().map_or(0, Vec::len)).map(of).collect()
    }
}

/// What one run said.
#[derive(Debug)]
pub(super) enum Answered {
    /// The lines of the spectrum.
    Lines(Vec<Line>),
    /// Why there are none, such as a mode that was left.
    Nothing(String),
    /// Somebody interrupted it.
    Interrupted,
}

/// Returns the settings that give a feature other gains in a mode.
pub(super) fn gains(feature: &Feature, mode: &OutlinedMode, gains: [f64; 3]) -> Vec<String> {
    let Some(pid) = &feature.pid else { return Vec::new() };
    let keys = ["kp", "ki", "kd"].into_iter().zip([feature.kp, feature.ki, feature.kd]).zip(gains);
    let changed = keys.filter(|((_, old), new)| old != new);
    changed.map(|((key, _), gain)| format!("{}={gain:?}", gain_key(pid, &feature.name, key, mode))).collect()
}

/// Returns where a gain stands: in the mode, if the mode sets it, or else in its node.
pub(super) fn gain_key(pid: &str, feature: &str, key: &str, mode: &OutlinedMode) -> String {
    let of_mode = format!("set.{pid}.gains.{feature}.{key}");
    match mode.settings.iter().any(|setting| setting.path == of_mode) {
        true => format!("modes.{}.{of_mode}", mode.name),
        false => format!("nodes.{pid}.gains.{feature}.{key}"),
    }
}

/// Returns the settings that let the simulated devices of a graph run for so long [s].
pub(super) fn long_enough(outline: &Outline, seconds: f64) -> impl Iterator<Item = String> {
    let limited = outline.devices.iter().filter(|device| device.settings.iter().any(|one| one.path == "for_s"));
    limited.map(move |device| format!("devices.{}.for_s={seconds:?}", device.name))
}

/// Returns the number of ticks of `period` [s] in which a contact settles before it is measured.
pub(super) fn settling(period: f64) -> usize {
    Sine::all(period).first().map_or(0, |sine| sine.begin)
}

/// Returns how long the mode is measured, for ticks of `period` [s].
pub(super) fn measured(period: f64) -> f64 {
    Sine::all(period).last().map_or(0.0, |sine| sine.end() as f64 * period)
}

/// Returns how long a run takes at most, for ticks of `period` [s].
pub(super) fn duration(period: f64) -> f64 {
    APPROACH_S + measured(period) + lift::LASTS_S
}

impl Experiment<'_> {
    /// Runs with a signal that moves the sensor to and fro by a way [m] or [rad].
    ///
    /// # Errors
    /// If the graph with the signal does not load.
    pub(super) fn run(&self, way: f64) -> Result<Answered, String> {
        let request = Request { set: [&self.request.set[..], &self.settings(way)].concat(), ..self.request.clone() };
        let compiled = compile(self.catalogue, &request).map_err(|report| self.refused(&report))?;
        let mut engine = Engine::new(compiled);
        let pid = self.feature.pid.as_deref().unwrap_or_default();
        let find = |engine: &Engine, name: String| {
            PortColumns::find(engine.ports(), &name).ok_or_else(|| format!("no port is `{name}`"))
        };
        let control = find(&engine, format!("{pid}.control.{}", self.feature.name))?;
        let all = find(&engine, format!("{}.twist.{}", self.adder, COMPONENTS[self.component]))?;
        let sines = Sine::all(self.period);
        let wanted = sines.last().map_or(0, Sine::end);
        let mut stay = Stay::new(self.mode.name.clone(), settling(self.period), wanted);
        let options = RunOptions { duration: Some(duration(self.period)), ..RunOptions::default() };
        let column = self.feature.column[self.component];
        let outcome = run(&mut engine, &options, &mut |engine| {
            let read = |port| engine.bus().scalar(port).unwrap_or(f64::NAN);
            stay.see(engine.mode(), || [read(control) * column, read(all)]);
        });
        let outcome = outcome.map_err(|error| format!("the run cannot start: {error}"))?;
        let (rows, left) = (stay.rows(), stay.left());
        Ok(match (&outcome.end, left) {
            (End::Interrupted, _) => Answered::Interrupted,
            (End::Fault(fault), _) => Answered::Nothing(fault.to_string()),
            (_, Some(mode)) => Answered::Nothing(format!("the mode `{}` was left for `{mode}`", self.mode.name)),
            _ if rows.len() < wanted => {
                let seconds = rows.len() as f64 * self.period;
                Answered::Nothing(format!("the mode `{}` lasted {seconds:.1} s only", self.mode.name))
            }
            _ if rows[sines[0].begin..].iter().flatten().any(|value| !value.is_finite()) => {
                Answered::Nothing(format!("`{}` was absent for a while", self.feature.name))
            }
            _ => Answered::Lines(sines.iter().map(|sine| self.line(rows, sine)).collect()),
        })
    }

    /// Returns why the graph with the signal does not load.
    fn refused(&self, report: &Report) -> String {
        if !report.diagnostics.iter().any(|one| one.code == Code::UngatedMotion) {
            return report.render(false);
        }
        format!(
            "`{}` is not measured: its modes can follow each other without a contact, so nothing would end the test \
             signal. Tune it in a task that holds it in one mode",
            self.feature.name
        )
    }

    /// Returns the response to a sine, with half of the gains: the controller is linear.
    fn line(&self, rows: &[[f64; 2]], sine: &Sine) -> Line {
        let line = line(rows, sine, self.period);
        Line { open: line.open * (HALF / self.share), ..line }
    }

    /// Returns the settings of a run: the signal, its way into the motion, the share of the gains, and the end.
    fn settings(&self, way: f64) -> Vec<String> {
        let unit = if self.component < 3 { "m/s" } else { "rad/s" };
        let fastest = FASTEST[self.component];
        let mut set = lift::settings(self.outline, self.mode, self.adder, measured(self.period) + self.period);
        for (i, sine) in Sine::all(self.period).iter().enumerate() {
            let hz = 1.0 / (sine.ticks as f64 * self.period);
            let lasts = (sine.end() - sine.begin) as f64 * self.period;
            let (signal, twist) = (format!("{SIGNAL}_signal_{i}"), format!("{SIGNAL}_twist_{i}"));
            set.extend([
                format!("nodes.{signal}.type=signal_generator"),
                format!("nodes.{signal}.in.gate=modes.{}", self.mode.name),
                format!("nodes.{signal}.form=sine"),
                format!("nodes.{signal}.unit={unit}"),
                format!("nodes.{signal}.amplitude={:?}", sine.speed(way, fastest, self.period)),
                format!("nodes.{signal}.frequency={hz:?}"),
                format!("nodes.{signal}.start={:?}", sine.begin as f64 * self.period),
                format!("nodes.{signal}.duration={lasts:?}"),
                format!("nodes.{twist}.type=compose_twist"),
                format!("nodes.{twist}.in.{}={signal}.value", COMPONENTS[self.component]),
                format!("nodes.{}.in.{twist}={twist}.twist", self.adder),
            ]);
        }
        let Feature { kp, ki, kd, column, .. } = *self.feature;
        set.extend(gains(self.feature, self.mode, [kp, ki, kd].map(|gain| gain * self.share)));
        // Otherwise the gains would change while they are measured.
        let schedule = self.feature.schedules.iter();
        set.extend(schedule.flat_map(|one| ["min", "max"].map(|key| format!("nodes.{}.{key}=1.0", one.node))));
        if column.iter().filter(|entry| **entry != 0.0).count() > 1 {
            let mut alone = [0.0; 6];
            alone[self.component] = column[self.component];
            set.push(format!("nodes.{}.columns.{}={alone:?}", self.feature.jacobian, self.feature.name));
        }
        set
    }
}

/// Returns the response to one sine. Each row is the motion by the controller, and the whole motion.
fn line(rows: &[[f64; 2]], sine: &Sine, period: f64) -> Line {
    let measured = &rows[sine.begin + sine.settling * sine.ticks..sine.end()];
    let spectra: Vec<[Complex<f64>; 2]> = measured.chunks_exact(sine.ticks).map(first_harmonic).collect();
    // The noise of the measurement moves the sensor too. The mean over the periods keeps what follows the signal.
    let mean = |i: usize| spectra.iter().map(|pair| pair[i]).sum::<Complex<f64>>() / spectra.len() as f64;
    let [own, all] = [mean(0), mean(1)];
    let omega = 2.0 * PI / (sine.ticks as f64 * period);
    let spread = spectra.iter().map(|pair| (pair[0] - own).norm_sqr()).sum::<f64>();
    let periods = spectra.len() as f64;
    Line {
        omega,
        open: -own / all,
        way: 2.0 * all.norm() / (sine.ticks as f64 * omega),
        error: (spread / (periods * (periods - 1.0))).sqrt() / own.norm(),
    }
}

/// Returns the first harmonic of one period: of the motion by the controller, and of the whole motion.
fn first_harmonic(rows: &[[f64; 2]]) -> [Complex<f64>; 2] {
    let sum = |of: usize| {
        let part = |(i, row): (usize, &[f64; 2])| turn(2.0 * PI * i as f64 / rows.len() as f64) * row[of];
        rows.iter().enumerate().map(part).sum::<Complex<f64>>()
    };
    [sum(0), sum(1)]
}
