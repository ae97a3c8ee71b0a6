//! One run of a scenario, with one seed.

use std::path::Path;

use serde::Serialize;

use super::judge::{Figure, FigureRow};
use super::measure::{self, Reading, since};
use super::model::{Check, Scenario};
use crate::catalogue::Catalogue;
use crate::engine::{End, Engine, run_virtual};
use crate::graph::{Request, compile};
use crate::node::ScalarId;
use crate::record::{PortColumns, RecordFormat, Recorder};
use crate::signal::Freshness;

/// The value of `ends_in` for a run that ends with a `done` condition.
pub(super) const DONE: &str = "done";

/// The result of one run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trial {
    /// The seed, if the scenario has seeds.
    pub seed: Option<u64>,
    /// Duration of the run [s].
    #[serde(rename = "time_s")]
    pub time: f64,
    /// Why the run cannot be measured, for example a fault.
    pub failure: Option<String>,
    /// Every figure, in the order of the scenario's rows; `None` if it could not be measured.
    #[serde(skip)]
    pub figures: Vec<Option<f64>>,
}

impl Scenario {
    /// Returns every figure over all runs, in the order of the file.
    #[must_use]
    pub fn rows(&self, trials: &[Trial]) -> Vec<FigureRow> {
        let mut rows = self.rows.clone();
        for (i, row) in rows.iter_mut().enumerate() {
            row.values = trials.iter().map(|trial| trial.figures[i]).collect();
        }
        rows
    }

    /// Runs the scenario with one seed, and records every tick to the file `record`, if it is given. Returns `None` if
    /// the run was interrupted.
    #[must_use]
    pub fn run(
        &self,
        catalogue: &Catalogue,
        seed: Option<u64>,
        record: Option<&Path>,
        is_interrupted: &dyn Fn() -> bool,
    ) -> Option<Trial> {
        let failed = |time: f64, failure: String| {
            Some(Trial { seed, time, failure: Some(failure), figures: vec![None; self.rows.len()] })
        };
        let mut engine = match compile(catalogue, &self.seeded(seed)) {
            Ok(plan) => Engine::new(plan),
            Err(report) => {
                let first = report.diagnostics.first().map(|first| first.message.clone());
                return failed(0.0, first.unwrap_or_default());
            }
        };
        let recorder = record.map(|path| Recorder::create(path, RecordFormat::Csv, &engine, true)).transpose();
        let mut recorder = match recorder {
            Ok(recorder) => recorder,
            Err(error) => return failed(0.0, format!("the recording cannot be created: {error}")),
        };
        let mut observer = Observer::new(self, &engine);
        let outcome = run_virtual(&mut engine, self.for_s, is_interrupted, &mut |engine| {
            observer.observe(engine);
            if let Some(recorder) = &mut recorder {
                recorder.record(engine);
            }
        });
        let written = recorder.map_or(Ok(0), Recorder::finish);
        let time = seconds(outcome.time);
        let is_short = time + 1.5 * seconds(engine.period()) < self.for_s;
        let failure = match (&outcome.end, &written) {
            (End::Interrupted, _) => return None,
            (End::Fault(fault), _) => Some(fault.to_string()),
            (_, Err(error)) => Some(format!("the recording cannot be written: {error}")),
            (End::Finished, _) if is_short => {
                Some(format!("a device has no more samples after {time:.3} s, before `for_s` is over"))
            }
            _ => observer.failure(),
        };
        match failure {
            Some(failure) => failed(time, failure),
            None => Some(Trial { seed, time, failure, figures: observer.figures(&engine, outcome.end == End::Done) }),
        }
    }

    fn seeded(&self, seed: Option<u64>) -> Request {
        let set = seed.iter().flat_map(|seed| self.seed_keys.iter().map(move |key| format!("{key}={seed}")));
        Request { set: set.collect(), ..self.request.clone() }
    }
}

fn seconds(nanos: i64) -> f64 {
    nanos as f64 * 1e-9
}

/// Collects the readings of every check during a run.
struct Observer<'s> {
    scenario: &'s Scenario,
    from: Option<ScalarId>,
    never_lost: Option<ScalarId>,
    /// The value of each check, and the value to subtract.
    values: Vec<(ScalarId, Option<ScalarId>)>,
    /// Time 0 of all figures in the graph's clock [ns].
    zero: Option<i64>,
    readings: Vec<Vec<Reading>>,
    /// Number of ticks in which the flag `never_lost` is not set.
    lost: u64,
    /// Number of ticks outside the mode `stays_in` after it was reached.
    away: u64,
    has_reached: bool,
}

impl<'s> Observer<'s> {
    fn new(scenario: &'s Scenario, engine: &Engine) -> Self {
        let find = |name: &String| PortColumns::find(engine.ports(), name).expect("the lookup found every column");
        let values = scenario.checks.iter().map(|check| (find(&check.column), check.minus.as_ref().map(find)));
        Self {
            scenario,
            from: scenario.from.as_ref().map(|(_, column)| find(column)),
            never_lost: scenario.never_lost.as_ref().map(find),
            values: values.collect(),
            zero: None,
            readings: vec![Vec::new(); scenario.checks.len()],
            lost: 0,
            away: 0,
            has_reached: false,
        }
    }

    fn observe(&mut self, engine: &Engine) {
        let (bus, tick) = (engine.bus(), engine.ticks());
        if let Some(mode) = &self.scenario.stays_in {
            let is_in = engine.mode() == Some(mode);
            self.has_reached |= is_in;
            self.away += u64::from(self.has_reached && !is_in);
        }
        let is_set = |flag: Option<ScalarId>| flag.is_none_or(|flag| bus.scalar(flag) == Some(1.0));
        if self.zero.is_none() && is_set(self.from) {
            self.zero = Some(engine.now());
        }
        let Some(zero) = self.zero else { return };
        self.lost += u64::from(!is_set(self.never_lost));
        let time = seconds(engine.now() - zero);
        let read = |scalar: ScalarId| bus.scalar(scalar).unwrap_or(f64::NAN);
        for (((of, minus), check), readings) in self.values.iter().zip(&self.scenario.checks).zip(&mut self.readings) {
            let value = check.nearest((read(*of) - minus.map_or(0.0, read)) / check.unit);
            readings.push(Reading { time, value, is_new: bus.scalar_freshness(*of, tick) == Freshness::New });
        }
    }

    /// Returns why nothing can be measured, if that is so.
    fn failure(&self) -> Option<String> {
        let (flag, _) = self.scenario.from.as_ref()?;
        self.zero.is_none().then(|| format!("`{flag}` was never set, so the figures have no time 0"))
    }

    /// Returns every figure, in the order of the scenario's rows.
    fn figures(&self, engine: &Engine, is_done: bool) -> Vec<Option<f64>> {
        let period = seconds(engine.period());
        let checks = self.scenario.checks.iter().zip(&self.readings);
        let mut figures: Vec<Option<f64>> = checks.flat_map(|(check, readings)| check.figures(readings)).collect();
        figures.extend(self.never_lost.map(|_| Some(self.lost as f64 * period)));
        let away = self.has_reached.then_some(self.away as f64 * period);
        figures.extend(self.scenario.stays_in.as_ref().map(|_| away));
        let ends = |mode: &String| engine.mode() == Some(mode) || (mode == DONE && is_done);
        figures.extend(self.scenario.ends_in.as_ref().map(|mode| Some(f64::from(u8::from(ends(mode))))));
        figures
    }
}

impl Check {
    /// Shifts the direction of a line by half turns, so that it is nearest to the target of the check, or to 0.
    fn nearest(&self, value: f64) -> f64 {
        let about = self.settles.map_or(0.0, |(target, _)| target);
        self.period.map_or(value, |period| value - period * ((value - about) / period).round())
    }

    /// Returns the figures of the readings from time 0 on.
    fn figures(&self, readings: &[Reading]) -> Vec<Option<f64>> {
        let response = self.settles.and_then(|(target, within)| measure::response(readings, target, within));
        let end = readings.last().map_or(0.0, |last| last.time);
        let steady = since(readings, (end - self.steady).max(response.unwrap_or(0.0)));
        let after = since(readings, self.after.unwrap_or(0.0));
        // A value that has not settled has no deviation around its target, unless the check sets `after_s`.
        let from = self.after.or(response).or(self.settles.is_none().then_some(0.0));
        let figure = |figure: &Figure| match figure {
            Figure::Response => response,
            Figure::Error => measure::mean(steady).zip(self.settles).map(|(mean, (target, _))| (mean - target).abs()),
            Figure::Mean => measure::mean(after),
            Figure::Std => measure::std(since(readings, from?)),
            Figure::Max => measure::max(after),
            Figure::Min => measure::min(after),
            Figure::Lost | Figure::Away | Figure::Ends => None,
        };
        self.figures.iter().map(figure).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A decay from 2 with a time constant of 0.5 s, for 4 s.
    fn decay() -> Vec<Reading> {
        let at = |tick: u32| f64::from(tick) * 0.004;
        (0..=1000).map(|tick| Reading { time: at(tick), value: 2.0 * (-at(tick) / 0.5).exp(), is_new: true }).collect()
    }

    /// Mean and variance of the decay from time `from` on, as integrals.
    fn expected(from: f64) -> (f64, f64) {
        let (length, start, end) = (4.0 - from, (-from / 0.5).exp(), (-4.0f64 / 0.5).exp());
        let mean = 2.0 * 0.5 * (start - end) / length;
        (mean, 4.0 * 0.25 * (start * start - end * end) / length - mean * mean)
    }

    #[test]
    fn the_steady_state_begins_after_the_response_and_the_deviation_at_after_s() {
        let figures = vec![Figure::Response, Figure::Error, Figure::Std];
        let check = |after, steady| Check {
            column: String::new(),
            minus: None,
            period: None,
            unit: 1.0,
            settles: Some((0.0, 0.3)),
            after,
            steady,
            figures: figures.clone(),
        };
        let response = check(None, 10.0).figures(&decay())[0].unwrap();
        assert!((response - 0.967).abs() < 0.005, "{response}");
        // `after_s`, `steady_s`, and the times from which the error and the deviation are measured.
        let cases = [
            (None, 10.0, response, response),
            (None, 2.0, 2.0, response),
            (Some(2.5), 10.0, response, 2.5),
            (Some(0.1), 1.0, 3.0, 0.1),
        ];
        for (after, steady, of_error, of_std) in cases {
            let figures = check(after, steady).figures(&decay());
            let (error, std) = (expected(of_error).0, expected(of_std).1.sqrt());
            assert!(
                (figures[1].unwrap() / error - 1.0).abs() < 0.01,
                "{after:?} {steady}: {:?}, not {error}",
                figures[1]
            );
            assert!((figures[2].unwrap() / std - 1.0).abs() < 0.01, "{after:?} {steady}: {:?}, not {std}", figures[2]);
        }
    }
}
