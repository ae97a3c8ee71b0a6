//! What does not change while a graph runs: the names of its tasks, parameters and ports, and where values are written.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use super::asks::{About, Got, ImageFacts, LiveState, Origin, PortFacts, PortState, TaskState};
use super::feed::is_fed;
use super::frames::{Frame, Whole};
use crate::engine::{Engine, TaskRun};
use crate::graph::{Compiled, LiveParam, PlannedPort, matches};
use crate::outline::{Outline, ValueOrigin};
use crate::record::{PortColumns, file_seconds as seconds};
use crate::signal::{Shape, VectorImageShape};
use crate::source::{SourceMap, suggest_name, suggestion};

/// What the socket states of a run, taken from the graph before it runs.
#[derive(Debug, Clone)]
pub struct RunFacts {
    graph: String,
    origins: Vec<(String, Origin)>,
    /// The exports of the parts, each with the name of its port.
    exports: Vec<(String, String)>,
    can_resume: bool,
}

impl RunFacts {
    /// Takes the facts of a graph under the name that the command line gives it. `can_resume` says whether a word can
    /// end a stop.
    #[must_use]
    pub fn of(compiled: &Compiled, graph: &Path, can_resume: bool) -> Self {
        let origins = origins(compiled.outline(), graph);
        let exports = compiled.exports().to_vec();
        Self { graph: graph.display().to_string(), origins, exports, can_resume }
    }
}

/// Returns the origin of each parameter of each node.
fn origins(outline: &Outline, graph: &Path) -> Vec<(String, Origin)> {
    let mut origins = Vec::new();
    for node in &outline.nodes {
        for setting in &node.settings {
            let origin = match &setting.origin {
                ValueOrigin::Written { place } if place.file == SourceMap::COMMAND_LINE => Origin::CommandLine,
                ValueOrigin::Written { place } if Path::new(&place.file) == graph => {
                    let file = std::path::absolute(graph).unwrap_or_else(|_| graph.to_owned());
                    let keys = ["nodes", &node.name].into_iter().chain(setting.path.split('.'));
                    Origin::Graph { file: file.display().to_string(), keys: keys.map(str::to_owned).collect() }
                }
                ValueOrigin::Written { place } => Origin::Other { file: place.file.clone(), line: place.line },
                ValueOrigin::Default => Origin::Default,
                ValueOrigin::Fact { fact, .. } => Origin::Fact { fact: fact.clone() },
            };
            origins.push((format!("{}.{}", node.name, setting.path), origin));
        }
    }
    origins
}

/// Describes a port that can be followed.
fn port_facts(port: &PlannedPort) -> PortFacts {
    let image = match &port.shape {
        Shape::Image(image) | Shape::VectorImage(VectorImageShape(image)) => Some(image),
        _ => None,
    };
    PortFacts {
        name: port.name.clone(),
        kind: port.shape.kind().name().to_owned(),
        frames: port.frames.clone(),
        numbers: port.shape.scalars().into_iter().map(|(name, unit)| (name, unit.to_string())).collect(),
        image: image.map(|image| ImageFacts {
            rows: image.rows,
            cols: image.cols,
            pitch: image.pitch,
            unit: image.unit.to_string(),
        }),
    }
}

/// A number of a port.
#[derive(Debug)]
pub(super) struct Column {
    /// The name of its port and its own, `node.port` and `node.port.x`; then those under which parts export it.
    names: Vec<(String, String)>,
    unit: String,
    /// The number of its port in the feed, and its own in the port.
    pub(super) port: usize,
    pub(super) index: usize,
}

impl Column {
    /// Returns the name under which a pattern means this number: its own, or that of an export.
    fn called(&self, pattern: &str) -> Option<&str> {
        let mut names = self.names.iter();
        let found = names.find(|(port, own)| matches(pattern, own) || matches(pattern, port));
        found.map(|(_, own)| own.as_str())
    }
}

/// A port that can be followed.
#[derive(Debug)]
struct Followable {
    facts: PortFacts,
    /// The names under which parts export it.
    exports: Vec<String>,
}

impl Followable {
    /// Returns the name under which a pattern means this port: its own, or that of an export.
    fn called(&self, pattern: &str) -> Option<&str> {
        std::iter::once(&self.facts.name).chain(&self.exports).find(|name| matches(pattern, name)).map(String::as_str)
    }
}

/// What does not change while a graph runs.
#[derive(Debug)]
pub(super) struct Described {
    facts: RunFacts,
    since: f64,
    /// The names of the tasks, each with those of its modes.
    tasks: Vec<(String, Vec<String>)>,
    live: Vec<LiveParam>,
    pub(super) columns: Vec<Column>,
    /// The ports of the feed, in its order.
    followable: Vec<Followable>,
    /// The words that the graph accepts.
    words: Vec<String>,
}

impl Described {
    pub(super) fn of(engine: &Engine, facts: RunFacts) -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64());
        let task = |task: &TaskRun| (task.name().to_owned(), task.mode_names().map(str::to_owned).collect());
        let (mut columns, mut followable) = (Vec::new(), Vec::new());
        for (port, (planned, _)) in engine.ports().iter().filter(|(port, _)| is_fed(port)).enumerate() {
            let exports = facts.exports.iter().filter(|(_, port)| *port == planned.name).map(|(export, _)| export);
            followable.push(Followable { facts: port_facts(planned), exports: exports.cloned().collect() });
            for (index, column) in PortColumns::of(planned).into_iter().enumerate() {
                let exports = facts.exports.iter().filter(|(_, port)| *port == planned.name).map(|(export, _)| export);
                let names = std::iter::once(&planned.name).chain(exports);
                let names = names.map(|port| (port.clone(), format!("{port}{}", column.part))).collect();
                let unit = column.unit.to_string();
                columns.push(Column { names, unit, port, index });
            }
        }
        Self {
            facts,
            since,
            tasks: engine.tasks().iter().map(task).collect(),
            live: engine.live_values().map(|live| live.param.clone()).collect(),
            columns,
            followable,
            words: engine.words(),
        }
    }

    /// Describes the run and its state.
    pub(super) fn about(&self, frame: &Frame, whole: &Whole) -> About {
        let tasks = self.tasks.iter().zip(&whole.tasks).map(|((name, modes), task)| TaskState {
            name: name.clone(),
            mode: task.mode.and_then(|mode| modes.get(mode).cloned()),
            halted: task.is_halted,
            ended: task.has_ended,
            halts: task.halts,
            reason: Some(task.reason.clone()).filter(|reason| !reason.is_empty()),
        });
        About {
            pid: std::process::id(),
            graph: self.facts.graph.clone(),
            since: self.since,
            t: seconds(frame.now),
            tick: frame.tick,
            tasks: tasks.collect(),
        }
    }

    /// Returns the live parameters and the ports whose names match a pattern.
    ///
    /// # Errors
    /// If none does.
    pub(super) fn got(&self, frame: &Frame, whole: &Whole, pattern: Option<&str>) -> Result<Got, String> {
        let live =
            self.live.iter().zip(&whole.live).filter(|(param, _)| pattern.is_none_or(|p| matches(p, &param.name)));
        let live: Vec<LiveState> =
            live.map(|(param, [value, target])| self.live_state(param, *value, *target)).collect();
        let columns: Vec<(usize, &str)> = self.find(pattern.unwrap_or("*")).collect();
        if let Some(pattern) = pattern.filter(|_| live.is_empty() && columns.is_empty()) {
            return Err(self.unknown("parameter in [live] and no number of a port", pattern));
        }
        let port = |(at, name): (usize, &str)| {
            let column = &self.columns[at];
            let row = whole.ports.get(column.port).and_then(Option::as_ref);
            let value = row.and_then(|row| row.get(column.index)).copied().filter(|number| number.is_finite());
            PortState { name: name.to_owned(), value, unit: column.unit.clone() }
        };
        Ok(Got { t: seconds(frame.now), tick: frame.tick, live, ports: columns.into_iter().map(port).collect() })
    }

    fn live_state(&self, param: &LiveParam, value: f64, target: f64) -> LiveState {
        let origin = self.facts.origins.iter().find(|(name, _)| *name == param.name);
        LiveState {
            name: param.name.clone(),
            value,
            target,
            min: param.min,
            max: param.max,
            rate: param.rate,
            unit: param.unit.clone(),
            origin: origin.map_or(Origin::Default, |(_, origin)| origin.clone()),
        }
    }

    /// Returns the columns that a name or a pattern means, each with the name under which it is meant.
    fn find<'s>(&'s self, pattern: &str) -> impl Iterator<Item = (usize, &'s str)> {
        let found = self.columns.iter().enumerate();
        found.filter_map(move |(at, column)| Some((at, column.called(pattern)?)))
    }

    /// Returns the columns that names and patterns mean, each once and in their order, with the name under which it is
    /// meant.
    ///
    /// # Errors
    /// If a name means none.
    pub(super) fn find_all(&self, patterns: &[String]) -> Result<Vec<(usize, String)>, String> {
        let mut found = BTreeMap::new();
        for pattern in patterns {
            let mut is_any = false;
            for (at, name) in self.find(pattern) {
                found.entry(at).or_insert_with(|| name.to_owned());
                is_any = true;
            }
            if !is_any {
                return Err(self.unknown("number of a port", pattern));
            }
        }
        if found.is_empty() { Err("name a port: `get` lists them".into()) } else { Ok(found.into_iter().collect()) }
    }

    /// Returns the ports that names and patterns mean, by their numbers in the feed, each under the name by which it is
    /// meant. Who follows none gets the end of the run.
    ///
    /// # Errors
    /// If a name means none.
    pub(super) fn find_ports(&self, patterns: &[String]) -> Result<BTreeMap<usize, PortFacts>, String> {
        let mut found = BTreeMap::new();
        for pattern in patterns {
            let mut is_any = false;
            for (number, port) in self.followable.iter().enumerate() {
                let Some(name) = port.called(pattern) else { continue };
                found.entry(number).or_insert_with(|| PortFacts { name: name.to_owned(), ..port.facts.clone() });
                is_any = true;
            }
            if !is_any {
                let known = self.followable.iter().flat_map(|port| port.exports.iter().chain([&port.facts.name]));
                let close = suggest_name(pattern, known.map(String::as_str));
                let way_out = close.map_or_else(
                    || "`tactflow get` lists those with numbers".into(),
                    |close| format!("did you mean `{close}`?"),
                );
                let kinds = "masks, regions and Jacobians cannot be followed";
                return Err(format!("no port with numbers and no image is called `{pattern}`; {way_out} ({kinds})"));
            }
        }
        Ok(found)
    }

    fn unknown(&self, what: &str, name: &str) -> String {
        let known = self.columns.iter().flat_map(|column| &column.names).map(|(_, own)| own.as_str());
        let known = known.chain(self.live.iter().map(|param| param.name.as_str()));
        let close = suggest_name(name, known);
        let way_out =
            close.map_or_else(|| "`get` lists all of them".into(), |close| format!("did you mean `{close}`?"));
        format!("no {what} is called `{name}`; {way_out}")
    }

    /// Says what a stop does.
    pub(super) fn stopped(&self, word: &str) -> String {
        let after = if self.facts.can_resume {
            "stay there until the run gets `resume`"
        } else {
            "the run ends, because nothing can send `resume` to it"
        };
        format!("`{word}` is sent: the commands ramp to zero and {after}")
    }

    /// Says why a word is not sent.
    pub(super) fn refused(&self, word: &str, stops: &[String]) -> String {
        let is_word = |known: &String| known.eq_ignore_ascii_case(word);
        if !self.words.iter().any(is_word) {
            let known = suggestion(word, stops.iter().map(String::as_str), "words that can be sent");
            return format!("the graph has no word `{word}`; {known}");
        }
        format!(
            "`{word}` can start a motion, so it is not sent from another process: whoever sends it must see the robot; \
             type it in the terminal of the run, which `run --listen` reads"
        )
    }
}
