//! What is measured: the graph on each bench, and with each setting.

use std::collections::BTreeSet;
use std::path::PathBuf;

use tactflow_runtime::cli::Shell;
use tactflow_runtime::graph::{Outline, Request, compile};
use tactflow_runtime::source::quoted;

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
        // Those with a setting are of the same object.
        let with = also.map_or_else(String::new, |set| format!("{WITH}{set}"));
        let object = touched(&stated, args.object.as_deref().filter(|_| bench.is_none()))? + &with;
        Ok(Case { request, outline: outline.clone(), stated, object })
    })
    .collect()
}

/// What stands between an object and a setting in the name of a contact.
const WITH: &str = " with ";

/// Returns the object that the arm touches on a bench: the one with this name, or else the only one that the bench states.
fn touched(bench: &Stated, name: Option<&str>) -> Result<String, String> {
    let Stated { file, contacts } = bench;
    if let Some(name) = name {
        return Ok(name.to_owned());
    }
    let objects: BTreeSet<&str> = contacts.iter().map(object).collect();
    match (objects.len(), &contacts[..], file) {
        (_, [], None) => Ok("object".into()),
        (_, [], Some(file)) => Ok(file.file_stem().unwrap_or_default().to_string_lossy().into_owned()),
        (_, [only], _) => Ok(only.object.clone()),
        (1, [one, ..], _) => Ok(object(one).to_owned()),
        (_, [.., last], _) => {
            let file = file.as_ref().map_or_else(String::new, |file| file.display().to_string());
            Err(format!(
                "the bench `{file}` states contacts with {}: measure it as the bench of the graph, and name the object that the \
                 arm touches, for example with `--bench {file} --object {:?}`",
                quoted(objects),
                object(last)
            ))
        }
    }
}

/// Returns the object of a contact. That with a setting is no other object.
fn object(contact: &Contact) -> &str {
    let setting = contact.object.split_once(WITH).filter(|(_, setting)| setting.contains('='));
    setting.map_or(&*contact.object, |(object, _)| object)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_several_objects_that_a_bench_states_one_must_be_named() {
        let bench = |objects: &[&str]| Stated {
            file: Some("hand.toml".into()),
            contacts: objects.iter().map(|object| Contact::unmeasured((*object).to_owned())).collect(),
        };
        for (objects, name, expected) in [
            (&[][..], None, Some("hand")),
            (&["ball"], None, Some("ball")),
            (&["ball with a=1", "ball"], None, Some("ball")),
            (&["ball"], Some("pen"), Some("pen")),
            (&["ball", "pen"], Some("pen"), Some("pen")),
            (&["ball", "pen"], Some("cup"), Some("cup")),
            (&["ball", "pen"], None, None),
            (&["cup with milk", "cup with tea"], None, None),
        ] {
            let found = touched(&bench(objects), name);
            assert_eq!(found.as_deref().ok(), expected, "{objects:?} {name:?}");
            if let Err(why) = found {
                let example = format!("`--bench hand.toml --object {:?}`", objects[1]);
                assert!(
                    objects.iter().all(|object| why.contains(&format!("`{object}`"))) && why.ends_with(&example),
                    "{why}"
                );
            }
        }
    }
}
