//! The catalogue as documentation: `list`, `describe`, and the pages of the reference.

pub(crate) mod describe;
pub(crate) mod entry;
pub(crate) mod list;
mod page;
pub(crate) mod pages;
