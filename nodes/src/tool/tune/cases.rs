//! What is measured: the graph on each bench, and with each setting.

use std::path::PathBuf;

use tactflow_runtime::cli::Shell;
use tactflow_runtime::graph::{Outline, Request, compile};

use super::task::Task;
use super::{TuneArgs, signal};
use crate::tool::control::contacts::{Contact, contacts};

/// A bench, and the contacts that it states.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stated {
    pub(super) file: Option<PathBuf>,
    pub(super) contacts: Vec<Contact>,
}

/// What is measured: a graph on a bench, with a setting.
pub(super) struct Case {
    pub(super) request: Request,
    pub(super) outline: Outline,
    pub(super) stated: Stated,
    pub(super) object: String,
}

impl Case {
    /// Returns its contact, whose features are not known yet.
    pub(super) fn contact(&self) -> Contact {
        Contact::unmeasured(self.object.clone())
    }
}

/// Returns what is measured of an arm: each bench as it is, and with each of the settings. Simulated devices run long
/// enough.
pub(super) fn cases(
    (args, arm): (&TuneArgs, &str),
    request: &Request,
    task: &Task,
    shell: &Shell,
) -> Result<Vec<Case>, String> {
    let benches = [None].into_iter().chain(args.others.iter().map(Some));
    let settings = || [None].into_iter().chain(args.also.iter().map(Some));
    let each = benches.flat_map(|bench| settings().map(move |also| (bench, also)));
    each.map(|(bench, also)| {
        let mut request = Request { bench: bench.cloned().or_else(|| request.bench.clone()), ..request.clone() };
        request.set.extend(also.cloned());
        let compiled = compile(shell.catalogue(), &request).map_err(|report| report.render(false))?;
        answers(compiled.outline())?;
        let outline = &task.outline(compiled.outline());
        request.set.extend(signal::long_enough(outline, signal::duration(outline.period_s)));
        let stated = Stated { file: bench_file(outline), contacts: contacts(compiled.facts(), arm)? };
        let stem = stated.file.as_ref().and_then(|file| file.file_stem());
        // Those with a setting are of the same object.
        let first = stated.contacts.first().map(|contact| contact.object.clone());
        let object = first.or_else(|| stem.map(|stem| stem.to_string_lossy().into_owned()));
        let with = also.map_or_else(String::new, |set| format!(" with {set}"));
        let outline = outline.clone();
        Ok(Case { request, outline, stated, object: object.unwrap_or_else(|| "object".into()) + &with })
    })
    .collect()
}

/// Refuses a bench that does not answer the motion of the arm.
pub(super) fn answers(outline: &Outline) -> Result<(), String> {
    let recording = outline.devices.iter().find(|device| device.kind.text == "recording");
    recording.map_or(Ok(()), |device| {
        let name = &device.name;
        Err(format!(
            "`{name}` plays a recording, which does not answer the motion: name a simulated or a real bench with `--bench`"
        ))
    })
}

/// Returns the file of the bench that a request uses, as the places of its devices say.
fn bench_file(outline: &Outline) -> Option<PathBuf> {
    outline.devices.first().map(|device| PathBuf::from(&device.place.file))
}
