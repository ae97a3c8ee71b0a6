//! `verify`: scenarios run side by side, and what came out is held against what was asked.

mod table;

use std::collections::BTreeSet;
use std::io::{IsTerminal, Write, stderr};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use super::describe::Format;
use super::json::{Diagnosed, diagnosed};
use super::run::quietly;
use super::{FAULTED, NOT_LOADED, Shell};
use crate::catalogue::Catalogue;
use crate::engine::Interrupt;
use crate::scenario::judge::{Row, Verdict};
use crate::scenario::{Scenario, Trial};
use crate::source::Report;

/// Run scenarios and hold what comes out against what they ask
#[derive(clap::Parser)]
#[command(
    name = "verify",
    after_help = "Examples:
  tactflow verify graphs/scenarios
  tactflow verify graphs/scenarios/hybrid_ball.toml --seeds 50 --out records
  tactflow verify graphs/scenarios --json > figures.json

Exit codes: 0 every row is met; 1 a row is missed, or a run ended in a fault; 2 a scenario does not load."
)]
pub(super) struct Verify {
    /// Scenario files, and folders of them
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// How many seeds, from 1 on, instead of those of each scenario that has any
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: Option<u64>,
    /// How many runs at a time; as many as there are cores unless given
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    jobs: Option<u64>,
    /// Folder to record each run in, as SCENARIO-SEED.csv
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The same as `--format json`
    #[arg(long)]
    json: bool,
    /// How to print it
    #[arg(long, value_enum, default_value_t = Format::Text, value_name = "FORMAT")]
    format: Format,
}

/// A scenario with what became of it.
pub(super) struct Verified {
    path: PathBuf,
    loaded: Result<Scenario, Report>,
    /// The runs, in the order of the seeds; none of those that were interrupted.
    trials: Vec<Trial>,
    rows: Vec<Row>,
}

pub(super) fn verify(args: Verify, shell: &Shell) -> u8 {
    let result = prepare(&args, shell.catalogue()).and_then(|mut all| {
        let is_whole = run(&mut all, &args, shell.catalogue())?;
        Ok((all, is_whole))
    });
    let (all, is_whole) = match result {
        Ok(result) => result,
        Err(message) => {
            shell.error(message);
            return NOT_LOADED;
        }
    };
    if args.json || args.format == Format::Json {
        shell.say_json(&table::json(&all));
    } else {
        all.iter().filter_map(|verified| verified.loaded.as_ref().err()).for_each(|report| shell.show(report));
        shell.say(table::text(&all, shell.has_colour()).trim_end());
    }
    for (verified, trial) in all.iter().flat_map(|verified| verified.trials.iter().map(move |trial| (verified, trial)))
    {
        if let Some(why) = &trial.failure {
            shell.error(format_args!("{}{}: {why}", verified.name(), of_seed(trial.seed)));
        }
    }
    if !is_whole {
        shell.error("interrupted: some runs are missing");
    }
    let is_met = is_whole && all.iter().all(Verified::is_met);
    match all.iter().any(|verified| verified.loaded.is_err()) {
        true => NOT_LOADED,
        false if is_met => 0,
        false => FAULTED,
    }
}

fn of_seed(seed: Option<u64>) -> String {
    seed.map_or_else(String::new, |seed| format!(", seed {seed}"))
}

impl Verified {
    fn name(&self) -> String {
        self.path.file_stem().unwrap_or(self.path.as_os_str()).to_string_lossy().into_owned()
    }

    /// Whether it loads, every run is of use and no row is missed.
    fn is_met(&self) -> bool {
        let is_whole = self.loaded.as_ref().is_ok_and(|scenario| scenario.runs().len() == self.trials.len());
        let has_failed = self.trials.iter().any(|trial| trial.failure.is_some());
        is_whole && !has_failed && self.rows.iter().all(|row| row.verdict() != Verdict::Failed)
    }

    fn diagnostics(&self) -> Vec<Diagnosed> {
        self.loaded.as_ref().err().map(diagnosed).unwrap_or_default()
    }
}

/// Finds the files and loads them all.
fn prepare(args: &Verify, catalogue: &Catalogue) -> Result<Vec<Verified>, String> {
    let mut files = Vec::new();
    for path in &args.paths {
        files.extend(if path.is_dir() { files_of(path)? } else { vec![path.clone()] });
    }
    let load = |path: PathBuf| {
        let loaded = Scenario::load(catalogue, &path);
        let loaded = loaded.map(|scenario| match args.seeds {
            Some(count) => scenario.with_seeds(count),
            None => scenario,
        });
        Verified { path, loaded, trials: Vec::new(), rows: Vec::new() }
    };
    let all: Vec<Verified> = files.into_iter().map(load).collect();
    if let Some(folder) = &args.out {
        let mut names = BTreeSet::new();
        if let Some(twice) = all.iter().map(Verified::name).find(|name| !names.insert(name.clone())) {
            return Err(format!("two scenarios are called `{twice}`: their records would have one name"));
        }
        std::fs::create_dir_all(folder).map_err(|error| format!("cannot create `{}`: {error}", folder.display()))?;
    }
    Ok(all)
}

/// The scenario files of a folder, by name.
fn files_of(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let wrong = |error: std::io::Error| format!("cannot read `{}`: {error}", folder.display());
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(wrong)? {
        let path = entry.map_err(wrong)?.path();
        if path.extension().is_some_and(|end| end == "toml") {
            files.push(path);
        }
    }
    files.sort();
    if files.is_empty() { Err(format!("there is no scenario in `{}`", folder.display())) } else { Ok(files) }
}

/// A run that is to be done: which scenario, and which of its seeds.
type Work = (usize, Option<u64>);

/// Runs everything, as many at a time as there are cores. What comes out does not depend on how many. Whether it came to
/// the end.
fn run(all: &mut [Verified], args: &Verify, catalogue: &Catalogue) -> Result<bool, String> {
    let interrupt = Interrupt::catch().map_err(|error| format!("cannot run: {error}"))?;
    let scenarios = all.iter().enumerate().filter_map(|(i, verified)| Some((i, verified.loaded.as_ref().ok()?)));
    let scenarios: Vec<(usize, &Scenario)> = scenarios.collect();
    let each = scenarios.iter().flat_map(|(i, scenario)| scenario.runs().into_iter().map(|seed| (*i, seed)));
    let work: Vec<Work> = each.collect();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = args.jobs.map_or(cores, |jobs| jobs as usize).min(work.len());
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let one = |(scenario, seed): Work| {
        let verified = &all[scenario];
        let record = args.out.as_deref().map(|folder| folder.join(record_name(&verified.name(), seed)));
        let scenario = verified.loaded.as_ref().ok()?;
        let trial = scenario.run(catalogue, seed, record.as_deref(), &|| interrupt.is_requested());
        show_progress(done.fetch_add(1, Ordering::Relaxed) + 1, work.len());
        trial
    };
    let worker = || {
        let mut trials = Vec::new();
        while let Some(which) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|which| *which < work.len()) {
            trials.push((which, one(work[which])));
        }
        trials
    };
    let mut trials: Vec<(usize, Option<Trial>)> = quietly(|| {
        std::thread::scope(|scope| {
            let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(worker)).collect();
            let joined = workers.into_iter().map(|worker| worker.join());
            joined.flat_map(|trials| trials.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
        })
    });
    clear_progress();
    trials.sort_by_key(|(which, _)| *which);
    let is_whole = trials.iter().all(|(_, trial)| trial.is_some());
    let of: Vec<usize> = work.iter().map(|(scenario, _)| *scenario).collect();
    for (which, trial) in trials {
        all[of[which]].trials.extend(trial);
    }
    for verified in all {
        verified.rows =
            verified.loaded.as_ref().map_or_else(|_| Vec::new(), |scenario| scenario.rows(&verified.trials));
    }
    Ok(is_whole)
}

fn record_name(scenario: &str, seed: Option<u64>) -> String {
    seed.map_or_else(|| format!("{scenario}.csv"), |seed| format!("{scenario}-{seed}.csv"))
}

/// How many runs are over, on one line of a terminal; silent where nobody looks.
fn show_progress(done: usize, all: usize) {
    if stderr().is_terminal() {
        // Where the line cannot be written nobody misses it.
        let _ = write!(stderr(), "\r{done} of {all} runs\x1b[K");
    }
}

fn clear_progress() {
    if stderr().is_terminal() {
        let _ = write!(stderr(), "\r\x1b[K");
    }
}
