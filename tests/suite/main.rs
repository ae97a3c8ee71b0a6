//! The suite: one module a subject.

mod errors;
mod faults;
mod freshness;
mod live;
mod tick;
mod tidy;
