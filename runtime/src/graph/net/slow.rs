//! Scales the limits of speed and acceleration, so that a task moves slowly.
//!
//! Only rates are scaled. A smaller box or a smaller force would be another task; the way without a contact stays as it
//! is, so the time for it must not shrink either.

use super::limits::{numbers, unit_of_limit};
use crate::graph::syntax::LimitSection;
use crate::source::{Item, Value};

/// Multiplies each limit of a speed or an acceleration by `fraction`. A value that is no number stays, and is reported
/// as it is.
pub(crate) fn slow_down(limits: &mut [LimitSection], fraction: f64) {
    for (key, value) in limits.iter_mut().flat_map(|section| &mut section.table.entries) {
        let is_rate = matches!(unit_of_limit(&key.name), Some("m/s" | "rad/s" | "m/s2" | "rad/s2"));
        if is_rate {
            scale(&key.name, value, fraction);
        }
    }
}

fn scale(name: &str, value: &mut Value, fraction: f64) {
    if let Item::Array(items) = &mut value.item {
        items.iter_mut().for_each(|item| scale(name, item, fraction));
    } else if let Some([number]) = numbers(name, value).as_deref() {
        value.item = Item::Float(number * fraction);
    }
}
