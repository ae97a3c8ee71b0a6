//! Scenarios: a task on a bench with seeds, a duration and checks on the results.
//!
//! `document` and `check_table` read the file, `load` checks it, and `lookup` resolves the ports and modes that it
//! names. `inject` spoils images and commands, and disturbs simulated worlds; [`matrix`] tries these faults one by one. `trial` runs it with one seed, and records it to a `run_file`, while `observer` collects the readings in the `window` of each check.
//! [`measure`] and `figures` compute the figures of a run, and [`judge`] combines the figures of all runs. A scenario
//! cannot change its task; it sets the seed, varies parameters of the bench (`vary`) and injects faults.

mod bounds;
mod check_table;
mod document;
pub mod figure;
mod figures;
mod inject;
pub mod judge;
mod load;
mod lookup;
pub mod matrix;
pub mod measure;
mod model;
mod observer;
mod run_file;
mod trial;
mod vary;
mod window;

pub use document::Seeds;
pub use model::Scenario;
pub use observer::NotChecked;
pub use trial::Trial;
pub use vary::Vary;
#[cfg(feature = "cli")]
pub(crate) use vary::assignment;
