//! The outline of a graph: the flat graph with all overrides, defaults and facts, and the origin of each value.

use std::ops::Range;
use std::path::Path;

use crate::graph::bench::OpenedBench;
use crate::graph::bench::fill_facts;
use crate::graph::net::{Net, Wire, WireOrigin};
use crate::graph::syntax::{Block, GraphTable, ModeBlock, Policy, PolicyTable};
use crate::node::{FilePath, Param, ParamSpec, Repeats, Word};
use crate::source::{Diagnostics, Item, Key, SourceMap, Table, Value, parse_table};

/// The span of a default in a list of tables, which was not written anywhere.
pub const NO_SPAN: Range<usize> = 0..0;

/// The outline of a graph.
#[derive(Debug, Clone, Default)]
pub struct Outline {
    /// Section `[graph]` without the bench, which is in the other sections.
    pub settings: Vec<Setting>,
    /// The roles: name, type and device.
    pub roles: Vec<OutlinedRole>,
    /// The wires of commands and reports, named `role.command`.
    pub commands: Vec<OutlinedWire>,
    /// Section `[policy]`: the reaction to each trouble.
    pub policy: Vec<Setting>,
    /// The modes with their settings and exits.
    pub modes: Vec<OutlinedMode>,
    /// The nodes in file order.
    pub nodes: Vec<OutlinedBlock>,
    /// The devices that the roles use.
    pub devices: Vec<OutlinedBlock>,
}

/// A role and its device.
#[derive(Debug, Clone)]
pub struct OutlinedRole {
    /// Its name.
    pub name: String,
    /// Its type, with its span.
    pub kind: Word,
    /// The device bound to it, with its span.
    pub device: Word,
}

/// A mode.
#[derive(Debug, Clone)]
pub struct OutlinedMode {
    /// Its name.
    pub name: String,
    /// `set.…` for each value that it sets, and its exits as written.
    pub settings: Vec<Setting>,
}

/// A wire.
#[derive(Debug, Clone)]
pub struct OutlinedWire {
    /// Name of the input or of the command.
    pub name: String,
    /// Full name of its source: `node.port`.
    pub source: String,
    /// Maximum age of its values [ms] and the reaction to older ones, if it has a limit.
    pub age: Option<(f64, Policy)>,
    /// Where the source was written.
    pub span: Range<usize>,
}

/// A node or a device.
#[derive(Debug, Clone)]
pub struct OutlinedBlock {
    /// Its full name.
    pub name: String,
    /// Span of its name.
    pub span: Range<usize>,
    /// Its type, with its span.
    pub kind: Word,
    /// Its wires.
    pub wires: Vec<OutlinedWire>,
    /// Its parameters, in the order of the declaration.
    pub settings: Vec<Setting>,
}

/// A parameter with its value.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Dotted path in its block.
    pub path: String,
    /// The value.
    pub value: Value,
    /// The origin of the value.
    pub origin: Origin,
}

/// The origin of a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// A file or the command line, at this span.
    Written(Range<usize>),
    /// The default of the parameter.
    Default,
    /// A fact of a device.
    Fact {
        /// `role.fact`
        fact: String,
        /// Span of the name of the device.
        device: Range<usize>,
    },
}

/// Builds the outline of a graph without mistakes.
pub(crate) struct OutlineBuilder<'a> {
    pub(crate) net: &'a Net<'a>,
    pub(crate) opened: &'a OpenedBench,
    pub(crate) sources: &'a SourceMap,
    /// Maximum time step between two samples [s].
    pub(crate) max_gap: f64,
}

impl OutlineBuilder<'_> {
    pub(crate) fn build(&self) -> Outline {
        let flat = self.net.flat;
        let commands = self.net.commands.iter().map(|wire| OutlinedWire {
            name: self.net.command_name(wire),
            source: self.net.port_name(wire.source),
            age: age(&wire.origin),
            span: wire.origin.word.span.clone(),
        });
        Outline {
            settings: self.graph(),
            roles: self.roles(),
            commands: commands.collect(),
            policy: self.policy(),
            modes: flat.modes.iter().map(outline_mode).collect(),
            nodes: (0..flat.nodes.len()).filter_map(|node| self.node(node)).collect(),
            devices: self.opened.devices.iter().filter_map(|device| self.device(&device.name)).collect(),
        }
    }

    fn graph(&self) -> Vec<Setting> {
        let mut settings = Vec::new();
        let given = self.net.flat.settings.as_ref().and_then(Value::as_table);
        self.table(given, &GraphTable::fields(), "", &mut settings);
        settings.retain(|setting| setting.path != "bench");
        if !settings.iter().any(|setting| setting.path == "max_gap_ms") {
            // Rounded to microseconds, to hide the digits of floating-point errors.
            let gap = Value { span: NO_SPAN, item: Item::Float((self.max_gap * 1e6).round() * 1e-3) };
            settings.push(Setting { path: "max_gap_ms".into(), value: gap, origin: Origin::Default });
        }
        settings
    }

    fn policy(&self) -> Vec<Setting> {
        let mut settings = Vec::new();
        let given = self.net.flat.policy.as_ref().and_then(|(section, _)| section.as_table());
        self.table(given, &PolicyTable::fields(), "", &mut settings);
        settings
    }

    fn roles(&self) -> Vec<OutlinedRole> {
        let bind = self.net.flat.bench.iter().flat_map(|bench| &bench.bind);
        let device = |role: &str| bind.clone().find(|(key, _)| key.name == role).map(|(_, word)| word.clone());
        let roles = self.net.flat.roles.iter();
        let role = |(key, kind): &(Key, Word)| {
            Some(OutlinedRole { name: key.name.clone(), kind: kind.clone(), device: device(&key.name)? })
        };
        roles.filter_map(role).collect()
    }

    fn node(&self, index: usize) -> Option<OutlinedBlock> {
        let node = &self.net.flat.nodes[index];
        let spec = self.net.spec(index)?;
        let wire = |wire: &Wire| OutlinedWire {
            name: wire.key.name.clone(),
            source: self.net.port_name(wire.source),
            age: age(&wire.origin),
            span: wire.origin.word.span.clone(),
        };
        let wires = self.net.wires[index].iter().map(wire).collect();
        Some(OutlinedBlock { name: node.name.clone(), wires, ..self.block(&node.block, &spec.params)? })
    }

    fn device(&self, name: &str) -> Option<OutlinedBlock> {
        let bench = self.net.flat.bench.as_ref()?;
        let block = bench.devices.iter().find(|device| device.key.name == name)?;
        let kind = block.kind.as_ref()?;
        let known = self.net.catalogue.find_device(&kind.text)?;
        self.block(block, &known.params())
    }

    fn block(&self, block: &Block, specs: &[ParamSpec]) -> Option<OutlinedBlock> {
        let mut settings = Vec::new();
        self.table(block.params.as_table(), specs, "", &mut settings);
        Some(OutlinedBlock {
            name: block.key.name.clone(),
            span: block.key.span.clone(),
            kind: block.kind.clone()?,
            wires: Vec::new(),
            settings,
        })
    }

    /// Adds the settings of a table: the given values, and the defaults of the others.
    fn table(&self, given: Option<&Table>, specs: &[ParamSpec], path: &str, settings: &mut Vec<Setting>) {
        for spec in specs {
            let path = format!("{path}{}", spec.name);
            match given.and_then(|table| table.get(spec.name)) {
                Some(value) => self.value(value, spec, path, settings),
                None => settings.extend(default(spec).map(|value| Setting { path, value, origin: Origin::Default })),
            }
        }
        let is_declared = |name: &str| specs.iter().any(|spec| spec.name == name);
        // A node type that is known only at run time may accept more than it declares.
        for (key, value) in given.iter().flat_map(|table| &table.entries).filter(|(key, _)| !is_declared(&key.name)) {
            settings.push(self.setting(value, format!("{path}{}", key.name)));
        }
    }

    fn value(&self, value: &Value, spec: &ParamSpec, path: String, settings: &mut Vec<Setting>) {
        let table = value.as_table().filter(|table| !table.is_fact());
        match (table, spec.repeats) {
            (Some(table), Repeats::Once) if !spec.fields.is_empty() => {
                self.table(Some(table), &spec.fields, &format!("{path}."), settings);
            }
            (Some(table), Repeats::PerName) => {
                for (key, value) in &table.entries {
                    let path = format!("{path}.{}", key.name);
                    match value.as_table().filter(|table| !table.is_fact() && !spec.fields.is_empty()) {
                        Some(table) => self.table(Some(table), &spec.fields, &format!("{path}."), settings),
                        None => settings.push(self.setting(value, path)),
                    }
                }
            }
            _ => {
                let mut setting = self.setting(value, path);
                self.resolve_path(&mut setting, spec);
                add_defaults(&mut setting.value, spec);
                settings.push(setting);
            }
        }
    }

    /// Returns a value as written, or the fact that it refers to.
    fn setting(&self, value: &Value, path: String) -> Setting {
        let fact = value.as_table().filter(|table| table.is_fact());
        let word = fact.and_then(|table| table.get("from")).and_then(Value::as_str);
        let role = word.and_then(|word| {
            self.net.flat.roles.iter().position(|(key, _)| word.starts_with(&format!("{}.", key.name)))
        });
        let mut filled = value.clone();
        // The graph has no mistakes, so every fact is there.
        fill_facts(&mut filled, self.net, self.opened, &mut Diagnostics::new());
        let bound = role.and_then(|role| self.opened.roles[role].as_ref());
        let origin = match (word, bound) {
            (Some(word), Some(bound)) => {
                Origin::Fact { fact: word.to_owned(), device: self.opened.devices[bound.device].span.clone() }
            }
            // A value of [limits] keeps its span in that section.
            _ => Origin::Written(filled.span.clone()),
        };
        Setting { path, value: filled, origin }
    }

    /// Makes the path of a file relative to the working folder.
    fn resolve_path(&self, setting: &mut Setting, spec: &ParamSpec) {
        if let (Origin::Written(span), Item::String(text)) = (&setting.origin, &mut setting.value.item)
            && spec.takes == FilePath::EXPECTS
        {
            *text = self.sources.path(text, span.start).display().to_string();
        }
    }
}

fn age(wire: &WireOrigin) -> Option<(f64, Policy)> {
    wire.age.map(|age| (age.max_age as f64 * 1e-6, age.stale))
}

fn outline_mode(block: &ModeBlock) -> OutlinedMode {
    let mut settings = Vec::new();
    for (key, value) in &block.table.entries {
        match value.as_table().filter(|_| key.name == "set") {
            Some(_) => add_leaves(value, "set", 4, &mut settings),
            None => add_leaves(value, &key.name, 0, &mut settings),
        }
    }
    OutlinedMode { name: block.key.name.clone(), settings }
}

/// Adds the values of a table, descending at most `depth` tables.
fn add_leaves(value: &Value, path: &str, depth: usize, settings: &mut Vec<Setting>) {
    match value.as_table().filter(|table| depth > 0 && !table.is_fact()) {
        Some(table) => {
            for (key, value) in &table.entries {
                add_leaves(value, &format!("{path}.{}", key.name), depth - 1, settings);
            }
        }
        None => {
            let origin = Origin::Written(value.span.clone());
            settings.push(Setting { path: path.to_owned(), value: value.clone(), origin });
        }
    }
}

/// Adds the defaults to the tables of a list.
fn add_defaults(value: &mut Value, spec: &ParamSpec) {
    let Item::Array(items) = &mut value.item else { return };
    for item in items {
        let Item::Table(table) = &mut item.item else { continue };
        for field in &spec.fields {
            let default = default(field).filter(|_| table.get(field.name).is_none());
            let key = Key { name: field.name.to_owned(), span: NO_SPAN };
            table.entries.extend(default.map(|value| (key, Value { span: NO_SPAN, ..value })));
        }
    }
}

/// Returns the default of a parameter as a value, or `None` if it has none.
fn default(spec: &ParamSpec) -> Option<Value> {
    let text = spec.default.as_ref()?;
    let mut sources = SourceMap::default();
    let parsed = parse_table(sources.add_file(Path::new("default"), format!("value = {text}")));
    let value = parsed.ok().and_then(|value| value.as_table()?.get("value").cloned());
    Some(value.unwrap_or_else(|| Value { span: NO_SPAN, item: Item::String(text.clone()) }))
}
