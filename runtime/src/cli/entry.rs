//! What the catalogue says of one thing: the page of `describe`, as data. Its JSON is this, and its text is made of it.

use std::borrow::Cow;

use serde::Serialize;

use super::example::{self, Asked};
use crate::catalogue::Catalogue;
use crate::device::{DeviceType, RoleType};
use crate::node::{Need, NodeSpec, ParamSpec, PortSpec, Repeats};
use crate::node::{frame_args, may_fit};
use crate::record::recorded;
use crate::signal::Kind;

/// What sort of thing it is, in the order of the lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Sort {
    Node,
    Device,
    Role,
    Kind,
    File,
}

impl Sort {
    pub(super) const ALL: [Self; 5] = [Self::Node, Self::Device, Self::Role, Self::Kind, Self::File];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Node => "node",
            Self::Device => "device",
            Self::Role => "role",
            Self::Kind => "kind",
            Self::File => "file",
        }
    }
}

/// One thing of the catalogue.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Entry {
    pub(super) sort: Sort,
    pub(super) name: String,
    pub(super) summary: String,
    /// Title of its group.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub(super) group: &'static str,
    pub(super) doc: String,
    /// When a node steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) steps: Option<&'static str>,
    pub(super) inputs: Vec<Port>,
    pub(super) outputs: Vec<Port>,
    /// What a role takes.
    pub(super) commands: Vec<Port>,
    /// What a role may be told without moving.
    pub(super) reports: Vec<Port>,
    pub(super) params: Vec<Param>,
    /// Roles that a device fills, or devices that fill a role, as far as the examples tell.
    pub(super) fits: Vec<String>,
    /// Limits that a node holds, or that a role's commands must have crossed.
    pub(super) limits: Vec<String>,
    /// How a kind is recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) recorded: Option<&'static str>,
    /// Its own block of a graph file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) block: Option<String>,
    /// A whole graph around it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) example: Option<String>,
}

/// A port, with its declaration in words.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Port {
    pub(super) name: String,
    pub(super) kind: &'static str,
    /// Unit as declared; a capital letter is a variable of the node.
    pub(super) unit: Option<String>,
    pub(super) frames: Vec<String>,
    /// What its absence does, and whether it wakes the node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) need: Option<&'static str>,
    pub(super) doc: String,
    /// Ports at the other end of a wire that fits.
    pub(super) fits: Vec<String>,
}

/// A parameter.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Param {
    pub(super) name: &'static str,
    pub(super) takes: String,
    pub(super) unit: Option<String>,
    /// Lower and upper end of the range; absent where there is none.
    pub(super) range: Option<[Option<f64>; 2]>,
    /// Whether the lower end itself is out of range.
    pub(super) is_open: bool,
    /// The words it takes, each with its meaning.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(super) words: &'static [(&'static str, &'static str)],
    /// As a graph file would say it.
    pub(super) default: Option<String>,
    pub(super) is_required: bool,
    /// Whether a mode can set it.
    pub(super) is_live: bool,
    pub(super) doc: String,
    /// How the path of a field goes on after the parameter's name.
    #[serde(skip)]
    pub(super) then: &'static str,
    pub(super) fields: Vec<Param>,
}

/// Everything in the catalogue, in its order.
pub(super) struct Entries<'a> {
    catalogue: &'a Catalogue,
    nodes: Vec<(&'static str, NodeSpec)>,
}

impl<'a> Entries<'a> {
    pub(super) fn new(catalogue: &'a Catalogue) -> Self {
        let groups = catalogue.groups();
        let nodes = groups.flat_map(|(title, nodes)| nodes.iter().map(move |node| (title, node.spec()))).collect();
        Self { catalogue, nodes }
    }

    /// All of one sort, without their examples.
    pub(super) fn of(&self, sort: Sort) -> Vec<Entry> {
        match sort {
            Sort::Node => self.nodes.iter().map(|(group, spec)| self.node(group, spec)).collect(),
            Sort::Device => self.catalogue.devices().iter().map(|device| self.device(&**device)).collect(),
            Sort::Role => self.catalogue.roles().iter().map(|role| self.role(role)).collect(),
            Sort::Kind => Kind::ALL.iter().map(|kind| self.kind(*kind)).collect(),
            Sort::File => self.catalogue.builtin_files().iter().map(|(name, bytes)| file(name, bytes)).collect(),
        }
    }

    /// Everything, without the examples.
    pub(super) fn all(&self) -> Vec<Entry> {
        Sort::ALL.into_iter().flat_map(|sort| self.of(sort)).collect()
    }

    /// The same with a whole graph around it, or with the reason why there is none.
    pub(super) fn with_example(&self, entry: Entry) -> (Entry, Option<String>) {
        let asked = match entry.sort {
            Sort::Node => Asked::Node(&entry.name),
            Sort::Device => Asked::Device(&entry.name),
            Sort::Role => match entry.fits.first() {
                Some(device) => Asked::Device(device),
                None => return (entry, None),
            },
            Sort::Kind | Sort::File => return (entry, None),
        };
        match example::compose(self.catalogue, asked) {
            Ok(example) => (Entry { example: Some(example), ..entry }, None),
            Err(why) => (entry, Some(why)),
        }
    }

    fn node(&self, group: &'static str, spec: &NodeSpec) -> Entry {
        let inputs = spec.inputs.iter().map(|port| Port { need: Some(need(port.need)), ..self.input(port) });
        Entry {
            group,
            limits: spec.limits.holds.iter().map(ToString::to_string).collect(),
            steps: Some(if spec.every_tick { "in every tick" } else { "when an input that wakes it is new or lost" }),
            inputs: inputs.collect(),
            outputs: spec.outputs.iter().map(|port| self.output(port)).collect(),
            params: spec.params.iter().map(param).collect(),
            block: example::block(&spec.example).map(str::to_owned),
            ..entry(Sort::Node, &spec.name, &spec.summary, &spec.doc)
        }
    }

    fn device(&self, device: &dyn DeviceType) -> Entry {
        let example = device.example();
        Entry {
            params: device.params().iter().map(param).collect(),
            fits: self.roles_of(device),
            block: example::block(&example).map(str::to_owned),
            ..entry(Sort::Device, &device.name(), &device.summary(), &device.doc())
        }
    }

    /// The roles that the example of a device binds it to.
    fn roles_of(&self, device: &dyn DeviceType) -> Vec<String> {
        let example: toml::Table = device.example().parse().unwrap_or_default();
        let roles = example.get("roles").and_then(toml::Value::as_table);
        let kinds = roles.into_iter().flatten().filter_map(|(_, kind)| kind.as_str());
        kinds.map(str::to_owned).collect()
    }

    fn role(&self, role: &RoleType) -> Entry {
        let devices = self.catalogue.devices().iter().map(|device| &**device);
        let fills = devices.filter(|device| self.roles_of(*device).iter().any(|name| *name == role.name));
        let observed = || {
            let name = role.observed_name();
            format!(
                "Only a scenario and the recorder read it. A bench binds it as `{name} = \"device\"`, and no task declares it."
            )
        };
        let doc = role.is_observed.then(observed).unwrap_or_default();
        Entry {
            outputs: role
                .outputs
                .iter()
                .map(|port| if role.is_observed { declared(port) } else { self.output(port) })
                .collect(),
            commands: role.commands.iter().map(|port| self.input(port)).collect(),
            reports: role.reports.iter().map(|port| self.input(port)).collect(),
            fits: fills.map(|device| device.name().into_owned()).collect(),
            limits: role.limits.iter().map(ToString::to_string).collect(),
            ..entry(Sort::Role, &role.name, &role.summary, &doc)
        }
    }

    /// A kind, with the ports that give it and those that take it.
    fn kind(&self, kind: Kind) -> Entry {
        let named = |owner: &str, port: &PortSpec, of: Port| Port { name: format!("{owner}.{}", port.name), ..of };
        let is_meant = |port: &&PortSpec| port.kind == kind;
        let mut entry =
            Entry { recorded: Some(recorded(kind)), ..entry(Sort::Kind, kind.name(), kind.summary(), kind.doc()) };
        for role in self.catalogue.roles() {
            let outputs = role.outputs.iter().filter(is_meant);
            entry.outputs.extend(outputs.map(|port| named(&role.name, port, self.output(port))));
            let commands = role.commands.iter().chain(&role.reports).filter(is_meant);
            entry.inputs.extend(commands.map(|port| named(&role.name, port, self.input(port))));
        }
        for (_, spec) in &self.nodes {
            let outputs = spec.outputs.iter().filter(is_meant);
            entry.outputs.extend(outputs.map(|port| named(&spec.name, port, self.output(port))));
            let inputs = spec.inputs.iter().filter(is_meant);
            entry.inputs.extend(inputs.map(|port| named(&spec.name, port, self.input(port))));
        }
        entry
    }

    /// A port that something reads, and where its wire can come from.
    fn input(&self, port: &PortSpec) -> Port {
        let readable = self.catalogue.roles().iter().filter(|role| !role.is_observed);
        let roles = readable.map(|role| (&role.name, &role.outputs));
        let nodes = self.nodes.iter().map(|(_, spec)| (&spec.name, &spec.outputs));
        let all = roles.chain(nodes).flat_map(|(owner, ports)| ports.iter().map(move |port| (owner, port)));
        Port { fits: best_first(port, all.filter(|(_, output)| may_fit(output, port))), ..declared(port) }
    }

    /// A port that something writes, and where a wire from it can go.
    fn output(&self, port: &PortSpec) -> Port {
        let roles = self.catalogue.roles().iter().map(|role| (&role.name, &role.commands));
        let nodes = self.nodes.iter().map(|(_, spec)| (&spec.name, &spec.inputs));
        let told = self.catalogue.roles().iter().map(|role| (&role.name, &role.reports));
        let all = nodes.chain(roles).chain(told).flat_map(|(owner, ports)| ports.iter().map(move |port| (owner, port)));
        Port { fits: best_first(port, all.filter(|(_, input)| may_fit(port, input))), ..declared(port) }
    }
}

/// Names of the ports at the other end: those that declare the same unit before those that may have it.
fn best_first<'p>(port: &PortSpec, others: impl Iterator<Item = (&'p Cow<'static, str>, &'p PortSpec)>) -> Vec<String> {
    let mut others: Vec<_> = others.collect();
    others.sort_by_key(|(_, other)| port.kind.has_unit() && other.args.first() != port.args.first());
    others.into_iter().map(|(owner, other)| format!("{owner}.{}", other.name)).collect()
}

fn entry(sort: Sort, name: &str, summary: &str, doc: &str) -> Entry {
    Entry {
        sort,
        name: name.to_owned(),
        summary: summary.to_owned(),
        group: "",
        doc: doc.trim().to_owned(),
        steps: None,
        inputs: Vec::new(),
        outputs: Vec::new(),
        commands: Vec::new(),
        reports: Vec::new(),
        params: Vec::new(),
        fits: Vec::new(),
        limits: Vec::new(),
        recorded: None,
        block: None,
        example: None,
    }
}

fn file(name: &str, bytes: &[u8]) -> Entry {
    // A file of ours starts with a comment that says what it is.
    let first = bytes.split(|byte| *byte == b'\n').next().and_then(|line| std::str::from_utf8(line).ok());
    let said = first.and_then(|line| line.strip_prefix("# ")).map(|line| line.trim_end_matches('.').to_owned());
    let size = format!("{} kB", bytes.len().div_ceil(1000));
    let summary = said.map_or_else(|| size.clone(), |said| format!("{said} ({size})"));
    // What takes a part wants to see what goes in, what comes out and what can be set.
    let text = std::str::from_utf8(bytes).ok().filter(|_| name.ends_with(".toml"));
    Entry { block: text.map(str::to_owned), ..entry(Sort::File, &format!("builtin:{name}"), &summary, "") }
}

fn declared(port: &PortSpec) -> Port {
    Port {
        name: port.name.to_string(),
        kind: port.kind.name(),
        unit: port.args.first().filter(|_| port.kind.has_unit()).map(|unit| unit.to_string()),
        frames: frame_args(port).iter().map(ToString::to_string).collect(),
        need: None,
        doc: port.doc.trim().lines().map(str::trim).collect::<Vec<_>>().join(" "),
        fits: Vec::new(),
    }
}

/// What an input needs, in words.
const fn need(need: Need) -> &'static str {
    match need {
        Need { is_many: true, is_trigger: true, .. } => "any number, each named in the graph; each wakes the node",
        Need { is_many: true, .. } => "any number, each named in the graph; only the loss of one wakes the node",
        Need { is_delayed: true, must_be_wired: false, .. } => {
            "optional, as the last tick left it; wakes the node only if no other input does"
        }
        Need { is_delayed: true, .. } => "as the last tick left it; wakes the node only if no other input does",
        Need { must_be_wired: true, must_be_present: true, is_trigger: true, .. } => "required, wakes the node",
        Need { must_be_wired: true, must_be_present: true, .. } => "required, only its loss wakes the node",
        Need { must_be_wired: true, is_trigger: true, .. } => "required but may be absent, wakes the node",
        Need { must_be_wired: true, .. } => "required but may be absent, only its loss wakes the node",
        Need { must_be_present: true, is_trigger: true, .. } => "optional, required if wired, wakes the node",
        Need { must_be_present: true, .. } => "optional, required if wired, only its loss wakes the node",
        Need { is_trigger: true, .. } => "optional, wakes the node",
        Need { .. } => "optional, only its loss wakes the node",
    }
}

fn param(spec: &ParamSpec) -> Param {
    Param {
        name: spec.name,
        takes: spec.takes.clone(),
        unit: spec.unit.clone(),
        range: spec.bounds.map(|bounds| [bounds.min, bounds.max].map(|end| Some(end).filter(|end| end.is_finite()))),
        is_open: spec.bounds.is_some_and(|bounds| bounds.is_open),
        words: spec.words,
        default: spec.default.clone(),
        is_required: !spec.is_optional,
        is_live: spec.is_live,
        doc: spec.doc_with_unit(),
        then: match spec.repeats {
            Repeats::Once => ".",
            Repeats::PerName => ".NAME.",
            Repeats::PerEntry => "[].",
        },
        fields: spec.fields.iter().map(param).collect(),
    }
}
