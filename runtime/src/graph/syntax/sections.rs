//! Parses the sections of a graph file, a part and a bench, before names are resolved.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::PathBuf;

use super::allow::{Allowance, read_allow};
use super::binding::Binding;
use super::correct::{
    correct_block, correct_facts, correct_keys, correct_model, correct_part_file, correct_sections, correct_wires,
    separate_wires,
};
use super::limits::{LimitOwner, LimitSection, read_limits};
use super::model::{ModelDocument, ModelFile, read_model};
use super::modes::{ModeBlock, read_mode};
use super::policy::{OnFail, PolicyTable};
use super::read::read_table;
use super::reserved::{ALLOW, ALLOW_UNCALIBRATED, GRAPH_SECTIONS, LIMITS, MODELS, is_name};
use super::wires::{InputWires, WireEntry};
use crate::node::{At, FilePath, Measured, Mistake, Param, Reader, Spanned};
use crate::source::{Code, Diagnostic, Diagnostics, Item, Key, Named, SourceMap, Table, Value, suggest_name};

/// The section `[graph]`.
#[derive(Debug, Clone, Param)]
pub(crate) struct GraphTable {
    /// Role whose samples trigger the ticks.
    pub(crate) clock: Option<Spanned<String>>,
    /// Tick rate of a graph without a clock role.
    #[param(unit = "Hz", range = 0.001..=1e6)]
    pub(crate) rate_hz: Option<f64>,
    /// Start mode.
    pub(crate) start: Option<Spanned<String>>,
    /// Default bench.
    pub(crate) bench: Option<FilePath>,
    /// Maximum time step between two samples; filters and integrals start afresh after a longer gap. The default is
    /// five periods of the slowest device of the task, and at least five of the graph.
    #[param(unit = "ms", above = 0.0)]
    pub(crate) max_gap_ms: Option<f64>,
    /// How long an input must be absent before the state of its node is reset.
    #[param(unit = "ms", range = 0.0.., default = 20.0)]
    pub(crate) reset_after_ms: f64,
    /// Ports that a run shows: images as pictures, numbers as curves over time.
    pub(crate) show: Option<Vec<Spanned<String>>>,
    /// Ports of the x and the y of the contact, marked in the first image that is shown.
    pub(crate) mark: Option<[Spanned<String>; 2]>,
}

/// The block of a node or a device: its type, its wires and its parameters.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    pub(crate) key: Key,
    pub(crate) kind: Option<Spanned<String>>,
    pub(crate) wires: InputWires,
    pub(crate) params: Value,
    /// The role without which the node is left out.
    pub(crate) only_with: Option<Spanned<String>>,
    /// Whether a device may come back after it was lost, and the place that says so.
    pub(crate) reconnect: Option<Spanned<bool>>,
}

/// The block of a part: its file, the wires into it, and its overrides.
#[derive(Debug, Clone)]
pub(crate) struct PartBlock {
    pub(crate) key: Key,
    pub(crate) file: Option<FilePath>,
    pub(crate) wires: InputWires,
    pub(crate) set: Table,
    /// The role for each name of a role in the file of the part.
    pub(crate) roles: Named<Spanned<String>>,
    /// The names in `roles`, also those whose value is no text.
    pub(crate) listed_roles: BTreeSet<String>,
    /// Whether its failure ends the run, and the place of that key.
    pub(crate) on_fail: Option<(OnFail, Range<usize>)>,
}

/// The sections of a graph file or of a part.
#[derive(Debug, Clone, Default)]
pub(crate) struct GraphDocument {
    /// The span of the section [graph], and the section if it is valid.
    pub(crate) graph: Option<(Range<usize>, Option<GraphTable>)>,
    /// The type of each role.
    pub(crate) roles: Named<Spanned<String>>,
    /// The arm that carries each sensor which names one.
    pub(crate) carriers: Named<Spanned<String>>,
    pub(crate) nodes: Vec<Block>,
    pub(crate) parts: Vec<PartBlock>,
    /// The wires to commands, each with its role.
    pub(crate) commands: Vec<(Key, WireEntry)>,
    /// The span of the section [commands] if it is empty.
    pub(crate) empty_commands: Option<Range<usize>>,
    pub(crate) limits: Vec<LimitSection>,
    pub(crate) modes: Vec<ModeBlock>,
    /// The section [policy] as written, and parsed if it is valid.
    pub(crate) policy: Option<(Value, Option<PolicyTable>)>,
    pub(crate) inputs: Named<Spanned<String>>,
    pub(crate) exports: Named<Spanned<String>>,
    pub(crate) allow: Vec<Allowance>,
}

/// The sections of a bench file.
#[derive(Debug, Clone, Default)]
pub(crate) struct BenchDocument {
    pub(crate) devices: Vec<Block>,
    pub(crate) bind: Named<Binding>,
    /// The place of the name of the section [bind].
    pub(crate) place: Option<Range<usize>>,
    /// Roles whose binding is not a string, which has its own diagnostic.
    pub(crate) invalid: Vec<Key>,
    /// Facts that the bench states beside those of its devices, by role.
    pub(crate) facts: Vec<(Key, Table)>,
    /// The limits of the cell, and of the robots of its devices.
    pub(crate) limits: Vec<LimitSection>,
    /// The files of the robots and sensors of its devices, in the order of the file.
    pub(crate) model_files: Vec<ModelFile>,
    /// What these files say.
    pub(crate) models: Vec<(ModelFile, ModelDocument)>,
    /// Whether limits may be in raw readings.
    pub(crate) allow_uncalibrated: bool,
    pub(crate) allow: Vec<Allowance>,
}

/// Reads sections and collects their diagnostics.
pub(crate) struct Sections<'a> {
    pub(crate) reader: Reader<'a>,
    pub(super) diagnostics: Diagnostics,
    /// Blocks that are not tables and have their own diagnostic.
    broken: Vec<Key>,
}

impl<'a> Sections<'a> {
    pub(crate) const fn new(sources: &'a SourceMap) -> Self {
        Self { reader: Reader::new(sources), diagnostics: Vec::new(), broken: Vec::new() }
    }

    /// Returns all diagnostics, the values that were written with a unit, and the files that are named.
    pub(crate) fn finish(self) -> (Diagnostics, Measured, Vec<PathBuf>) {
        let mut diagnostics = self.diagnostics;
        let Reader { mistakes, warnings, measured, files, .. } = self.reader;
        diagnostics.extend(mistakes.into_iter().chain(warnings).map(into_diagnostic));
        (diagnostics, measured, files)
    }

    /// Reads the sections of a graph file.
    pub(crate) fn graph(&mut self, root: &mut Table) -> GraphDocument {
        correct_sections(root, &GRAPH_SECTIONS, &mut self.reader);
        for name in [ALLOW_UNCALIBRATED, "facts"] {
            let Some((key, _)) = root.entry(name).filter(|_| root.get("devices").is_none()) else { continue };
            let message = format!("`{name}` is a key of a bench, and a task cannot set it");
            let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
            self.diagnostics.push(diagnostic.help("move it to the bench file"));
        }
        self.task(root)
    }

    /// Reads the sections of a task: of a graph, or of a part that is one.
    fn task(&mut self, root: &Table) -> GraphDocument {
        let graph =
            root.entry("graph").map(|(key, value)| (key.span.clone(), GraphTable::read(value, &mut self.reader)));
        let commands = self.table(root.get("commands")).entries.into_iter().flat_map(|(role, value)| {
            let wires = InputWires::read(Some(&value), &mut self.reader).valid;
            wires.into_iter().map(move |wire| (role.clone(), wire))
        });
        let commands = commands.collect();
        let empty_commands = self.empty_section(root, "commands");
        let limits = read_limits(root, &LimitOwner::Task, &mut self.reader);
        let policy = root.get("policy");
        let policy = policy.map(|value| (value.clone(), PolicyTable::read(value, &mut self.reader)));
        let modes = self.named_tables(root.get("modes")).into_iter();
        let modes = modes.map(|(key, table)| read_mode(key, table, &mut self.reader)).collect();
        let (roles, carriers) = self.roles(root.get("roles"));
        let allow = read_allow(root.get(ALLOW), &mut self.reader);
        GraphDocument {
            graph,
            roles,
            carriers,
            commands,
            empty_commands,
            limits,
            modes,
            policy,
            allow,
            ..self.body(root)
        }
    }

    /// Corrects the names of the sections of a part, before the graph overrides values in them.
    pub(crate) fn correct_part(&mut self, root: &mut Table) {
        let sections: Vec<&str> = ["inputs", "exports"].into_iter().chain(GRAPH_SECTIONS).collect();
        correct_sections(root, &sections, &mut self.reader);
    }

    /// Reads the sections of a part.
    pub(crate) fn part(&mut self, root: &Table) -> GraphDocument {
        let (inputs, exports) = (self.names(root.get("inputs")), self.names(root.get("exports")));
        GraphDocument { inputs, exports, ..self.task(root) }
    }

    /// Reads the sections of a bench file.
    pub(crate) fn bench(&mut self, root: &mut Table) -> BenchDocument {
        correct_sections(root, &["devices", "bind", "facts", LIMITS, ALLOW, ALLOW_UNCALIBRATED], &mut self.reader);
        let allow = read_allow(root.get(ALLOW), &mut self.reader);
        let limits = read_limits(root, &LimitOwner::Bench, &mut self.reader);
        BenchDocument { allow, limits, ..self.own_bench(root) }
    }

    /// Reads the limits of the command line.
    pub(crate) fn set_limits(&mut self, root: &Table) -> Vec<LimitSection> {
        read_limits(root, &LimitOwner::CommandLine, &mut self.reader)
    }

    /// Reads the sections of the file of a robot or of a sensor.
    pub(crate) fn model(&mut self, root: &mut Table, from: &ModelFile) -> ModelDocument {
        read_model(root, from, &mut self.reader)
    }

    /// Reads the sections of a bench in a file that may have others. Its [allow] and [limits] belong to the graph.
    pub(crate) fn own_bench(&mut self, root: &Table) -> BenchDocument {
        let devices = self.named_tables(root.get("devices"));
        let names = names_of(&devices);
        let mut model_files = Vec::new();
        let block = |(key, mut table): (Key, Table)| {
            correct_block(&mut table, &[], &mut self.reader);
            for what in MODELS {
                correct_model(&mut table, what, &mut self.reader);
                let file = table.remove(what).and_then(|(_, value)| FilePath::read(&value, &mut self.reader));
                model_files.extend(file.map(|file| ModelFile { device: key.clone(), what, file }));
            }
            let reconnect = table.remove("reconnect").and_then(|(_, value)| Spanned::read(&value, &mut self.reader));
            Block { reconnect, ..self.block(key, table, &names) }
        };
        let devices = devices.into_iter().map(block).collect();
        let section = root.entry("bind");
        let is_invalid = |(_, value): &&(Key, Value)| value.as_str().is_none();
        let entries = section.and_then(|(_, value)| value.as_table()).into_iter().flat_map(|table| &table.entries);
        let invalid = entries.filter(is_invalid).map(|(key, _)| key.clone()).collect();
        let allow_uncalibrated = root.get(ALLOW_UNCALIBRATED).and_then(|value| bool::read(value, &mut self.reader));
        let (bind, facts) = (self.bindings(root.get("bind")), self.named_tables(root.get("facts")));
        for (key, _) in facts.iter().filter(|(key, _)| bind.position(&key.name).is_none()) {
            let unknown = Diagnostic::unknown(Code::UnboundRole, "role", &key.name, &key.span, bind.names());
            self.diagnostics.push(unknown);
        }
        let place = section.map(|(key, _)| key.span.clone());
        let allow_uncalibrated = allow_uncalibrated.unwrap_or(false);
        BenchDocument {
            devices,
            bind,
            place,
            invalid,
            facts,
            allow_uncalibrated,
            model_files,
            ..BenchDocument::default()
        }
    }

    fn body(&mut self, root: &Table) -> GraphDocument {
        let nodes = self.named_tables(root.get("nodes"));
        let names = names_of(&nodes);
        let parts = self.named_tables(root.get("parts"));
        let part_names: BTreeSet<&str> = parts.iter().map(|(key, _)| key.name.as_str()).collect();
        let nodes = nodes.into_iter().filter(|(key, table)| !self.addresses_part(key, table, &part_names));
        let nodes: Vec<(Key, Table)> = nodes.collect();
        let roles = root.get("roles").and_then(Value::as_table).into_iter().flat_map(|table| &table.entries);
        let roles = roles.map(|(key, _)| key.name.clone());
        let all: Vec<String> = names.iter().cloned().chain(names_of(&parts)).chain(roles).collect();
        let nodes = nodes.into_iter().map(|(key, table)| self.node(key, table, &names, &all)).collect();
        let parts = parts.into_iter().map(|(key, table)| self.part_block(key, table, &all)).collect();
        GraphDocument { nodes, parts, ..GraphDocument::default() }
    }

    /// Returns whether a block of [nodes] addresses a node in a part, as `--set nodes.PART.NODE.…` does, and reports
    /// it.
    fn addresses_part(&mut self, key: &Key, table: &Table, parts: &BTreeSet<&str>) -> bool {
        if !parts.contains(key.name.as_str()) || table.get("type").is_some() {
            return false;
        }
        let message = format!("`{0}` is a part: set its nodes through `parts.{0}.set`", key.name);
        let node = table.entries.first().map_or_else(String::new, |(node, _)| format!(".{}", node.name));
        let help = format!("write `parts.{}.set{node}`", key.name);
        self.diagnostics.push(Diagnostic::new(Code::UnknownKey, key.span.clone(), message).help(help));
        true
    }

    fn node(&mut self, key: Key, mut table: Table, names: &[String], sources: &[String]) -> Block {
        correct_block(&mut table, sources, &mut self.reader);
        let only_with = table.remove("only_with").and_then(|(_, value)| Spanned::read(&value, &mut self.reader));
        Block { only_with, wires: self.wires(&mut table), ..self.block(key, table, names) }
    }

    fn block(&mut self, key: Key, mut table: Table, names: &[String]) -> Block {
        let kind = match table.remove("type") {
            Some((_, value)) => Spanned::read(&value, &mut self.reader),
            None if self.broken.contains(&key) => None,
            None => {
                let message = format!("`{}` has no `type`", key.name);
                // A misspelt `--set nodes.pidd.…` creates a new block.
                let others = names.iter().map(String::as_str).filter(|name| *name != key.name);
                let help = suggest_name(&key.name, others).map(|name| format!("did you mean `{name}`?"));
                self.diagnostics.push(Diagnostic::new(Code::MissingKey, key.span.clone(), message).with_help(help));
                None
            }
        };
        // A missing parameter is reported at the name of the block.
        let params = Value { span: key.span.clone(), item: Item::Table(table) };
        Block { key, kind, wires: InputWires::default(), params, only_with: None, reconnect: None }
    }

    fn part_block(&mut self, key: Key, mut table: Table, sources: &[String]) -> PartBlock {
        separate_wires(&mut table, &mut self.reader);
        correct_wires(&mut table, sources, &mut self.reader);
        correct_part_file(&mut table, &mut self.reader);
        correct_keys(&mut table, &["file", "in", "set", "roles", "on_fail"], "", &mut self.reader);
        let on_fail = table.remove("on_fail");
        let on_fail = on_fail.and_then(|(key, value)| Some((OnFail::read(&value, &mut self.reader)?, key.span)));
        let roles = table.remove("roles").map(|(_, value)| value);
        let listed = roles.as_ref().and_then(Value::as_table).into_iter().flat_map(|table| &table.entries);
        let listed_roles = listed.map(|(key, _)| key.name.clone()).collect();
        let roles = self.words(roles.as_ref());
        let wires = self.wires(&mut table);
        let mut set = table.remove("set").map(|(_, value)| value);
        set.iter_mut().for_each(|value| correct_facts(value, &mut self.reader));
        let set = self.table(set.as_ref());
        let file = match table.remove("file") {
            Some((_, value)) => FilePath::read(&value, &mut self.reader),
            None if self.broken.contains(&key) => None,
            None => {
                let message = format!("part `{}` has no `file`", key.name);
                self.diagnostics.push(Diagnostic::new(Code::MissingKey, key.span.clone(), message));
                None
            }
        };
        PartBlock { key, file, wires, set, roles, listed_roles, on_fail }
    }

    /// Reads the table `in` of a block.
    fn wires(&mut self, table: &mut Table) -> InputWires {
        let wires = table.remove("in").map(|(_, value)| value);
        let mut wires = InputWires::read(wires.as_ref(), &mut self.reader);
        let mut invalid = Vec::new();
        wires.valid.retain_mut(|WireEntry { key, .. }| {
            if key.name == "from" {
                let diagnostic = Diagnostic::new(Code::BadName, key.span.clone(), "a wire cannot be named `from`");
                let help = "`from` is reserved for facts, as in `{ from = \"role.fact\" }`: choose another name";
                self.diagnostics.push(diagnostic.help(help));
            }
            let is_valid = key.name != "from" && self.check_name(key);
            invalid.extend((!is_valid).then(|| key.clone()));
            is_valid
        });
        wires.invalid.extend(invalid);
        wires
    }

    /// Returns the span of a section that is there and empty. An inline table, `name = {}`, is none.
    fn empty_section(&self, root: &Table, name: &str) -> Option<Range<usize>> {
        let (key, value) = root.entry(name)?;
        let file = self.reader.sources.file_at(key.span.start);
        let is_section = file.text[..file.local(&key.span).start].ends_with('[');
        let is_empty = value.as_table().is_some_and(|table| table.entries.is_empty());
        (is_section && is_empty).then(|| key.span.clone())
    }

    pub(super) fn table(&mut self, value: Option<&Value>) -> Table {
        read_table(value, &mut self.reader)
    }

    /// Reads a table whose values are strings.
    fn words(&mut self, value: Option<&Value>) -> Named<Spanned<String>> {
        let table = self.table(value);
        let read = |(key, value): (Key, Value)| Some((key, Spanned::read(&value, &mut self.reader)?));
        table.entries.into_iter().filter_map(read).collect()
    }

    /// Reads the section [bind].
    fn bindings(&mut self, value: Option<&Value>) -> Named<Binding> {
        self.words(value).iter().map(|(key, word)| (key.clone(), Binding { word: word.clone() })).collect()
    }

    /// Reads a table whose keys are names and whose values are strings.
    fn names(&mut self, value: Option<&Value>) -> Named<Spanned<String>> {
        let mut words = self.words(value).to_vec();
        for (key, _) in &mut words {
            self.check_name(key);
        }
        words.into_iter().collect()
    }

    /// Reads a table whose keys are names and whose values are tables.
    fn named_tables(&mut self, value: Option<&Value>) -> Vec<(Key, Table)> {
        let mut tables = Vec::new();
        for (mut key, value) in self.table(value).entries {
            self.check_name(&mut key);
            let table = self.table(Some(&value));
            if value.as_table().is_none() {
                self.broken.push(key.clone());
            }
            tables.push((key, table));
        }
        tables
    }

    /// Returns whether a key is a valid name. If not, it is reported, and a name with the same letters replaces it.
    pub(super) fn check_name(&mut self, key: &mut Key) -> bool {
        if is_name(&key.name) {
            return true;
        }
        let message = format!("`{}` is not a valid name", key.name);
        let diagnostic = Diagnostic::new(Code::BadName, key.span.clone(), message);
        let meant = key.name.to_lowercase().replace(['-', ' '], "_");
        if is_name(&meant) {
            self.diagnostics.push(diagnostic.instead(&key.name, &meant));
            key.name = meant;
            return true;
        }
        let help = "a name has lower-case letters, digits and `_`, starts with a letter, and is not `inputs`, `limits` or `modes`";
        self.diagnostics.push(diagnostic.help(help));
        false
    }
}

fn names_of(tables: &[(Key, Table)]) -> Vec<String> {
    tables.iter().map(|(key, _)| key.name.clone()).collect()
}

/// Converts a mistake of a reader into a diagnostic.
pub(crate) fn into_diagnostic(mistake: Mistake) -> Diagnostic {
    let At::Span(span) = mistake.at else { unreachable!("a reader reports spans") };
    let diagnostic = Diagnostic::new(mistake.code, span, mistake.message);
    match mistake.instead {
        Some(names) => diagnostic.instead(&names.0, &names.1),
        None => diagnostic,
    }
    .with_help(mistake.help)
}
