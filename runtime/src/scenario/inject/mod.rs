//! Faults that a scenario injects: a wrapper around the device of a role spoils its images before the graph sees them,
//! spoils the commands before the device sees them, and disturbs the world that the device simulates.
//!
//! [`table`] reads the entries `[[inject]]`, [`resolve`] checks them with the task on its bench, [`cells`] draws cells,
//! [`fault`] spoils one image or one command, and [`device`] is the wrapper, with [`images`] and [`commands`]. It works
//! for every stepped device; the world is only there in a simulation.

mod cells;
mod commands;
mod device;
mod fault;
mod images;
mod resolve;
mod table;

pub(super) use device::inject;
pub(super) use resolve::{Injection, resolve};
pub(super) use table::{InjectBlock, InjectTable, blocks};

#[cfg(test)]
mod tests;
