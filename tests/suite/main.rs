//! The suite: one module a subject.

mod cli;
mod course;
mod errors;
mod faults;
mod freshness;
mod live;
mod tool;
