//! `report`: recordings and scenarios as one page for a browser, with everything in it.

mod lateness;
mod page;
mod run;

use std::path::{Path, PathBuf};

use page::HtmlPage;

use super::shell::replays::is_recording;
use super::shell::{FAULTED, NOT_LOADED, Shell};
use super::verify;
use crate::recording::ReplayChanges;

/// Show recorded runs and the results of scenarios on one page for a browser
#[derive(clap::Parser)]
#[command(
    name = "report",
    after_help = "The page goes to the standard output. It is one file: it loads nothing, and prints well.

A recording is replayed: the page has what `run` prints, the image and the curves of the ports that the graph
shows, how late its ticks began in real time, its modes and the graph. A scenario runs, and its results stand beside those of the paper.

Examples:
  tactflow run graphs/hybrid.toml --record run.mcap
  tactflow report run.mcap > run.html
  tactflow report run.mcap graphs/scenarios/table3_ball.toml > page.html
  tactflow report records/ > page.html

Exit codes: 0 success; 1 a replay differs from its recording, or a check failed; 2 a file does not load."
)]
pub(super) struct ReportArgs {
    /// Recordings (.mcap), scenarios, or folders of them
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Run each scenario that has `seeds` with the seeds 1 to N instead of its own
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: Option<u64>,
}

fn has_toml(folder: &Path) -> bool {
    let is_toml = |path: &Path| path.extension().is_some_and(|end| end == "toml");
    std::fs::read_dir(folder).is_ok_and(|entries| entries.flatten().any(|entry| is_toml(&entry.path())))
}

/// Returns the recordings in a folder by name, or `None` for a file.
fn recordings_in(folder: &Path) -> Result<Option<Vec<PathBuf>>, String> {
    if !folder.is_dir() {
        return Ok(None);
    }
    let cannot = |error: std::io::Error| format!("cannot read the folder `{}`: {error}", folder.display());
    let entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| entry.map(|entry| entry.path())).collect())
        .map_err(cannot)?;
    // `run.1.mcap` is the second part of `run.mcap`, which names it.
    let is_part = |path: &PathBuf| {
        let whole = path.file_stem().map(Path::new).filter(|stem| {
            stem.extension().is_some_and(|number| number.to_string_lossy().bytes().all(|byte| byte.is_ascii_digit()))
        });
        whole.and_then(Path::file_stem).is_some_and(|stem| path.with_file_name(stem).with_extension("mcap").exists())
    };
    let mut found: Vec<PathBuf> = entries.into_iter().filter(|path| is_recording(path) && !is_part(path)).collect();
    found.sort();
    Ok(Some(found))
}

pub(super) fn report(args: ReportArgs, shell: &Shell) -> Result<u8, u8> {
    let names: Vec<String> = args.files.iter().map(|file| file.display().to_string()).collect();
    let mut page = HtmlPage::new(&names.join(", "));
    let (mut recordings, mut scenarios) = (Vec::new(), Vec::new());
    for file in args.files {
        let found = recordings_in(&file).map_err(|message| shell.refuse(message))?;
        match found {
            None if is_recording(&file) => recordings.push(file),
            None => scenarios.push(file),
            Some(found) if found.is_empty() => scenarios.push(file),
            Some(found) => {
                // A folder may have scenarios beside its recordings.
                scenarios.extend(Some(file).filter(|folder| has_toml(folder)));
                recordings.extend(found);
            }
        }
    }
    let mut code = 0;
    for path in recordings {
        let replay = shell.open_replay(&path, &ReplayChanges::default())?;
        let name = path.display().to_string();
        if let Some(difference) = run::add(&mut page, &name, replay).map_err(|message| shell.refuse(message))? {
            shell.error(format_args!("{name}: {difference}"));
            code = FAULTED;
        }
    }
    if !scenarios.is_empty() {
        let results = verify::results(scenarios, args.seeds, shell).map_err(|message| shell.refuse(message))?;
        page.table(&results.title, &results.rows, &results.notes);
        results.reports.iter().for_each(|report| shell.show(report));
        code = if results.reports.is_empty() { code.max(u8::from(!results.has_passed)) } else { NOT_LOADED };
    }
    shell.say(page.finish().trim_end());
    Ok(code)
}
