//! The task with the old and with the new gains.

use serde::Serialize;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{OutlinedMode, Request, compile};
use tactflow_runtime::node::ScalarId;
use tactflow_runtime::record::PortColumns;

use super::stay::Stay;
use super::{Stop, TunedFeature, experiment, lift};

/// How a task holds a feature.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Settled {
    pub(super) object: String,
    pub(super) feature: String,
    /// Root mean square of the error in the last part of the run, with the old gains.
    pub(super) old: Option<f64>,
    /// The same with the new gains.
    pub(super) new: Option<f64>,
    /// Why the run with the new gains is no success.
    pub(super) failure: Option<String>,
}

impl Settled {
    pub(super) const fn is_good(&self) -> bool {
        self.failure.is_none()
    }
}

/// Largest error with the new gains, as a multiple of that with the old ones.
const WORSE: f64 = 1.5;

/// Runs the task with both gains, and compares how it holds each feature that has new ones. The request lets the sensor
/// lift off at the end.
pub(super) fn compare(
    catalogue: &Catalogue,
    request: &Request,
    mode: &OutlinedMode,
    features: &[TunedFeature],
    object: &str,
) -> Result<Vec<Settled>, Stop> {
    let changed: Vec<(&TunedFeature, [f64; 3])> = features.iter().filter_map(|one| Some((one, one.new?))).collect();
    if changed.is_empty() {
        return Ok(Vec::new());
    }
    let set = changed.iter().flat_map(|(one, new)| experiment::gains(&one.feature, mode, *new));
    let new = Request { set: request.set.iter().cloned().chain(set).collect(), ..request.clone() };
    let names: Vec<&str> = changed.iter().filter_map(|(one, _)| one.feature.error.as_deref()).collect();
    let [(before, _), (after, failure)] =
        [hold(catalogue, request, mode, &names)?, hold(catalogue, &new, mode, &names)?];
    let one = |(i, (one, _)): (usize, &(&TunedFeature, _))| {
        let (old, new) = (before.get(i).copied().flatten(), after.get(i).copied().flatten());
        let worse = old
            .zip(new)
            .filter(|(old, new)| *new > WORSE * old)
            .map(|(old, new)| format!("the error grows to {:.1} times what it was", new / old));
        let failure = failure.clone().or(worse);
        Settled { object: object.to_owned(), feature: one.name.clone(), old, new, failure }
    };
    Ok(changed.iter().enumerate().map(one).collect())
}

/// Returns the error of each feature in the last part of a run, and why the run has failed.
fn hold(
    catalogue: &Catalogue,
    request: &Request,
    mode: &OutlinedMode,
    errors: &[&str],
) -> Result<(Vec<Option<f64>>, Option<String>), Stop> {
    let compiled = compile(catalogue, request).map_err(|report| report.render(false))?;
    let period = compiled.outline().period_s;
    let mut engine = Engine::new(compiled);
    let columns = errors.iter().map(|name| {
        PortColumns::find(engine.ports(), name).ok_or_else(|| Stop::Refused(format!("no port is `{name}`")))
    });
    let columns: Vec<_> = columns.collect::<Result<_, _>>()?;
    let options = RunOptions { duration: Some(experiment::duration(period)), ..RunOptions::default() };
    let mut stay = Stay::new(&mode.name, experiment::settling(period), usize::MAX);
    let outcome = run(&mut engine, &options, &mut |engine| {
        let read = |column: &ScalarId| engine.bus().scalar(*column).unwrap_or(f64::NAN);
        stay.see(engine.mode(), || columns.iter().map(read).collect::<Vec<_>>());
    });
    let outcome = outcome.map_err(|error| format!("the run cannot start: {error}"))?;
    let (rows, left) = stay.end();
    let failure = match (&outcome.end, left) {
        (End::Interrupted, _) => return Err(Stop::Interrupted),
        (End::Fault(fault), _) => Some(fault.to_string()),
        (_, Some(mode)) if mode != lift::MODE => Some(format!("the task goes on to `{mode}`")),
        _ => None,
    };
    let last = &rows[rows.len() / 2..];
    let deviation = |i: usize| {
        let values: Vec<f64> = last.iter().map(|row| row[i]).filter(|value| value.is_finite()).collect();
        let square: f64 = values.iter().map(|value| value * value).sum();
        (!values.is_empty()).then(|| (square / values.len() as f64).sqrt())
    };
    Ok(((0..errors.len()).map(deviation).collect(), failure))
}
