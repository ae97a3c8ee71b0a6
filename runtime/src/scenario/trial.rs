//! One run of a scenario, with one seed.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use super::inject::inject;
use super::judge::FigureRow;
use super::model::Scenario;
use super::observer::{NotChecked, Observer, seconds};
use super::run_file::RunFile;
use super::vary::assignment;
use crate::catalogue::Catalogue;
use crate::engine::{End, Engine, run_virtual};
use crate::graph::{Request, compile};

/// The result of one run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trial {
    /// The seed, if the scenario has seeds.
    pub seed: Option<u64>,
    /// The parameters that vary between the runs, with the values of this one.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub varied: BTreeMap<String, f64>,
    /// Duration of the run [s].
    #[serde(rename = "time_s")]
    pub time: f64,
    /// Why the run cannot be measured, for example a fault.
    pub failure: Option<String>,
    /// The checks without a tick to check; their figures could not be measured.
    pub not_checked: Vec<NotChecked>,
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
            let is_of_check = i < self.checks.iter().map(|check| check.figures.len()).sum::<usize>();
            let is_not_checked = |trial: &&Trial| trial.not_checked.iter().any(|one| one.check == row.check);
            row.not_checked = trials.iter().filter(|trial| is_of_check && is_not_checked(trial)).count();
        }
        rows
    }

    /// Runs the scenario with one seed, and records every tick to the file `record`, if it is given: its numbers, or the
    /// whole run if the name ends in .mcap. Returns `None` if the run was interrupted.
    #[must_use]
    pub fn run(
        &self,
        catalogue: &Catalogue,
        seed: Option<u64>,
        record: Option<&Path>,
        is_interrupted: &dyn Fn() -> bool,
    ) -> Option<Trial> {
        let failed = |time: f64, failure: String| {
            let figures = vec![None; self.rows.len()];
            Some(Trial {
                seed,
                varied: self.varied(seed),
                time,
                failure: Some(failure),
                not_checked: Vec::new(),
                figures,
            })
        };
        let request = self.seeded(seed);
        let mut engine = match compile(catalogue, &request) {
            Ok(mut compiled) => {
                inject(&mut compiled, &self.injections, seed.unwrap_or(0));
                Engine::new(compiled)
            }
            Err(report) => {
                let first = report.diagnostics.first().map(|first| first.message.clone());
                return failed(0.0, first.unwrap_or_default());
            }
        };
        let recorder = record.map(|path| RunFile::create(path, &mut engine, &request, seed)).transpose();
        let mut recorder = match recorder {
            Ok(recorder) => recorder,
            Err(error) => return failed(0.0, format!("the recording cannot be created: {error}")),
        };
        let mut observer = Observer::new(self, &engine);
        let outcome = run_virtual(&mut engine, self.for_s, is_interrupted, &mut |engine| {
            observer.observe(engine);
            if let Some(recorder) = &mut recorder {
                recorder.record(engine, || !is_interrupted());
            }
        });
        let unwritten = recorder.and_then(|recorder| recorder.finish(&engine, &outcome.end));
        let time = seconds(outcome.time);
        let is_short = time + 1.5 * seconds(engine.period()) < self.for_s;
        let failure = match (&outcome.end, &unwritten) {
            (End::Interrupted, _) => return None,
            (End::Fault(fault), _) => Some(fault.to_string()),
            (_, Some(error)) => Some(format!("the recording cannot be written: {error}")),
            (End::Finished, _) if is_short => {
                Some(format!("a device has no more samples after {time:.3} s, before `for_s` is over"))
            }
            _ => observer.failure(),
        };
        match failure {
            Some(failure) => failed(time, failure),
            None => {
                let figures = observer.figures(&engine, outcome.end == End::Done);
                Some(Trial {
                    seed,
                    varied: self.varied(seed),
                    time,
                    failure,
                    not_checked: observer.not_checked(),
                    figures,
                })
            }
        }
    }

    fn seeded(&self, seed: Option<u64>) -> Request {
        let seeds = seed.iter().flat_map(|seed| self.seed_keys.iter().map(move |key| format!("{key}={seed}")));
        let varied = self.varied(seed);
        let set = seeds.chain(varied.iter().map(|(path, value)| assignment(path, *value)));
        Request { set: set.collect(), ..self.request.clone() }
    }

    /// Returns the values of the parameters that vary, in the run with this seed.
    fn varied(&self, seed: Option<u64>) -> BTreeMap<String, f64> {
        seed.into_iter().flat_map(|seed| self.vary.drawn(seed)).collect()
    }
}
