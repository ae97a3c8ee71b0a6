//! The control law of a graph in numbers: what moves an arm, and how stable its loops are.
//!
//! [`collect`] finds the [`law`] of a twist: it multiplies gains, columns and projectors, with the [`filters`] before a gain
//! and the [`schedule`] behind it.
//! [`response`] follows one feature around its loop, with the [`contacts`] that a bench declares, [`margins`] says how far
//! the loop is from instability, and [`choose`] finds the largest gains that keep their margins.

pub(super) mod chain;
pub(super) mod choose;
pub(super) mod collect;
pub(super) mod contacts;
pub(super) mod digits;
pub(super) mod exits;
pub(super) mod filters;
pub(super) mod law;
pub(super) mod margins;
pub(super) mod mount;
pub(super) mod nodes;
pub(super) mod response;
pub(super) mod schedule;
pub(super) mod shape;
