//! Text for the commands: numbers, tables, pages, charts and pictures. Nothing here knows an engine or a graph.

pub(super) mod chart;
pub mod figure;
pub(super) mod number;
pub(super) mod picture;
pub(super) mod prose;
pub(super) mod series;
pub mod svg;
pub(super) mod table;
