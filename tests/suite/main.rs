//! The suite: one module a subject.

mod freshness;
mod faults;
mod live;
