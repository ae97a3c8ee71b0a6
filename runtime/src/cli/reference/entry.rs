//! The documentation of the catalogue as data: the JSON of `describe`, from which its text is made.

use clap::ValueEnum;
use serde::Serialize;

use crate::catalogue::Catalogue;
use crate::device::{DeviceType, RoleType};
use crate::example::example_graph;
use crate::node::{Need, NodeSpec, ParamSpec, PortSpec, Repeats, frame_args, may_fit};
use crate::record::recorded;
use crate::signal::Kind;

/// The categories, in the order of the lists.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Category {
    #[default]
    Node,
    Device,
    Role,
    Kind,
    File,
}

impl Category {
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
#[derive(Debug, Clone, Default, Serialize)]
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
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct PortEntry {
    pub(crate) name: String,
    pub(crate) kind: &'static str,
    /// Unit as declared; a capital letter is a variable of the node.
    pub(crate) unit: Option<String>,
    pub(crate) frames: Vec<String>,
    /// Whether it must be wired, and whether it wakes the node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) need: Option<String>,
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
    /// Lower and upper end of the range; an end is null if it has no bound.
    pub(crate) range: Option<[Option<f64>; 2]>,
    /// Whether the lower end is outside the range.
    pub(crate) is_open: bool,
    /// Accepted words, each with its meaning.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) words: &'static [(&'static str, &'static str)],
    /// Default value as TOML.
    pub(crate) default: Option<String>,
    pub(crate) is_required: bool,
    /// Whether a mode can set it.
    pub(crate) is_live: bool,
    /// Whether `[live]` can list it.
    pub(crate) is_tunable: bool,
    pub(crate) doc: String,
    /// Text between the name of the parameter and the name of a field in a path.
    #[serde(skip)]
    pub(crate) separator: &'static str,
    pub(crate) fields: Vec<ParamEntry>,
}

/// Returns the entries of a catalogue in the order of the lists, without example graphs.
pub(crate) fn entries(catalogue: &Catalogue) -> Vec<Entry> {
    let groups = catalogue.groups();
    let nodes = groups.flat_map(|(group, specs)| specs.iter().map(move |spec| Entry::of_node(catalogue, group, spec)));
    let devices = catalogue.devices().iter().map(|device| Entry::of_device(&**device));
    let roles = catalogue.roles().iter().map(|role| Entry::of_role(catalogue, role));
    let kinds = Kind::ALL.iter().map(|kind| Entry::of_kind(catalogue, *kind));
    let files = catalogue.builtin_files().iter().map(|(name, bytes)| Entry::of_file(name, bytes));
    nodes.chain(devices).chain(roles).chain(kinds).chain(files).collect()
}

impl Entry {
    fn new(category: Category, name: &str, summary: &str, doc: &str) -> Self {
        let doc = doc.trim().to_owned();
        Self { category, name: name.to_owned(), summary: summary.to_owned(), doc, ..Self::default() }
    }

    fn of_node(catalogue: &Catalogue, group: &'static str, spec: &NodeSpec) -> Self {
        let input = |port: &PortSpec| PortEntry { need: Some(need(port.need)), ..PortEntry::input(catalogue, port) };
        Self {
            group,
            limits: spec.limits.holds.iter().map(ToString::to_string).collect(),
            steps: Some(if spec.every_tick {
                "in every tick"
            } else {
                "when an input that wakes the node has a new value or loses its value"
            }),
            inputs: spec.inputs.iter().map(input).collect(),
            outputs: spec.outputs.iter().map(|port| PortEntry::output(catalogue, port)).collect(),
            params: spec.params.iter().map(ParamEntry::of).collect(),
            block: block(&spec.example),
            ..Self::new(Category::Node, &spec.name, &spec.summary, &spec.doc)
        }
    }

    fn of_device(device: &dyn DeviceType) -> Self {
        Self {
            params: device.params().iter().map(ParamEntry::of).collect(),
            fits: roles_of(device),
            block: block(&device.example()),
            ..Self::new(Category::Device, &device.name(), &device.summary(), &device.doc())
        }
    }

    fn of_role(catalogue: &Catalogue, role: &RoleType) -> Self {
        let fills =
            catalogue.devices().iter().filter(|device| roles_of(&***device).iter().any(|name| role.is_filled_by(name)));
        let name = role.observed_name();
        let doc = match role.is_observed {
            true => format!(
                "Only scenarios and recordings read it. Bind it in the bench as `{name} = \"device\"`; a task cannot declare it."
            ),
            false => String::new(),
        };
        let output =
            |port| if role.is_observed { PortEntry::declared(port) } else { PortEntry::output(catalogue, port) };
        let input = |port| PortEntry::input(catalogue, port);
        Self {
            outputs: role.outputs.iter().map(output).collect(),
            commands: role.commands.iter().map(input).collect(),
            reports: role.reports.iter().map(input).collect(),
            fits: fills.map(|device| device.name().into_owned()).collect(),
            limits: role.limits.iter().map(ToString::to_string).collect(),
            ..Self::new(Category::Role, &role.name, &role.summary, &doc)
        }
    }

    /// Describes a kind, with the ports that produce it and those that take it.
    fn of_kind(catalogue: &Catalogue, kind: Kind) -> Self {
        let is_meant = |(_, port): &OwnedPort<'_>| port.kind == kind;
        let named = |owned: OwnedPort<'_>, port: PortEntry| PortEntry { name: full_name(owned), ..port };
        let outputs = of_roles(catalogue, |role| &role.outputs).chain(of_nodes(catalogue, |spec| &spec.outputs));
        let outputs = outputs.filter(is_meant).map(|owned| named(owned, PortEntry::output(catalogue, owned.1)));
        let roles = of_roles(catalogue, |role| &role.commands).chain(of_roles(catalogue, |role| &role.reports));
        let inputs = roles.chain(of_nodes(catalogue, |spec| &spec.inputs));
        let inputs = inputs.filter(is_meant).map(|owned| named(owned, PortEntry::input(catalogue, owned.1)));
        Self {
            recorded: Some(recorded(kind)),
            outputs: outputs.collect(),
            inputs: inputs.collect(),
            ..Self::new(Category::Kind, kind.name(), kind.summary(), kind.doc())
        }
    }

    fn of_file(name: &str, bytes: &[u8]) -> Self {
        let text = std::str::from_utf8(bytes).ok();
        // The first line of a built-in file is a comment with its summary.
        let first = text.and_then(|text| text.lines().next());
        let comment = first.and_then(|line| line.strip_prefix("# ")).map(|line| line.trim_end_matches('.'));
        let size = format!("{} kB", bytes.len().div_ceil(1000));
        let summary = comment.map_or_else(|| size.clone(), |comment| format!("{comment} ({size})"));
        // The text of a part shows its inputs, its exports and its parameters.
        let block = text.filter(|_| name.ends_with(".toml")).map(str::to_owned);
        Self { block, ..Self::new(Category::File, &format!("builtin:{name}"), &summary, "") }
    }

    /// Composes the example graph.
    ///
    /// # Errors
    /// If there is none.
    pub(crate) fn example_graph(&self, catalogue: &Catalogue) -> Result<String, String> {
        let subject = match self.category {
            Category::Node | Category::Device => Some(&self.name),
            Category::Role => self.fits.first(),
            Category::Kind | Category::File => None,
        };
        example_graph(catalogue, subject.ok_or_else(|| format!("`{}` has no example", self.name))?)
    }
}

/// Returns the roles that the example of a device binds it to.
fn roles_of(device: &dyn DeviceType) -> Vec<String> {
    let example: toml::Table = device.example().parse().unwrap_or_default();
    let roles = example.get("roles").and_then(toml::Value::as_table);
    let kind =
        |(_, role): (&String, &toml::Value)| Some(role.as_str().or_else(|| role.get("type")?.as_str())?.to_owned());
    roles.into_iter().flatten().filter_map(kind).collect()
}

/// Returns the block of a node or a device as written, or `None` without an example.
fn block(example: &str) -> Option<String> {
    Some(example.trim().to_owned()).filter(|text| !text.is_empty())
}

/// A port with the name of its role or its node.
type OwnedPort<'c> = (&'c str, &'c PortSpec);

fn of_roles(catalogue: &Catalogue, ports: fn(&RoleType) -> &[PortSpec]) -> impl Iterator<Item = OwnedPort<'_>> {
    catalogue.roles().iter().flat_map(move |role| ports(role).iter().map(|port| (&*role.name, port)))
}

fn of_nodes(catalogue: &Catalogue, ports: fn(&NodeSpec) -> &[PortSpec]) -> impl Iterator<Item = OwnedPort<'_>> {
    catalogue.specs().flat_map(move |spec| ports(spec).iter().map(|port| (&*spec.name, port)))
}

fn full_name((owner, port): OwnedPort<'_>) -> String {
    format!("{owner}.{}", port.name)
}

impl PortEntry {
    /// Describes an input, with the outputs that its wire can come from.
    fn input(catalogue: &Catalogue, port: &PortSpec) -> Self {
        let readable = of_roles(catalogue, |role| if role.is_observed { &[] } else { &role.outputs });
        let outputs = readable.chain(of_nodes(catalogue, |spec| &spec.outputs));
        Self::fitting(port, outputs.filter(|(_, output)| may_fit(output, port)))
    }

    /// Describes an output, with the inputs that a wire from it can lead to.
    fn output(catalogue: &Catalogue, port: &PortSpec) -> Self {
        let roles = of_roles(catalogue, |role| &role.commands).chain(of_roles(catalogue, |role| &role.reports));
        let inputs = of_nodes(catalogue, |spec| &spec.inputs).chain(roles);
        Self::fitting(port, inputs.filter(|(_, input)| may_fit(port, input)))
    }

    /// Describes a port and names those that fit it; ports that declare the same unit come first.
    fn fitting<'c>(port: &PortSpec, others: impl Iterator<Item = OwnedPort<'c>>) -> Self {
        let mut others: Vec<OwnedPort<'_>> = others.collect();
        others.sort_by_key(|(_, other)| port.kind.has_unit() && other.args.first() != port.args.first());
        Self { fits: others.into_iter().map(full_name).collect(), ..Self::declared(port) }
    }

    fn declared(port: &PortSpec) -> Self {
        Self {
            name: port.name.to_string(),
            kind: port.kind.name(),
            unit: port.args.first().filter(|_| port.kind.has_unit()).map(ToString::to_string),
            frames: frame_args(port).iter().map(ToString::to_string).collect(),
            doc: port.doc.trim().lines().map(str::trim).collect::<Vec<_>>().join(" "),
            ..Self::default()
        }
    }
}

/// Describes what an input needs, and when it wakes the node.
fn need(need: Need) -> String {
    let needs = match (need.must_be_wired, need.must_be_present) {
        _ if need.is_many => "any number of inputs, named in the graph; each",
        (true, _) if need.is_delayed => "the value of the previous tick;",
        (false, _) if need.is_delayed => "optional, the value of the previous tick;",
        (true, true) => "required,",
        (true, false) => "must be wired, may be absent,",
        (false, true) => "optional, must be present if wired,",
        (false, false) => "optional,",
    };
    let when = match need {
        Need { is_many: false, is_delayed: true, .. } => " only if no other input does",
        Need { is_trigger: true, .. } => "",
        Need { is_many: true, .. } => " when it loses its value",
        Need { .. } => " only when the input loses its value",
    };
    format!("{needs} wakes the node{when}")
}

impl ParamEntry {
    fn of(spec: &ParamSpec) -> Self {
        Self {
            name: spec.name,
            takes: spec.takes.clone(),
            unit: spec.unit.clone(),
            range: spec
                .bounds
                .map(|bounds| [bounds.min, bounds.max].map(|end| Some(end).filter(|end| end.is_finite()))),
            is_open: spec.bounds.is_some_and(|bounds| bounds.is_open),
            words: spec.words,
            default: spec.default.clone(),
            is_required: !spec.is_optional,
            is_live: spec.is_live,
            is_tunable: spec.is_tunable,
            doc: spec.doc_with_unit(),
            separator: match spec.repeats {
                Repeats::Once => ".",
                Repeats::PerName => ".NAME.",
                Repeats::PerEntry => "[].",
            },
            fields: spec.fields.iter().map(Self::of).collect(),
        }
    }
}
