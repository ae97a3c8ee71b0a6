//! Scenarios: a task on a bench with seeds, a duration and checks on the results.
//!
//! `document` reads the file, `load` checks it, and `lookup` resolves the ports that it names. `trial` runs it with one
//! seed, [`measure`] computes the figures of a run, and [`judge`] combines the figures of all runs. A scenario cannot
//! change its task or its bench; it only sets the seed.

mod document;
pub mod judge;
mod load;
mod lookup;
pub mod measure;
mod model;
mod trial;

pub use document::Seeds;
pub use model::Scenario;
pub use trial::Trial;
