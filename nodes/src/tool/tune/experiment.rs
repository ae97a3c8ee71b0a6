//! One run with a test signal: the frequency response of a loop, measured while it is closed.

use nalgebra::Complex;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{Outline, OutlinedMode, Request, compile};
use tactflow_runtime::record::PortColumns;

use super::gain_keys::{gain_key, gains};
use super::lift;
use super::limited::{Limited, Watch};
use super::load::{Loads, Room};
use super::signal::{Pace, Sine, duration, measured, settling};
use super::spectrum::{Line, line};
use super::stay::Stay;
use super::task::Task;
use crate::motion::COMPONENTS;
use crate::tool::control::contacts::Answer;
use crate::tool::control::law::Feature;
use crate::tool::control::response::Loop;

/// Beginning of the names of the nodes that make the test signal.
const SIGNAL: &str = "tune";

/// Time before the test signal in which the load on the pad is that of the contact at rest [s].
const CALM_S: f64 = 1.0;

/// The loop that an experiment opens with its signal.
pub(super) struct Experiment<'a> {
    pub(super) catalogue: &'a Catalogue,
    pub(super) task: &'a Task,
    pub(super) request: &'a Request,
    pub(super) outline: &'a Outline,
    pub(super) mode: &'a OutlinedMode,
    /// The node that adds the test signal to the motion.
    pub(super) adder: &'a str,
    pub(super) feature: &'a Feature,
    /// How fast the signal moves along each component at most.
    pub(super) pace: [Pace; 6],
    /// Period of the graph [s].
    pub(super) period: f64,
    /// Share of the gains of the graph with which it is measured [1].
    pub(super) share: f64,
}

/// Share of the gains for which the response holds, and with which a loop is measured first [1].
pub(super) const HALF: f64 = 0.5;

/// Returns the response of what the graph states, at half of the gains and for one component alone.
pub(super) fn known(feature: &Feature, component: usize) -> impl Fn(f64) -> Complex<f64> {
    let around = Loop::new(feature, &Answer::default(), 0.0).times(HALF);
    let column = feature.column[component];
    move |omega| around.known(omega) * column
}

/// What one run said.
#[derive(Debug)]
pub(super) enum Answered {
    /// The lines of the spectrum, the limit that has acted much, and the room that the limits of a force leave.
    Lines { lines: Vec<Line>, limited: Option<Limited>, room: Option<Room> },
    /// Why there are none, such as a mode that was left, and whether the feature was absent.
    Nothing { why: String, is_absent: bool },
    /// Why the task has not reached the mode.
    NotReached(String),
    /// Somebody interrupted it.
    Interrupted,
}

impl Experiment<'_> {
    /// Runs with a signal that moves the sensor to and fro along a component, by an amplitude [m] or [rad].
    ///
    /// # Errors
    /// If the graph with the signal does not load.
    pub(super) fn run(&self, component: usize, amplitude: f64) -> Result<Answered, String> {
        let settings = self.settings(component, amplitude);
        lift::unless_it_bounces((self.task, self.request), &settings, self.mode, |request| {
            self.attempt((component, amplitude), request)
        })
    }

    /// Runs with a signal along a component. Also returns whether the pad has bounced at the first touch.
    fn attempt(&self, (component, amplitude): (usize, f64), request: &Request) -> Result<(Answered, bool), String> {
        let compiled = compile(self.catalogue, request).map_err(|report| report.render(false))?;
        let outline = compiled.outline().clone();
        let mut engine = Engine::new(compiled);
        let mut loads = Loads::new(&outline, &engine);
        let pid = self.feature.pid.as_deref().unwrap_or_default();
        let find = |engine: &Engine, name: String| {
            PortColumns::find(engine.ports(), &self.task.port(&name)).ok_or_else(|| format!("no port is `{name}`"))
        };
        let control = find(&engine, format!("{pid}.control.{}", self.feature.name))?;
        let all = find(&engine, format!("{}.twist.{}", self.adder, COMPONENTS[component]))?;
        let sines = Sine::all(self.period);
        let wanted = sines.last().map_or(0, Sine::end);
        let (mut limits, settled) = (Watch::new(&engine), settling(self.period));
        let calm = ((CALM_S / self.period) as usize).min(settled);
        let mut stay = Stay::new(self.mode.name.clone(), settled, wanted);
        let options = RunOptions { duration: Some(duration(self.period)), ..RunOptions::default() };
        let column = self.feature.column[component];
        let outcome = run(&mut engine, &options, &mut |engine| {
            let read = |port| engine.bus().scalar(port).unwrap_or(f64::NAN);
            let before = stay.rows().len();
            stay.see(self.task.mode(engine), || [read(control) * column, read(all)]);
            let rows = stay.rows().len();
            if (settled..wanted).contains(&rows) {
                limits.see(engine);
            }
            // After a bounce, the stay begins again.
            if rows < before {
                loads.clear();
            }
            if rows != before && (settled - calm..wanted).contains(&rows) {
                loads.see(engine, rows < settled);
            }
        });
        let outcome = outcome.map_err(|error| format!("the run cannot start: {error}"))?;
        let (rows, left) = (stay.rows(), stay.left());
        let mut values = rows.iter().skip(sines[0].begin).flatten();
        let is_absent = values.any(|value| !value.is_finite());
        let nothing = |why: String| Answered::Nothing { why, is_absent };
        let answered = match (&outcome.end, left) {
            (End::Interrupted, _) => Answered::Interrupted,
            (end, _) if rows.is_empty() => {
                Answered::NotReached(format!("the task does not reach the mode `{}`: {end}", self.mode.name))
            }
            (End::Fault(fault), _) => nothing(fault.to_string()),
            (_, Some(mode)) => nothing(lift::left(&self.mode.name, mode)),
            _ if rows.len() < wanted => {
                let seconds = rows.len() as f64 * self.period;
                nothing(format!("the mode `{}` lasted {seconds:.1} s only", self.mode.name))
            }
            _ if is_absent => nothing(format!("`{}` was absent for a while", self.feature.name)),
            _ => Answered::Lines {
                lines: sines.iter().map(|sine| self.line(rows, sine)).collect(),
                limited: limits.most(),
                room: loads.room(amplitude),
            },
        };
        Ok((answered, stay.has_bounced()))
    }

    /// Returns the response to a sine, with half of the gains: the controller is linear.
    fn line(&self, rows: &[[f64; 2]], sine: &Sine) -> Line {
        let line = line(rows, sine, self.period);
        Line { open: line.open * (HALF / self.share), ..line }
    }

    /// Returns the settings of a run: the signal, its way into the motion, the share of the gains, and the end.
    fn settings(&self, component: usize, amplitude: f64) -> Vec<String> {
        let unit = if component < 3 { "m/s" } else { "rad/s" };
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
                format!("nodes.{signal}.amplitude={:?}", sine.speed(amplitude, self.pace[component], self.period)),
                format!("nodes.{signal}.frequency={hz:?}"),
                format!("nodes.{signal}.start={:?}", sine.begin as f64 * self.period),
                format!("nodes.{signal}.duration={lasts:?}"),
                format!("nodes.{twist}.type=compose_twist"),
                format!("nodes.{twist}.in.{}={signal}.value", COMPONENTS[component]),
                format!("nodes.{}.in.{twist}={twist}.twist", self.adder),
            ]);
        }
        let Feature { kp, ki, kd, column, .. } = *self.feature;
        set.extend(gains(self.feature, self.mode, [kp, ki, kd].map(|gain| gain * self.share)));
        // A response is computed from the gains alone, so the brake must not act: no contact is as fast as this.
        let pid = self.feature.pid.iter().filter(|_| self.feature.brake_above.is_some());
        set.extend(pid.map(|pid| format!("{}=1e9", gain_key(pid, &self.feature.name, "brake_above", self.mode))));
        // Otherwise the gains would change while they are measured.
        let schedule = self.feature.schedules.iter();
        set.extend(schedule.flat_map(|one| ["min", "max"].map(|key| format!("nodes.{}.{key}=1.0", one.node))));
        if column.iter().filter(|entry| **entry != 0.0).count() > 1 {
            let mut alone = [0.0; 6];
            alone[component] = column[component];
            // A mount turns what is written.
            let written = self.feature.turn.as_ref().and_then(|turn| turn.written(alone));
            let alone = written.unwrap_or(alone);
            set.push(format!("nodes.{}.columns.{}={alone:?}", self.feature.jacobian, self.feature.name));
        }
        set
    }
}
