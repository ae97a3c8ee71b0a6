//! The task with the old and with the new gains: how it holds its setpoints, and how it follows steps of them.

use serde::Serialize;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{Outline, OutlinedMode, Request, compile};
use tactflow_runtime::node::ScalarId;
use tactflow_runtime::record::PortColumns;

use super::course::Course;
use super::propose::TunedFeature;
use super::step::{self, Planned, Step};
use super::{Stop, gain_keys, signal};

/// How a task holds a feature.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Settled {
    pub(super) object: String,
    pub(super) feature: String,
    /// With the old gains.
    pub(super) old: Held,
    /// With the new gains.
    pub(super) new: Held,
    /// Why the run with the new gains is no success.
    pub(super) failure: Option<String>,
}

/// How a feature is held with some gains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Held {
    /// Root mean square of the error before the step.
    pub(super) error: Option<f64>,
    pub(super) step: Option<Step>,
}

/// Largest error, as a multiple of that with the old gains, where no step says more [1].
const WORSE: f64 = 1.5;

impl Held {
    /// Returns what is wrong with it, if it is worse than with the old gains.
    fn failure(&self, old: &Self) -> Option<String> {
        if let Some((new, old)) = self.step.zip(old.step) {
            return new.failure(&old);
        }
        let growth = self.error.zip(old.error).map(|(new, old)| new / old).filter(|growth| *growth > WORSE);
        let grows = growth.map(|growth| format!("the error grows to {growth:.1} times what it was"));
        let is_lost = old.step.is_some() || old.error.is_some() && self.error.is_none();
        grows.or_else(|| is_lost.then(|| "it is not held, or absent for a while".to_owned()))
    }
}

impl Settled {
    pub(super) const fn is_good(&self) -> bool {
        self.failure.is_none()
    }
}

/// What a task does with its features.
pub(super) struct Trial<'a> {
    pub(super) catalogue: &'a Catalogue,
    /// Lets the sensor lift off at the end.
    pub(super) request: &'a Request,
    pub(super) outline: &'a Outline,
    pub(super) mode: &'a OutlinedMode,
}

impl Trial<'_> {
    /// Runs the task with both gains, and compares how it holds each feature that has new ones.
    pub(super) fn compare(&self, features: &[TunedFeature], object: &str) -> Result<Vec<Settled>, Stop> {
        let changed: Vec<&TunedFeature> = features.iter().filter(|one| one.new.is_some()).collect();
        if changed.is_empty() {
            return Ok(Vec::new());
        }
        let gains = |one: &&TunedFeature| gain_keys::gains(&one.feature, self.mode, one.new.unwrap_or(one.old));
        let new: Vec<String> = changed.iter().flat_map(gains).collect();
        let steps = step::plan(self.outline, self.mode, &changed);
        let [(old, _), (new, failure)] = [self.hold(&changed, &steps, &[])?, self.hold(&changed, &steps, &new)?];
        let each = changed.iter().zip(old.into_iter().zip(new));
        Ok(each
            .map(|(one, (old, new))| {
                let failure = failure.clone().or_else(|| new.failure(&old));
                Settled { object: object.to_owned(), feature: one.name.clone(), old, new, failure }
            })
            .collect())
    }

    /// Returns how the task holds each feature with some gains, and why the run has failed.
    fn hold(
        &self,
        features: &[&TunedFeature],
        steps: &[Option<Planned>],
        gains: &[String],
    ) -> Result<(Vec<Held>, Option<String>), Stop> {
        let set = [&self.request.set[..], gains, &step::settings(self.mode, features, steps)].concat();
        let request = Request { set, ..self.request.clone() };
        let compiled = compile(self.catalogue, &request).map_err(|report| report.render(false))?;
        let period = compiled.outline().period_s;
        let mut engine = Engine::new(compiled);
        let ports = features.iter().map(|one| {
            let port = one.feature.error_port().unwrap_or_else(|| format!(".error.{}", one.feature.name));
            PortColumns::find(engine.ports(), &port).ok_or_else(|| Stop::Refused(format!("no port is `{port}`")))
        });
        let ports: Vec<ScalarId> = ports.collect::<Result<_, _>>()?;
        let settling = signal::settling(period);
        let mut course = Course::new(step::modes(self.mode, steps), settling);
        let options = RunOptions { duration: Some(signal::duration(period)), ..RunOptions::default() };
        let outcome = run(&mut engine, &options, &mut |engine| {
            let read = |port: &ScalarId| engine.bus().scalar(*port).unwrap_or(f64::NAN);
            course.see(engine.mode(), || ports.iter().map(read).collect());
        });
        let outcome = outcome.map_err(|error| format!("the run cannot start: {error}"))?;
        let failure = match (&outcome.end, course.failure()) {
            (End::Interrupted, _) => return Err(Stop::Interrupted),
            (End::Fault(fault), _) => Some(fault.to_string()),
            (_, failure) => failure,
        };
        let held = (0..features.len()).map(|i| {
            let column = |rows: &[Vec<f64>]| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
            let before = column(course.rows(&self.mode.name).get(settling..).unwrap_or_default());
            let after = column(course.rows(&step::mode_name(i)));
            let step = steps[i].and_then(|step| Step::of(step.size, &before, &after, period));
            Held { error: deviation(before.into_iter()), step }
        });
        Ok((held.collect(), failure))
    }
}

/// Returns the root mean square of what is finite.
fn deviation(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let square: f64 = values.iter().map(|value| value * value).sum();
    (!values.is_empty()).then(|| (square / values.len() as f64).sqrt())
}
