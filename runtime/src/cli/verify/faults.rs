//! `verify --faults`: the fault matrix of a task.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;
use tracing::subscriber::{NoSubscriber, with_default};

use super::{VerifyArgs, in_parallel};
use crate::cli::shell::patience::Patience;
use crate::cli::shell::{FAULTED, Shell};
use crate::cli::text::number::{count_of, number};
use crate::cli::text::table::table;
use crate::engine::Interrupt;
use crate::scenario::matrix::{Attack, Cell, Matrix, Phase, Refusal};

const HEADER: [&str; 9] =
    ["fault", "phase", "expected", "seen", "force [N]", "bound [N]", "same up to", "changes at", ""];

/// Attacks a task with every fault in every phase, and prints a row for each.
pub(super) fn verify_faults(graph: &Path, args: &VerifyArgs, shell: &Shell) -> Result<u8, String> {
    let interrupt = Arc::new(Interrupt::catch().map_err(|error| format!("cannot run: {error}"))?);
    let patience = Patience::Interruptible(interrupt.clone());
    shell.set_patience(&patience);
    let is_interrupted = || interrupt.is_requested();
    let (catalogue, seed) = (shell.catalogue(), args.seed.unwrap_or(1));
    let matrix = match Matrix::load(catalogue, graph, args.bench.as_deref(), seed, &is_interrupted) {
        Ok(Some(matrix)) => matrix,
        Ok(None) => return Err("interrupted".to_owned()),
        Err(Refusal::Report(report)) => return Ok(shell.reject(&report)),
        Err(Refusal::Message(message)) => return Err(message),
    };
    let work = matrix.cells(&args.only, &args.phase)?;
    // Halts are what a fault should cause, so they are no warnings here.
    let attack = |i: usize| with_default(NoSubscriber::new(), || matrix.attack(catalogue, work[i], &is_interrupted));
    let cells = in_parallel(work.len(), "cells", args.jobs, shell, &attack);
    shell.set_patience(&patience.after_run());
    let cells: Vec<Cell> = cells.into_iter().filter_map(std::sync::OnceLock::into_inner).collect();
    let is_complete = cells.len() == work.len();
    let ok = is_complete && cells.iter().all(Cell::has_passed);
    if args.is_json() {
        let missing = matrix.missing().map(|(phase, why)| MissingJson { phase, why }).collect();
        let rows = cells.iter().map(|cell| CellJson { ok: cell.has_passed(), cell }).collect();
        shell.say_json(&FaultsJson { ok, graph: graph.display().to_string(), seed, missing, cells: rows });
    } else {
        shell.say(text(&matrix, &cells, shell.has_colour()).trim_end());
    }
    if !is_complete {
        shell.error("interrupted: some cells are missing");
    }
    Ok(if ok { 0 } else { FAULTED })
}

/// Writes the table, the broken promises with the entry that repeats each, and what is not there.
fn text(matrix: &Matrix, cells: &[Cell], has_colour: bool) -> String {
    let mut rows = vec![HEADER.map(String::from)];
    rows.extend(cells.iter().map(|cell| row(cell, has_colour)));
    let mut text = table(&rows, 4, 8);
    for (phase, why) in matrix.missing() {
        text.push_str(&format!("\nno phase `{}`: {why}", phase.name()));
    }
    for cell in cells.iter().filter(|cell| !cell.has_passed()) {
        let Some(attack) = cell.attacks.last() else { continue };
        let promises = if attack.broken.is_empty() { unexpected(attack) } else { attack.broken.join("; ") };
        text.push_str(&format!(
            "\n\n{}, {}: {promises}. It comes again with:\n{}",
            cell.fault,
            cell.phase.name(),
            attack.inject
        ));
    }
    let failed = cells.iter().filter(|cell| !cell.has_passed()).count();
    let runs = cells.iter().map(|cell| cell.attacks.len()).sum();
    let not_run = cells.iter().filter(|cell| cell.attacks.is_empty()).count();
    let passed = cells.len() - failed - not_run;
    format!("{text}\n\n{passed} passed, {failed} failed, {not_run} not run, in {}\n", count_of(runs, "run"))
}

fn unexpected(attack: &Attack) -> String {
    let cause = attack.cause.as_ref().map_or_else(String::new, |cause| format!(" ({cause})"));
    format!("it {}{cause}", attack.fate.name())
}

fn row(cell: &Cell, has_colour: bool) -> [String; 9] {
    let (text, colour) = match (cell.attacks.is_empty(), cell.has_passed()) {
        (true, _) => ("not run", "\x1b[33m"),
        (_, true) => ("passed", "\x1b[32m"),
        (_, false) => ("FAILED", "\x1b[1;31m"),
    };
    let mark = if has_colour { format!("{colour}{text}\x1b[0m") } else { text.to_owned() };
    let expected: Vec<&str> = cell.expected.iter().map(|fate| fate.name()).collect();
    let first = cell.attacks.first();
    let most = cell.attacks.iter().max_by(|a, b| a.force_n.total_cmp(&b.force_n));
    let of = |severity: f64| format!("{severity} {}", cell.unit).trim_end().to_owned();
    let (same, changes) = cell.margin().map_or((String::new(), None), |(same, changes)| (of(same), changes));
    let change = cell.attacks.last().map_or("", |attack| attack.fate.name());
    [
        cell.fault.clone(),
        cell.phase.name().to_owned(),
        expected.join(" or "),
        cell.not_run.clone().unwrap_or_else(|| first.map_or("", |attack: &Attack| attack.fate.name()).to_owned()),
        most.map_or_else(String::new, |attack| number(attack.force_n)),
        most.and_then(|attack| attack.bound_n).map_or_else(String::new, number),
        same,
        changes.map_or_else(|| "-".to_owned(), |severity| format!("{}: {change}", of(severity))),
        mark,
    ]
}

/// The matrix as JSON.
#[derive(Serialize)]
struct FaultsJson<'a> {
    ok: bool,
    graph: String,
    seed: u64,
    /// The phases that the task does not have.
    missing: Vec<MissingJson>,
    cells: Vec<CellJson<'a>>,
}

#[derive(Serialize)]
struct MissingJson {
    phase: Phase,
    why: &'static str,
}

#[derive(Serialize)]
struct CellJson<'a> {
    ok: bool,
    #[serde(flatten)]
    cell: &'a Cell,
}
