//! `#[derive(Param)]`: what needs no types.

use tactflow_runtime::node::Param;

/// Parameters.
#[derive(Debug, Clone, Param)]
pub struct Params {
    #[param(unit = "s")]
    no_docs: f64,
    /// A word that is not known.
    #[param(unit = "s", defualt = 1.0)]
    unknown: f64,
    /// A word that stands twice.
    #[param(unit = "s", unit = "ms")]
    twice: f64,
    /// Two ranges.
    #[param(unit = "s", range = 0.0.., above = 0.0)]
    two_ranges: f64,
    /// A range without its last number.
    #[param(unit = "s", range = 0.0..1.0)]
    half_open: f64,
    /// A range of everything.
    #[param(unit = "s", range = ..)]
    everything: f64,
    /// No range at all.
    #[param(unit = "s", range = 1.0)]
    no_range: f64,
    /// A unit that is no string.
    #[param(unit = s)]
    no_string: f64,
    /// A flag with a value.
    #[param(unit = "s", live = true)]
    flag: f64,
    /// A word without its value.
    #[param(unit = "s", default)]
    no_value: f64,
}

/// Not a table.
#[derive(Debug, Clone, Param)]
pub struct Tuple(f64);

/// Words.
#[derive(Debug, Clone, Copy, Param)]
pub enum Words {
    NoDocs,
    /// With data.
    Data(f64),
}

/// No words.
#[derive(Debug, Clone, Copy, Param)]
pub enum NoWords {}

fn main() {}
