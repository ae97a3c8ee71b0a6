//! Scenarios: a task on a bench, with seeds and a duration, and what must come out of it.
//!
//! `document` says what the file holds, `load` checks it, `lookup` finds the ports that it names, `trial` runs it with
//! one seed, [`measure`] says what a figure is, and [`judge`] combines many runs. A scenario patches neither its task nor
//! its bench: it only sets the seed.

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
