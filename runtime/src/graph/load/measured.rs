//! The values of a graph that were written with a unit, as numbers in the units of their parameters.

use std::collections::BTreeMap;

use crate::node::Measured;
use crate::source::{Item, Value};

/// The numbers of all values that were written with a unit.
///
/// A value has its place as a key, and the node that reads it: a value in [limits] or in the file of a part may be for
/// parameters in different units.
#[derive(Debug, Clone, Default)]
pub(crate) struct MeasuredValues {
    /// `None` if one node reads the value in two units.
    numbers: BTreeMap<(usize, Option<usize>), Option<Item>>,
}

impl MeasuredValues {
    /// Adds the values that a node has read, or with `None` those of a section or a device.
    pub(crate) fn add(&mut self, node: Option<usize>, measured: Measured) {
        for (span, item) in measured {
            let number = self.numbers.entry((span.start, node)).or_insert_with(|| Some(item.clone()));
            if number.as_ref() != Some(&item) {
                *number = None;
            }
        }
    }

    /// Adds all of other values.
    pub(crate) fn extend(&mut self, others: Self) {
        self.numbers.extend(others.numbers);
    }

    /// Replaces the texts with a unit in a value that `node` reads, or in any other value, by their numbers.
    pub(crate) fn replace_texts(&self, value: &mut Value, node: Option<usize>) {
        match &mut value.item {
            Item::String(_) => {
                let start = value.span.start;
                let mut any = self.numbers.range((start, None)..=(start, Some(usize::MAX))).map(|(_, number)| number);
                let number = self.numbers.get(&(start, node)).or_else(|| any.next());
                if let Some(Some(number)) = number {
                    value.item = number.clone();
                }
            }
            Item::Array(items) => items.iter_mut().for_each(|item| self.replace_texts(item, node)),
            Item::Table(table) => table.entries.iter_mut().for_each(|(_, value)| self.replace_texts(value, node)),
            _ => {}
        }
    }
}
