//! Reads the files of a graph and merges `--set` into them.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::flat::{FlatGraph, Scope};
use super::measured::MeasuredValues;
use super::request::Request;
use super::task::Task;
use crate::graph::syntax::{ALLOW_UNCALIBRATED, BenchDocument, GraphDocument, LIMITS, ROBOT, SENSOR, Sections};
use crate::node::Spanned;
use crate::source::{
    BuiltinFile, Code, Diagnostic, Diagnostics, Item, Key, SourceMap, Table, Value, parse_table, suggest_name,
};

/// Reads files and collects their diagnostics.
#[derive(Default)]
pub(crate) struct Loader {
    pub(crate) sources: SourceMap,
    pub(crate) diagnostics: Diagnostics,
    /// The values of sections that were written with a unit.
    pub(crate) measured: MeasuredValues,
    pub(super) open_parts: Vec<PathBuf>,
    /// What overrides the files of parts.
    pub(super) part_set: Vec<(PathBuf, Table)>,
    /// Whether the maximum number of parts is exceeded, so that loading stops.
    pub(super) is_full: bool,
    /// Whether a part that is a task has wrong roles, so that nothing is known about what it reads and commands.
    pub(crate) has_wrong_roles: bool,
    /// The roles that a bench adds to every task, each with its type.
    pub(crate) joined: Vec<(String, String)>,
    /// The types of nodes that compute beside the tick.
    pub(crate) beside: Vec<String>,
}

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
        let Assignments { graph: graph_set, bench: bench_set, limits: set_limits } = self.assignments(&request.set);
        let set_limits: Vec<_> =
            set_limits.iter().flat_map(|table| self.sections(|sections| sections.set_limits(table))).collect();
        let of_parts =
            request.part_set.iter().filter_map(|(file, text)| Some((canonical(file), self.assignment(text)?)));
        self.part_set = of_parts.collect();
        let Some(mut root) = root else { return flat };
        if let Some(what) = wrong_file_type(&root.0, "graph") {
            let message = format!("this is {what}, not a graph");
            let help = match what {
                SCENARIO => Some("run it with `tactflow verify`".to_owned()),
                BENCH => Some(format!(
                    "name a task, and this file as its bench: `TASK.toml --bench {}`",
                    request.graph.display()
                )),
                "a sensor" | "a robot" => {
                    Some("name it in a bench, and check a task with that: `TASK.toml --bench BENCH.toml`".to_owned())
                }
                _ => None,
            };
            self.diagnostics.push(Diagnostic::new(Code::WrongFile, root.1, message).with_help(help));
            return flat;
        }
        root.0.merge(graph_set);
        let mut document = self.sections(|sections| sections.graph(&mut root.0));
        flat.live = self.sections(|sections| sections.live(&root.0, ""));
        flat.record = self.sections(|sections| sections.record(&root.0));
        if document.graph.is_none() {
            let message = "the graph has no section [graph]";
            let help = "write a section [graph] with `clock = \"role\"` or `rate_hz = 250`, and a `bench`";
            self.diagnostics.push(Diagnostic::new(Code::MissingKey, root.1.clone(), message).help(help));
        }
        let settings = root.0.get("graph").cloned();
        let task = Task { place: root.1, settings, ends_run: true, ..Task::default() };
        flat.bench = self.bench(request, (&document, &task), &root.0, bench_set);
        flat.bench.iter_mut().for_each(|bench| self.complete(bench));
        let binds = flat.bench.as_ref().map(|bench| bench.bind.clone()).unwrap_or_default();
        self.diagnostics.extend(document.correct_names(&binds, &[], &self.sources));
        for (name, kind) in &self.joined {
            let bound = binds.position(name).filter(|_| document.roles.position(name).is_none());
            let key = bound.map(|at| binds[at].0.clone());
            let role = key.map(|key| (key.clone(), Spanned { value: kind.clone(), span: key.span }));
            role.into_iter().for_each(|(key, kind)| document.roles.push(key, kind));
        }
        self.move_beside(&mut document, flat.bench.as_mut());
        flat.roles.clone_from(&document.roles);
        self.add_task(&document, task, &Scope::default(), &mut flat);
        self.flatten(document, "", Scope::default(), &mut flat);
        flat.limits.extend(flat.bench.iter().flat_map(|bench| bench.limits.iter().cloned()));
        flat.limits.extend(set_limits);
        flat
    }

    pub(super) fn sections<T>(&mut self, read: impl FnOnce(&mut Sections<'_>) -> T) -> T {
        let mut sections = Sections::new(&self.sources);
        let result = read(&mut sections);
        let (diagnostics, measured, files) = sections.finish();
        self.sources.add_named(files);
        self.diagnostics.extend(diagnostics);
        self.measured.add(None, measured);
        result
    }

    /// Loads the requested bench, or the sections of a bench in the graph, or the bench that the graph names.
    fn bench(
        &mut self,
        request: &Request,
        (document, task): (&GraphDocument, &Task),
        graph: &Table,
        mut set: Table,
    ) -> Option<BenchDocument> {
        // An invalid section [graph] has its own diagnostic.
        let (place, table) = document.graph.as_ref()?;
        let named = table.as_ref()?.bench.as_ref();
        if let Some(text) = &request.bench_text {
            let mut root = self.parse(Path::new("bench.toml"), text.clone())?.0;
            root.merge(set);
            return Some(self.sections(|sections| sections.bench(&mut root)));
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
                return Some(self.sections(|sections| sections.bench(&mut set)));
            }
            (None, None) if task.has_wrong_setting(&self.diagnostics) => return None,
            (None, None) => {
                let diagnostic = Diagnostic::new(Code::MissingKey, place.clone(), "the graph has no bench");
                let help =
                    "name a bench under [graph] with `bench`, pass `--bench`, or write [bind] and [devices] here";
                self.diagnostics.push(diagnostic.help(help));
                return None;
            }
        };
        self.bench_file(&path, span, set)
    }

    /// Reads a bench file, and the files of its robots.
    pub(crate) fn load_bench(&mut self, path: &Path) -> Option<BenchDocument> {
        let mut bench = self.bench_file(path, None, Table::default())?;
        self.complete(&mut bench);
        Some(bench)
    }

    /// Corrects the names of the devices of a bench, and then reads the files of their robots and sensors.
    fn complete(&mut self, bench: &mut BenchDocument) {
        let corrected = bench.correct_names(&self.sources);
        self.diagnostics.extend(corrected);
        self.models(bench);
    }

    fn bench_file(&mut self, path: &Path, from: Option<Range<usize>>, set: Table) -> Option<BenchDocument> {
        let (mut root, place) = self.read(path, from)?;
        if let Some(what) = wrong_file_type(&root, "devices") {
            let message = format!("this is {what}, not a bench");
            self.diagnostics.push(Diagnostic::new(Code::WrongFile, place, message));
            return None;
        }
        root.merge(set);
        Some(self.sections(|sections| sections.bench(&mut root)))
    }

    /// Reads the files of the robots and the sensors of the devices of a bench.
    fn models(&mut self, bench: &mut BenchDocument) {
        for from in &bench.model_files {
            let place = from.file.span.clone();
            if from.file.path.extension().is_some_and(|end| end == "urdf") {
                let what = from.what;
                let message = format!("this is a model, and `{what}` names a file with a section [{what}]");
                let help = format!("write the model as `urdf`, or make a {what} file: `tactflow new {what} NAME`");
                self.diagnostics.push(Diagnostic::new(Code::WrongFile, place, message).help(help));
                continue;
            }
            let Some((mut root, _)) = self.read(&from.file.path, Some(place.clone())) else { continue };
            if let Some(other) = wrong_file_type(&root, from.what) {
                let message = format!("this is {other}, not a {}", from.what);
                self.diagnostics.push(Diagnostic::new(Code::WrongFile, place, message));
                continue;
            }
            let model = self.sections(|sections| sections.model(&mut root, from));
            bench.limits.extend(model.limits.iter().cloned());
            bench.models.push((from.clone(), model));
        }
    }

    /// Reads and parses a file; `from` is the span of its name.
    pub(crate) fn read(&mut self, path: &Path, from: Option<Range<usize>>) -> Option<(Table, Range<usize>)> {
        let text = match self.sources.builtin(path) {
            Ok(Some(bytes)) => Ok(String::from_utf8_lossy(&bytes).into_owned()),
            Ok(None) => std::fs::read_to_string(path).map_err(|error| (error.to_string(), None)),
            Err(unknown) => Err((unknown.message, Some(unknown.help))),
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
            Err(mistake) => {
                self.diagnostics.push(*mistake);
                None
            }
        }
    }

    /// Parses the assignments of the command line.
    fn assignments(&mut self, assignments: &[String]) -> Assignments {
        let Assignments { mut graph, mut bench, mut limits } = Assignments::default();
        for assignment in assignments {
            let Some(table) = self.assignment(assignment) else { continue };
            for (key, value) in table.entries {
                let of_bench = matches!(key.name.as_str(), "devices" | "bind" | "facts" | ALLOW_UNCALIBRATED);
                let target = match of_bench {
                    true => &mut bench,
                    // Each of two assignments of a limit holds.
                    false if key.name == LIMITS => {
                        limits.push(Table { entries: vec![(key, value)] });
                        continue;
                    }
                    false => &mut graph,
                };
                target.merge(Table { entries: vec![(key, value)] });
            }
        }
        Assignments { graph, bench, limits }
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
}

/// Returns the one name of a file that may have several; its own if it does not exist.
pub(super) fn canonical(file: &Path) -> PathBuf {
    file.canonicalize().unwrap_or_else(|_| file.to_path_buf())
}

/// The assignments of the command line: for the graph and the bench, which they replace, and for [limits], which they
/// can only make tighter.
#[derive(Default)]
struct Assignments {
    graph: Table,
    bench: Table,
    limits: Vec<Table>,
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
const BENCH: &str = "a bench";

/// Returns the type of a file, if it lacks the section `expected` and has the sections of another type.
pub(crate) fn wrong_file_type(root: &Table, expected: &str) -> Option<&'static str> {
    let is_misspelt = |(key, _): &(Key, Value)| suggest_name(&key.name, std::iter::once(expected)).is_some();
    if root.entries.iter().any(is_misspelt) {
        return None;
    }
    let types = [
        ("scenario", SCENARIO),
        ("graph", "a graph"),
        ("devices", BENCH),
        ("exports", "a part"),
        (ROBOT, "a robot"),
        (SENSOR, "a sensor"),
    ];
    types.iter().find(|(section, _)| root.get(section).is_some()).map(|(_, what)| *what)
}
