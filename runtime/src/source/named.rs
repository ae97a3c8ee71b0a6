//! Entries with names: in the order of the file, and found by name.

use std::collections::BTreeMap;
use std::ops::Deref;

use super::Key;

/// Entries in the order of the file. A search by name does not slow down with their number.
#[derive(Debug, Clone)]
pub(crate) struct Named<T> {
    entries: Vec<(Key, T)>,
    /// Index of each name.
    places: BTreeMap<String, usize>,
}

impl<T> Named<T> {
    /// Returns the index of the entry with that name.
    pub(crate) fn position(&self, name: &str) -> Option<usize> {
        self.places.get(name).copied()
    }

    /// Returns the value of the entry with that name.
    pub(crate) fn get(&self, name: &str) -> Option<&T> {
        self.position(name).map(|place| &self.entries[place].1)
    }

    /// Returns the names in the order of the file.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.entries.iter().map(|(key, _)| key.name.as_str())
    }
}

impl<T> Named<T> {
    /// Adds an entry with a name that no other one has.
    pub(crate) fn push(&mut self, key: Key, value: T) {
        self.places.insert(key.name.clone(), self.entries.len());
        self.entries.push((key, value));
    }
}

impl<T> Default for Named<T> {
    fn default() -> Self {
        Self { entries: Vec::new(), places: BTreeMap::new() }
    }
}

impl<T> Deref for Named<T> {
    type Target = [(Key, T)];

    fn deref(&self) -> &[(Key, T)] {
        &self.entries
    }
}

/// Collects entries whose names differ, as the keys of a TOML table do.
impl<T> FromIterator<(Key, T)> for Named<T> {
    fn from_iter<I: IntoIterator<Item = (Key, T)>>(entries: I) -> Self {
        let entries: Vec<(Key, T)> = entries.into_iter().collect();
        let places = entries.iter().enumerate().map(|(place, (key, _))| (key.name.clone(), place)).collect();
        Self { entries, places }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_keep_their_order_and_are_found_by_name() {
        let entry = |(i, name): (usize, &str)| (Key { name: name.into(), span: i..i }, i);
        let named: Named<usize> = ["pad", "arm", "tip"].into_iter().enumerate().map(entry).collect();
        assert_eq!(named.names().collect::<Vec<_>>(), ["pad", "arm", "tip"]);
        assert_eq!((named.position("arm"), named.get("tip"), named.get("cup")), (Some(1), Some(&2), None));
    }
}
