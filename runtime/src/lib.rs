//! The runtime of tactflow: loads, checks and runs the dataflow graphs of tactile servoing.
//!
//! The runtime contains no node, sensor or robot; they are registered in a [`Catalogue`](catalogue::Catalogue). Modules
//! in reading order:
//!
//! - [`signal`]: the kinds of values on wires, their shapes, units and freshness
//! - [`node`]: the contract of nodes
//! - [`source`] and [`graph`]: graph files, compiled to a plan or to diagnostics for every mistake
//! - [`engine`]: the tick and the run around it; [`fault`]: what ends or halts a run
//! - [`device`]: the contract of devices
//! - [`example`]: example graphs from a catalogue
//! - [`random`]: seeded random numbers
//! - [`record`]: recordings of runs as tables; `recording`: whole runs, behind the feature `mcap`; [`scenario`]: checks on the results of runs
//! - [`harness`]: test rigs for nodes and graphs
//! - `socket`: the socket of a run in real time, behind the feature `cli`
//! - `cli`: the command line as a library, behind the feature `cli`

// The derives name this crate from outside; they work inside it too.
extern crate self as tactflow_runtime;

pub mod catalogue;
#[cfg(feature = "cli")]
pub mod cli;
pub mod device;
pub mod engine;
pub mod example;
pub mod fault;
pub mod graph;
pub mod harness;
pub mod node;
mod outline;
pub mod random;
pub mod record;
#[cfg(feature = "mcap")]
pub mod recording;
pub mod scenario;
pub mod signal;
#[cfg(all(feature = "cli", unix))]
pub mod socket;
pub mod source;
