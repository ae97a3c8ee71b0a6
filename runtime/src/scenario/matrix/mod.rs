//! The fault matrix: every fault of the `table` strikes a task in each of its phases, and grows until the outcome
//! changes.
//!
//! `scene` finds what there is to see in a task, `attack` runs it, `phases` finds when to strike, and `judge` judges a
//! run beside the one without a fault. A fault is an entry `[[inject]]`, so a scenario can repeat it.

mod attack;
mod judge;
mod phases;
mod scene;
mod table;

use std::path::Path;

use serde::Serialize;

use super::inject::{InjectTable, Injection, blocks, resolve};
use crate::catalogue::Catalogue;
use crate::graph::{Compiled, Request, compile};
use crate::node::Reader;
use crate::source::{Report, SourceMap, parse_table, quoted};
use attack::{Course, Run, run};
use judge::{Strike, judge};
use phases::{missing, phases};
use scene::Scene;
use table::{Row, TABLE};

pub use judge::Attack;
pub use table::{Fate, Phase, described};

/// Longest run without a fault, and time for which a run goes on after a fault strikes [s].
const REFERENCE_S: f64 = 20.0;
const AFTER_S: f64 = 3.0;

/// The matrix of a task on a bench.
#[derive(Debug)]
pub struct Matrix {
    request: Request,
    scene: Scene,
    seed: u64,
    reference: Run,
    phases: [Option<f64>; 6],
}

/// One cell: a fault in a phase.
#[derive(Debug, Clone, Serialize)]
pub struct Cell {
    /// Name of the fault.
    pub fault: String,
    /// The phase in which it strikes.
    pub phase: Phase,
    /// When it strikes [s].
    pub at_s: Option<f64>,
    /// What may come of the smallest severity.
    pub expected: Vec<Fate>,
    /// What the severity is.
    pub unit: String,
    /// The runs, from the smallest severity on.
    pub attacks: Vec<Attack>,
    /// Why there is none.
    pub not_run: Option<String>,
}

impl Cell {
    /// Whether the outcome is an expected one and no promise is broken.
    #[must_use]
    pub fn has_passed(&self) -> bool {
        let is_expected = self.attacks.first().is_none_or(|attack| self.expected.contains(&attack.fate));
        is_expected && self.attacks.iter().all(|attack| attack.broken.is_empty())
    }

    /// Returns the largest severity whose outcome is that of the smallest, and the one at which it changes.
    #[must_use]
    pub fn margin(&self) -> Option<(f64, Option<f64>)> {
        let first = self.attacks.first()?;
        let is_same = |attack: &&Attack| attack.fate == first.fate && attack.broken.is_empty();
        let same = self.attacks.iter().take_while(is_same).count();
        let last = self.attacks.get(same.checked_sub(1)?)?;
        Some((last.severity, self.attacks.get(same).map(|attack| attack.severity)))
    }
}

/// Why there is no matrix of a task.
#[derive(Debug)]
pub enum Refusal {
    /// Its files have mistakes.
    Report(Report),
    /// It cannot be judged.
    Message(String),
}

impl Matrix {
    /// Loads a task, runs it once without a fault and finds its phases. Returns `None` if it was interrupted.
    ///
    /// # Errors
    /// If the task does not load, runs in real time, has no pad with a true force, or ends in a fault.
    pub fn load(
        catalogue: &Catalogue,
        graph: &Path,
        bench: Option<&Path>,
        seed: u64,
        is_interrupted: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, Refusal> {
        let request = Request { bench: bench.map(Path::to_owned), ..Request::file(graph) };
        let compiled = compile(catalogue, &request).map_err(Refusal::Report)?;
        let refuse = |message: &str| Err(Refusal::Message(message.to_owned()));
        if compiled.is_live() {
            return refuse("a device of this bench runs in real time: use a simulated bench, with `--bench`");
        }
        let Some(request) = with_truth(catalogue, &compiled, request) else {
            return refuse(
                "no pad of this task has a true force, so nothing can be judged: use a simulated bench, with `--bench`",
            );
        };
        let request = seeded(catalogue, &compiled, request, seed);
        let scene = Scene::of(&compile(catalogue, &request).map_err(Refusal::Report)?, catalogue);
        let course = Course { until: REFERENCE_S, stop: None };
        let reference = run((catalogue, &request), &scene, &[], seed, course, is_interrupted);
        let Some(reference) = reference.map_err(Refusal::Message)? else { return Ok(None) };
        if let Some(fault) = &reference.fault {
            return refuse(&format!("the task ends in a fault without any fault of the matrix: {fault}"));
        }
        let phases = phases(&reference);
        Ok(Some(Self { request, scene, seed, reference, phases }))
    }

    /// Returns the phases that the task does not have, each with the reason.
    pub fn missing(&self) -> impl Iterator<Item = (Phase, &'static str)> {
        let phases = Phase::ALL.into_iter().zip(self.phases);
        phases.filter(|(_, at)| at.is_none()).map(|(phase, _)| (phase, missing(phase)))
    }

    /// Returns the cells of the faults and the phases with these names, or of all: the number of the fault, and the phase.
    ///
    /// # Errors
    /// If there is no fault or no phase with a name.
    pub fn cells(&self, faults: &[String], phases: &[String]) -> Result<Vec<(usize, Phase)>, String> {
        let (rows, known) =
            (TABLE.rows.iter().map(|row| row.name.as_str()), Phase::ALL.iter().map(|phase| phase.name()));
        let rows = wanted("fault", faults, &rows.collect::<Vec<_>>())?;
        let phases = wanted("phase", phases, &known.collect::<Vec<_>>())?;
        let here = phases.into_iter().filter(|phase| self.phases[*phase].is_some());
        let here: Vec<Phase> = here.map(|phase| Phase::ALL[phase]).collect();
        Ok(rows.into_iter().flat_map(|row| here.iter().map(move |phase| (row, *phase))).collect())
    }

    /// Attacks the task with a fault in a phase, with growing severity until the outcome changes. Returns `None` if it was
    /// interrupted.
    #[must_use]
    pub fn attack(
        &self,
        catalogue: &Catalogue,
        (number, phase): (usize, Phase),
        is_interrupted: &dyn Fn() -> bool,
    ) -> Option<Cell> {
        let row = &TABLE.rows[number];
        let (at_s, expected) = (self.phases[phase as usize], row.expected(phase));
        let (fault, unit) = (row.name.clone(), row.unit.clone());
        let mut cell = Cell { fault, phase, at_s, expected, unit, attacks: Vec::new(), not_run: None };
        let at = at_s?;
        for severity in &row.severities {
            let strike = Strike { row, severity: *severity, phase, at };
            match self.strike(catalogue, strike, is_interrupted) {
                Ok(attack) => cell.attacks.push(attack?),
                Err(why) => {
                    cell.not_run = Some(why);
                    break;
                }
            }
            let is_first = cell.attacks.len() == 1;
            let last = cell.attacks.last()?;
            let has_changed = last.fate != cell.attacks[0].fate || is_first && !cell.expected.contains(&last.fate);
            if has_changed || !last.broken.is_empty() {
                break;
            }
        }
        Some(cell)
    }

    fn strike(
        &self,
        catalogue: &Catalogue,
        strike: Strike<'_>,
        is_interrupted: &dyn Fn() -> bool,
    ) -> Result<Option<Attack>, String> {
        let Strike { row, severity, phase, at } = strike;
        let (entry, injections) = self.injections(catalogue, row, severity, at)?;
        let stop = (phase == Phase::Ramping).then_some(at);
        let course = Course { until: at + AFTER_S, stop };
        let run = run((catalogue, &self.request), &self.scene, &injections, self.seed, course, is_interrupted)?;
        Ok(run.map(|run| judge(&self.scene, strike, [&self.reference, &run], entry)))
    }

    /// Returns a fault as an entry of a scenario, and resolved.
    fn injections(
        &self,
        catalogue: &Catalogue,
        row: &Row,
        severity: f64,
        at: f64,
    ) -> Result<(String, Vec<Injection>), String> {
        let side = &self.scene.sides[0];
        let (arm, joints) = self.scene.arm.clone().unwrap_or_default();
        let role = if row.is_of_commands() { &arm } else { &side.pad };
        if role.is_empty() {
            return Err("the task commands no arm".to_owned());
        }
        let entry = row.entry(severity, [role, &format!("{at:.3}")], self.reference.largest, &joints, side.cells);
        let mut compiled =
            compile(catalogue, &self.request).map_err(|_| "the task does not load any more".to_owned())?;
        let mut found = Vec::new();
        let injections = resolve(read(&entry)?, &mut compiled, &mut found);
        found.first().map_or(Ok((entry, injections)), |mistake| Err(mistake.message.clone()))
    }
}

/// Returns the numbers of the names that are wanted, in the order in which they are known; without any, all.
fn wanted(what: &str, names: &[String], known: &[&str]) -> Result<Vec<usize>, String> {
    if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(format!("there is no {what} `{name}`: the {what}s are {}", quoted(known)));
    }
    Ok((0..known.len()).filter(|i| names.is_empty() || names.iter().any(|name| name == known[*i])).collect())
}

/// Reads entries `[[inject]]`.
fn read(text: &str) -> Result<Vec<InjectTable>, String> {
    let mut sources = SourceMap::default();
    let root = parse_table(sources.add("matrix", text, "")).map_err(|mistake| mistake.message)?;
    let mut reader = Reader::new(&sources);
    let blocks = root.as_table().map(|root| blocks(root, &mut reader)).unwrap_or_default();
    let wrong = reader.mistakes.first().map(|mistake| mistake.message.clone());
    let wrong = wrong.or_else(|| blocks.iter().find_map(|block| Some(block.mistake(None)?.message)));
    wrong.map_or_else(|| Ok(blocks.into_iter().filter_map(|block| block.table).collect()), Err)
}

/// Returns the request with the true values of a pad bound, or `None` if no device knows them.
fn with_truth(catalogue: &Catalogue, compiled: &Compiled, request: Request) -> Option<Request> {
    let sees = |request: &Request| {
        compile(catalogue, request).is_ok_and(|compiled| !Scene::of(&compiled, catalogue).sides.is_empty())
    };
    if sees(&request) {
        return Some(request);
    }
    let devices = compiled.outline().roles.iter().map(|role| role.device.text.split('.').next().unwrap_or_default());
    let bound = devices.flat_map(|device| {
        let observed = catalogue.roles().iter().filter(|role| role.is_observed);
        observed.map(move |role| format!("bind.{}={device}", role.observed_name()))
    });
    bound.map(|bound| request.clone().set(bound)).find(sees)
}

/// Returns the request with a seed for each device that has one.
fn seeded(catalogue: &Catalogue, compiled: &Compiled, request: Request, seed: u64) -> Request {
    let has_seed = |kind: &str| {
        catalogue.find_device(kind).is_some_and(|device| device.params().iter().any(|param| param.name == "seed"))
    };
    let devices = compiled.outline().devices.iter().filter(|device| has_seed(&device.kind.text));
    devices.fold(request, |request, device| request.set(format!("devices.{}.seed={seed}", device.name)))
}
