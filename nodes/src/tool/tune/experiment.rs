//! One run with a test signal: the frequency response of a loop, measured while it is closed.

use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Complex;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{Outline, OutlinedMode, Request, compile};
use tactflow_runtime::record::PortColumns;

use crate::tool::control::law::{COMPONENTS, Feature};
use crate::tool::control::response::turn;

/// Period of the test signal [s].
const PERIOD_S: f64 = 4.0;
/// Lowest and highest frequency of the test signal [Hz].
const BAND_HZ: [f64; 2] = [0.25, 8.0];
/// Periods for the response to become periodic.
const SETTLING: usize = 1;
/// Periods that are measured: more tell noise better.
const MEASURED: usize = 4;
/// Time for the approach [s].
const APPROACH_S: f64 = 20.0;
/// Name of the test signal in the graph.
const SIGNAL: &str = "tune_signal";
/// Name of its twist in the graph.
const TWIST: &str = "tune_twist";

/// The loop that an experiment opens with its signal.
#[derive(Clone)]
pub(super) struct Experiment<'a> {
    pub(super) catalogue: &'a Catalogue,
    pub(super) request: &'a Request,
    pub(super) mode: &'a OutlinedMode,
    /// The node that adds the test signal to the motion.
    pub(super) adder: &'a str,
    pub(super) feature: &'a Feature,
    /// The component of the twist that is moved.
    pub(super) component: usize,
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

/// Returns how long an experiment takes at most [s].
pub(super) const fn duration() -> f64 {
    APPROACH_S + (SETTLING + MEASURED) as f64 * PERIOD_S
}

impl Experiment<'_> {
    /// Runs with a signal of that amplitude in the unit of its component, at half of the gains.
    ///
    /// # Errors
    /// If the graph with the signal does not load.
    pub(super) fn run(&self, amplitude: f64) -> Result<Answered, String> {
        let request =
            Request { set: [&self.request.set[..], &self.settings(amplitude)].concat(), ..self.request.clone() };
        let compiled = compile(self.catalogue, &request).map_err(|report| report.render(false))?;
        let mut engine = Engine::new(compiled);
        let pid = self.feature.pid.as_deref().unwrap_or_default();
        let find = |engine: &Engine, name: String| {
            PortColumns::find(engine.ports(), &name).ok_or_else(|| format!("no port is `{name}`"))
        };
        let control = find(&engine, format!("{pid}.control.{}", self.feature.name))?;
        let signal = find(&engine, format!("{SIGNAL}.value"))?;
        let (mut rows, mut left) = (Vec::new(), None);
        let period = engine.period() as f64 * 1e-9;
        let in_period = (PERIOD_S / period).round() as usize;
        let wanted = (SETTLING + MEASURED) * in_period;
        let cancel = Arc::new(AtomicBool::new(false));
        let options = RunOptions { duration: Some(duration()), cancel: Some(cancel.clone()), ..RunOptions::default() };
        let column = self.feature.column[self.component];
        let outcome = run(&mut engine, &options, &mut |engine| {
            let Some(added) = engine.bus().scalar(signal) else {
                if !rows.is_empty() && rows.len() < wanted {
                    left.get_or_insert_with(|| engine.mode().unwrap_or("the end").to_owned());
                }
                return;
            };
            rows.push([engine.bus().scalar(control).unwrap_or(f64::NAN) * column, added]);
            if rows.len() >= wanted {
                cancel.store(true, Ordering::Relaxed);
            }
        });
        let outcome = outcome.map_err(|error| format!("the run cannot start: {error}"))?;
        Ok(match (&outcome.end, left) {
            (End::Interrupted, _) if outcome.signal.is_some() => Answered::Interrupted,
            (End::Fault(fault), _) => Answered::Nothing(fault.to_string()),
            (_, Some(mode)) => Answered::Nothing(format!("the mode `{}` was left for `{mode}`", self.mode.name)),
            _ if rows.len() < wanted => {
                let seconds = rows.len() as f64 * period;
                Answered::Nothing(format!("the mode `{}` lasted {seconds:.1} s only", self.mode.name))
            }
            _ if rows.iter().flatten().any(|value| !value.is_finite()) => {
                Answered::Nothing(format!("`{}` was absent for a while", self.feature.name))
            }
            _ => Answered::Lines(lines(&rows, in_period, period)),
        })
    }

    /// Returns the settings of a run: the signal, its way into the motion, and half of the gains.
    fn settings(&self, amplitude: f64) -> Vec<String> {
        let unit = if self.component < 3 { "m/s" } else { "rad/s" };
        let [low, high] = BAND_HZ;
        let mut set = vec![
            format!("nodes.{SIGNAL}.type=multisine"),
            format!("nodes.{SIGNAL}.in.gate=modes.{}", self.mode.name),
            format!("nodes.{SIGNAL}.unit={unit}"),
            format!("nodes.{SIGNAL}.amplitude={amplitude:?}"),
            format!("nodes.{SIGNAL}.period={PERIOD_S:?}"),
            format!("nodes.{SIGNAL}.min_frequency={low:?}"),
            format!("nodes.{SIGNAL}.max_frequency={high:?}"),
            format!("nodes.{TWIST}.type=compose_twist"),
            format!("nodes.{TWIST}.in.{}={SIGNAL}.value", COMPONENTS[self.component]),
            format!("nodes.{}.in.{TWIST}={TWIST}.twist", self.adder),
        ];
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

/// Returns the spectrum of the last periods. Each row is the motion by the controller, and the signal added to it.
fn lines(rows: &[[f64; 2]], in_period: usize, period: f64) -> Vec<Line> {
    let [low, high] = BAND_HZ.map(|hz| (hz * PERIOD_S).round() as usize);
    let periods: Vec<&[[f64; 2]]> = rows[SETTLING * in_period..].chunks_exact(in_period).collect();
    let line = |harmonic: usize| {
        let omega = 2.0 * PI * harmonic as f64 / (in_period as f64 * period);
        let spectra: Vec<[Complex<f64>; 2]> = periods.iter().map(|rows| spectrum(rows, harmonic)).collect();
        let sum = |of: &dyn Fn(&[Complex<f64>; 2]) -> Complex<f64>| spectra.iter().map(of).sum::<Complex<f64>>();
        let cross = sum(&|[by, all]| by * all.conj());
        let [own, whole] = [0, 1].map(|i| sum(&|pair| Complex::from(pair[i].norm_sqr())).re);
        Line { omega, open: -cross / whole, coherence: cross.norm_sqr() / (own * whole) }
    };
    (low..=high).map(line).collect()
}

/// Returns one harmonic of the motion by the controller, and of the whole motion.
fn spectrum(rows: &[[f64; 2]], harmonic: usize) -> [Complex<f64>; 2] {
    let (mut by, mut all) = (Complex::from(0.0), Complex::from(0.0));
    for (i, [control, added]) in rows.iter().enumerate() {
        let phase = turn(2.0 * PI * ((harmonic * i) % rows.len()) as f64 / rows.len() as f64);
        by += phase * *control;
        all += phase * (control + added);
    }
    [by, all]
}
