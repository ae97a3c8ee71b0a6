//! Builds the outline of a graph: what `show` prints and lints read.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;

use crate::graph::bench::{OpenedBench, fill_facts};
use crate::graph::load::{MeasuredValues, Task};
use crate::graph::net::{CommandWire, Net, Wire, WireOrigin};
use crate::graph::plan::{PlannedNode, PlannedPort, PortRef};
use crate::graph::syntax::{Block, GraphTable, LIMITS, LiveEntry, PolicyTable};
use crate::node::{FilePath, Param, ParamSpec, Repeats, Spanned};
use crate::outline::{
    NO_SPAN, Outline, OutlinedBlock, OutlinedMode, OutlinedPort, OutlinedRange, OutlinedRole, OutlinedTask,
    OutlinedWire, OutlinedWord, Setting, ValueOrigin,
};
use crate::signal::Shape;
use crate::source::{Diagnostics, Item, Key, SourceMap, Table, Value, parse_table};

/// Builds the outline of a graph without mistakes.
pub(crate) struct OutlineBuilder<'a> {
    pub(crate) net: &'a Net<'a>,
    pub(crate) opened: &'a OpenedBench,
    pub(crate) sources: &'a SourceMap,
    /// The nodes, in the order in which they step.
    pub(crate) nodes: &'a [PlannedNode],
    /// The values of sections and of nodes that were written with a unit.
    pub(crate) measured: &'a MeasuredValues,
    /// Nominal time between two ticks [s].
    pub(crate) period: f64,
    /// Longest time between two samples that counts as one step [s].
    pub(crate) max_gap: f64,
    /// The default values by their texts.
    pub(crate) defaults: RefCell<BTreeMap<String, Value>>,
}

impl OutlineBuilder<'_> {
    pub(crate) fn build(&self) -> Outline {
        let flat = self.net.flat;
        let command = |wire: &CommandWire| self.wire(self.net.command_name(wire), wire.source, &wire.origin);
        Outline {
            period_s: self.period,
            settings: self.graph(),
            tasks: flat.tasks.iter().skip(1).map(|task| self.task(task)).collect(),
            roles: self.roles(),
            commands: self.net.commands.iter().map(command).collect(),
            policy: self.policy(flat.root()),
            modes: (0..flat.modes.len()).map(|mode| self.mode(mode)).collect(),
            nodes: self.nodes.iter().filter_map(|node| self.node(node)).collect(),
            devices: self.devices(),
            facts: self.facts(),
            live: flat.live.iter().map(outlined_range).collect(),
        }
    }

    fn facts(&self) -> Vec<(String, Value)> {
        let roles = self.net.flat.bench.iter().flat_map(|bench| &bench.facts);
        let facts = roles.flat_map(|(role, table)| table.entries.iter().map(move |(fact, value)| (role, fact, value)));
        facts.map(|(role, fact, value)| (format!("{}.{}", role.name, fact.name), value.clone())).collect()
    }

    fn policy(&self, task: &Task) -> Vec<Setting> {
        let written = task.policy.as_ref().and_then(|(section, _)| section.as_table());
        self.table(written, &PolicyTable::fields(), "", None)
    }

    /// The sections of a part that is a task: the keys of [graph] that hold in it, and its own [policy].
    fn task(&self, task: &Task) -> OutlinedTask {
        let given = task.settings.as_ref().and_then(Value::as_table);
        let mut settings = self.table(given, &GraphTable::fields(), "", None);
        settings.retain(|setting| ["start", "max_gap_ms", "reset_after_ms"].contains(&setting.path.as_str()));
        let policy = task.policy.as_ref().map(|_| self.policy(task)).unwrap_or_default();
        OutlinedTask { name: task.name().to_owned(), settings, policy }
    }

    fn graph(&self) -> Vec<Setting> {
        let given = self.net.flat.root().settings.as_ref().and_then(Value::as_table);
        let mut settings = self.table(given, &GraphTable::fields(), "", None);
        settings.retain(|setting| setting.path != "bench");
        if !settings.iter().any(|setting| setting.path == "max_gap_ms") {
            // A whole number of microseconds, so that no digits are there by chance.
            let gap = Value { span: NO_SPAN, item: Item::Float((self.max_gap * 1e6).round() * 1e-3) };
            settings.push(Setting::default_of("max_gap_ms".into(), gap));
        }
        settings
    }

    fn roles(&self) -> Vec<OutlinedRole> {
        let device = |role: &str| self.net.flat.bench.as_ref()?.bind.get(role);
        let roles = self.net.flat.roles.iter();
        let role = |(key, kind): &(Key, Spanned<String>)| {
            let device = self.word(&device(&key.name)?.word);
            Some(OutlinedRole { name: key.name.clone(), kind: self.word(kind), device })
        };
        roles.filter_map(role).collect()
    }

    fn node(&self, planned: &PlannedNode) -> Option<OutlinedBlock> {
        let node = &self.net.flat.nodes[planned.index];
        let spec = self.net.spec(planned.index)?;
        let wire = |wire: &Wire| self.wire(wire.key.name.clone(), wire.source, &wire.origin);
        let wires = self.net.wires[planned.index].iter().map(wire).collect();
        let outputs = planned.ports.iter().map(outlined_port).collect();
        Some(OutlinedBlock {
            name: node.name.clone(),
            wires,
            outputs,
            sample_s: planned.sample_times.period,
            latency_s: planned.sample_times.latency,
            ..self.block(&node.block, &spec.params, Some(planned.index))?
        })
    }

    fn wire(&self, name: String, source: PortRef, origin: &WireOrigin) -> OutlinedWire {
        OutlinedWire {
            name,
            source: self.net.port_name(source),
            max_age_ms: origin.age.map(|age| age.max_age as f64 * 1e-6),
            stale: origin.age.map(|age| age.stale.word()),
            place: self.sources.location(&origin.word.span),
        }
    }

    fn word(&self, word: &Spanned<String>) -> OutlinedWord {
        OutlinedWord { text: word.value.clone(), place: self.sources.location(&word.span) }
    }

    fn devices(&self) -> Vec<OutlinedBlock> {
        let blocks = self.net.flat.bench.iter().flat_map(|bench| &bench.devices);
        let blocks: BTreeMap<&str, &Block> = blocks.map(|block| (block.key.name.as_str(), block)).collect();
        self.opened.devices.iter().filter_map(|device| self.device(blocks.get(&*device.name)?)).collect()
    }

    fn device(&self, block: &Block) -> Option<OutlinedBlock> {
        let kind = block.kind.as_ref()?;
        let known = self.net.catalogue.find_device(&kind.value)?;
        self.block(block, &known.params(), None)
    }

    fn block(&self, block: &Block, specs: &[ParamSpec], node: Option<usize>) -> Option<OutlinedBlock> {
        Some(OutlinedBlock {
            name: block.key.name.clone(),
            place: self.sources.location(&block.key.span),
            span: block.key.span.clone(),
            kind: self.word(block.kind.as_ref()?),
            wires: Vec::new(),
            settings: self.table(block.params.as_table(), specs, "", node),
            outputs: Vec::new(),
            sample_s: 0.0,
            latency_s: 0.0,
        })
    }

    /// The settings of a table: what is given, and the defaults of what is not.
    fn table(&self, given: Option<&Table>, specs: &[ParamSpec], path: &str, node: Option<usize>) -> Vec<Setting> {
        let mut settings = Vec::new();
        for spec in specs {
            let path = format!("{path}{}", spec.name);
            match given.and_then(|table| table.get(spec.name)) {
                Some(value) => settings.extend(self.value(value, spec, path, node)),
                None => settings.extend(self.default(spec).map(|value| Setting::default_of(path, value))),
            }
        }
        let is_declared = |name: &str| specs.iter().any(|spec| spec.name == name);
        // A node that is known only at run time may take more than it declares.
        let more = given.iter().flat_map(|table| &table.entries).filter(|(key, _)| !is_declared(&key.name));
        settings.extend(more.map(|(key, value)| self.setting(value, format!("{path}{}", key.name), node)));
        settings
    }

    fn value(&self, value: &Value, spec: &ParamSpec, path: String, node: Option<usize>) -> Vec<Setting> {
        let fields = |table: &Table, path: &str| self.table(Some(table), &spec.fields, &format!("{path}."), node);
        match (value.as_section(), spec.repeats) {
            (Some(table), Repeats::Once) if !spec.fields.is_empty() => fields(table, &path),
            (Some(section), Repeats::PerName) => {
                let entry = |(key, value): &(Key, Value)| {
                    let path = format!("{path}.{}", key.name);
                    match value.as_section().filter(|_| !spec.fields.is_empty()) {
                        Some(table) => fields(table, &path),
                        None => vec![self.setting(value, path, node)],
                    }
                };
                section.entries.iter().flat_map(entry).collect()
            }
            _ => {
                let mut setting = self.setting(value, path, node);
                // An optional fact that is not there is no value.
                if setting.value.as_table().and_then(Table::fact).is_some() {
                    return Vec::new();
                }
                self.resolve(&mut setting, spec);
                self.complete(&mut setting.value, spec);
                vec![setting]
            }
        }
    }

    /// A value as it was written, or the fact that it asks for.
    fn setting(&self, value: &Value, path: String, node: Option<usize>) -> Setting {
        let fact = value.as_table().and_then(Table::fact);
        let word = fact.as_ref().map(|fact| fact.word);
        let role = fact.as_ref().and_then(|fact| Some((fact.word.split_once('.')?.0, fact.place.start)));
        let role = role.and_then(|(role, at)| self.net.flat.roles.position(self.net.role_at(node, role, at)));
        let mut filled = value.clone();
        // The graph has no mistakes, so every fact is there.
        fill_facts(&mut filled, node, self.net, self.opened, &mut Diagnostics::new());
        let bound = role.and_then(|role| self.opened.roles[role].as_ref());
        let origin = match (word, bound) {
            (Some(word), Some(bound)) => {
                let device = &self.opened.devices[bound.device];
                ValueOrigin::Fact { fact: word.to_owned(), place: self.sources.location(&device.span) }
            }
            // A value from [limits] keeps its place there.
            _ => ValueOrigin::Written { place: self.sources.location(&filled.span) },
        };
        // A limit is filled in with the unit of its name, which nobody has written.
        let limit = word.and_then(|word| word.split_once('.')).filter(|(section, _)| *section == LIMITS);
        let arms = node.map_or(&[][..], |node| self.net.arms_of(node));
        let written = limit.and_then(|(_, name)| self.net.limit(arms, name));
        self.in_units(Setting { path, value: filled, written, origin }, node)
    }

    /// Replaces the numbers that were written with a unit by those that were read.
    fn in_units(&self, mut setting: Setting, node: Option<usize>) -> Setting {
        let written = setting.written.take().unwrap_or_else(|| setting.value.clone());
        for values in [self.measured, &self.opened.measured] {
            values.replace_texts(&mut setting.value, node);
        }
        let is_of_a_file = matches!(setting.origin, ValueOrigin::Written { .. });
        Setting { written: Some(written).filter(|written| is_of_a_file && *written != setting.value), ..setting }
    }

    /// The path of a file, which stands relative to the file it is written in, as seen from the working folder.
    fn resolve(&self, setting: &mut Setting, spec: &ParamSpec) {
        if let (ValueOrigin::Written { .. }, Item::String(text)) = (&setting.origin, &mut setting.value.item)
            && spec.takes == FilePath::EXPECTS
        {
            *text = self.sources.path(text, setting.value.span.start).display().to_string();
        }
    }

    /// Fills the defaults into the tables of a list.
    fn complete(&self, value: &mut Value, spec: &ParamSpec) {
        let Item::Array(items) = &mut value.item else { return };
        for item in items {
            let Item::Table(table) = &mut item.item else { continue };
            for field in &spec.fields {
                let default = self.default(field).filter(|_| table.get(field.name).is_none());
                let key = Key { name: field.name.to_owned(), span: NO_SPAN };
                table.entries.extend(default.map(|value| (key, Value { span: NO_SPAN, ..value })));
            }
        }
    }

    /// Returns the default of a parameter as a value; none if nothing is set. Each text is parsed once.
    fn default(&self, spec: &ParamSpec) -> Option<Value> {
        let text = spec.default.as_deref()?;
        let mut defaults = self.defaults.borrow_mut();
        if let Some(value) = defaults.get(text) {
            return Some(value.clone());
        }
        let value = parse_default(text);
        defaults.insert(text.to_owned(), value.clone());
        Some(value)
    }

    fn mode(&self, mode: usize) -> OutlinedMode {
        let block = &self.net.flat.modes[mode];
        let mut settings = Vec::new();
        for (key, value) in &block.table.entries {
            match value.as_table().filter(|_| key.name == "set") {
                Some(_) => self.leaves(value, "set", 4, &mut settings),
                None => self.leaves(value, &key.name, 0, &mut settings),
            }
        }
        OutlinedMode { name: self.net.flat.mode_name(mode), settings }
    }

    /// Collects the values in nested tables, down to `depth` levels.
    fn leaves(&self, value: &Value, path: &str, depth: usize, settings: &mut Vec<Setting>) {
        match value.as_section().filter(|_| depth > 0) {
            Some(table) => {
                for (key, value) in &table.entries {
                    self.leaves(value, &format!("{path}.{}", key.name), depth - 1, settings);
                }
            }
            None => {
                let origin = ValueOrigin::Written { place: self.sources.location(&value.span) };
                let setting = Setting { path: path.to_owned(), value: value.clone(), written: None, origin };
                settings.push(self.in_units(setting, None));
            }
        }
    }
}

fn outlined_range(entry: &LiveEntry) -> OutlinedRange {
    let ends = [&entry.range.min, &entry.range.max];
    OutlinedRange {
        name: entry.name.value.clone(),
        range: ends.map(|end| end.value),
        spans: ends.map(|end| end.span.clone()),
    }
}

fn outlined_port(port: &PlannedPort) -> OutlinedPort {
    OutlinedPort {
        name: port.name.clone(),
        kind: port.shape.kind().name(),
        unit: port.shape.unit().map(|unit| unit.to_string()),
        frames: port.frames.clone(),
        range: match &port.shape {
            Shape::Scalar(shape) => Some(shape.range).filter(|range| range.iter().all(|end| end.is_finite())),
            _ => None,
        },
    }
}

/// Parses the text of a default.
fn parse_default(text: &str) -> Value {
    let mut sources = SourceMap::default();
    let parsed = parse_table(sources.add_file(Path::new("default"), format!("value = {text}")));
    let value = parsed.ok().and_then(|value| value.as_table()?.get("value").cloned());
    value.unwrap_or_else(|| Value { span: NO_SPAN, item: Item::String(text.to_owned()) })
}
