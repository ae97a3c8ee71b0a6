//! What the sections of a graph file, a part and a bench hold, before anything is looked up.

use std::collections::BTreeMap;
use std::ops::Range;

use super::modes::{self, ModeBlock};
use super::policy::{Age, PolicyTable, WireTable};
use crate::node::{At, FilePath, Mistake, NonNegative, Param, Positive, Rate, Reader, Word};
use crate::source::{Code, Diagnostic, Item, Key, SourceMap, Table, Value, meant};

crate::params! { GraphTable:
    /// Role whose samples trigger the ticks.
    clock: Option<Word>,
    /// Ticks per second of a graph that has no role for a clock [Hz].
    rate_hz: Option<Rate>,
    /// Mode that it starts in.
    start: Option<Word>,
    /// Bench it runs on unless another is named.
    bench: Option<FilePath>,
    /// Greatest time between two samples that counts as one step; five periods unless said [ms].
    max_gap_ms: Option<Positive>,
    /// How long something must be absent before the state behind it is reset [ms].
    reset_after_ms: NonNegative = NonNegative(20.0),
    /// Ports that a run shows: images as they were, and numbers over time.
    show: Option<Vec<Word>>,
    /// Where the contact is in the first image that is shown: ports of its x and of its y.
    mark: Option<[Word; 2]>,
}

/// A block of a node or a device: its type, its wires, and what is left are its parameters.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    pub(crate) key: Key,
    pub(crate) kind: Option<Word>,
    pub(crate) wires: Vec<(Key, Word)>,
    /// Inputs whose wire cannot be read: that has been told.
    pub(crate) unread: Vec<Key>,
    pub(crate) params: Value,
}

/// A block of a part: the file, the wires into it, and what is set in it.
#[derive(Debug, Clone)]
pub(crate) struct PartBlock {
    pub(crate) key: Key,
    pub(crate) file: Option<FilePath>,
    pub(crate) wires: Vec<(Key, Word)>,
    /// Inputs whose wire cannot be read: that has been told.
    pub(crate) unread: Vec<Key>,
    pub(crate) set: Table,
}

/// A graph file or a part.
#[derive(Debug, Clone, Default)]
pub(crate) struct Document {
    /// The section [graph] and its place, if there is one; no table if it has mistakes.
    pub(crate) graph: Option<(Range<usize>, Option<GraphTable>)>,
    pub(crate) roles: Vec<(Key, Word)>,
    pub(crate) nodes: Vec<Block>,
    pub(crate) parts: Vec<PartBlock>,
    pub(crate) commands: Vec<(Key, Key, Word)>,
    /// The section [limits] and its place.
    pub(crate) limits: Option<(Range<usize>, Table)>,
    pub(crate) modes: Vec<ModeBlock>,
    /// The section [policy], as it is written and as it reads.
    pub(crate) policy: Option<(Value, Option<PolicyTable>)>,
    pub(crate) inputs: Vec<(Key, Word)>,
    pub(crate) exports: Vec<(Key, Word)>,
}

/// A bench file.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bench {
    pub(crate) devices: Vec<Block>,
    pub(crate) bind: Vec<(Key, Word)>,
}

/// What parameters call the section [limits] in `{ from = "limits.…" }`.
pub(crate) const LIMITS: &str = "limits";

/// What cannot be a name: what wires and facts call something else.
const RESERVED: [&str; 2] = ["inputs", LIMITS];

/// Reads sections and collects what is wrong with them.
pub(crate) struct Sections<'a> {
    reader: Reader<'a>,
    diagnostics: Vec<Diagnostic>,
    /// Wires that may grow only so old, by the places of their sources.
    pub(crate) ages: BTreeMap<usize, Age>,
    /// Blocks that are no tables: that has been told, and is all there is to tell.
    broken: Vec<Key>,
}

impl<'a> Sections<'a> {
    pub(crate) const fn new(sources: &'a SourceMap) -> Self {
        Self { reader: Reader::new(sources), diagnostics: Vec::new(), ages: BTreeMap::new(), broken: Vec::new() }
    }

    /// Everything that was wrong.
    pub(crate) fn finish(self) -> Vec<Diagnostic> {
        let mut diagnostics = self.diagnostics;
        diagnostics.extend(self.reader.mistakes.into_iter().map(spanned));
        diagnostics
    }

    /// The sections of a graph file.
    pub(crate) fn graph(&mut self, root: &Table) -> Document {
        self.known(
            root,
            &["graph", "roles", "parts", "nodes", "commands", "limits", "modes", "policy", "devices", "bind"],
        );
        let graph =
            root.entry("graph").map(|(key, value)| (key.span.clone(), GraphTable::read(value, &mut self.reader)));
        let commands = self.table(root.get("commands")).entries.into_iter().flat_map(|(role, value)| {
            let (wires, _) = self.wire_words(Some(&value));
            wires.into_iter().map(move |(command, word)| (role.clone(), command, word))
        });
        let commands = commands.collect();
        let limits = root.entry("limits").map(|(key, value)| (key.span.clone(), self.table(Some(value))));
        let policy = root.get("policy");
        let policy = policy.map(|value| (value.clone(), PolicyTable::read(value, &mut self.reader)));
        let modes = self.named_tables(root.get("modes"));
        let modes = modes::modes(modes, &mut self.reader);
        Document { graph, roles: self.names(root.get("roles")), commands, limits, modes, policy, ..self.body(root) }
    }

    /// The sections of a part.
    pub(crate) fn part(&mut self, root: &Table) -> Document {
        self.known(root, &["inputs", "exports", "parts", "nodes"]);
        let (inputs, exports) = (self.names(root.get("inputs")), self.names(root.get("exports")));
        Document { inputs, exports, ..self.body(root) }
    }

    /// The sections of a bench file.
    pub(crate) fn bench(&mut self, root: &Table) -> Bench {
        self.known(root, &["devices", "bind"]);
        self.own_bench(root)
    }

    /// The sections of a bench, in a file with others.
    pub(crate) fn own_bench(&mut self, root: &Table) -> Bench {
        let devices = self.named_tables(root.get("devices"));
        let names = names_of(&devices);
        let devices = devices.into_iter().map(|(key, table)| self.block(key, table, &names)).collect();
        Bench { devices, bind: self.words(root.get("bind")) }
    }

    fn body(&mut self, root: &Table) -> Document {
        let nodes = self.named_tables(root.get("nodes"));
        let names = names_of(&nodes);
        let parts = self.named_tables(root.get("parts"));
        let nodes = nodes.into_iter().filter(|(key, table)| !self.is_in_part(key, table, &parts));
        let nodes: Vec<(Key, Table)> = nodes.collect();
        let nodes = nodes.into_iter().map(|(key, table)| self.node(key, table, &names)).collect();
        let parts = parts.into_iter().map(|(key, table)| self.part_block(key, table)).collect();
        Document { nodes, parts, ..Document::default() }
    }

    /// Whether what looks like a node is meant for one in a part, as `--set nodes.PART.NODE.…` is: `show` calls it so.
    fn is_in_part(&mut self, key: &Key, table: &Table, parts: &[(Key, Table)]) -> bool {
        let is_part = parts.iter().any(|(part, _)| part.name == key.name);
        if !is_part || table.get("type").is_some() {
            return false;
        }
        let message = format!("`{0}` is a part: its nodes are set through `parts.{0}.set`", key.name);
        let node = table.entries.first().map_or("NODE", |(node, _)| &node.name);
        let help = format!("write `parts.{}.set.{node}.…`", key.name);
        self.diagnostics.push(Diagnostic::new(Code::UnknownKey, key.span.clone(), message).help(help));
        true
    }

    fn node(&mut self, key: Key, mut table: Table, names: &[String]) -> Block {
        let (wires, unread) = self.wires(&mut table);
        Block { wires, unread, ..self.block(key, table, names) }
    }

    fn block(&mut self, key: Key, mut table: Table, names: &[String]) -> Block {
        let kind = match table.remove("type") {
            Some((_, value)) => Word::read(&value, &mut self.reader),
            None if self.broken.contains(&key) => None,
            None => {
                let message = format!("`{}` has no `type`", key.name);
                // `--set nodes.pidd.…` makes a block of its own.
                let others = names.iter().map(String::as_str).filter(|name| *name != key.name);
                let help = meant(&key.name, others).map(|name| format!("did you mean `{name}`?"));
                self.diagnostics.push(Diagnostic::new(Code::MissingKey, key.span.clone(), message).with_help(help));
                None
            }
        };
        // What is missing among the parameters is shown at the block's name.
        let params = Value { span: key.span.clone(), item: Item::Table(table) };
        Block { key, kind, wires: Vec::new(), unread: Vec::new(), params }
    }

    fn part_block(&mut self, key: Key, mut table: Table) -> PartBlock {
        let (wires, unread) = self.wires(&mut table);
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
        self.known(&table, &["file", "in", "set"]);
        PartBlock { key, file, wires, unread, set }
    }

    /// The wires of a block, its table `in`, and those that cannot be read.
    fn wires(&mut self, table: &mut Table) -> (Vec<(Key, Word)>, Vec<Key>) {
        let wires = table.remove("in").map(|(_, value)| value);
        let (mut wires, unread) = self.wire_words(wires.as_ref());
        wires.retain(|(key, _)| {
            if key.name == "from" {
                let diagnostic = Diagnostic::new(Code::BadName, key.span.clone(), "a wire cannot be called `from`");
                let help = "`{ from = \"role.fact\" }` asks a device for a fact: choose another name";
                self.diagnostics.push(diagnostic.help(help));
            }
            key.name != "from" && self.name(key)
        });
        (wires, unread)
    }

    /// Every key must be one of `keys`.
    fn known(&mut self, table: &Table, keys: &[&str]) {
        for (key, _) in table.entries.iter().filter(|(key, _)| !keys.contains(&key.name.as_str())) {
            let diagnostic =
                Diagnostic::new(Code::UnknownKey, key.span.clone(), format!("`{}` means nothing here", key.name));
            self.diagnostics.push(diagnostic.suggest(&key.name, keys.iter().copied(), "keys"));
        }
    }

    fn table(&mut self, value: Option<&Value>) -> Table {
        match value.map(|value| (value, value.as_table())) {
            Some((_, Some(table))) => table.clone(),
            Some((value, None)) => {
                self.reader.wrong_type(value, "a table");
                Table::default()
            }
            None => Table::default(),
        }
    }

    /// Keys with a string each.
    fn words(&mut self, value: Option<&Value>) -> Vec<(Key, Word)> {
        let table = self.table(value);
        let read = |(key, value): (Key, Value)| Some((key, Word::read(&value, &mut self.reader)?));
        table.entries.into_iter().filter_map(read).collect()
    }

    /// Keys with a wire each: where it comes from, or a table that says how old it may be too. And the keys of those that
    /// cannot be read.
    fn wire_words(&mut self, value: Option<&Value>) -> (Vec<(Key, Word)>, Vec<Key>) {
        let (mut wires, mut unread) = (Vec::new(), Vec::new());
        for (key, value) in self.table(value).entries {
            let from =
                if value.as_table().is_some() { self.aged_wire(&value) } else { Word::read(&value, &mut self.reader) };
            match from {
                Some(from) => wires.push((key, from)),
                None => unread.push(key),
            }
        }
        (wires, unread)
    }

    /// Where a wire comes from that may grow only so old.
    fn aged_wire(&mut self, value: &Value) -> Option<Word> {
        if let Some(wire) = WireTable::read(value, &mut self.reader) {
            self.ages.insert(wire.from.span.start, Age::of(&wire));
            return Some(wire.from);
        }
        // What is wrong with it has been told; where it comes from is looked up all the same, if it says that.
        let from = value.as_table().and_then(|table| table.get("from"))?;
        Some(Word { text: from.as_str()?.to_owned(), span: from.span.clone() })
    }

    /// Keys that are names, with a string each.
    fn names(&mut self, value: Option<&Value>) -> Vec<(Key, Word)> {
        let words = self.words(value);
        for (key, _) in &words {
            self.name(key);
        }
        words
    }

    /// Keys that are names, with a table each.
    fn named_tables(&mut self, value: Option<&Value>) -> Vec<(Key, Table)> {
        let mut tables = Vec::new();
        for (key, value) in self.table(value).entries {
            self.name(&key);
            let table = self.table(Some(&value));
            if value.as_table().is_none() {
                self.broken.push(key.clone());
            }
            tables.push((key, table));
        }
        tables
    }

    /// Whether a key is a name.
    fn name(&mut self, key: &Key) -> bool {
        let is_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        let starts_well = key.name.starts_with(|c: char| c.is_ascii_lowercase());
        let is_name = starts_well && key.name.chars().all(is_word) && !RESERVED.contains(&key.name.as_str());
        if !is_name {
            let message = format!("`{}` cannot be a name", key.name);
            let help =
                "a name is made of small letters, digits and `_`, starts with a letter and is not `inputs` or `limits`";
            self.diagnostics.push(Diagnostic::new(Code::BadName, key.span.clone(), message).help(help));
        }
        is_name
    }
}

fn names_of(tables: &[(Key, Table)]) -> Vec<String> {
    tables.iter().map(|(key, _)| key.name.clone()).collect()
}

/// A mistake that knows its place.
pub(crate) fn spanned(mistake: Mistake) -> Diagnostic {
    let At::Span(span) = mistake.at else { unreachable!("a reader points at places") };
    Diagnostic { code: mistake.code, message: mistake.message, span, notes: Vec::new(), help: mistake.help }
}
