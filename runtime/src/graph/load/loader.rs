//! Loads the files of a graph, expands its parts, and merges `--set` and overrides.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::flat::{Entity, FlatGraph, FlatNode, Scope};
use crate::graph::syntax::{BenchDocument, GraphDocument, PartBlock, Sections};
use crate::source::{BuiltinFile, Code, Diagnostic, Diagnostics, Item, Key, SourceMap, Table, Value, parse_table};

/// Which graph to load, and what to change in it.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// The graph file.
    pub graph: PathBuf,
    /// The text of the graph, instead of the content of the file.
    pub text: Option<String>,
    /// The bench file, instead of the bench of the graph.
    pub bench: Option<PathBuf>,
    /// The text of the bench, instead of a file.
    pub bench_text: Option<String>,
    /// Assignments `key=value` that override values of the files.
    pub set: Vec<String>,
}

impl Request {
    /// Requests the graph of a file, on its own bench.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self { graph: path.into(), ..Self::default() }
    }

    /// Requests a graph given as text, with paths relative to the working folder.
    pub fn text(text: impl Into<String>) -> Self {
        Self { graph: "graph.toml".into(), text: Some(text.into()), ..Self::default() }
    }

    /// Replaces the bench.
    #[must_use]
    pub fn bench(mut self, path: impl Into<PathBuf>) -> Self {
        self.bench = Some(path.into());
        self
    }

    /// Overrides a value of the files, for example `nodes.pid.gains.x.kp=3`.
    #[must_use]
    pub fn set(mut self, assignment: impl Into<String>) -> Self {
        self.set.push(assignment.into());
        self
    }
}

/// Reads files and collects their diagnostics.
#[derive(Default)]
pub(crate) struct Loader {
    pub(crate) sources: SourceMap,
    pub(crate) diagnostics: Diagnostics,
    open_parts: Vec<PathBuf>,
    /// Whether the maximum number of parts is exceeded, so that loading stops.
    is_full: bool,
}

/// Maximum depth of parts inside parts.
const MAX_PART_DEPTH: usize = 32;
/// Maximum number of parts in a graph.
const MAX_PARTS: usize = 4096;

impl Loader {
    /// Creates a loader with the built-in files of a catalogue.
    pub(crate) fn new(builtin: &[BuiltinFile]) -> Self {
        Self { sources: SourceMap::with_builtin(builtin), ..Self::default() }
    }

    /// Reads all files of a request into one flat graph.
    pub(crate) fn load(&mut self, request: &Request) -> FlatGraph {
        let mut flat = FlatGraph::default();
        let root = match &request.text {
            Some(text) => self.parse(&request.graph, text.clone()),
            None => self.read(&request.graph, None),
        };
        let (graph_set, bench_set) = self.assignments(&request.set);
        let Some(mut root) = root else { return flat };
        if let Some(what) = wrong_file_type(&root.0, "graph") {
            let message = format!("this is {what}, not a graph");
            let help = (what == SCENARIO).then(|| "run it with `tactflow verify`".to_owned());
            self.diagnostics.push(Diagnostic::new(Code::WrongFile, root.1, message).with_help(help));
            return flat;
        }
        flat.place = root.1;
        root.0.merge(graph_set);
        let document = self.sections(|sections| sections.graph(&root.0));
        flat.table = match &document.graph {
            Some((span, table)) => {
                flat.place = span.clone();
                table.clone()
            }
            None => {
                let message = "the graph has no section [graph]";
                let help = "add [graph] with `clock = \"role\"` or `rate_hz = 250`, and a `bench`";
                self.diagnostics.push(Diagnostic::new(Code::MissingKey, flat.place.clone(), message).help(help));
                None
            }
        };
        flat.settings = root.0.get("graph").cloned();
        flat.bench = self.bench(request, &flat, &root.0, bench_set);
        flat.roles.clone_from(&document.roles);
        flat.commands.clone_from(&document.commands);
        flat.limits.clone_from(&document.limits);
        flat.modes.clone_from(&document.modes);
        flat.policy.clone_from(&document.policy);
        flat.allow.clone_from(&document.allow);
        self.flatten(document, "", Scope::default(), &mut flat);
        flat
    }

    fn sections<T>(&mut self, read: impl FnOnce(&mut Sections<'_>) -> T) -> T {
        let mut sections = Sections::new(&self.sources);
        let result = read(&mut sections);
        self.diagnostics.extend(sections.finish());
        result
    }

    /// Loads the requested bench, or the sections of a bench in the graph, or the bench that the graph names.
    fn bench(&mut self, request: &Request, flat: &FlatGraph, graph: &Table, set: Table) -> Option<BenchDocument> {
        // An invalid section [graph] has its own diagnostic.
        let named = flat.table.as_ref()?.bench.as_ref();
        if let Some(text) = &request.bench_text {
            let mut root = self.parse(Path::new("bench.toml"), text.clone())?.0;
            root.merge(set);
            return Some(self.sections(|sections| sections.bench(&root)));
        }
        let own = graph.entry("devices").or_else(|| graph.entry("bind")).map(|(key, _)| key.span.clone());
        if let (Some(own), Some(file)) = (&own, named) {
            let message = "the graph has its own devices and also names a bench";
            let diagnostic = Diagnostic::new(Code::DuplicateName, file.span.clone(), message);
            let help = "remove one of the two; `--bench` replaces either of them";
            self.diagnostics.push(diagnostic.note(own.clone(), "its own devices are here").help(help));
            return None;
        }
        if own.is_some() && request.bench.is_none() {
            let mut root = graph.clone();
            root.merge(set);
            return Some(self.sections(|sections| sections.own_bench(&root)));
        }
        let (path, span) = match (&request.bench, named) {
            (Some(path), _) => (path.clone(), None),
            (None, Some(file)) => (file.path.clone(), Some(file.span.clone())),
            (None, None) if set.get("devices").is_some() => {
                return Some(self.sections(|sections| sections.bench(&set)));
            }
            (None, None) => {
                let diagnostic = Diagnostic::new(Code::MissingKey, flat.place.clone(), "the graph has no bench");
                let help = "add `bench = \"benches/….toml\"` under [graph], pass `--bench`, or add [bind] and [devices] \
                            here";
                self.diagnostics.push(diagnostic.help(help));
                return None;
            }
        };
        let (mut root, place) = self.read(&path, span)?;
        if let Some(what) = wrong_file_type(&root, "devices") {
            let message = format!("this is {what}, not a bench");
            self.diagnostics.push(Diagnostic::new(Code::WrongFile, place, message));
            return None;
        }
        root.merge(set);
        Some(self.sections(|sections| sections.bench(&root)))
    }

    /// Reads and parses a file; `from` is the span of its name.
    pub(crate) fn read(&mut self, path: &Path, from: Option<Range<usize>>) -> Option<(Table, Range<usize>)> {
        let text = match self.sources.builtin(path) {
            Ok(Some(bytes)) => Ok(String::from_utf8_lossy(bytes).into_owned()),
            Ok(None) => std::fs::read_to_string(path).map_err(|error| (error.to_string(), None)),
            Err((message, help)) => Err((message, Some(help))),
        };
        match text {
            Ok(text) => self.parse(path, text),
            Err((error, help)) => {
                let message = format!("cannot read `{}`: {error}", path.display());
                let span = from.unwrap_or_else(|| {
                    let file = self.sources.add(SourceMap::COMMAND_LINE, path.display().to_string(), "");
                    file.span()
                });
                self.diagnostics.push(Diagnostic::new(Code::Unreadable, span, message).with_help(help));
                None
            }
        }
    }

    fn parse(&mut self, path: &Path, text: String) -> Option<(Table, Range<usize>)> {
        let file = self.sources.add_file(path, text);
        // Diagnostics about the file as a whole point at its first line.
        let first_line = file.base..file.base + file.text.lines().next().map_or(0, str::len);
        match parse_table(file) {
            Ok(Value { item: Item::Table(table), .. }) => Some((table, first_line)),
            Ok(_) => None,
            Err(mistakes) => {
                self.diagnostics.extend(mistakes);
                None
            }
        }
    }

    /// Parses the assignments of the command line, for the graph and for the bench.
    fn assignments(&mut self, assignments: &[String]) -> (Table, Table) {
        let (mut graph, mut bench) = (Table::default(), Table::default());
        for assignment in assignments {
            let Some(table) = self.assignment(assignment) else { continue };
            for (key, value) in table.entries {
                let of_bench = matches!(key.name.as_str(), "devices" | "bind");
                let target = if of_bench { &mut bench } else { &mut graph };
                target.merge(Table { entries: vec![(key, value)] });
            }
        }
        (graph, bench)
    }

    /// Parses one `key=value`. A value that is not TOML is a string, so that no second quoting is needed in a shell.
    fn assignment(&mut self, text: &str) -> Option<Table> {
        let is_line = !text.contains(['\n', '\r']);
        let quoted = text.split_once('=').filter(|_| is_line).map(|(key, value)| format!("{key}={value:?}"));
        for text in [Some(text.to_owned()), quoted].into_iter().flatten() {
            let file = self.sources.add(SourceMap::COMMAND_LINE, text, "");
            if let Ok(Value { item: Item::Table(table), .. }) = parse_table(file)
                && is_one_assignment(&table, &file.text)
            {
                return Some(table);
            }
        }
        let file = self.sources.add(SourceMap::COMMAND_LINE, text, "");
        let span = file.span();
        let diagnostic = Diagnostic::new(Code::Syntax, span, "this is not `key=value`");
        self.diagnostics.push(diagnostic.help("for example `--set nodes.pid.gains.x.kp=3`"));
        None
    }

    /// Adds the nodes and parts of a document to the graph, and returns the index of its scope.
    fn flatten(&mut self, document: GraphDocument, prefix: &str, mut scope: Scope, flat: &mut FlatGraph) -> usize {
        let index = flat.scopes.len();
        flat.scopes.push(Scope::default());
        (scope.exports, scope.declared) = (document.exports, document.inputs);
        for (i, (key, _)) in document.roles.iter().enumerate() {
            self.declare(&mut scope, key, Entity::Role(i));
        }
        for block in document.nodes {
            self.declare(&mut scope, &block.key, Entity::Node(flat.nodes.len()));
            flat.nodes.push(FlatNode { name: format!("{prefix}{}", block.key.name), scope: index, block });
        }
        for part in document.parts {
            if let Some(inner) = self.part(&part, prefix, index, flat) {
                self.declare(&mut scope, &part.key, Entity::Part(inner));
            }
        }
        flat.scopes[index] = scope;
        index
    }

    fn declare(&mut self, scope: &mut Scope, key: &Key, entity: Entity) {
        if let Some((first, _)) = scope.names.get(&key.name) {
            let message = format!("the name `{}` is used twice", key.name);
            let (first, second) = if first.span.start < key.span.start { (first, key) } else { (key, first) };
            let diagnostic = Diagnostic::new(Code::DuplicateName, second.span.clone(), message);
            let diagnostic = diagnostic.note(first.span.clone(), "first used here");
            self.diagnostics.push(diagnostic.help("roles, nodes and parts share one namespace: rename one of them"));
            return;
        }
        scope.names.insert(key.name.clone(), (key.clone(), entity));
    }

    fn part(&mut self, part: &PartBlock, prefix: &str, parent: usize, flat: &mut FlatGraph) -> Option<usize> {
        let file = part.file.as_ref().filter(|_| !self.is_full)?;
        if self.open_parts.len() >= MAX_PART_DEPTH || flat.scopes.len() > MAX_PARTS {
            let message =
                format!("parts are nested more than {MAX_PART_DEPTH} deep, or there are more than {MAX_PARTS} parts");
            self.diagnostics.push(Diagnostic::new(Code::EndlessPart, file.span.clone(), message));
            self.is_full = true;
            return None;
        }
        let canonical = file.path.canonicalize().unwrap_or_else(|_| file.path.clone());
        if self.open_parts.contains(&canonical) {
            let message = format!("part `{}` contains itself", part.key.name);
            self.diagnostics.push(Diagnostic::new(Code::EndlessPart, file.span.clone(), message));
            return None;
        }
        let mut root = self.read(&file.path, Some(file.span.clone()))?.0;
        self.override_with(&mut root, &part.set);
        let document = self.sections(|sections| sections.part(&root));
        self.check_part_wires(part, &document);
        self.open_parts.push(canonical);
        let scope = Scope { inputs: part.wires.valid.clone(), parent: Some(parent), ..Scope::default() };
        let inner = self.flatten(document, &format!("{prefix}{}.", part.key.name), scope, flat);
        self.open_parts.pop();
        Some(inner)
    }

    /// Merges `set.NAME` of a part into its node NAME, or into the `set` of its part NAME.
    fn override_with(&mut self, root: &mut Table, set: &Table) {
        let names = |section: &str| -> Vec<String> {
            let table = root.get(section).and_then(Value::as_table);
            table.map(|table| table.entries.iter().map(|(key, _)| key.name.clone()).collect()).unwrap_or_default()
        };
        let (nodes, parts) = (names("nodes"), names("parts"));
        for (key, value) in &set.entries {
            let entry = |name: &str, value: Value| Table {
                entries: vec![(Key { name: name.to_owned(), span: key.span.clone() }, value)],
            };
            let wrap =
                |name: &str, inner: Value| Value { span: value.span.clone(), item: Item::Table(entry(name, inner)) };
            if nodes.contains(&key.name) {
                root.merge(entry("nodes", wrap(&key.name, value.clone())));
            } else if parts.contains(&key.name) {
                root.merge(entry("parts", wrap(&key.name, wrap("set", value.clone()))));
            } else {
                let message = format!("the part has no node or part `{}`", key.name);
                let known = nodes.iter().chain(&parts).map(String::as_str);
                let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
                self.diagnostics.push(diagnostic.suggest(&key.name, known, "nodes and parts"));
            }
        }
    }

    fn check_part_wires(&mut self, part: &PartBlock, document: &GraphDocument) {
        let names = document.inputs.iter().map(|(input, _)| input.name.as_str());
        for key in part.wires.valid.iter().map(|wire| &wire.key) {
            if !names.clone().any(|name| name == key.name) {
                let message = format!("part `{}` has no input `{}`", part.key.name, key.name);
                let diagnostic = Diagnostic::new(Code::UnknownInput, key.span.clone(), message);
                self.diagnostics.push(diagnostic.suggest(&key.name, names.clone(), "inputs"));
            }
        }
        for (input, doc) in &document.inputs {
            if part.wires.lack(&input.name, names.clone()) {
                let message = format!("part `{}` needs a wire to `in.{}`: {}", part.key.name, input.name, doc.value);
                let diagnostic = Diagnostic::new(Code::MissingInput, part.key.span.clone(), message);
                let help = format!("add `in.{} = \"…\"`", input.name);
                self.diagnostics.push(diagnostic.note(input.span.clone(), "the part declares it here").help(help));
            }
        }
    }
}

/// Returns whether a text is a single assignment, without a header or a second line.
fn is_one_assignment(table: &Table, text: &str) -> bool {
    table.entries.len() == 1
        && text.contains('=')
        && !text.contains(['\n', '\r'])
        && !text.trim_start().starts_with('[')
}

/// Name of the type of a file with the section [scenario].
const SCENARIO: &str = "a scenario";

/// Returns the type of a file, if it lacks the section `expected` and has the sections of another type.
pub(crate) fn wrong_file_type(root: &Table, expected: &str) -> Option<&'static str> {
    if root.get(expected).is_some() {
        return None;
    }
    let types = [("scenario", SCENARIO), ("graph", "a graph"), ("devices", "a bench"), ("exports", "a part")];
    types.iter().find(|(section, _)| root.get(section).is_some()).map(|(_, what)| *what)
}
