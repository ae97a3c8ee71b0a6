//! `verify`: runs scenarios in parallel and compares the results with their checks, or tries the faults of a task.

mod faults;
mod table;
mod verified;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use verified::Verified;

use super::shell::command::OutputFormat;
use super::shell::panics::without_panic_messages;
use super::shell::patience::Patience;
use super::shell::{FAULTED, NOT_LOADED, Shell};
use crate::catalogue::Catalogue;
use crate::engine::Interrupt;
use crate::scenario::{NotChecked, Scenario};

/// Run scenarios and check their results
#[derive(Default, clap::Parser)]
#[command(
    name = "verify",
    after_help = "Examples:
  tactflow verify graphs/scenarios
  tactflow verify graphs/scenarios/table1_ball.toml --seeds 50 --out records
  tactflow verify graphs/scenarios --json > figures.json
  tactflow verify --faults graphs/force.toml --only 'object gone'

Exit codes: 0 every check passed; 1 a check failed, or a run ended in a fault; 2 a scenario does not load."
)]
pub(crate) struct VerifyArgs {
    /// Scenario files, or folders of scenario files
    #[arg(required_unless_present = "faults")]
    paths: Vec<PathBuf>,
    /// Attack this task with every fault in every phase, growing until the outcome changes
    #[arg(long, value_name = "GRAPH", conflicts_with_all = ["paths", "seeds", "out"])]
    faults: Option<PathBuf>,
    /// Bench for `--faults`, instead of the one of the task
    #[arg(long, value_name = "FILE", requires = "faults")]
    bench: Option<PathBuf>,
    /// Seed for `--faults` [default: 1]
    #[arg(long, value_name = "N", requires = "faults")]
    seed: Option<u64>,
    /// Fault for `--faults`, instead of all; several are allowed
    #[arg(long, value_name = "FAULT", requires = "faults")]
    only: Vec<String>,
    /// Phase for `--faults`, instead of all; several are allowed
    #[arg(long, value_name = "PHASE", requires = "faults")]
    phase: Vec<String>,
    /// Run each scenario that has `seeds` with the seeds 1 to N instead of its own
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: Option<u64>,
    /// Number of parallel runs [default: number of cores]
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    jobs: Option<u64>,
    /// Record each run in this folder, as SCENARIO-SEED.csv
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Record each run whole in this folder, as SCENARIO-SEED.mcap
    #[cfg(feature = "mcap")]
    #[arg(long, value_name = "DIR", conflicts_with = "out")]
    record: Option<PathBuf>,
    /// Same as `--format json`
    #[arg(long)]
    json: bool,
    /// Output format
    #[arg(long, value_enum, default_value_t = OutputFormat::Text, value_name = "FORMAT")]
    format: OutputFormat,
}

impl VerifyArgs {
    fn is_json(&self) -> bool {
        self.json || self.format == OutputFormat::Json
    }

    /// Returns the folder of the recordings, and the extension of their names.
    fn records(&self) -> Option<(&Path, &'static str)> {
        #[cfg(feature = "mcap")]
        if let Some(folder) = &self.record {
            return Some((folder, "mcap"));
        }
        self.out.as_deref().map(|folder| (folder, "csv"))
    }
}

pub(crate) fn verify(args: VerifyArgs, shell: &Shell) -> u8 {
    let done = match &args.faults {
        Some(graph) => faults::verify_faults(graph, &args, shell),
        None => verify_all(&args, shell),
    };
    done.unwrap_or_else(|message| shell.refuse(message))
}

/// The results of scenarios, for a page.
#[cfg(feature = "mcap")]
pub(crate) struct ScenarioResults {
    /// How many checks passed and failed.
    pub(crate) title: String,
    /// The rows of the table, with that of the titles.
    pub(crate) rows: Vec<Vec<String>>,
    /// What the scenarios are.
    pub(crate) notes: String,
    /// The mistakes in the files of scenarios that do not load.
    pub(crate) reports: Vec<crate::source::Report>,
    pub(crate) has_passed: bool,
}

/// Runs scenarios, or all of a folder, for a page.
///
/// # Errors
/// If a file cannot be read.
#[cfg(feature = "mcap")]
pub(crate) fn results(paths: Vec<PathBuf>, seeds: Option<u64>, shell: &Shell) -> Result<ScenarioResults, String> {
    let args = VerifyArgs { paths, seeds, ..VerifyArgs::default() };
    let mut all = prepare(&args, shell.catalogue())?;
    let is_complete = run(&mut all, &args, shell)?;
    Ok(ScenarioResults {
        title: table::summary(&all),
        rows: table::rows(&all, false).into_iter().map(Vec::from).collect(),
        notes: table::notes(&all),
        has_passed: is_complete && all.iter().all(Verified::has_passed),
        reports: all.into_iter().filter_map(|verified| verified.loaded.err()).collect(),
    })
}

fn verify_all(args: &VerifyArgs, shell: &Shell) -> Result<u8, String> {
    let mut all = prepare(args, shell.catalogue())?;
    let is_complete = run(&mut all, args, shell)?;
    if args.is_json() {
        shell.say_json(&table::json(&all));
    } else {
        all.iter().filter_map(|verified| verified.loaded.as_ref().err()).for_each(|report| shell.show(report));
        shell.say(table::text(&all, shell.has_colour()).trim_end());
    }
    for verified in &all {
        let run = |seed: Option<u64>| {
            format!("{}{}", verified.name(), seed.map_or_else(String::new, |seed| format!(", seed {seed}")))
        };
        for (why, trial) in verified.failures() {
            let varied =
                if trial.varied.is_empty() { String::new() } else { format!(" ({})", table::sets(&trial.varied)) };
            shell.error(format_args!("{}: {why}{varied}", run(trial.seed)));
        }
        for (NotChecked { check, why }, seed) in verified.not_checked() {
            shell.error(format_args!("{}: check `{check}`: {why}", run(seed)));
        }
    }
    if !is_complete {
        shell.error("interrupted: some runs are missing");
    }
    let has_passed = is_complete && all.iter().all(Verified::has_passed);
    Ok(match all.iter().any(|verified| verified.loaded.is_err()) {
        true => NOT_LOADED,
        false if has_passed => 0,
        false => FAULTED,
    })
}

/// Finds and loads all scenario files.
fn prepare(args: &VerifyArgs, catalogue: &Catalogue) -> Result<Vec<Verified>, String> {
    let mut files = Vec::new();
    for path in &args.paths {
        files.extend(if path.is_dir() { files_of(path)? } else { vec![path.clone()] });
    }
    let load = |path: PathBuf| {
        let loaded = match Scenario::load(catalogue, &path) {
            Ok(scenarios) => scenarios.into_iter().map(Ok).collect(),
            Err(report) => vec![Err(report)],
        };
        loaded.into_iter().map(move |mut loaded| {
            if let (Ok(scenario), Some(count)) = (&mut loaded, args.seeds) {
                scenario.set_seeds(count);
            }
            Verified { path: path.clone(), loaded, trials: Vec::new(), rows: Vec::new() }
        })
    };
    let all: Vec<Verified> = files.into_iter().flat_map(load).collect();
    if let Some((folder, _)) = args.records() {
        let mut names = BTreeSet::new();
        let mut recorded = all.iter().map(|verified| verified.name().replace(' ', "_"));
        if let Some(twice) = recorded.find(|name| !names.insert(name.clone())) {
            return Err(format!("two scenarios would be recorded as `{twice}`: rename a file"));
        }
        std::fs::create_dir_all(folder).map_err(|error| format!("cannot create `{}`: {error}", folder.display()))?;
    }
    Ok(all)
}

/// Returns the scenario files of a folder, sorted by name.
fn files_of(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let paths = std::fs::read_dir(folder).and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
    let mut files: Vec<PathBuf> = paths.map_err(|error| format!("cannot read `{}`: {error}", folder.display()))?;
    files.retain(|path| path.extension().is_some_and(|end| end == "toml"));
    files.sort();
    if files.is_empty() { Err(format!("no scenario in folder `{}`", folder.display())) } else { Ok(files) }
}

/// A run to do: the index of its scenario, and its seed.
type PendingRun = (usize, Option<u64>);

/// Runs all scenarios in parallel and returns whether all runs were completed. The results do not depend on the number
/// of threads.
fn run(all: &mut [Verified], args: &VerifyArgs, shell: &Shell) -> Result<bool, String> {
    let interrupt = Arc::new(Interrupt::catch().map_err(|error| format!("cannot run: {error}"))?);
    let patience = Patience::Interruptible(interrupt.clone());
    shell.set_patience(&patience);
    let runs = |(i, verified): (usize, &Verified)| {
        let seeds: Vec<Option<u64>> = verified.loaded.iter().flat_map(Scenario::runs).collect();
        seeds.into_iter().map(move |seed| (i, seed))
    };
    let work: Vec<PendingRun> = all.iter().enumerate().flat_map(runs).collect();
    let one = |i: usize| {
        let (scenario, seed) = work[i];
        let verified = &all[scenario];
        let record = args.records().map(|(folder, end)| folder.join(record_name(&verified.name(), seed, end)));
        let scenario = verified.loaded.as_ref().ok()?;
        scenario.run(shell.catalogue(), seed, record.as_deref(), &|| interrupt.is_requested())
    };
    let trials = in_parallel(work.len(), "runs", args.jobs, shell, &one);
    shell.set_patience(&patience.after_run());
    let is_complete = trials.iter().all(|trial| trial.get().is_some());
    for ((scenario, _), trial) in work.iter().zip(trials) {
        all[*scenario].trials.extend(trial.into_inner());
    }
    for verified in all {
        verified.rows = verified.loaded.iter().flat_map(|scenario| scenario.rows(&verified.trials)).collect();
    }
    Ok(is_complete)
}

/// Does a piece of work for each number below `count` in parallel, and draws how many are done. What was interrupted has
/// no result.
fn in_parallel<T: Send + Sync>(
    count: usize,
    what: &str,
    jobs: Option<u64>,
    shell: &Shell,
    one: &(dyn Fn(usize) -> Option<T> + Sync),
) -> Vec<OnceLock<T>> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = jobs.map_or(cores, |jobs| jobs as usize).min(count);
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Vec<OnceLock<T>> = (0..count).map(|_| OnceLock::new()).collect();
    let worker = || {
        while let Some(i) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|i| *i < count) {
            let result = one(i);
            shell.draw(&format!("{} of {count} {what}", done.fetch_add(1, Ordering::Relaxed) + 1));
            result.map(|result| results[i].set(result));
        }
    };
    without_panic_messages(|| {
        std::thread::scope(|scope| {
            let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(worker)).collect();
            let joined = workers.into_iter().map(|worker| worker.join());
            joined.for_each(|end| end.unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        });
    });
    shell.draw("");
    results
}

fn record_name(scenario: &str, seed: Option<u64>, end: &str) -> String {
    let scenario = scenario.replace(' ', "_");
    seed.map_or_else(|| format!("{scenario}.{end}"), |seed| format!("{scenario}-{seed}.{end}"))
}
