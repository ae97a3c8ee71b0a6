//! The bench: opens the devices that the graph's roles are bound to.

use std::borrow::Cow;
use std::ops::Range;

use crate::catalogue::Catalogue;
use crate::device::{Description, StatedPort};
use crate::graph::net::Net;
use crate::graph::plan::PlannedDevice;
use crate::graph::syntax::{Bench, Block};
use crate::node::{Mistake, PortSpec, Reader, Word};
use crate::signal::Shape;
use crate::source::{Code, Diagnostic, Key, SourceMap, Value, meant};

/// A role with the device that fills it. Ports stand in the order of the role, each with its number in the device.
#[derive(Debug, Clone)]
pub(crate) struct BoundRole {
    /// Index among the opened devices.
    pub(crate) device: usize,
    pub(crate) outputs: Vec<(usize, Shape)>,
    pub(crate) commands: Vec<(usize, Shape)>,
    pub(crate) reports: Vec<(usize, Shape)>,
    pub(crate) facts: Vec<(Cow<'static, str>, toml::Value)>,
}

/// The devices that are needed, and which role each fills.
#[derive(Default)]
pub(crate) struct Opened {
    pub(crate) devices: Vec<PlannedDevice>,
    /// Nominal time between two samples of each device [s].
    pub(crate) periods: Vec<f64>,
    pub(crate) roles: Vec<Option<BoundRole>>,
    /// What only a scenario and the recorder may read, as the net has it.
    pub(crate) observed: Vec<Option<BoundRole>>,
}

impl Opened {
    /// What the devices state of themselves: `role.fact`, and the value.
    pub(crate) fn facts(&self, net: &Net<'_>) -> Vec<(String, toml::Value)> {
        let observed = net.observed.iter().map(|(key, ..)| *key).zip(&self.observed);
        let roles = net.flat.roles.iter().map(|(key, _)| key).zip(&self.roles).chain(observed);
        let facts = roles.flat_map(|(key, bound)| bound.iter().flat_map(|bound| &bound.facts).map(move |f| (key, f)));
        facts.map(|(key, (fact, value))| (format!("{}.{fact}", key.name), value.clone())).collect()
    }
}

/// Opens what the roles are bound to.
pub(crate) fn open(net: &Net<'_>, sources: &mut SourceMap, found: &mut Vec<Diagnostic>) -> Opened {
    let mut opener = Opener {
        catalogue: net.catalogue,
        sources,
        found,
        names: Vec::new(),
        taken: Vec::new(),
        opened: Opened::default(),
    };
    let bench = net.flat.bench.as_ref();
    if let Some(bench) = bench {
        opener.check_types(bench);
        opener.check_rest(bench, net);
    }
    for (i, (key, kind)) in net.flat.roles.iter().enumerate() {
        let role = match bench {
            Some(bench) if net.roles[i].is_some() => opener.role(bench, key, kind),
            _ => None,
        };
        opener.opened.roles.push(role);
    }
    for (key, _, role) in &net.observed {
        let kind = Word { text: role.name.to_string(), span: key.span.clone() };
        let bound = bench.and_then(|bench| opener.role(bench, key, &kind));
        opener.opened.observed.push(bound);
    }
    opener.opened
}

/// Periods of a device that make sense, in nanoseconds too [s].
const PERIODS: std::ops::RangeInclusive<f64> = 1e-6..=1e3;

struct Opener<'a> {
    catalogue: &'a Catalogue,
    sources: &'a mut SourceMap,
    found: &'a mut Vec<Diagnostic>,
    /// Devices that were opened or tried, with the description if it went well.
    names: Vec<(String, Option<(usize, Description)>)>,
    /// Roles of a device that are filled already: device, index of the filling, by whom.
    taken: Vec<(usize, usize, String)>,
    opened: Opened,
}

impl Opener<'_> {
    /// What no role asks for is not opened, but what it says must still mean something.
    fn check_rest(&mut self, bench: &Bench, net: &Net<'_>) {
        let names = || bench.devices.iter().map(|device| device.key.name.as_str());
        let is_used = |role: &Key| {
            let declared = net.flat.roles.iter().map(|(key, _)| key);
            declared.chain(net.observed.iter().map(|(key, ..)| *key)).any(|key| key.name == role.name)
        };
        // A spare binding may be for another task, but what only scenarios read is no task's.
        let read_by_scenarios =
            || self.catalogue.roles().iter().filter(|role| role.is_observed).map(|role| role.observed_name());
        for (role, word) in bench.bind.iter().filter(|(role, _)| !is_used(role)) {
            let is_right = self.catalogue.roles().iter().any(|known| known.is_observed_as(&role.name));
            if let Some(meant) = meant(&role.name, read_by_scenarios()).filter(|_| !is_right) {
                let message = format!("`{}` binds nothing that a scenario could read", role.name);
                let diagnostic = Diagnostic::new(Code::ObservedRole, role.span.clone(), message);
                self.found.push(diagnostic.help(format!("did you mean `{meant}`?")));
            }
            if !names().any(|name| name == word.text) {
                self.found.push(no_device(word, bench));
            }
        }
        for device in &bench.devices {
            let is_opened = bench.bind.iter().any(|(role, word)| word.text == device.key.name && is_used(role));
            let kind = device.kind.as_ref().filter(|_| !is_opened);
            let kind = self.catalogue.devices().iter().find(|known| kind.is_some_and(|kind| known.name() == kind.text));
            let (Some(kind), Some(table)) = (kind, device.params.as_table()) else { continue };
            let params = kind.params();
            for (key, _) in table.entries.iter().filter(|(key, _)| !params.iter().any(|param| param.name == key.name)) {
                let message = format!("`{}` is not a parameter here", key.name);
                self.found.push(Diagnostic::new(Code::UnknownKey, key.span.clone(), message).suggest(
                    &key.name,
                    params.iter().map(|param| param.name),
                    "parameters",
                ));
            }
        }
    }

    fn check_types(&mut self, bench: &Bench) {
        for kind in bench.devices.iter().filter_map(|device| device.kind.as_ref()) {
            if !self.catalogue.devices().iter().any(|device| device.name() == kind.text) {
                let names: Vec<_> = self.catalogue.devices().iter().map(|device| device.name()).collect();
                let message = format!("there is no device type `{}`", kind.text);
                self.found.push(Diagnostic::new(Code::UnknownType, kind.span.clone(), message).suggest(
                    &kind.text,
                    names.iter().map(|name| &**name),
                    "device types",
                ));
            }
        }
    }

    fn role(&mut self, bench: &Bench, key: &Key, kind: &Word) -> Option<BoundRole> {
        let Some((_, word)) = bench.bind.iter().find(|(role, _)| role.name == key.name) else {
            let message = format!("the bench binds role `{}` to no device", key.name);
            let help = format!("add `{} = \"device\"` under [bind] in the bench", key.name);
            self.found.push(Diagnostic::new(Code::UnboundRole, key.span.clone(), message).help(help));
            return None;
        };
        let (device, description) = self.device(bench, word)?;
        let is_free = |i: &usize| !self.taken.iter().any(|(d, filled, _)| (*d, filled) == (device, i));
        let mut fitting = (0..description.fills.len()).filter(|i| description.fills[*i].role == kind.text);
        let Some(fills) = fitting.clone().find(is_free) else {
            let by = fitting.next().and_then(|i| self.taken.iter().find(|(d, filled, _)| (*d, *filled) == (device, i)));
            let message = match by {
                Some((_, _, by)) => format!("device `{}` fills role `{by}` already", word.text),
                None => format!("device `{}` cannot be a `{}`, which role `{}` is", word.text, kind.text, key.name),
            };
            let roles: Vec<_> = description.fills.iter().map(|filled| format!("`{}`", filled.role)).collect();
            let help = match by {
                Some(_) => "give each role a device of its own".to_owned(),
                None => format!("it can be: {}", roles.join(", ")),
            };
            self.found.push(Diagnostic::new(Code::WrongRole, word.span.clone(), message).help(help));
            return None;
        };
        self.taken.push((device, fills, key.name.clone()));
        let role = self.catalogue.roles().iter().find(|role| role.name == kind.text)?;
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

    fn device(&mut self, bench: &Bench, word: &Word) -> Option<(usize, Description)> {
        if let Some((_, opened)) = self.names.iter().find(|(name, _)| *name == word.text) {
            return opened.clone();
        }
        let opened = self.open(bench, word);
        self.names.push((word.text.clone(), opened.clone()));
        opened
    }

    fn open(&mut self, bench: &Bench, word: &Word) -> Option<(usize, Description)> {
        let Some(block) = bench.devices.iter().find(|device| device.key.name == word.text) else {
            self.found.push(no_device(word, bench));
            return None;
        };
        let kind = block.kind.as_ref()?;
        let device = self.catalogue.devices().iter().find(|device| device.name() == kind.text)?;
        let mut reader = Reader::new(self.sources);
        let opened = device.open(&block.params, &mut reader);
        let mistakes = reader.mistakes;
        place(mistakes, &block.params, &[], self.sources, self.found);
        let crate::device::Opened { mut description, driver } = opened?;
        let period = description.period;
        if !PERIODS.contains(&period) {
            let message = format!("device `{}` says that it samples every {period:e} s", word.text);
            let help = format!("a period is from {:e} to {:e} s", PERIODS.start(), PERIODS.end());
            self.found.push(Diagnostic::new(Code::BadClock, block.key.span.clone(), message).help(help));
            return None;
        }
        if !self.fits(&mut description, block) {
            return None;
        }
        let (name, span) = (word.text.clone(), block.key.span.clone());
        self.opened.devices.push(PlannedDevice { name, driver, description: description.clone(), span });
        self.opened.periods.push(period);
        Some((self.opened.devices.len() - 1, description))
    }

    /// Compares what a device states of its roles with the roles, and adds the reports that it does not read.
    fn fits(&mut self, description: &mut Description, block: &Block) -> bool {
        let before = self.found.len();
        for fill in 0..description.fills.len() {
            let name = description.fills[fill].role.clone();
            let Some(role) = self.catalogue.roles().iter().find(|role| role.name == name) else { continue };
            let misfits = description.misfits(fill, role);
            if !misfits.is_empty() {
                let device = &block.key.name;
                let message = format!("device `{device}` does not match the role `{name}`: {}", misfits.join("; "));
                let kind = block.kind.as_ref().map_or("", |kind| &kind.text);
                let help = format!("the mistake is in the device type `{kind}`, not in this file");
                self.found.push(Diagnostic::new(Code::WrongRole, block.key.span.clone(), message).help(help));
            }
            description.add_reports(fill, role);
        }
        self.found.len() == before
    }
}

fn no_device(word: &Word, bench: &Bench) -> Diagnostic {
    let message = format!("the bench has no device `{}`", word.text);
    Diagnostic::new(Code::UnknownDevice, word.span.clone(), message).suggest(
        &word.text,
        bench.devices.iter().map(|device| device.key.name.as_str()),
        "devices",
    )
}

/// Gives mistakes their place: in the block they speak of, in a wire, or in a file of data.
pub(crate) fn place(
    mistakes: Vec<Mistake>,
    block: &Value,
    wires: &[(Key, Word)],
    sources: &mut SourceMap,
    found: &mut Vec<Diagnostic>,
) {
    use crate::node::At;
    for Mistake { code, at, message, help } in mistakes {
        let mut notes = Vec::new();
        let span = match at {
            At::Span(span) => span,
            At::Node => block.span.clone(),
            At::Param(path) => lookup(block, &path).map_or(block.span.clone(), |(_, value)| value),
            At::Key(path) => lookup(block, &path).map_or(block.span.clone(), |(key, _)| key),
            At::Input(name) => {
                wires.iter().find(|(key, _)| key.name == name).map_or(&block.span, |(_, w)| &w.span).clone()
            }
            At::Data { file, text, span } => {
                notes.push((file.span.clone(), "the file is named here".to_owned()));
                let base = sources.add_file(&file.path, &*text).base;
                base + span.start..base + span.end
            }
        };
        found.push(Diagnostic { code, message, span, notes, help });
    }
}

/// Places of the key and of the value at a dotted path.
fn lookup(block: &Value, path: &str) -> Option<(Range<usize>, Range<usize>)> {
    let mut value = block;
    let mut key = block.span.clone();
    for name in path.split('.') {
        let (found, inner) = value.as_table()?.entry(name)?;
        (key, value) = (found.span.clone(), inner);
    }
    Some((key, value.span.clone()))
}
