//! Checks the names and the docs in a catalogue.

use super::{Lint, Notes, Violation};
use crate::node::{ParamSpec, PortSpec};

/// The docs of an entry of a catalogue.
struct Declaration<'c> {
    name: String,
    summary: String,
    /// The reference; of a role only its ports are described.
    doc: Option<String>,
    ports: Vec<(&'static str, &'c [PortSpec])>,
    params: Vec<ParamSpec>,
}

impl Lint<'_> {
    fn entries(&self) -> Vec<Declaration<'_>> {
        let nodes = self.catalogue.specs().map(|spec| Declaration {
            name: spec.name.to_string(),
            summary: spec.summary.to_string(),
            doc: Some(spec.doc.to_string()),
            ports: vec![("input", &spec.inputs), ("output", &spec.outputs)],
            params: spec.params.clone(),
        });
        let devices = self.catalogue.devices().iter().map(|device| Declaration {
            name: device.name().into_owned(),
            summary: device.summary().into_owned(),
            doc: Some(device.doc().into_owned()),
            ports: Vec::new(),
            params: device.params(),
        });
        let roles = self.catalogue.roles().iter().map(|role| Declaration {
            name: role.name.to_string(),
            summary: role.summary.to_string(),
            doc: None,
            ports: vec![("output", &role.outputs), ("command", &role.commands), ("report", &role.reports)],
            params: Vec::new(),
        });
        nodes.chain(devices).chain(roles).collect()
    }

    /// Checks that names are valid and that each is used once. The catalogue itself refuses two entries of one name.
    pub(super) fn names(&self, found: &mut Vec<Violation>) {
        for entry in self.entries() {
            let mut notes = Notes { owner: entry.name.clone(), found };
            notes.unless(is_name(&entry.name), None, "a name is `snake_case`");
            for (sort, ports) in &entry.ports {
                // A node may pass a port on under its name, so inputs and outputs are apart.
                unique(ports.iter().map(|port| port.name.to_string()), sort, &mut notes);
            }
            params(&entry.params, "", &mut |specs, path| {
                unique(specs.iter().map(|spec| format!("{path}{}", spec.name)), "parameter", &mut notes);
            });
        }
    }

    /// Checks that everything is documented.
    pub(super) fn docs(&self, found: &mut Vec<Violation>) {
        for entry in self.entries() {
            let mut notes = Notes { owner: entry.name, found };
            let summary = entry.summary;
            let is_line = !summary.trim().is_empty() && !summary.ends_with('.') && !summary.contains('\n');
            notes.unless(is_line, None, "its summary has to be one line without a full stop");
            notes.unless(entry.doc.is_none_or(|doc| !doc.trim().is_empty()), None, "it has no reference (`DOC`)");
            for (sort, ports) in &entry.ports {
                for port in *ports {
                    let place = format!("{sort} `{}`", port.name);
                    notes.unless(!port.doc.trim().is_empty(), Some(place), "it has no doc");
                }
            }
            params(&entry.params, "", &mut |specs, path| {
                for spec in specs {
                    let place = || Some(format!("parameter `{path}{}`", spec.name));
                    notes.unless(!spec.doc.trim().is_empty(), place(), "it has no doc");
                    let is_number = spec.takes.contains("a number") && spec.fields.is_empty();
                    notes.unless(!is_number || spec.unit.is_some(), place(), "it has no unit");
                }
            });
        }
    }
}

/// Visits each table of parameters, with the path to it.
fn params(specs: &[ParamSpec], path: &str, visit: &mut impl FnMut(&[ParamSpec], &str)) {
    visit(specs, path);
    for spec in specs {
        params(&spec.fields, &format!("{path}{}.", spec.name), visit);
    }
}

/// Reports names that are used twice or are not valid.
fn unique(names: impl Iterator<Item = String>, sort: &str, notes: &mut Notes<'_>) {
    let names: Vec<String> = names.collect();
    for (i, name) in names.iter().enumerate() {
        let place = || Some(format!("{sort} `{name}`"));
        notes.unless(!names[..i].contains(name), place(), "it is declared twice");
        notes.unless(name.split('.').all(is_name), place(), "a name is `snake_case`");
    }
}

/// Whether a name is `snake_case`: words of small letters and digits, the first with a letter at its start.
fn is_name(name: &str) -> bool {
    let is_word = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit());
    name.starts_with(|c: char| c.is_ascii_lowercase()) && name.split('_').all(is_word)
}
