//! The suite: one module a subject.
#![allow(clippy::unwrap_used, reason = "clippy knows a test by its attribute, and this crate is nothing but tests")]

mod absence;
mod answers;
mod bad_data;
mod cli;
mod complete;
mod course;
mod determinism;
mod docs;
mod erased;
mod errors;
mod faults;
mod freshness;
mod live;
mod merge;
mod mutations;
mod oracles;
mod reference;
mod tick;
mod tidy;
mod tool;
