//! the outline of a graph, as data: parts are expanded, and every value has its origin in a file, a default or a fact.
//!
//! `show` prints it, and the lints of a catalogue read it.

use std::ops::Range;

use serde::Serialize;

use crate::source::{Location, Value};

/// The span of a default inside a list of tables, which was not written anywhere.
pub const NO_SPAN: Range<usize> = 0..0;

/// A graph as it runs.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Outline {
    /// Nominal time between two ticks [s].
    pub period_s: f64,
    /// Section `[graph]`, without the bench.
    #[serde(rename = "graph")]
    pub settings: Vec<Setting>,
    /// The roles, with their types and devices.
    pub roles: Vec<OutlinedRole>,
    /// The wires to the commands and the reports of roles: `role.command`.
    pub commands: Vec<OutlinedWire>,
    /// Section `[policy]`.
    pub policy: Vec<Setting>,
    /// The parts that are tasks.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tasks: Vec<OutlinedTask>,
    /// The modes; those of a part that is a task have its name before theirs.
    pub modes: Vec<OutlinedMode>,
    /// The nodes, in the order in which they step.
    pub nodes: Vec<OutlinedBlock>,
    /// The devices that fill the roles.
    pub devices: Vec<OutlinedBlock>,
    /// The facts that the bench states, `role.fact`, with their places.
    #[serde(skip)]
    pub facts: Vec<(String, Value)>,
    /// The parameters that may change while the graph runs.
    #[serde(skip)]
    pub live: Vec<OutlinedRange>,
}

/// A parameter that may change while the graph runs.
#[derive(Debug, Clone)]
pub struct OutlinedRange {
    /// Its full name: that of the node, and the path of the parameter in it, such as `pid.gains.x.kp`.
    pub name: String,
    /// Its smallest and its largest value, in its unit.
    pub range: [f64; 2],
    /// Where they are written.
    pub spans: [Range<usize>; 2],
}

/// A word of a graph file.
#[derive(Debug, Clone, Serialize)]
pub struct OutlinedWord {
    /// The word.
    pub text: String,
    /// Its location.
    pub place: Location,
}

/// A role and its device.
#[derive(Debug, Clone, Serialize)]
pub struct OutlinedRole {
    /// Its name.
    pub name: String,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: OutlinedWord,
    /// The device that fills it.
    pub device: OutlinedWord,
}

/// A part that is a task.
#[derive(Debug, Clone, Serialize)]
pub struct OutlinedTask {
    /// Its full name.
    pub name: String,
    /// The keys of its section [graph] that hold in a part.
    pub settings: Vec<Setting>,
    /// Its section [policy]; without one, that of the file around it holds.
    pub policy: Vec<Setting>,
}

/// A mode.
#[derive(Debug, Clone, Serialize)]
pub struct OutlinedMode {
    /// Its name.
    pub name: String,
    /// `set.…` for each value that it sets, and its exits.
    pub settings: Vec<Setting>,
}

/// A wire.
#[derive(Debug, Clone, Serialize)]
pub struct OutlinedWire {
    /// Name of the input or the command.
    pub name: String,
    /// The port that it comes from: `node.port`.
    pub source: String,
    /// Maximum age of its value [ms], if it has one.
    pub max_age_ms: Option<f64>,
    /// Policy for an older value, if it has a maximum age.
    pub stale: Option<&'static str>,
    /// Where the wire is written.
    pub place: Location,
}

/// A node or a device.
#[derive(Debug, Clone, Serialize)]
pub struct OutlinedBlock {
    /// Its full name.
    pub name: String,
    /// Where its name is written.
    pub place: Location,
    /// The same place as a range of the source map, for diagnostics.
    #[serde(skip)]
    pub span: Range<usize>,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: OutlinedWord,
    /// The wires to its inputs.
    #[serde(rename = "inputs")]
    pub wires: Vec<OutlinedWire>,
    /// Its parameters, in the order of the declaration.
    #[serde(rename = "params")]
    pub settings: Vec<Setting>,
    /// The outputs of a node.
    pub outputs: Vec<OutlinedPort>,
    /// Nominal time between two samples behind its outputs, at least that between two ticks [s]; 0 for a device.
    #[serde(skip)]
    pub sample_s: f64,
    /// Largest latency that a device behind its outputs states, from a measurement until its sample arrives [s]; 0 for a
    /// device.
    #[serde(skip)]
    pub latency_s: f64,
}

/// An output of a node.
#[derive(Debug, Clone, Serialize)]
pub struct OutlinedPort {
    /// Its name: `node.port`.
    pub name: String,
    /// Its kind.
    pub kind: &'static str,
    /// Its unit, if all its values have the same.
    pub unit: Option<String>,
    /// Its frames, where they are known.
    pub frames: Vec<Option<String>>,
    /// The smallest and the largest value of a number, if both are finite.
    #[serde(skip)]
    pub range: Option<[f64; 2]>,
}

/// A value of a section or a block.
#[derive(Debug, Clone, Serialize)]
pub struct Setting {
    /// Dotted path in its block.
    pub path: String,
    /// The value, with numbers in the units of their parameters.
    pub value: Value,
    /// The value as written, if it has numbers with units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub written: Option<Value>,
    /// Where it comes from.
    #[serde(flatten)]
    pub origin: ValueOrigin,
}

/// Where a value comes from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "origin", rename_all = "lowercase")]
pub enum ValueOrigin {
    /// A file or the command line.
    Written {
        /// Where the value is written.
        place: Location,
    },
    /// The declaration of the parameter.
    Default,
    /// A fact of a device.
    Fact {
        /// The fact: `role.fact`.
        fact: String,
        /// Where the name of the device is written.
        place: Location,
    },
}

impl Setting {
    /// Returns the default of a parameter.
    pub(crate) const fn default_of(path: String, value: Value) -> Self {
        Self { path, value, written: None, origin: ValueOrigin::Default }
    }
}
