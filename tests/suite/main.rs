//! The suite: one module a subject.

mod bad_data;
mod cli;
mod course;
mod determinism;
mod errors;
mod faults;
mod freshness;
mod live;
mod merge;
mod mutations;
mod oracles;
mod tool;
