//! What a client asks, and what a run answers: one line of JSON each. docs/live.md describes them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A request.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Ask {
    /// Which run this is, and its state.
    About {},
    /// The live parameters and the ports whose names match a pattern.
    Get {
        /// The pattern, in which `*` stands for any text; all of them without one.
        pattern: Option<String>,
    },
    /// Changes live parameters, which are checked together.
    Set {
        /// The parameters with their values.
        values: BTreeMap<String, f64>,
    },
    /// Sends a word that stops.
    Send {
        /// The word.
        word: String,
    },
    /// Takes the zeros of the sensors anew.
    Tare {},
    /// Sends the values of ports after each tick in which one of them has changed.
    Watch {
        /// Names and patterns.
        ports: Vec<String>,
        /// The number of samples after which it ends.
        count: Option<u64>,
    },
    /// Sends the newest values of whole ports, images included, each with the time of its sample.
    Follow {
        /// Names and patterns.
        ports: Vec<String>,
        /// Shortest time between two lines [ms].
        period_ms: f64,
    },
}

/// What does not change of a port that is followed.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PortFacts {
    /// `node.port`, or the name under which a part exports it.
    pub name: String,
    /// Its kind, such as `features`.
    pub kind: String,
    /// Its frames. A pose has its own and the one in which it is written; `None` where the wires do not determine one.
    pub frames: Vec<Option<String>>,
    /// Its numbers, each with its name, which is empty in a port with one number, and its unit; none in an image.
    pub numbers: Vec<(String, String)>,
    /// What an image has instead.
    pub image: Option<ImageFacts>,
}

/// What does not change of an image.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ImageFacts {
    /// Number of rows, along y.
    pub rows: usize,
    /// Number of columns, along x.
    pub cols: usize,
    /// Distance of neighbouring tactels along x and y [m].
    pub pitch: [f64; 2],
    /// Unit of its values.
    pub unit: String,
}

/// What a followed run sends in a line.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Followed {
    /// The values that are new, by the names of their ports.
    pub ports: BTreeMap<String, PortSample>,
    /// How the run has ended, in the last line.
    pub end: Option<RunEnd>,
}

/// The newest value of a port.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PortSample {
    /// Time of the sample from which it was computed, by the wall clock [ns since 1970].
    pub stamp_ns: i64,
    /// Its numbers, or the cells of an image row by row; those of a vector image have three. `None` while it is absent. A
    /// component that is absent, or is not finite, is `None`.
    pub values: Option<Vec<Option<f64>>>,
}

/// How a run has ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunEnd {
    /// The reason.
    pub reason: String,
    /// Whether it is a fault.
    pub is_fault: bool,
}

/// Which run this is, and its state.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct About {
    /// Number of the process.
    pub pid: u32,
    /// The graph, as on the command line.
    pub graph: String,
    /// Time of the wall clock at which it began [s since 1970].
    pub since: f64,
    /// Time of the last tick [s].
    pub t: f64,
    /// Number of the last tick.
    pub tick: u64,
    /// The graph itself and the parts that are tasks.
    pub tasks: Vec<TaskState>,
}

/// The state of a task.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TaskState {
    /// Its name; empty for the graph itself.
    pub name: String,
    /// Its mode; none in a task without modes.
    pub mode: Option<String>,
    /// Whether its commands are held at zero.
    pub halted: bool,
    /// Whether it has ended.
    pub ended: bool,
    /// Number of halts so far.
    pub halts: u64,
    /// Why its commands are held, or why it has failed.
    pub reason: Option<String>,
}

/// The values of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Got {
    /// Time of the last tick [s].
    pub(crate) t: f64,
    /// Number of the last tick.
    pub(crate) tick: u64,
    /// The live parameters.
    pub(crate) live: Vec<LiveState>,
    /// The numbers of the ports.
    pub(crate) ports: Vec<PortState>,
}

/// A live parameter and its value.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct LiveState {
    /// Its name in `[live]`.
    pub(crate) name: String,
    /// Its value in the last tick.
    pub(crate) value: f64,
    /// The value toward which it moves.
    pub(crate) target: f64,
    /// Smallest value.
    pub(crate) min: f64,
    /// Largest value.
    pub(crate) max: f64,
    /// Largest change in one second.
    pub(crate) rate: f64,
    /// Its unit, if it has one.
    pub(crate) unit: Option<String>,
    /// Where its value at the start was written.
    pub(crate) origin: Origin,
}

/// Where the value of a live parameter was written.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(tag = "from", rename_all = "kebab-case")]
pub(crate) enum Origin {
    /// The file of the graph.
    Graph {
        /// Its absolute path.
        file: String,
        /// The keys that lead to the value.
        keys: Vec<String>,
    },
    /// Another file: that of a part or a bench.
    Other {
        /// Its name.
        file: String,
        /// Line, from 1.
        line: usize,
    },
    /// The command line.
    CommandLine,
    /// The default of the parameter.
    Default,
    /// A fact of a device.
    Fact {
        /// Its name.
        fact: String,
    },
}

/// A number of a port.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct PortState {
    /// `node.port`, or `node.port.x` for a component.
    pub(crate) name: String,
    /// Its newest value; none while it is absent.
    pub(crate) value: Option<f64>,
    /// Its unit.
    pub(crate) unit: String,
}

/// The way of a parameter that changes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct WalkAnswer {
    /// Its name.
    pub(crate) name: String,
    /// Its value now.
    pub(crate) from: f64,
    /// Its value at the end.
    pub(crate) to: f64,
    /// The time until then [s].
    pub(crate) seconds: f64,
}

/// An answer: a value, or why there is none.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Answer<T> {
    /// The value.
    Ok(T),
    /// Why the request is refused.
    Error(String),
}

impl<T: Serialize> From<Result<T, String>> for Answer<T> {
    fn from(result: Result<T, String>) -> Self {
        result.map_or_else(Self::Error, Self::Ok)
    }
}

impl<T: Serialize> Answer<T> {
    /// Returns the answer as a line.
    pub(super) fn line(&self) -> String {
        serde_json::to_string(self).expect("every key is a string") + "\n"
    }
}
