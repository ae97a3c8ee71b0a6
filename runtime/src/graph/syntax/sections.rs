//! Parses the sections of a graph file, a part and a bench, before names are resolved.

use std::ops::Range;

use super::allow::{ALLOW, Allowance, read_allow};
use super::modes::{ModeBlock, read_mode};
use super::policy::{AgeLimit, PolicyTable, WireTable};
use super::read::{check_keys, read_table};
use crate::node::{At, FilePath, Mistake, Param, Reader, Spanned};
use crate::source::{Code, Diagnostic, Diagnostics, Item, Key, SourceMap, Table, Value, suggest_name};

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
    /// five periods.
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

/// A wire: its input or command, and the port that it reads.
#[derive(Debug, Clone)]
pub(crate) struct WireEntry {
    pub(crate) key: Key,
    pub(crate) from: Spanned<String>,
    pub(crate) age: Option<AgeLimit>,
}

/// The table `in` of a block.
#[derive(Debug, Clone, Default)]
pub(crate) struct InputWires {
    pub(crate) valid: Vec<WireEntry>,
    /// Inputs whose wire is invalid and has its own diagnostic.
    invalid: Vec<Key>,
}

impl InputWires {
    /// Returns whether an input has no wire. A wire to a misspelt name counts, since it has its own diagnostic.
    pub(crate) fn lack<'n>(&self, input: &str, known: impl Iterator<Item = &'n str> + Clone) -> bool {
        let is_misspelt = |key: &Key| {
            !known.clone().any(|name| name == key.name) && suggest_name(&key.name, known.clone()) == Some(input)
        };
        let mut keys = self.valid.iter().map(|wire| &wire.key).chain(&self.invalid);
        !keys.any(|key| key.name == input || is_misspelt(key))
    }
}

/// The block of a node or a device: its type, its wires and its parameters.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    pub(crate) key: Key,
    pub(crate) kind: Option<Spanned<String>>,
    pub(crate) wires: InputWires,
    pub(crate) params: Value,
}

/// The block of a part: its file, the wires into it, and its overrides.
#[derive(Debug, Clone)]
pub(crate) struct PartBlock {
    pub(crate) key: Key,
    pub(crate) file: Option<FilePath>,
    pub(crate) wires: InputWires,
    pub(crate) set: Table,
}

/// The sections of a graph file or of a part.
#[derive(Debug, Clone, Default)]
pub(crate) struct GraphDocument {
    /// The span of the section [graph], and the section if it is valid.
    pub(crate) graph: Option<(Range<usize>, Option<GraphTable>)>,
    pub(crate) roles: Vec<(Key, Spanned<String>)>,
    pub(crate) nodes: Vec<Block>,
    pub(crate) parts: Vec<PartBlock>,
    /// The wires to commands, each with its role.
    pub(crate) commands: Vec<(Key, WireEntry)>,
    /// The section [limits] and its span.
    pub(crate) limits: Option<(Range<usize>, Table)>,
    pub(crate) modes: Vec<ModeBlock>,
    /// The section [policy] as written, and parsed if it is valid.
    pub(crate) policy: Option<(Value, Option<PolicyTable>)>,
    pub(crate) inputs: Vec<(Key, Spanned<String>)>,
    pub(crate) exports: Vec<(Key, Spanned<String>)>,
    pub(crate) allow: Vec<Allowance>,
}

/// The sections of a bench file.
#[derive(Debug, Clone, Default)]
pub(crate) struct BenchDocument {
    pub(crate) devices: Vec<Block>,
    pub(crate) bind: Vec<(Key, Spanned<String>)>,
    /// Whether limits may be in raw readings.
    pub(crate) allow_uncalibrated: bool,
    pub(crate) allow: Vec<Allowance>,
}

/// Name of the section [limits] in `{ from = "limits.KEY" }`.
pub(crate) const LIMITS: &str = "limits";

/// Key of a bench that allows limits in raw readings.
pub(crate) const ALLOW_UNCALIBRATED: &str = "allow_uncalibrated";

/// Reserved names, which have another meaning in wires and facts.
const RESERVED: [&str; 2] = ["inputs", LIMITS];

/// Reads sections and collects their diagnostics.
pub(crate) struct Sections<'a> {
    reader: Reader<'a>,
    diagnostics: Diagnostics,
    /// Blocks that are not tables and have their own diagnostic.
    broken: Vec<Key>,
}

impl<'a> Sections<'a> {
    pub(crate) const fn new(sources: &'a SourceMap) -> Self {
        Self { reader: Reader::new(sources), diagnostics: Vec::new(), broken: Vec::new() }
    }

    /// Returns all diagnostics.
    pub(crate) fn finish(self) -> Diagnostics {
        let mut diagnostics = self.diagnostics;
        let Reader { mistakes, warnings, .. } = self.reader;
        diagnostics.extend(mistakes.into_iter().chain(warnings).map(into_diagnostic));
        diagnostics
    }

    /// Reads the sections of a graph file.
    pub(crate) fn graph(&mut self, root: &Table) -> GraphDocument {
        const KEYS: [&str; 12] = [
            "graph",
            "roles",
            "parts",
            "nodes",
            "commands",
            "limits",
            "modes",
            "policy",
            "devices",
            "bind",
            ALLOW,
            ALLOW_UNCALIBRATED,
        ];
        check_keys(root, &KEYS, "", &mut self.reader);
        if let (Some((key, _)), None) = (root.entry(ALLOW_UNCALIBRATED), root.get("devices")) {
            let message = format!("`{ALLOW_UNCALIBRATED}` is a key of a bench: a task cannot allow it");
            let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
            self.diagnostics.push(diagnostic.help("move it to the bench file"));
        }
        let graph =
            root.entry("graph").map(|(key, value)| (key.span.clone(), GraphTable::read(value, &mut self.reader)));
        let commands = self.table(root.get("commands")).entries.into_iter().flat_map(|(role, value)| {
            let wires = self.wire_entries(Some(&value)).valid;
            wires.into_iter().map(move |wire| (role.clone(), wire))
        });
        let commands = commands.collect();
        let limits = root.entry("limits").map(|(key, value)| (key.span.clone(), self.table(Some(value))));
        let policy = root.get("policy");
        let policy = policy.map(|value| (value.clone(), PolicyTable::read(value, &mut self.reader)));
        let modes = self.named_tables(root.get("modes")).into_iter();
        let modes = modes.map(|(key, table)| read_mode(key, table, &mut self.reader)).collect();
        let roles = self.names(root.get("roles"));
        let allow = read_allow(root.get(ALLOW), &mut self.reader);
        GraphDocument { graph, roles, commands, limits, modes, policy, allow, ..self.body(root) }
    }

    /// Reads the sections of a part.
    pub(crate) fn part(&mut self, root: &Table) -> GraphDocument {
        check_keys(root, &["inputs", "exports", "parts", "nodes"], "", &mut self.reader);
        let (inputs, exports) = (self.names(root.get("inputs")), self.names(root.get("exports")));
        GraphDocument { inputs, exports, ..self.body(root) }
    }

    /// Reads the sections of a bench file.
    pub(crate) fn bench(&mut self, root: &Table) -> BenchDocument {
        check_keys(root, &["devices", "bind", ALLOW, ALLOW_UNCALIBRATED], "", &mut self.reader);
        let allow = read_allow(root.get(ALLOW), &mut self.reader);
        BenchDocument { allow, ..self.own_bench(root) }
    }

    /// Reads the sections of a bench in a file that may have others. Its [allow] belongs to the graph.
    pub(crate) fn own_bench(&mut self, root: &Table) -> BenchDocument {
        let devices = self.named_tables(root.get("devices"));
        let names = names_of(&devices);
        let devices = devices.into_iter().map(|(key, table)| self.block(key, table, &names)).collect();
        let allow_uncalibrated = root.get(ALLOW_UNCALIBRATED).and_then(|value| bool::read(value, &mut self.reader));
        let bind = self.words(root.get("bind"));
        BenchDocument { devices, bind, allow_uncalibrated: allow_uncalibrated.unwrap_or(false), allow: Vec::new() }
    }

    fn body(&mut self, root: &Table) -> GraphDocument {
        let nodes = self.named_tables(root.get("nodes"));
        let names = names_of(&nodes);
        let parts = self.named_tables(root.get("parts"));
        let nodes = nodes.into_iter().filter(|(key, table)| !self.addresses_part(key, table, &parts));
        let nodes: Vec<(Key, Table)> = nodes.collect();
        let nodes = nodes.into_iter().map(|(key, table)| self.node(key, table, &names)).collect();
        let parts = parts.into_iter().map(|(key, table)| self.part_block(key, table)).collect();
        GraphDocument { nodes, parts, ..GraphDocument::default() }
    }

    /// Returns whether a block of [nodes] addresses a node in a part, as `--set nodes.PART.NODE.…` does, and reports
    /// it.
    fn addresses_part(&mut self, key: &Key, table: &Table, parts: &[(Key, Table)]) -> bool {
        let is_part = parts.iter().any(|(part, _)| part.name == key.name);
        if !is_part || table.get("type").is_some() {
            return false;
        }
        let message = format!("`{0}` is a part: set its nodes through `parts.{0}.set`", key.name);
        let node = table.entries.first().map_or("NODE", |(node, _)| &node.name);
        let help = format!("write `parts.{}.set.{node}.…`", key.name);
        self.diagnostics.push(Diagnostic::new(Code::UnknownKey, key.span.clone(), message).help(help));
        true
    }

    fn node(&mut self, key: Key, mut table: Table, names: &[String]) -> Block {
        Block { wires: self.wires(&mut table), ..self.block(key, table, names) }
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
        Block { key, kind, wires: InputWires::default(), params }
    }

    fn part_block(&mut self, key: Key, mut table: Table) -> PartBlock {
        let wires = self.wires(&mut table);
        let set = table.remove("set").map(|(_, value)| value);
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
        check_keys(&table, &["file", "in", "set"], "", &mut self.reader);
        PartBlock { key, file, wires, set }
    }

    /// Reads the table `in` of a block.
    fn wires(&mut self, table: &mut Table) -> InputWires {
        let wires = table.remove("in").map(|(_, value)| value);
        let mut wires = self.wire_entries(wires.as_ref());
        wires.valid.retain(|WireEntry { key, .. }| {
            if key.name == "from" {
                let diagnostic = Diagnostic::new(Code::BadName, key.span.clone(), "a wire cannot be named `from`");
                let help = "`from` is reserved for facts, as in `{ from = \"role.fact\" }`: choose another name";
                self.diagnostics.push(diagnostic.help(help));
            }
            key.name != "from" && self.check_name(key)
        });
        wires
    }

    fn table(&mut self, value: Option<&Value>) -> Table {
        read_table(value, &mut self.reader)
    }

    /// Reads a table whose values are strings.
    fn words(&mut self, value: Option<&Value>) -> Vec<(Key, Spanned<String>)> {
        let table = self.table(value);
        let read = |(key, value): (Key, Value)| Some((key, Spanned::read(&value, &mut self.reader)?));
        table.entries.into_iter().filter_map(read).collect()
    }

    /// Reads a table whose values are wires, each a port or a table with an age limit.
    fn wire_entries(&mut self, value: Option<&Value>) -> InputWires {
        let mut wires = InputWires::default();
        for (key, value) in self.table(value).entries {
            let wire = match value.as_table() {
                Some(table) => self.aged_wire(&value, table),
                None => Spanned::read(&value, &mut self.reader).map(|from| (from, None)),
            };
            match wire {
                Some((from, age)) => wires.valid.push(WireEntry { key, from, age }),
                None => wires.invalid.push(key),
            }
        }
        wires
    }

    /// Reads a wire with an age limit.
    fn aged_wire(&mut self, value: &Value, table: &Table) -> Option<(Spanned<String>, Option<AgeLimit>)> {
        if let Some(wire) = WireTable::read(value, &mut self.reader) {
            let age = AgeLimit::of(&wire);
            return Some((wire.from, Some(age)));
        }
        // The table has a diagnostic; its port is still resolved, to report a second mistake there.
        let from = table.get("from")?;
        Some((Spanned { value: from.as_str()?.to_owned(), span: from.span.clone() }, None))
    }

    /// Reads a table whose keys are names and whose values are strings.
    fn names(&mut self, value: Option<&Value>) -> Vec<(Key, Spanned<String>)> {
        let words = self.words(value);
        for (key, _) in &words {
            self.check_name(key);
        }
        words
    }

    /// Reads a table whose keys are names and whose values are tables.
    fn named_tables(&mut self, value: Option<&Value>) -> Vec<(Key, Table)> {
        let mut tables = Vec::new();
        for (key, value) in self.table(value).entries {
            self.check_name(&key);
            let table = self.table(Some(&value));
            if value.as_table().is_none() {
                self.broken.push(key.clone());
            }
            tables.push((key, table));
        }
        tables
    }

    /// Returns whether a key is a valid name, and reports it if not.
    fn check_name(&mut self, key: &Key) -> bool {
        let is_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        let starts_well = key.name.starts_with(|c: char| c.is_ascii_lowercase());
        let is_name = starts_well && key.name.chars().all(is_word) && !RESERVED.contains(&key.name.as_str());
        if !is_name {
            let message = format!("`{}` is not a valid name", key.name);
            let help =
                "a name has lower-case letters, digits and `_`, starts with a letter, and is not `inputs` or `limits`";
            self.diagnostics.push(Diagnostic::new(Code::BadName, key.span.clone(), message).help(help));
        }
        is_name
    }
}

fn names_of(tables: &[(Key, Table)]) -> Vec<String> {
    tables.iter().map(|(key, _)| key.name.clone()).collect()
}

/// Converts a mistake of a reader into a diagnostic.
pub(crate) fn into_diagnostic(mistake: Mistake) -> Diagnostic {
    let At::Span(span) = mistake.at else { unreachable!("a reader reports spans") };
    Diagnostic { code: mistake.code, message: mistake.message, span, notes: Vec::new(), help: mistake.help }
}
