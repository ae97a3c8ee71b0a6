//! The task with the old and with the new gains: how it holds its setpoints, and how it follows steps of them.

use serde::Serialize;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{Outline, OutlinedMode, Request, compile};
use tactflow_runtime::node::ScalarId;
use tactflow_runtime::record::PortColumns;

use super::stay::Stay;
use super::step::{self, Step};
use super::{Stop, TunedFeature, experiment, lift};

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
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub(super) struct Held {
    /// Root mean square of the error before the step.
    pub(super) error: Option<f64>,
    pub(super) step: Option<Step>,
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
        let gains = |one: &&TunedFeature| experiment::gains(&one.feature, self.mode, one.new.unwrap_or(one.old));
        let new: Vec<String> = changed.iter().flat_map(gains).collect();
        let [(old, _), (new, failure)] = [self.hold(&changed, &[])?, self.hold(&changed, &new)?];
        let each = changed.iter().zip(old.into_iter().zip(new));
        Ok(each
            .map(|(one, (old, new))| {
                let failure = failure.clone().or_else(|| new.step?.failure());
                Settled { object: object.to_owned(), feature: one.name.clone(), old, new, failure }
            })
            .collect())
    }

    /// Returns how the task holds each feature with some gains, and why the run has failed.
    fn hold(&self, features: &[&TunedFeature], gains: &[String]) -> Result<(Vec<Held>, Option<String>), Stop> {
        let sizes = step::sizes(self.outline, self.mode, features);
        let set = [&self.request.set[..], gains, &step::settings(self.mode, features, &sizes)].concat();
        let request = Request { set, ..self.request.clone() };
        let compiled = compile(self.catalogue, &request).map_err(|report| report.render(false))?;
        let period = compiled.outline().period_s;
        let mut engine = Engine::new(compiled);
        let ports = features.iter().map(|one| {
            let node = one.feature.compared.as_deref().unwrap_or_default();
            let port = format!("{node}.error.{}", one.feature.name);
            PortColumns::find(engine.ports(), &port).ok_or_else(|| Stop::Refused(format!("no port is `{port}`")))
        });
        let ports: Vec<ScalarId> = ports.collect::<Result<_, _>>()?;
        let settling = experiment::settling(period);
        let wanted = (step::BEFORE_S / period) as usize;
        let mut before = Stay::new(&self.mode.name, settling, wanted);
        let names: Vec<String> = (0..features.len()).map(step::mode_name).collect();
        let mut after: Vec<Vec<f64>> = vec![Vec::new(); features.len()];
        let mut last = String::new();
        let options = RunOptions { duration: Some(experiment::duration(period)), ..RunOptions::default() };
        let outcome = run(&mut engine, &options, &mut |engine| {
            let read = |port: &ScalarId| engine.bus().scalar(*port).unwrap_or(f64::NAN);
            before.see(engine.mode(), || ports.iter().map(read).collect::<Vec<_>>());
            let now = engine.mode().unwrap_or("the end");
            if let Some(i) = names.iter().position(|name| name == now) {
                after[i].push(read(&ports[i]));
            }
            if now != last {
                now.clone_into(&mut last);
            }
        });
        let outcome = outcome.map_err(|error| format!("the run cannot start: {error}"))?;
        let (rows, left) = before.end();
        let failure = match (&outcome.end, left) {
            (End::Interrupted, _) => return Err(Stop::Interrupted),
            (End::Fault(fault), _) => Some(fault.to_string()),
            (_, Some(mode)) => Some(format!("the task goes on to `{mode}`")),
            _ if last != lift::MODE => Some(format!("after a step of a setpoint, the task goes on to `{last}`")),
            _ => None,
        };
        let held = (0..features.len()).map(|i| Held {
            error: deviation(rows.iter().skip(settling).map(|row| row[i])),
            step: sizes[i].and_then(|size| Step::of(size, &after[i], period)),
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
