//! From files to one flat graph: parts are expanded, `--set` and overrides are merged.

mod beside;
mod flat;
mod loader;
mod measured;
mod parts;
mod request;
mod task;
mod task_roles;
mod tasks;

pub(crate) use beside::role_type_of;
pub(crate) use flat::{Entity, FlatGraph, FlatNode, Scope};
pub(crate) use loader::{Loader, wrong_file_type};
pub(crate) use measured::MeasuredValues;
pub use request::{RecordedGraph, Request};
pub(crate) use task::Task;
