//! Opens the devices to which the roles of a graph are bound.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crate::catalogue::Catalogue;
use crate::device::{Description, StatedPort};
use crate::graph::net::Net;
use crate::graph::plan::PlannedDevice;
use crate::graph::syntax::{BenchDocument, Block, WireEntry};
use crate::node::{Mistake, PortSpec, Reader, Spanned};
use crate::signal::Shape;
use crate::source::{Code, Diagnostic, Diagnostics, Key, SourceMap, Value, quoted, suggest_name, suggestion};

/// A role that is bound to a device. Ports are in the order of the role, each with its index in the device.
#[derive(Debug, Clone)]
pub(crate) struct BoundRole {
    /// Index among the opened devices.
    pub(crate) device: usize,
    pub(crate) outputs: Vec<(usize, Shape)>,
    pub(crate) commands: Vec<(usize, Shape)>,
    pub(crate) reports: Vec<(usize, Shape)>,
    pub(crate) facts: Vec<(Cow<'static, str>, toml::Value)>,
}

/// The opened devices, and the device of each role.
#[derive(Default)]
pub(crate) struct OpenedBench {
    pub(crate) devices: Vec<PlannedDevice>,
    pub(crate) roles: Vec<Option<BoundRole>>,
    /// Roles for scenarios and recordings only, in the order of `Net::observed`.
    pub(crate) observed: Vec<Option<BoundRole>>,
}

impl OpenedBench {
    /// Returns the shortest sample period of the devices of some roles [s], or `None` if there is no device.
    pub(crate) fn shortest_period(&self, roles: impl Iterator<Item = usize>) -> Option<f64> {
        let bound = roles.filter_map(|role| self.roles.get(role)?.as_ref());
        bound.map(|bound| self.period(bound)).reduce(f64::min)
    }

    /// Returns the nominal sample period of the device of a role [s].
    pub(crate) fn period(&self, role: &BoundRole) -> f64 {
        self.devices[role.device].description.period
    }

    /// Returns the facts of the devices: `role.fact` and the value.
    pub(crate) fn facts(&self, net: &Net<'_>) -> Vec<(String, toml::Value)> {
        let observed = net.observed.iter().map(|(key, ..)| *key).zip(&self.observed);
        let roles = net.flat.roles.iter().map(|(key, _)| key).zip(&self.roles).chain(observed);
        let facts = roles.flat_map(|(key, bound)| bound.iter().flat_map(|bound| &bound.facts).map(move |f| (key, f)));
        facts.map(|(key, (fact, value))| (format!("{}.{fact}", key.name), value.clone())).collect()
    }
}

/// Opens the devices of all roles.
pub(crate) fn open(net: &Net<'_>, sources: &mut SourceMap, diagnostics: &mut Diagnostics) -> OpenedBench {
    let mut opener = Opener {
        catalogue: net.catalogue,
        sources,
        diagnostics,
        tried: BTreeMap::new(),
        taken: Vec::new(),
        opened: OpenedBench::default(),
    };
    let bench = net.flat.bench.as_ref();
    if let Some(bench) = bench {
        let declared = net.flat.roles.iter().map(|(key, _)| key);
        let roles = declared.chain(net.observed.iter().map(|(key, ..)| *key)).map(|key| key.name.as_str()).collect();
        opener.check_unused_bindings(bench, &roles);
        opener.check_devices(bench, &roles);
    }
    for (i, (key, kind)) in net.flat.roles.iter().enumerate() {
        let role = match bench {
            Some(bench) if net.roles[i].is_some() => opener.role(bench, key, kind),
            _ => None,
        };
        opener.opened.roles.push(role);
    }
    for (key, _, role) in &net.observed {
        let kind = Spanned { value: role.name.to_string(), span: key.span.clone() };
        let bound = bench.and_then(|bench| opener.role(bench, key, &kind));
        opener.opened.observed.push(bound);
    }
    opener.opened
}

/// Valid sample periods of a device [s]; a period is also counted in whole nanoseconds.
const PERIOD_RANGE_S: std::ops::RangeInclusive<f64> = 1e-6..=1e3;

struct Opener<'a> {
    catalogue: &'a Catalogue,
    sources: &'a mut SourceMap,
    diagnostics: &'a mut Vec<Diagnostic>,
    /// Devices that were tried, by name: their index if they opened.
    tried: BTreeMap<String, Option<usize>>,
    /// Bindings so far: index of the device, index of the role among those it can fill, name of the role.
    taken: Vec<(usize, usize, String)>,
    opened: OpenedBench,
}

impl Opener<'_> {
    /// Checks the bindings that none of the `roles` uses.
    ///
    /// Such a binding may belong to another task, unless it looks like a role that only scenarios read.
    fn check_unused_bindings(&mut self, bench: &BenchDocument, roles: &BTreeSet<&str>) {
        let observed = || self.catalogue.roles().iter().filter(|role| role.is_observed);
        for (role, word) in bench.bind.iter().filter(|(role, _)| !roles.contains(&*role.name)) {
            let is_right = observed().any(|known| known.is_observed_as(&role.name));
            let names = observed().map(|role| role.observed_name());
            if let Some(name) = suggest_name(&role.name, names).filter(|_| !is_right) {
                let message = format!("`{}` is neither a role of the task nor a role for scenarios", role.name);
                let diagnostic = Diagnostic::new(Code::ObservedRole, role.span.clone(), message);
                self.diagnostics.push(diagnostic.help(format!("did you mean `{name}`?")));
            }
            if !bench.devices.iter().any(|device| device.key.name == word.value) {
                self.diagnostics.push(unknown_device(word, bench));
            }
        }
    }

    /// Checks the types of all devices, and the parameters of those that are not opened because none of the `roles`
    /// uses them.
    fn check_devices(&mut self, bench: &BenchDocument, roles: &BTreeSet<&str>) {
        for device in &bench.devices {
            let Some(kind) = &device.kind else { continue };
            let Some(known) = self.catalogue.find_device(&kind.value) else {
                let names: Vec<_> = self.catalogue.devices().iter().map(|device| device.name()).collect();
                let known = names.iter().map(|name| &**name);
                let unknown = Diagnostic::unknown(Code::UnknownType, "device type", &kind.value, &kind.span, known);
                self.diagnostics.push(unknown);
                continue;
            };
            let mut bound = bench.bind.iter().filter(|(_, word)| word.value == device.key.name);
            let is_opened = bound.any(|(role, _)| roles.contains(&*role.name));
            let params = known.params();
            let entries = device.params.as_table().filter(|_| !is_opened).into_iter().flat_map(|table| &table.entries);
            for (key, _) in entries.filter(|(key, _)| !params.iter().any(|param| param.name == key.name)) {
                let message = format!("`{}` is not a parameter here", key.name);
                let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
                let known = params.iter().map(|param| param.name);
                self.diagnostics.push(diagnostic.suggest(&key.name, known, "parameters"));
            }
        }
    }

    fn role(&mut self, bench: &BenchDocument, key: &Key, kind: &Spanned<String>) -> Option<BoundRole> {
        let Some((_, word)) = bench.bind.iter().find(|(role, _)| role.name == key.name) else {
            let message = format!("the bench does not bind the role `{}`", key.name);
            let devices = quoted(bench.devices.iter().map(|device| device.key.name.as_str()));
            let example = bench.devices.first().map_or("device", |device| &device.key.name);
            let help =
                format!("add `{} = \"{example}\"` under [bind] in the bench; its devices are {devices}", key.name);
            self.diagnostics.push(Diagnostic::new(Code::UnboundRole, key.span.clone(), message).help(help));
            return None;
        };
        let device = self.device(bench, word)?;
        let description = &self.opened.devices[device].description;
        let is_free = |i: &usize| !self.taken.iter().any(|(d, filled, _)| (*d, filled) == (device, i));
        let mut fitting = (0..description.fills.len()).filter(|i| description.fills[*i].role == kind.value);
        let Some(fills) = fitting.clone().find(is_free) else {
            let by = fitting.next().and_then(|i| self.taken.iter().find(|(d, filled, _)| (*d, *filled) == (device, i)));
            let roles = quoted(description.roles());
            let (device, role) = (&word.value, &key.name);
            let (message, help) = match by {
                Some((_, _, by)) => (
                    format!("device `{device}` already fills the role `{by}`"),
                    "bind each role to its own device".into(),
                ),
                None => (
                    format!("device `{device}` cannot fill the role `{role}` of type `{}`", kind.value),
                    format!("it can fill: {roles}"),
                ),
            };
            self.diagnostics.push(Diagnostic::new(Code::WrongRole, word.span.clone(), message).help(help));
            return None;
        };
        self.taken.push((device, fills, key.name.clone()));
        let role = self.catalogue.role_type(&kind.value)?;
        let number = |stated: &[StatedPort], declared: &[PortSpec]| {
            let port = |spec: &PortSpec| stated.iter().position(|port| port.fill == fills && port.name == spec.name);
            let port = |spec: &PortSpec| port(spec).map(|port| (port, stated[port].shape.clone()));
            declared.iter().filter_map(port).collect()
        };
        Some(BoundRole {
            device,
            outputs: number(&description.outputs, &role.outputs),
            commands: number(&description.commands, &role.commands),
            reports: number(&description.reports, &role.reports),
            facts: description.fills[fills].facts.clone(),
        })
    }

    fn device(&mut self, bench: &BenchDocument, word: &Spanned<String>) -> Option<usize> {
        if let Some(opened) = self.tried.get(&word.value) {
            return *opened;
        }
        let opened = self.open(bench, word);
        self.tried.insert(word.value.clone(), opened);
        opened
    }

    fn open(&mut self, bench: &BenchDocument, word: &Spanned<String>) -> Option<usize> {
        let Some(block) = bench.devices.iter().find(|device| device.key.name == word.value) else {
            self.diagnostics.push(unknown_device(word, bench));
            return None;
        };
        let kind = block.kind.as_ref()?;
        let device = self.catalogue.find_device(&kind.value)?;
        let mut reader = Reader::new(self.sources);
        let opened = device.open(&block.params, &mut reader);
        let Reader { mistakes, warnings, .. } = reader;
        let found = mistakes.into_iter().chain(warnings).collect();
        place_mistakes(found, &block.params, &[], self.sources, self.diagnostics);
        let crate::device::Opened { mut description, driver } = opened?;
        let period = description.period;
        if !PERIOD_RANGE_S.contains(&period) {
            let message = format!("device `{}` has a sample period of {period:e} s", word.value);
            let help = format!("the period must be from {:e} to {:e} s", PERIOD_RANGE_S.start(), PERIOD_RANGE_S.end());
            self.diagnostics.push(Diagnostic::new(Code::BadClock, block.key.span.clone(), message).help(help));
            return None;
        }
        if !self.check_ports(&mut description, block) {
            return None;
        }
        let (name, span) = (word.value.clone(), block.key.span.clone());
        self.opened.devices.push(PlannedDevice { name, driver, description, span });
        Some(self.opened.devices.len() - 1)
    }

    /// Reports where the ports of a device differ from those of its roles, and adds the reports that it does not read.
    fn check_ports(&mut self, description: &mut Description, block: &Block) -> bool {
        let before = self.diagnostics.len();
        for fill in 0..description.fills.len() {
            let name = description.fills[fill].role.clone();
            let device = &block.key.name;
            let message = match self.catalogue.role_type(&name) {
                Some(role) => {
                    let misfits = description.misfits(fill, role);
                    description.add_reports(fill, role);
                    if misfits.is_empty() {
                        continue;
                    }
                    format!("device `{device}` does not match the role `{name}`: {}", misfits.join("; "))
                }
                None => {
                    let roles = self.catalogue.roles().iter().map(|role| &*role.name);
                    let help = suggestion(&name, roles, "role types");
                    format!("device `{device}` states the role type `{name}`, which does not exist ({help})")
                }
            };
            let kind = block.kind.as_ref().map_or("", |kind| &kind.value);
            let help = format!("the mistake is in the device type `{kind}`, not in this file");
            self.diagnostics.push(Diagnostic::new(Code::WrongRole, block.key.span.clone(), message).help(help));
        }
        self.diagnostics.len() == before
    }
}

fn unknown_device(word: &Spanned<String>, bench: &BenchDocument) -> Diagnostic {
    let message = format!("the bench has no device `{}`", word.value);
    let known = bench.devices.iter().map(|device| device.key.name.as_str());
    Diagnostic::new(Code::UnknownDevice, word.span.clone(), message).suggest(&word.value, known, "devices")
}

/// Converts the mistakes of a node or device into diagnostics, with spans in its block, its wires or a data file.
pub(crate) fn place_mistakes(
    mistakes: Vec<Mistake>,
    block: &Value,
    wires: &[WireEntry],
    sources: &mut SourceMap,
    diagnostics: &mut Diagnostics,
) {
    use crate::node::At;
    for Mistake { code, at, message, help } in mistakes {
        let mut notes = Vec::new();
        let span = match at {
            At::Span(span) => span,
            At::Node => block.span.clone(),
            At::Param(path) => find_spans(block, &path).map_or(block.span.clone(), |(_, value)| value),
            At::Key(path) => find_spans(block, &path).map_or(block.span.clone(), |(key, _)| key),
            At::Input(name) => {
                wires.iter().find(|wire| wire.key.name == name).map_or(&block.span, |wire| &wire.from.span).clone()
            }
            At::Data { file, text, span } => {
                notes.push((file.span.clone(), "the file is named here".to_owned()));
                let base = sources.add_file(&file.path, &*text).base;
                base + span.start..base + span.end
            }
        };
        diagnostics.push(Diagnostic { code, message, span, notes, help });
    }
}

/// Returns the spans of the key and of the value at a dotted path.
fn find_spans(block: &Value, path: &str) -> Option<(Range<usize>, Range<usize>)> {
    let mut value = block;
    let mut key = block.span.clone();
    for name in path.split('.') {
        let (entry_key, inner) = value.as_table()?.entry(name)?;
        (key, value) = (entry_key.span.clone(), inner);
    }
    Some((key, value.span.clone()))
}
