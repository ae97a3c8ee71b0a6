//! Opens the devices to which the roles of a graph are bound.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use super::place::place_mistakes;
use super::reconnect::allow_return;
use super::sides;
use crate::catalogue::Catalogue;
use crate::device::{Description, RecordedDevice, RoleType, StatedPort};
use crate::graph::load::{MeasuredValues, role_type_of};
use crate::graph::net::Net;
use crate::graph::plan::PlannedDevice;
use crate::graph::syntax::{BenchDocument, Binding, Block};
use crate::node::{KnownUnits, PortSpec, Reader, Spanned};
use crate::signal::Shape;
use crate::source::{Code, Diagnostic, Diagnostics, Edit, Key, SourceMap, quoted, suggest_name, suggestion};

/// A role that is bound to a device. Ports are in the order of the role, each with its index in the device.
#[derive(Debug, Clone)]
pub(crate) struct BoundRole {
    /// Index among the opened devices.
    pub(crate) device: usize,
    /// Index among the roles that the device can fill.
    fills: usize,
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
    /// The values of parameters that were written with a unit.
    pub(crate) measured: MeasuredValues,
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

    /// Returns the latency that the device of a role states [s].
    pub(crate) fn latency(&self, role: &BoundRole) -> f64 {
        self.devices[role.device].description.latency
    }

    /// Returns the device that fills a role and its side, or `None` if the device has no sides.
    fn side(&self, role: usize) -> Option<(usize, &str)> {
        let bound = self.roles[role].as_ref()?;
        let side = self.devices[bound.device].description.fills[bound.fills].side.as_deref()?;
        Some((bound.device, side))
    }

    /// Returns the facts of the devices: `role.fact` and the value.
    pub(crate) fn facts(&self, net: &Net<'_>) -> Vec<(String, toml::Value)> {
        let observed = net.observed.iter().map(|(key, ..)| *key).zip(&self.observed);
        let roles = net.flat.roles.iter().map(|(key, _)| key).zip(&self.roles).chain(observed);
        let facts = roles.flat_map(|(key, bound)| bound.iter().flat_map(|bound| &bound.facts).map(move |f| (key, f)));
        facts.map(|(key, (fact, value))| (format!("{}.{fact}", key.name), value.clone())).collect()
    }
}

/// Opens the devices of all roles, or takes those of a recording. Their joints move at most at `slow` times their speeds.
pub(crate) fn open(
    net: &Net<'_>,
    (slow, recorded): (f64, Option<&[RecordedDevice]>),
    sources: &mut SourceMap,
    diagnostics: &mut Diagnostics,
) -> OpenedBench {
    let bench = net.flat.bench.as_ref();
    let mut opener = Opener::new(net.catalogue, bench, slow, sources, diagnostics);
    opener.recorded = recorded;
    opener.net = Some(net);
    opener.kinds = net.flat.roles.iter().map(|(key, kind)| (key.name.clone(), kind.value.clone())).collect();
    let is_bound = |role: &&String| bench.is_none_or(|bench| bench.bind.position(role).is_some());
    opener.unbound = opener.kinds.keys().filter(|role| !is_bound(role)).cloned().collect();
    if let Some(bench) = bench {
        let declared = net.flat.roles.iter().map(|(key, _)| key);
        let roles = declared.chain(net.observed.iter().map(|(key, ..)| *key)).map(|key| key.name.as_str()).collect();
        opener.check_unused_bindings(bench, &roles);
        // The types of recorded devices do not matter.
        if recorded.is_none() {
            opener.check_devices(bench, &roles);
        }
    }
    for (i, (key, kind)) in net.flat.roles.iter().enumerate() {
        let role = match bench {
            Some(bench) if net.roles[i].is_some() => opener.role(bench, key, kind),
            // A node that computes beside the tick, and has a mistake.
            Some(bench) if kind.value.contains(' ') => {
                let binding = bench.bind.get(&key.name).map(Binding::device_word);
                binding.and_then(|word| opener.device(bench, &word));
                None
            }
            _ => None,
        };
        opener.opened.roles.push(role);
    }
    for (key, role) in &net.observed {
        let kind = Spanned { value: role.name.to_string(), span: key.span.clone() };
        let bound = bench.and_then(|bench| opener.role(bench, key, &kind));
        opener.opened.observed.push(bound);
    }
    let crossed = sides::crossed(net, |role| opener.opened.side(role));
    opener.diagnostics.extend(crossed);
    opener.opened
}

/// Valid sample periods of a device [s]; a period is also counted in whole nanoseconds.
const PERIOD_RANGE_S: std::ops::RangeInclusive<f64> = 1e-6..=1e3;

pub(super) struct Opener<'a> {
    catalogue: &'a Catalogue,
    sources: &'a mut SourceMap,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
    /// The blocks of the devices, by name.
    blocks: BTreeMap<&'a str, &'a Block>,
    /// Devices that were tried, by name: their index if they opened.
    tried: BTreeMap<String, Option<usize>>,
    /// Name of the role for each role of a device that is filled: index of the device, and index of the role among
    /// those that it can fill.
    taken: BTreeMap<(usize, usize), String>,
    /// The roles of the task with their types, and those of them that no device is bound to.
    kinds: BTreeMap<String, String>,
    unbound: Vec<String>,
    /// Fraction of the speeds of joints that is used.
    slow: f64,
    /// The graph whose roles the devices fill; `None` for a bench without a task.
    net: Option<&'a Net<'a>>,
    /// The devices of a recording, which replace those of the bench.
    recorded: Option<&'a [RecordedDevice]>,
    pub(super) opened: OpenedBench,
}

impl<'a> Opener<'a> {
    pub(super) fn new(
        catalogue: &'a Catalogue,
        bench: Option<&'a BenchDocument>,
        slow: f64,
        sources: &'a mut SourceMap,
        diagnostics: &'a mut Vec<Diagnostic>,
    ) -> Self {
        let blocks =
            bench.into_iter().flat_map(|bench| &bench.devices).map(|block| (&*block.key.name, block)).collect();
        Self {
            catalogue,
            sources,
            diagnostics,
            blocks,
            tried: BTreeMap::new(),
            taken: BTreeMap::new(),
            kinds: BTreeMap::new(),
            unbound: Vec::new(),
            slow,
            net: None,
            recorded: None,
            opened: OpenedBench::default(),
        }
    }

    /// Checks the bindings that none of the `roles` uses.
    ///
    /// Such a binding may belong to another task, unless it looks like a role that only scenarios read.
    fn check_unused_bindings(&mut self, bench: &BenchDocument, roles: &BTreeSet<&str>) {
        let observed = || self.catalogue.roles().iter().filter(|role| role.is_observed);
        for (role, binding) in bench.bind.iter().filter(|(role, _)| !roles.contains(&*role.name)) {
            let is_right = observed().any(|known| known.is_observed_as(&role.name));
            let names = observed().map(|role| role.observed_name());
            if let Some(name) = suggest_name(&role.name, names).filter(|_| !is_right) {
                let message = format!("`{}` is neither a role of the task nor a role for scenarios", role.name);
                let diagnostic = Diagnostic::new(Code::ObservedRole, role.span.clone(), message);
                self.diagnostics.push(diagnostic.help(format!("did you mean `{name}`?")));
            }
            let device = binding.device();
            if !self.blocks.contains_key(device) && self.tried.insert(device.into(), None).is_none() {
                self.diagnostics.push(unknown_device(&binding.device_word(), bench));
            }
        }
    }

    /// There is no such device type: a misspelt one, or one that this build leaves out.
    fn unknown_type(&self, kind: &Spanned<String>) -> Diagnostic {
        if let Some(how) = self.catalogue.how_to_get(&kind.value) {
            let message = format!("this build leaves out the device type `{}`", kind.value);
            return Diagnostic::new(Code::UnknownType, kind.span.clone(), message).help(how);
        }
        let names: Vec<_> = self.catalogue.devices().iter().map(|device| device.name()).collect();
        let known = names.iter().map(|name| &**name);
        Diagnostic::unknown(Code::UnknownType, "device type", &kind.value, &kind.span, known)
    }

    /// Checks the types of all devices, and the parameters of those that are not opened because none of the `roles`
    /// uses them.
    pub(super) fn check_devices(&mut self, bench: &BenchDocument, roles: &BTreeSet<&str>) {
        let bound = bench.bind.iter().filter(|(role, _)| roles.contains(&*role.name));
        let opened: BTreeSet<&str> = bound.map(|(_, binding)| binding.device()).collect();
        for device in &bench.devices {
            let Some(kind) = &device.kind else { continue };
            let Some(known) = self.catalogue.find_device(&kind.value) else {
                self.diagnostics.push(self.unknown_type(kind));
                continue;
            };
            // A device that is opened checks its own parameters.
            if opened.contains(&*device.key.name) {
                continue;
            }
            let params = known.params();
            let entries = device.params.as_table().into_iter().flat_map(|table| &table.entries);
            for (key, _) in entries.filter(|(key, _)| !params.iter().any(|param| param.name == key.name)) {
                let message = format!("`{}` is not a parameter here", key.name);
                let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
                let known = params.iter().map(|param| param.name);
                self.diagnostics.push(diagnostic.suggest(&key.name, known, "parameters"));
            }
        }
    }

    fn role(&mut self, bench: &BenchDocument, key: &Key, kind: &Spanned<String>) -> Option<BoundRole> {
        let Some(binding) = bench.bind.get(&key.name) else {
            if !bench.invalid.iter().any(|role| role.name == key.name) {
                let unbound = self.unbound(bench, key, &kind.value);
                self.diagnostics.push(unbound);
            }
            return None;
        };
        let device = self.device(bench, &binding.device_word())?;
        let fills = self.fill(device, binding, key, kind).map_err(|diagnostic| self.diagnostics.push(diagnostic));
        let fills = fills.ok()?;
        self.taken.insert((device, fills), key.name.clone());
        let description = &self.opened.devices[device].description;
        let role = self.role_type(&kind.value)?;
        let number = |stated: &[StatedPort], declared: &[PortSpec]| {
            let port = |spec: &PortSpec| stated.iter().position(|port| port.fill == fills && port.name == spec.name);
            let port = |spec: &PortSpec| port(spec).map(|port| (port, stated[port].shape.clone()));
            declared.iter().filter_map(port).collect()
        };
        let own = bench.facts.iter().filter(|(role, _)| role.name == key.name).flat_map(|(_, table)| &table.entries);
        let own = own.filter_map(|(fact, value)| Some((fact.name.clone().into(), toml::Value::try_from(value).ok()?)));
        // The bench knows better than the device.
        let own: Vec<(Cow<'static, str>, toml::Value)> = own.collect();
        let stated =
            description.fills[fills].facts.iter().filter(|(name, _)| !own.iter().any(|(fact, _)| fact == name));
        let facts = stated.cloned().chain(own.iter().cloned()).collect();
        Some(BoundRole {
            device,
            fills,
            outputs: number(&description.outputs, &role.outputs),
            commands: number(&description.commands, &role.commands),
            reports: number(&description.reports, &role.reports),
            facts,
        })
    }

    /// Returns the index of the role of an opened device that a binding means.
    fn fill(&self, device: usize, binding: &Binding, key: &Key, kind: &Spanned<String>) -> Result<usize, Diagnostic> {
        let description = &self.opened.devices[device].description;
        let fills = 0..description.fills.len();
        let fit: Vec<usize> = fills.filter(|i| self.can_fill(&description.fills[*i].role, &kind.value)).collect();
        let wrong = |message: String| Diagnostic::new(Code::WrongRole, binding.word.span.clone(), message);
        let (word, role) = (&binding.word.value, &key.name);
        if fit.is_empty() {
            let message =
                format!("device `{}` cannot fill the role `{role}` of type `{}`", binding.device(), kind.value);
            return Err(wrong(message).help(format!("it can fill: {}", quoted(description.roles()))));
        }
        let fills = sides::choose(description, &fit, binding, role)?;
        match self.taken.get(&(device, fills)) {
            Some(by) => {
                let message = format!("device `{word}` already fills the role `{by}`");
                Err(wrong(message).help("bind each role to its own device"))
            }
            None => Ok(fills),
        }
    }

    /// Reports that no device is bound to a role: a binding has a similar name or is the only one left over, or there is
    /// none.
    fn unbound(&mut self, bench: &BenchDocument, role: &Key, kind: &str) -> Diagnostic {
        let name = &role.name;
        let strange = self.strange_bindings(bench);
        let only = strange.first().filter(|_| strange.len() == 1 && self.unbound.len() == 1);
        let only = only.filter(|key| {
            let device = bench.bind.iter().find(|(other, _)| other.name == key.name);
            let device = device.and_then(|(_, binding)| self.device(bench, &binding.device_word()));
            device.is_some_and(|device| {
                self.opened.devices[device].description.roles().any(|role| self.can_fill(role, kind))
            })
        });
        let similar = suggest_name(name, strange.iter().map(|key| key.name.as_str()));
        if let Some(binding) = strange.iter().find(|key| similar == Some(&key.name)).or(only) {
            let message = format!("the task has no role `{}`, and its role `{name}` is not bound", binding.name);
            let diagnostic = Diagnostic::new(Code::UnboundRole, binding.span.clone(), message);
            return diagnostic.note(role.span.clone(), "the role is here").instead(&binding.name, name);
        }
        let message = format!("the bench does not bind the role `{name}`");
        let device = self.device_for(bench, name, kind);
        let devices = quoted(bench.devices.iter().map(|device| device.key.name.as_str()));
        let Some(device) = device else {
            let help = format!("bind it to a device of a type that fills `{kind}`; the devices here are {devices}");
            let place = bench.place.as_ref().unwrap_or(&role.span).clone();
            let diagnostic = Diagnostic::new(Code::UnboundRole, place, message).help(help);
            return if bench.place.is_some() {
                diagnostic.note(role.span.clone(), "the role is here")
            } else {
                diagnostic
            };
        };
        let line = format!("{name} = \"{device}\"");
        let help = format!("add `{line}` under [bind]");
        match (&bench.place, bench.devices.first()) {
            (Some(place), _) => Diagnostic::new(Code::UnboundRole, place.clone(), message)
                .note(role.span.clone(), "the role is here")
                .edit(Edit::Below(place.clone(), line)),
            (None, Some(device)) => Diagnostic::new(Code::UnboundRole, role.span.clone(), message)
                .edit(Edit::Append(device.key.span.clone(), format!("\n[bind]\n{line}"))),
            (None, None) => Diagnostic::new(Code::UnboundRole, role.span.clone(), message),
        }
        .help(help)
    }

    /// Returns a type of role by its name.
    fn role_type(&self, name: &str) -> Option<&'a RoleType> {
        self.net.map_or_else(|| self.catalogue.role_type(name), |net| net.role_type(name))
    }

    /// Returns whether a device that fills roles of the type `filled` can fill one of the type `kind`.
    fn can_fill(&self, filled: &str, kind: &str) -> bool {
        self.role_type(kind).is_some_and(|role| role.is_filled_by(filled))
    }

    /// Returns the binding of a role to a device that can fill it: to one with the name of the role, or to the first that
    /// has a place for such a role.
    fn device_for(&mut self, bench: &BenchDocument, role: &str, kind: &str) -> Option<String> {
        let names: Vec<Spanned<String>> = bench
            .devices
            .iter()
            .map(|device| Spanned { value: device.key.name.clone(), span: device.key.span.clone() })
            .collect();
        let mut fitting = Vec::new();
        for word in names {
            let Some(device) = self.device(bench, &word) else { continue };
            let is_of_kind = |name: &Key| self.kinds.get(&name.name).is_some_and(|taken| taken == kind);
            let taken: BTreeSet<&str> = bench
                .bind
                .iter()
                .filter(|(name, _)| is_of_kind(name))
                .map(|(_, binding)| &*binding.word.value)
                .collect();
            let fills = self.opened.devices[device].description.fills.iter();
            let fit = fills.filter(|fill| self.can_fill(&fill.role, kind)).map(|fill| fill.side.as_deref());
            let free: Vec<Option<&str>> =
                fit.filter(|side| !taken.contains(&*binding_to(&word.value, *side))).collect();
            let named = sides::named_in(role, free.iter().copied().flatten());
            let side = named.map(Some).or_else(|| free.first().copied());
            fitting.extend(side.map(|side| binding_to(&word.value, side)));
        }
        fitting
            .iter()
            .position(|name| name == role)
            .map(|at| fitting[at].clone())
            .or_else(|| fitting.into_iter().next())
    }

    /// Returns the bindings of names that are neither roles of the task nor roles for scenarios.
    fn strange_bindings<'b>(&self, bench: &'b BenchDocument) -> Vec<&'b Key> {
        let keys = bench.bind.iter().map(|(key, _)| key);
        let is_observed = |key: &Key| self.catalogue.roles().iter().any(|role| role.is_observed_as(&key.name));
        keys.filter(|key| !self.kinds.contains_key(&key.name) && !is_observed(key)).collect()
    }

    /// Opens a device, the first time it is named. Returns its index, or `None` if it has mistakes.
    pub(super) fn device(&mut self, bench: &BenchDocument, word: &Spanned<String>) -> Option<usize> {
        if let Some(opened) = self.tried.get(&word.value) {
            return *opened;
        }
        let opened = self.open(bench, word);
        self.tried.insert(word.value.clone(), opened);
        opened
    }

    fn open(&mut self, bench: &BenchDocument, word: &Spanned<String>) -> Option<usize> {
        let Some(block) = self.blocks.get(&*word.value).copied() else {
            self.diagnostics.push(unknown_device(word, bench));
            return None;
        };
        if let Some(recorded) = self.recorded {
            return self.open_recorded(recorded, block);
        }
        let kind = block.kind.as_ref()?;
        let device = self.catalogue.find_device(&kind.value)?;
        let specs = device.params();
        let mut reader = Reader::new(self.sources).with_units(KnownUnits::of_params(&block.params, &specs));
        let opened = device.open(&block.params, &mut reader);
        let Reader { mistakes, warnings, measured, files, .. } = reader;
        self.sources.add_named(files);
        self.opened.measured.add(None, measured);
        let found = mistakes.into_iter().chain(warnings).collect();
        place_mistakes(found, &block.params, &[], self.sources, self.diagnostics);
        let crate::device::Opened { mut description, driver } = opened?;
        self.name_own_role(block, &mut description);
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
        self.diagnostics.extend(allow_return(block, &driver, &mut description));
        description.slow_down(self.slow);
        let (name, span) = (word.value.clone(), block.key.span.clone());
        self.opened.devices.push(PlannedDevice { name, driver, description, span });
        Some(self.opened.devices.len() - 1)
    }

    /// Gives the role of a node that computes beside the tick the name that it has in this graph.
    fn name_own_role(&self, block: &Block, description: &mut Description) {
        let kind = block.kind.as_ref().map_or("", |kind| &*kind.value);
        let name = role_type_of(kind, &block.key.name);
        if self.role_type(&name).is_some() {
            description.fills.iter_mut().for_each(|fill| fill.role = name.clone().into());
        }
    }

    /// Reports where the ports of a device differ from those of its roles, and adds the reports that it does not read.
    pub(super) fn check_ports(&mut self, description: &mut Description, block: &Block) -> bool {
        let before = self.diagnostics.len();
        let wrong = |message: String| {
            let kind = block.kind.as_ref().map_or("", |kind| &kind.value);
            let help = format!("the mistake is in the device type `{kind}`, not in this file");
            Diagnostic::new(Code::WrongRole, block.key.span.clone(), message).help(help)
        };
        let device = &block.key.name;
        let indistinct = sides::indistinct(description);
        self.diagnostics.extend(indistinct.map(|what| wrong(format!("device `{device}` {what}"))));
        for fill in 0..description.fills.len() {
            let name = description.fills[fill].role.clone();
            let message = match self.role_type(&name) {
                Some(role) => {
                    let misfits = description.misfits(fill, role);
                    description.add_optional_ports(fill, role);
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
            self.diagnostics.push(wrong(message));
        }
        self.diagnostics.len() == before
    }
}

/// Returns the text that binds a role to a device, or to a side of it.
fn binding_to(device: &str, side: Option<&str>) -> String {
    side.map_or_else(|| device.to_owned(), |side| format!("{device}.{side}"))
}

fn unknown_device(word: &Spanned<String>, bench: &BenchDocument) -> Diagnostic {
    let message = format!("the bench has no device `{}`", word.value);
    let known = bench.devices.iter().map(|device| device.key.name.as_str());
    Diagnostic::new(Code::UnknownDevice, word.span.clone(), message).suggest(&word.value, known, "devices")
}
