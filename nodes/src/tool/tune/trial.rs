//! A run of the task through steps of its setpoints, with some gains.

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{Outline, OutlinedMode, Request, compile};
use tactflow_runtime::node::ScalarId;
use tactflow_runtime::record::PortColumns;

use super::cases::Case;
use super::course::Course;
use super::limited::{Limited, Watch};
use super::step::{self, Planned, STEPS, Step};
use super::task::Task;
use super::{Stop, gain_keys, lift, signal};
use crate::tool::control::law::Feature;

/// What a task does with its features.
pub(super) struct Trial<'a> {
    catalogue: &'a Catalogue,
    task: &'a Task,
    /// Lets the sensor lift off at the end.
    request: Request,
    pub(super) outline: &'a Outline,
    pub(super) mode: &'a OutlinedMode,
}

impl<'a> Trial<'a> {
    /// A trial of a case, in a mode whose motions the node `adder` adds.
    pub(super) fn new(
        catalogue: &'a Catalogue,
        task: &'a Task,
        case: &'a Case,
        (mode, adder): (&'a OutlinedMode, &str),
    ) -> Self {
        // With another setting, the mode and its setpoints may be others.
        let outline = &case.outline;
        let mode = outline.modes.iter().find(|one| one.name == mode.name).unwrap_or(mode);
        let lifts = lift::settings(outline, mode, adder, signal::measured(outline.period_s));
        let request = task.with(&case.request, lifts);
        Self { catalogue, task, request, outline, mode }
    }

    /// Returns the steps of a feature to and fro; `None` if its setpoint has none.
    pub(super) fn steps(&self, feature: &Feature) -> Option<[Planned; STEPS]> {
        step::plan(self.outline, self.mode, &[feature])[0].map(step::to_and_fro)
    }

    /// Returns how a feature follows steps with some gains, as far as it is known.
    pub(super) fn to_and_fro(
        &self,
        feature: &Feature,
        steps: &[Planned; STEPS],
        gains: [f64; 3],
    ) -> Result<Run<Option<Step>>, Stop> {
        let gains = gain_keys::gains(feature, self.mode, gains);
        let Run { each: seen, failure, limited } = self.follow(&[feature; STEPS], &steps.map(Some), &gains)?;
        let each = seen.iter().zip(steps).map(|(seen, step)| Step::of(step.size, &seen.after, self.outline.period_s));
        Ok(Run { each: each.collect(), failure, limited })
    }

    /// Runs the task with some gains through steps of its features. Returns what each feature did.
    pub(super) fn follow(
        &self,
        features: &[&Feature],
        steps: &[Option<Planned>],
        gains: &[String],
    ) -> Result<Run<Seen>, Stop> {
        let settings = [gains, &step::settings(self.mode, features, steps)].concat();
        let request = (self.task, &self.request);
        lift::unless_it_bounces(request, &settings, self.mode, |request| self.attempt(features, steps, request))
    }

    /// Runs a request through steps of its features. Also returns whether the pad has bounced at the first touch.
    fn attempt(
        &self,
        features: &[&Feature],
        steps: &[Option<Planned>],
        request: &Request,
    ) -> Result<(Run<Seen>, bool), Stop> {
        let compiled = compile(self.catalogue, request).map_err(|report| report.render(false))?;
        let period = compiled.outline().period_s;
        let mut engine = Engine::new(compiled);
        let ports = features.iter().map(|feature| {
            let port = feature.error_port().unwrap_or_else(|| format!(".error.{}", feature.name));
            PortColumns::find(engine.ports(), &self.task.port(&port))
                .ok_or_else(|| Stop::Refused(format!("no port is `{port}`")))
        });
        let ports: Vec<ScalarId> = ports.collect::<Result<_, _>>()?;
        let settling = signal::settling(period);
        let mut limits = Watch::new(&engine);
        let mut course = Course::new(step::modes(self.mode, steps), settling);
        let options = RunOptions { duration: Some(signal::duration(period)), ..RunOptions::default() };
        let outcome = run(&mut engine, &options, &mut |engine| {
            let read = |port: &ScalarId| engine.bus().scalar(*port).unwrap_or(f64::NAN);
            if course.has_stepped() {
                limits.see(engine);
            }
            course.see(self.task.mode(engine), || ports.iter().map(read).collect());
        });
        let outcome = outcome.map_err(|error| format!("the run cannot start: {error}"))?;
        let failure = match (&outcome.end, course.failure()) {
            (End::Interrupted, _) => return Err(Stop::Interrupted),
            (End::Fault(fault), _) => Some(fault.to_string()),
            (_, failure) => failure,
        };
        let seen = (0..features.len()).map(|i| {
            let column = |rows: &[Vec<f64>]| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
            let held = column(course.rows(&self.mode.name).get(settling..).unwrap_or_default());
            let earlier = (0..i).rev().find(|earlier| steps[*earlier].is_some());
            let before = earlier.map(|earlier| column(step::end(course.rows(&step::mode_name(earlier)))));
            Seen {
                before: before.unwrap_or_else(|| held.clone()),
                held,
                after: column(course.rows(&step::mode_name(i))),
            }
        });
        Ok((Run { each: seen.collect(), failure, limited: limits.most() }, course.has_bounced()))
    }
}

/// What one run of a trial has shown.
pub(super) struct Run<T> {
    /// For each step.
    pub(super) each: Vec<T>,
    /// Why the run has failed.
    pub(super) failure: Option<String>,
    /// The limit that has acted much since the first step.
    pub(super) limited: Option<Limited>,
}

/// The errors of a feature in one run.
pub(super) struct Seen {
    /// In the mode itself.
    pub(super) held: Vec<f64>,
    /// Before its step.
    pub(super) before: Vec<f64>,
    /// After its step.
    pub(super) after: Vec<f64>,
}
