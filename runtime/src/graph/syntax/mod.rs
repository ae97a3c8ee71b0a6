//! The sections of a graph file, a part and a bench, before anything is looked up.

mod modes;
mod policy;
mod sections;

pub(crate) use modes::{Exit, Is, ModeBlock, Sort};
pub use policy::Policy;
pub(crate) use policy::{Age, PolicyTable};
pub(crate) use sections::{Bench, Block, Document, GraphTable, LIMITS, PartBlock, Sections, spanned};
