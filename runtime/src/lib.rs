//! tactflow's runtime: what a tactile-servoing graph is, how it is checked, and how it runs.
//!
//! It knows no node, no sensor and no robot: those stand in a [`Catalogue`](catalogue::Catalogue). In reading order:
//! [`signal`] (what travels on a wire), [`node`] (the contract), [`graph`] (text in, plan or all mistakes out),
//! [`diagnostic`] (what load says) and [`fault`] (what a run says), [`engine`] (the tick), [`device`] (the edge),
//! [`record`], [`scenario`] (what must come out of a run), [`harness`], and `cli` (the command line as a library function, behind the feature `cli`).

// The derives name this crate from outside; they work inside it too.
extern crate self as tactflow_runtime;

pub mod catalogue;
#[cfg(feature = "cli")]
pub mod cli;
pub mod device;

pub mod engine;
pub mod fault;
pub mod graph;
pub mod harness;
pub mod node;
pub mod record;
pub mod scenario;
pub mod signal;
pub mod source;
