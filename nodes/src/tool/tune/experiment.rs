//! One run with a test signal: the frequency response of a loop, measured while it is closed.

use std::f64::consts::PI;

use nalgebra::Complex;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{Outline, OutlinedMode, Request, compile};
use tactflow_runtime::record::PortColumns;

use super::lift;
use crate::tool::control::law::{COMPONENTS, Feature};
use crate::tool::control::shape::turn;

/// Lowest frequency of the test signal [Hz].
const LOWEST_HZ: f64 = 0.35;
/// Number of frequencies, each √2 times the one before.
const FREQUENCIES: usize = 10;
/// Time after the begin of the mode until the test signal begins [s].
const BEGIN_S: f64 = 6.0;
/// Time for the response to a frequency to become periodic [s], and at least one period.
const SETTLING_S: f64 = 1.0;
/// Time in which a frequency is measured [s], and at least three periods.
const MEASURING_S: f64 = 2.0;
/// Largest speed of the test signal [m/s], [rad/s]: ceilings of force let a pad move no faster into an object.
const FASTEST: [f64; 2] = [0.006, 0.15];
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
        let mut sine = |k: usize| {
            let hz = LOWEST_HZ * libm::exp2(k as f64 / 2.0);
            let ticks = (1.0 / (hz * period)).round().max(4.0) as usize;
            let periods = |seconds: f64| (seconds / (ticks as f64 * period)).ceil() as usize;
            let sine =
                Self { ticks, begin, settling: periods(SETTLING_S).max(1), measured: periods(MEASURING_S).max(3) };
            begin = sine.end();
            sine
        };
        (0..FREQUENCIES).map(&mut sine).collect()
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
}

/// The response at one frequency.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    /// Circular frequency [rad/s].
    pub(super) omega: f64,
    /// The response around the loop: L, by the controller of the experiment.
    pub(super) open: Complex<f64>,
    /// The share of the answer that the signal explains, from 0 to 1.
    pub(super) coherence: f64,
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

/// Returns how long the mode is measured, for ticks of `period` [s].
pub(super) fn measured(period: f64) -> f64 {
    Sine::all(period).last().map_or(0.0, |sine| sine.end() as f64 * period)
}

/// Returns how long a run takes at most, for ticks of `period` [s].
pub(super) fn duration(period: f64) -> f64 {
    APPROACH_S + measured(period) + lift::LASTS_S
}

impl Experiment<'_> {
    /// Runs with a signal that moves the sensor to and fro by a way [m] or [rad], at half of the gains.
    ///
    /// # Errors
    /// If the graph with the signal does not load.
    pub(super) fn run(&self, way: f64) -> Result<Answered, String> {
        let request = Request { set: [&self.request.set[..], &self.settings(way)].concat(), ..self.request.clone() };
        let compiled = compile(self.catalogue, &request).map_err(|report| report.render(false))?;
        let mut engine = Engine::new(compiled);
        let pid = self.feature.pid.as_deref().unwrap_or_default();
        let find = |engine: &Engine, name: String| {
            PortColumns::find(engine.ports(), &name).ok_or_else(|| format!("no port is `{name}`"))
        };
        let control = find(&engine, format!("{pid}.control.{}", self.feature.name))?;
        let all = find(&engine, format!("{}.twist.{}", self.adder, COMPONENTS[self.component]))?;
        let sines = Sine::all(self.period);
        let wanted = sines.last().map_or(0, Sine::end);
        let (mut rows, mut left): (Vec<[f64; 2]>, Option<String>) = (Vec::new(), None);
        let options = RunOptions { duration: Some(duration(self.period)), ..RunOptions::default() };
        let column = self.feature.column[self.component];
        let outcome = run(&mut engine, &options, &mut |engine| {
            let is_in = engine.mode() == Some(&*self.mode.name);
            if !is_in && !rows.is_empty() && rows.len() < wanted {
                left.get_or_insert_with(|| engine.mode().unwrap_or("the end").to_owned());
            }
            if is_in && rows.len() < wanted {
                let read = |port| engine.bus().scalar(port).unwrap_or(f64::NAN);
                rows.push([read(control) * column, read(all)]);
            }
        });
        let outcome = outcome.map_err(|error| format!("the run cannot start: {error}"))?;
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
            _ => Answered::Lines(sines.iter().map(|sine| line(&rows, sine, self.period)).collect()),
        })
    }

    /// Returns the settings of a run: the signal, its way into the motion, half of the gains, and the end.
    fn settings(&self, way: f64) -> Vec<String> {
        let unit = if self.component < 3 { "m/s" } else { "rad/s" };
        let fastest = FASTEST[self.component / 3];
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
        set.extend(gains(self.feature, self.mode, [kp / 2.0, ki / 2.0, kd / 2.0]));
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
    let power = spectra.iter().map(|pair| pair[0].norm_sqr()).sum::<f64>() / spectra.len() as f64;
    Line {
        omega: 2.0 * PI / (sine.ticks as f64 * period),
        open: -mean(0) / mean(1),
        coherence: mean(0).norm_sqr() / power,
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
