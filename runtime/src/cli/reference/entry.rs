//! The documentation of the catalogue as data: the JSON of `describe`, from which its text is made.

use std::borrow::Cow;

use serde::Serialize;

use super::example::{self, Target};
use crate::catalogue::Catalogue;
use crate::device::{DeviceType, RoleType};
use crate::node::{Need, NodeSpec, ParamSpec, PortSpec, Repeats};
use crate::node::{frame_args, may_fit};
use crate::record::recorded;
use crate::signal::Kind;

/// The categories, in the order of the lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Category {
    Node,
    Device,
    Role,
    Kind,
    File,
}

impl Category {
    /// All categories.
    pub(crate) const ALL: [Self; 5] = [Self::Node, Self::Device, Self::Role, Self::Kind, Self::File];

    /// Returns its name.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Node => "node",
            Self::Device => "device",
            Self::Role => "role",
            Self::Kind => "kind",
            Self::File => "file",
        }
    }
}

/// One entry of the catalogue.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Entry {
    pub(crate) category: Category,
    pub(crate) name: String,
    pub(crate) summary: String,
    /// Title of the group it belongs to.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub(crate) group: &'static str,
    pub(crate) doc: String,
    /// When a node steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) steps: Option<&'static str>,
    pub(crate) inputs: Vec<PortEntry>,
    pub(crate) outputs: Vec<PortEntry>,
    /// Commands of a role.
    pub(crate) commands: Vec<PortEntry>,
    /// Ports of a role that take information without moving anything.
    pub(crate) reports: Vec<PortEntry>,
    pub(crate) params: Vec<ParamEntry>,
    /// Roles that a device fills, or devices that fill a role, according to the examples.
    pub(crate) fits: Vec<String>,
    /// Limits that a node enforces, or that the commands of a role must cross.
    pub(crate) limits: Vec<String>,
    /// How a kind is recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) recorded: Option<&'static str>,
    /// Its own block of the example graph, or the text of a built-in file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) block: Option<String>,
    /// A complete example graph.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) example: Option<String>,
}

/// A port as it is declared.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct PortEntry {
    pub(crate) name: String,
    pub(crate) kind: &'static str,
    /// Unit as declared; a capital letter is a variable of the node.
    pub(crate) unit: Option<String>,
    pub(crate) frames: Vec<String>,
    /// Whether it must be wired, and whether it wakes the node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) need: Option<&'static str>,
    pub(crate) doc: String,
    /// Ports that a wire can connect it to.
    pub(crate) fits: Vec<String>,
}

/// A parameter.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ParamEntry {
    pub(crate) name: &'static str,
    pub(crate) takes: String,
    pub(crate) unit: Option<String>,
    /// Lower and upper end of the range; `None` where there is none.
    pub(crate) range: Option<[Option<f64>; 2]>,
    /// Whether the lower end itself is out of range.
    pub(crate) is_open: bool,
    /// The words that it accepts, each with its meaning.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) words: &'static [(&'static str, &'static str)],
    /// Default value as TOML.
    pub(crate) default: Option<String>,
    pub(crate) is_required: bool,
    /// Whether a mode can set it.
    pub(crate) is_live: bool,
    pub(crate) doc: String,
    /// Text between the name of the parameter and the name of a field in a path.
    #[serde(skip)]
    pub(crate) separator: &'static str,
    pub(crate) fields: Vec<ParamEntry>,
}

/// Access to the entries of a catalogue, in its order.
pub(crate) struct Entries<'a> {
    catalogue: &'a Catalogue,
    nodes: Vec<(&'static str, NodeSpec)>,
}

impl<'a> Entries<'a> {
    pub(crate) fn new(catalogue: &'a Catalogue) -> Self {
        let groups = catalogue.groups();
        let nodes = groups.flat_map(|(title, nodes)| nodes.iter().map(move |node| (title, node.spec()))).collect();
        Self { catalogue, nodes }
    }

    /// Returns the entries of one category, without example graphs.
    pub(crate) fn of(&self, category: Category) -> Vec<Entry> {
        match category {
            Category::Node => self.nodes.iter().map(|(group, spec)| self.node(group, spec)).collect(),
            Category::Device => self.catalogue.devices().iter().map(|device| self.device(&**device)).collect(),
            Category::Role => self.catalogue.roles().iter().map(|role| self.role(role)).collect(),
            Category::Kind => Kind::ALL.iter().map(|kind| self.kind(*kind)).collect(),
            Category::File => self.catalogue.builtin_files().iter().map(|(name, bytes)| file(name, bytes)).collect(),
        }
    }

    /// Returns all entries, without example graphs.
    pub(crate) fn all(&self) -> Vec<Entry> {
        Category::ALL.into_iter().flat_map(|category| self.of(category)).collect()
    }

    /// Adds the example graph to an entry, or returns the reason why there is none.
    pub(crate) fn with_example(&self, entry: Entry) -> (Entry, Option<String>) {
        let target = match entry.category {
            Category::Node => Target::Node(&entry.name),
            Category::Device => Target::Device(&entry.name),
            Category::Role => match entry.fits.first() {
                Some(device) => Target::Device(device),
                None => return (entry, None),
            },
            Category::Kind | Category::File => return (entry, None),
        };
        match example::compose(self.catalogue, target) {
            Ok(example) => (Entry { example: Some(example), ..entry }, None),
            Err(why) => (entry, Some(why)),
        }
    }

    fn node(&self, group: &'static str, spec: &NodeSpec) -> Entry {
        let inputs = spec.inputs.iter().map(|port| PortEntry { need: Some(need(port.need)), ..self.input(port) });
        Entry {
            group,
            limits: spec.limits.holds.iter().map(ToString::to_string).collect(),
            steps: Some(if spec.every_tick { "in every tick" } else { "when an input that wakes it is new or lost" }),
            inputs: inputs.collect(),
            outputs: spec.outputs.iter().map(|port| self.output(port)).collect(),
            params: spec.params.iter().map(param).collect(),
            block: example::block(&spec.example).map(str::to_owned),
            ..entry(Category::Node, &spec.name, &spec.summary, &spec.doc)
        }
    }

    fn device(&self, device: &dyn DeviceType) -> Entry {
        let example = device.example();
        Entry {
            params: device.params().iter().map(param).collect(),
            fits: self.roles_of(device),
            block: example::block(&example).map(str::to_owned),
            ..entry(Category::Device, &device.name(), &device.summary(), &device.doc())
        }
    }

    /// Returns the roles that the example of a device binds it to.
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
            ..entry(Category::Role, &role.name, &role.summary, &doc)
        }
    }

    /// Describes a kind, with the ports that produce it and those that take it.
    fn kind(&self, kind: Kind) -> Entry {
        let named =
            |owner: &str, port: &PortSpec, of: PortEntry| PortEntry { name: format!("{owner}.{}", port.name), ..of };
        let is_meant = |port: &&PortSpec| port.kind == kind;
        let mut entry =
            Entry { recorded: Some(recorded(kind)), ..entry(Category::Kind, kind.name(), kind.summary(), kind.doc()) };
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

    /// Describes an input, with the outputs that its wire can come from.
    fn input(&self, port: &PortSpec) -> PortEntry {
        let readable = self.catalogue.roles().iter().filter(|role| !role.is_observed);
        let roles = readable.map(|role| (&role.name, &role.outputs));
        let nodes = self.nodes.iter().map(|(_, spec)| (&spec.name, &spec.outputs));
        let all = roles.chain(nodes).flat_map(|(owner, ports)| ports.iter().map(move |port| (owner, port)));
        PortEntry { fits: best_first(port, all.filter(|(_, output)| may_fit(output, port))), ..declared(port) }
    }

    /// Describes an output, with the inputs that a wire from it can lead to.
    fn output(&self, port: &PortSpec) -> PortEntry {
        let roles = self.catalogue.roles().iter().map(|role| (&role.name, &role.commands));
        let nodes = self.nodes.iter().map(|(_, spec)| (&spec.name, &spec.inputs));
        let reports = self.catalogue.roles().iter().map(|role| (&role.name, &role.reports));
        let all =
            nodes.chain(roles).chain(reports).flat_map(|(owner, ports)| ports.iter().map(move |port| (owner, port)));
        PortEntry { fits: best_first(port, all.filter(|(_, input)| may_fit(port, input))), ..declared(port) }
    }
}

/// Returns the names of ports that fit `port`; ports that declare the same unit come first.
fn best_first<'p>(port: &PortSpec, others: impl Iterator<Item = (&'p Cow<'static, str>, &'p PortSpec)>) -> Vec<String> {
    let mut others: Vec<_> = others.collect();
    others.sort_by_key(|(_, other)| port.kind.has_unit() && other.args.first() != port.args.first());
    others.into_iter().map(|(owner, other)| format!("{owner}.{}", other.name)).collect()
}

fn entry(category: Category, name: &str, summary: &str, doc: &str) -> Entry {
    Entry {
        category,
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
    // The first line of a built-in file is a comment with its summary.
    let first = bytes.split(|byte| *byte == b'\n').next().and_then(|line| std::str::from_utf8(line).ok());
    let comment = first.and_then(|line| line.strip_prefix("# ")).map(|line| line.trim_end_matches('.').to_owned());
    let size = format!("{} kB", bytes.len().div_ceil(1000));
    let summary = comment.map_or_else(|| size.clone(), |comment| format!("{comment} ({size})"));
    // The text of a part shows its inputs, its exports and its parameters.
    let text = std::str::from_utf8(bytes).ok().filter(|_| name.ends_with(".toml"));
    Entry { block: text.map(str::to_owned), ..entry(Category::File, &format!("builtin:{name}"), &summary, "") }
}

fn declared(port: &PortSpec) -> PortEntry {
    PortEntry {
        name: port.name.to_string(),
        kind: port.kind.name(),
        unit: port.args.first().filter(|_| port.kind.has_unit()).map(|unit| unit.to_string()),
        frames: frame_args(port).iter().map(ToString::to_string).collect(),
        need: None,
        doc: port.doc.trim().lines().map(str::trim).collect::<Vec<_>>().join(" "),
        fits: Vec::new(),
    }
}

/// Describes what an input needs.
const fn need(need: Need) -> &'static str {
    match need {
        Need { is_many: true, is_trigger: true, .. } => "any number of inputs, named in the graph; each wakes the node",
        Need { is_many: true, .. } => "any number of inputs, named in the graph; each wakes the node when it is lost",
        Need { is_delayed: true, must_be_wired: false, .. } => {
            "optional, the value of the previous tick; wakes the node only if no other input does"
        }
        Need { is_delayed: true, .. } => "the value of the previous tick; wakes the node only if no other input does",
        Need { must_be_wired: true, must_be_present: true, is_trigger: true, .. } => "required, wakes the node",
        Need { must_be_wired: true, must_be_present: true, .. } => "required, wakes the node only when it is lost",
        Need { must_be_wired: true, is_trigger: true, .. } => "must be wired, may be absent, wakes the node",
        Need { must_be_wired: true, .. } => "must be wired, may be absent, wakes the node only when it is lost",
        Need { must_be_present: true, is_trigger: true, .. } => "optional, must be present if wired, wakes the node",
        Need { must_be_present: true, .. } => "optional, must be present if wired, wakes the node only when it is lost",
        Need { is_trigger: true, .. } => "optional, wakes the node",
        Need { .. } => "optional, wakes the node only when it is lost",
    }
}

fn param(spec: &ParamSpec) -> ParamEntry {
    ParamEntry {
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
        separator: match spec.repeats {
            Repeats::Once => ".",
            Repeats::PerName => ".NAME.",
            Repeats::PerEntry => "[].",
        },
        fields: spec.fields.iter().map(param).collect(),
    }
}
