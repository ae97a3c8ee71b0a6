//! What to write in filters that take the margin of a loop, so that it keeps it.

use std::ops::Range;

use super::mode_law::ModeLaw;
use crate::tool::control::digits::{down_to_two_digits, to_two_digits};
use crate::tool::control::filters::{Filter, shape};
use crate::tool::control::law::Feature;
use crate::tool::control::shape::Shape;

/// Returns the key that says how slow a filter is.
pub(super) fn time_key(mode: &ModeLaw<'_>, filter: &Filter) -> Option<&'static str> {
    let node = mode.nodes.node(&filter.node)?;
    let keys = ["time_constant_ms", "cutoff_hz", "window_ms", "window"];
    keys.into_iter().find(|key| mode.nodes.number(node, key).is_some())
}

/// A filter that is made faster.
pub(super) struct Faster {
    node: String,
    key: &'static str,
    pub(super) value: f64,
    /// The filter with this value.
    shape: Shape,
    pub(super) place: Range<usize>,
    /// Whether the old value is written nowhere.
    pub(super) is_default: bool,
}

impl Faster {
    /// Returns what to write, so that a part of the delay of a filter is left; `None` if no number says how slow it is.
    fn of(mode: &ModeLaw<'_>, filter: &Filter, share: f64) -> Option<Self> {
        let (node, key) = (mode.nodes.node(&filter.node)?, time_key(mode, filter)?);
        let old = mode.nodes.number(node, key)?;
        let value = match key {
            // Rounded up.
            "cutoff_hz" => to_two_digits(old / share, libm::ceil),
            "window" => libm::floor(old * share).max(1.0),
            _ => down_to_two_digits(old * share),
        };
        let number = |path: &str| if path == key { Some(value) } else { mode.nodes.number(node, path) };
        let shape = shape(&mode.nodes, node, number)?;
        let place = mode.place(&filter.node, key);
        let is_default = place == node.span;
        Some(Self { node: filter.node.clone(), key, value, shape, place, is_default })
    }

    /// Returns what to write, for a help.
    pub(super) fn text(&self) -> String {
        let more = if self.key == "cutoff_hz" { "more" } else { "less" };
        format!("`{} = {}` or {more} in `{}`", self.key, self.value, self.node)
    }
}

/// Returns what to write in a filter, or else in all of them, so that a loop is good.
pub(super) fn faster(
    mode: &ModeLaw<'_>,
    feature: &Feature,
    slowest: usize,
    is_good: impl Fn(&Feature) -> bool,
) -> Option<Vec<Faster>> {
    let is_written = |i: &usize| {
        let filter = &feature.filters[*i];
        filter.shape.smooths() && time_key(mode, filter).is_some()
    };
    let all: Vec<usize> = (0..feature.filters.len()).filter(is_written).collect();
    let made = |which: &[usize], share: f64| -> Option<Vec<Faster>> {
        which.iter().map(|i| Faster::of(mode, &feature.filters[*i], share)).collect()
    };
    let good = |which: Vec<usize>| {
        let mut all = shares().filter_map(|share| made(&which, share));
        all.find(|all| is_good(&with(feature, &which, all)))
    };
    [vec![slowest], all].into_iter().find_map(good)
}

/// Returns the parts of a delay that are tried, down to a hundredth.
fn shares() -> impl Iterator<Item = f64> {
    std::iter::successors(Some(0.8), |share| Some(share * 0.8)).take(20)
}

/// Returns a feature with faster ones in place of some of its filters.
fn with(feature: &Feature, which: &[usize], made: &[Faster]) -> Feature {
    let mut feature = feature.clone();
    which.iter().zip(made).for_each(|(i, faster)| feature.filters[*i].shape = faster.shape);
    feature
}
