//! One run of a scenario, with one seed.

use std::path::Path;

use super::judge::{Figure, Row};
use super::measure::{self, Reading, since};
use super::model::{Check, Scenario};
use crate::catalogue::Catalogue;
use crate::engine::{End, Engine, run_virtual};
use crate::graph::{Request, compile};
use crate::node::PortId;
use crate::record::{Columns, Format, Recorder};
use crate::signal::{Features, Freshness, Shape, Signal};

/// What a scenario calls the end that a mode says the task has come to.
pub(super) const DONE: &str = "done";

/// How a run went.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Its seed, if it has one.
    pub seed: Option<u64>,
    /// How long it was [s].
    pub time: f64,
    /// Why it is of no use, if it is: a fault, say.
    pub failure: Option<String>,
    /// Every figure, in the order of the scenario's rows; none where it could not be measured.
    pub figures: Vec<Option<f64>>,
}

impl Scenario {
    /// Every figure over all runs, in the order of the file.
    #[must_use]
    pub fn rows(&self, trials: &[Trial]) -> Vec<Row> {
        let mut rows = self.rows.clone();
        for (i, row) in rows.iter_mut().enumerate() {
            row.values = trials.iter().map(|trial| trial.figures[i]).collect();
        }
        rows
    }

    /// Runs it with one seed, and records each tick in a file if there is one. None if it was interrupted.
    #[must_use]
    pub fn run(
        &self,
        catalogue: &Catalogue,
        seed: Option<u64>,
        record: Option<&Path>,
        is_interrupted: &dyn Fn() -> bool,
    ) -> Option<Trial> {
        let failed = |time: f64, why: String| {
            Some(Trial { seed, time, failure: Some(why), figures: vec![None; self.rows.len()] })
        };
        let mut engine = match compile(catalogue, &self.seeded(seed)) {
            Ok(plan) => Engine::new(plan),
            Err(report) => {
                let first = report.diagnostics.first().map(|first| first.message.clone());
                return failed(0.0, first.unwrap_or_default());
            }
        };
        let recorder = record.map(|path| Recorder::create(path, Format::Csv, &engine, true)).transpose();
        let mut recorder = match recorder {
            Ok(recorder) => recorder,
            Err(error) => return failed(0.0, format!("the record cannot be made: {error}")),
        };
        let mut watch = Watch::new(self, &engine);
        let outcome = run_virtual(&mut engine, self.for_s, is_interrupted, &mut |engine| {
            watch.look(engine);
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
            (_, Err(error)) => Some(format!("the record cannot be written: {error}")),
            (End::Finished, _) if is_short => Some(format!("the samples of a device end after {time:.3} s")),
            _ => watch.failure(),
        };
        match failure {
            Some(why) => failed(time, why),
            None => Some(Trial { seed, time, failure, figures: watch.figures(&engine, outcome.end == End::Done) }),
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

/// Where a column is read, and how it is known to be new.
#[derive(Debug, Clone, Copy)]
struct Eye {
    column: usize,
    port: PortId,
    /// Of a feature vector, which: each has a freshness of its own.
    component: Option<usize>,
}

impl Eye {
    fn new(engine: &Engine, columns: &Columns, name: &str) -> Self {
        let column = columns.list.iter().position(|column| column.name == name).expect("it was looked up");
        let has_it = |port: &crate::graph::PlannedPort| Columns::of(port).iter().position(|known| known.name == name);
        let found = engine.ports().iter().find_map(|(port, id)| Some((port, *id, has_it(port)?)));
        let (port, id, part) = found.expect("a column is of a port");
        Self { column, port: id, component: matches!(port.shape, Shape::Features(_)).then_some(part) }
    }

    fn is_new(&self, engine: &Engine) -> bool {
        let (bus, tick) = (engine.bus(), engine.ticks());
        let freshness = match self.component {
            Some(component) => {
                Features::arena(&bus.arenas)[self.port.slot as usize].components()[component].freshness(tick)
            }
            None => bus.marks[self.port.mark as usize].freshness(tick),
        };
        freshness == Freshness::New
    }
}

/// Looks at every tick of a run.
struct Watch<'s> {
    scenario: &'s Scenario,
    columns: Columns,
    row: Vec<f64>,
    from: Option<Eye>,
    never_lost: Option<Eye>,
    eyes: Vec<(Eye, Option<Eye>)>,
    /// Time 0 of all figures in the graph's clock [ns].
    zero: Option<i64>,
    readings: Vec<Vec<Reading>>,
    /// Ticks in which the flag that is never lost is so, and those out of the mode that is not left.
    lost: u64,
    away: u64,
    has_reached: bool,
}

impl<'s> Watch<'s> {
    fn new(scenario: &'s Scenario, engine: &Engine) -> Self {
        let columns = Columns::new(engine.ports());
        let eye = |name: &String| Eye::new(engine, &columns, name);
        Self {
            scenario,
            row: vec![0.0; columns.list.len()],
            from: scenario.from.as_ref().map(|(_, column)| eye(column)),
            never_lost: scenario.never_lost.as_ref().map(eye),
            eyes: scenario.checks.iter().map(|check| (eye(&check.column), check.minus.as_ref().map(eye))).collect(),
            zero: None,
            readings: vec![Vec::new(); scenario.checks.len()],
            lost: 0,
            away: 0,
            has_reached: false,
            columns,
        }
    }

    fn look(&mut self, engine: &Engine) {
        self.columns.read(engine.bus(), &mut self.row);
        if let Some(mode) = &self.scenario.stays_in {
            let is_in = engine.mode() == Some(mode);
            self.has_reached |= is_in;
            self.away += u64::from(self.has_reached && !is_in);
        }
        let is_set = |eye: Option<Eye>| eye.is_none_or(|eye| self.row[eye.column] == 1.0);
        if self.zero.is_none() && is_set(self.from) {
            self.zero = Some(engine.now());
        }
        let Some(zero) = self.zero else { return };
        self.lost += u64::from(!is_set(self.never_lost));
        let time = seconds(engine.now() - zero);
        for (((eye, minus), check), readings) in self.eyes.iter().zip(&self.scenario.checks).zip(&mut self.readings) {
            let off = minus.map_or(0.0, |minus| self.row[minus.column]);
            let value = check.nearest((self.row[eye.column] - off) / check.unit);
            readings.push(Reading { time, value, is_new: eye.is_new(engine) });
        }
    }

    /// Why there is nothing to measure.
    fn failure(&self) -> Option<String> {
        let (flag, _) = self.scenario.from.as_ref()?;
        self.zero.is_none().then(|| format!("`{flag}` was never set, so that no figure has a time 0"))
    }

    /// Every figure, in the order of the scenario's rows.
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
    /// A direction as it is nearest to where it settles, or to 0: lines know no half turns.
    fn nearest(&self, value: f64) -> f64 {
        let about = self.settles.map_or(0.0, |(target, _)| target);
        self.period.map_or(value, |period| value - period * ((value - about) / period).round())
    }

    /// Its figures, of what was read from time 0 on.
    fn figures(&self, readings: &[Reading]) -> Vec<Option<f64>> {
        let response = self.settles.and_then(|(target, within)| measure::response(readings, target, within));
        let end = readings.last().map_or(0.0, |last| last.time);
        let steady = since(readings, (end - self.steady).max(response.unwrap_or(0.0)));
        let after = since(readings, self.after.unwrap_or(0.0));
        // What has not settled has no deviation from where it settles, unless the check says from when on it counts.
        let from = self.after.or(response).or(self.settles.is_none().then_some(0.0));
        let figure = |figure: &Figure| match figure {
            Figure::Response => response,
            Figure::Error => measure::mean(steady).zip(self.settles).map(|(mean, (target, _))| (mean - target).abs()),
            Figure::Mean => measure::mean(after),
            Figure::Std => measure::std(since(readings, from?)),
            Figure::Max => measure::greatest(after),
            Figure::Min => measure::least(after),
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

    /// Mean and variance of the decay from `from` on, as integrals.
    fn expected(from: f64) -> (f64, f64) {
        let (length, start, end) = (4.0 - from, (-from / 0.5).exp(), (-4.0f64 / 0.5).exp());
        let mean = 2.0 * 0.5 * (start - end) / length;
        (mean, 4.0 * 0.25 * (start * start - end * end) / length - mean * mean)
    }

    #[test]
    fn a_short_steady_state_begins_with_the_response_and_a_deviation_when_it_is_told_to() {
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
        // When it is looked at, how long its end is, and from when on the error and the deviation are taken.
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
