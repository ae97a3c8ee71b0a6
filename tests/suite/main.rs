//! The suite: one module a subject.
#![allow(clippy::unwrap_used, reason = "clippy knows a test by its attribute, and this crate is nothing but tests")]

mod absence;
mod answers;
mod bad_data;
mod blind;
mod calibrate;
mod cli;

mod course;
mod crossings;
mod determinism;
mod devices;
mod docs;
mod erased;
mod errors;
mod examples;
mod explain;
mod faults;
mod features;
mod fixes;
mod flow;
mod freshness;
#[cfg(target_os = "linux")]
mod growth;
mod layers;
mod limits;
mod lint;
mod live;
mod lockstep;
mod merge;
mod modes;
mod mutations;
mod observed;
mod operator;
mod oracles;
mod paths;
mod points;
mod policies;
mod quantities;
mod recordings;
mod reference;
mod reports;
mod robots;
mod sim;
mod situations;
mod svg;
mod tick;
mod tidy;
mod tool;
mod touch;
mod udp_pad;
mod units;
mod verify;
mod view;
mod warnings;
mod windows;
