//! Faults that a scenario injects: a wrapper around the device of a role spoils its images before the graph sees them.
//!
//! [`table`] reads the entries `[[inject]]`, [`resolve`] checks them with the task on its bench, [`cells`] draws cells,
//! [`fault`] spoils one image, and [`device`] is the wrapper. The wrapper knows only images, so it works for every
//! stepped device.

mod cells;
mod device;
mod fault;
mod resolve;
mod table;

pub(super) use device::inject;
pub(super) use resolve::{Injection, resolve};
pub(super) use table::{InjectBlock, blocks};

#[cfg(test)]
mod tests;
