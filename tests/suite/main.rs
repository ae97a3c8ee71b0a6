//! The suite: one module a subject.
#![allow(clippy::unwrap_used, reason = "clippy knows a test by its attribute, and this crate is nothing but tests")]

mod absence;
#[cfg(unix)]
mod agni;
mod answers;
mod arm_spring;
mod bad_data;
mod blind;
mod calibrate;
#[cfg(target_os = "linux")]
mod calibrate_guided;
mod ceilings;
#[cfg(unix)]
mod cell;
mod changes;
mod cli;
mod clocks;

mod control_law;
mod course;
mod crossings;
mod determinism;
mod devices;
mod docs;
#[cfg(target_os = "linux")]
mod doctor;
#[cfg(target_os = "linux")]
mod doctor_press;
mod draw;
mod engine;
mod engine_scenes;
mod erased;
mod errors;
mod examples;
mod explain;
mod explained_motion;
mod fault_matrix;
mod faults;
mod features;
#[cfg(target_os = "linux")]
mod first_robot;
mod fixes;
mod flow;
mod freshness;
mod fuzz;
#[cfg(target_os = "linux")]
mod growth;
mod guided;
mod keep_out;
mod layers;
mod leases;
mod limits;
mod lint;
mod live;
mod lockstep;
mod lost_contact;
mod lwr_fri;
mod merge;
mod modes;
mod mutations;
mod new;
mod observed;
mod operator;
mod oracles;
mod output;
mod pads;
mod pair;
mod paths;
mod peer;
mod plot;
mod points;
mod policies;
mod poor_controllers;
mod processes;
mod processes_python;
mod quantities;
mod rates;
mod record;
mod recordings;
mod reference;
mod replay;
mod replay_bench;
mod report;
mod reports;
mod resume;
mod robots;
#[cfg(feature = "ros2")]
mod ros2;
mod self_test;
#[cfg(unix)]
mod signals;
mod sim;
mod situations;
mod slow;
#[cfg(unix)]
pub(crate) mod socket;
#[cfg(target_os = "linux")]
mod stream;
mod svg;
mod tare;
mod task_crossings;
mod task_drivers;
mod task_folder;
mod tasks;
#[cfg(target_os = "linux")]
mod teach;
mod three_axes;
mod tick;
mod tidy;
mod together;
mod tool;
mod touch;
mod tune;
mod udp_pad;
mod units;
mod ur;
mod ur_process;
mod ur_start;
mod verify;
mod view;
mod warnings;
mod watching;
mod windows;
mod words;
mod wrench;
