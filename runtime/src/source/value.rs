//! A tree of TOML values, each with its span in the source map.

use std::ops::Range;

use super::suggest::suggest_name;
use serde::de::DeserializeOwned;
use serde::{Serialize, Serializer};

/// A value of a graph file with its span.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// Where the value was written; merging keeps it.
    pub span: Range<usize>,
    /// The value itself.
    pub item: Item,
}

/// The content of a value.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A string.
    String(String),
    /// An integer.
    Integer(i64),
    /// A floating-point number.
    Float(f64),
    /// A boolean.
    Boolean(bool),
    /// A date, a time or both. No parameter accepts one.
    Datetime(String),
    /// An array.
    Array(Vec<Value>),
    /// A table.
    Table(Table),
}

/// A key with its span.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Key {
    /// The text of the key.
    pub name: String,
    /// Where the key was written.
    pub span: Range<usize>,
}

/// A table whose entries keep the order of the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// The entries.
    pub entries: Vec<(Key, Value)>,
}

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.item {
            Item::String(text) | Item::Datetime(text) => serializer.serialize_str(text),
            Item::Integer(number) => serializer.serialize_i64(*number),
            Item::Float(number) => serializer.serialize_f64(*number),
            Item::Boolean(value) => serializer.serialize_bool(*value),
            Item::Array(items) => serializer.collect_seq(items),
            Item::Table(table) => serializer.collect_map(table.entries.iter().map(|(key, value)| (&key.name, value))),
        }
    }
}

/// A reference to a fact of a role or to a value of `[limits]`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FactRef<'a> {
    /// `role.fact` or `limits.key`.
    pub(crate) word: &'a str,
    pub(crate) place: &'a Range<usize>,
    /// Whether the parameter is left out if there is no such fact, as in `{ from = "limits.force_raw", optional = true }`.
    pub(crate) is_optional: bool,
}

impl Table {
    /// Returns the value of a key.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.entry(name).map(|(_, value)| value)
    }

    /// Returns the entry of a key: the key with its span, and the value.
    #[must_use]
    pub fn entry(&self, name: &str) -> Option<&(Key, Value)> {
        self.entries.iter().find(|(key, _)| key.name == name)
    }

    /// Removes and returns the entry of a key.
    pub fn remove(&mut self, name: &str) -> Option<(Key, Value)> {
        let at = self.entries.iter().position(|(key, _)| key.name == name)?;
        Some(self.entries.remove(at))
    }

    /// Returns the fact that the table refers to, as in `{ from = "pad.threshold" }`.
    ///
    /// Such a table is one value: it is replaced as a whole, not merged.
    pub(crate) fn fact(&self) -> Option<FactRef<'_>> {
        let ((key, value), is_optional) = match self.entries.as_slice() {
            [from] => (from, false),
            [from, (key, Value { item: Item::Boolean(is), .. })] if key.name == "optional" => (from, *is),
            _ => return None,
        };
        let word = value.as_str().filter(|_| key.name == "from")?;
        Some(FactRef { word, place: &value.span, is_optional })
    }

    /// Returns whether each key is the number of an item in a list of this length, counted from 0.
    fn counts(&self, items: usize) -> bool {
        let is_one = |name: &str| name.parse().is_ok_and(|i: usize| i < items && i.to_string() == name);
        !self.entries.is_empty() && self.entries.iter().all(|(key, _)| is_one(&key.name))
    }

    /// Merges another table over this one: tables merge recursively, other values replace, nothing is deleted. A table
    /// whose keys count the items of a list, as in `objects.0.stiffness`, merges with these items.
    pub fn merge(&mut self, over: Self) {
        for (key, value) in over.entries {
            match self.entries.iter_mut().find(|(mine, _)| mine.name == key.name) {
                None => self.entries.push((key, value)),
                Some((mine, old)) => {
                    if let Err(new) = old.merge(value) {
                        (*old, mine.span) = (new, key.span);
                    }
                }
            }
        }
    }
}

impl Value {
    /// Returns the value behind a few words: keys of tables, and numbers of the items of lists from 0.
    pub(crate) fn at<T: AsRef<str>>(&self, path: &[T]) -> Option<&Self> {
        let Some((word, rest)) = path.split_first() else { return Some(self) };
        let inner = match &self.item {
            Item::Table(table) => table.get(word.as_ref()),
            Item::Array(items) => word.as_ref().parse().ok().and_then(|i: usize| items.get(i)),
            _ => None,
        };
        inner?.at(rest)
    }

    /// Returns the value behind a few words, as [`at`](Self::at) does, to change it.
    pub(crate) fn at_mut<T: AsRef<str>>(&mut self, path: &[T]) -> Option<&mut Self> {
        let Some((word, rest)) = path.split_first() else { return Some(self) };
        let inner = match &mut self.item {
            Item::Table(table) => {
                table.entries.iter_mut().find(|(key, _)| key.name == word.as_ref()).map(|(_, value)| value)
            }
            Item::Array(items) => word.as_ref().parse().ok().and_then(|i: usize| items.get_mut(i)),
            _ => None,
        };
        inner?.at_mut(rest)
    }

    /// Merges a table into a table or into the items of a list, or returns a value that replaces this one.
    fn merge(&mut self, over: Self) -> Result<(), Self> {
        match (&mut self.item, over.item) {
            (Item::Table(old), Item::Table(new)) if old.fact().or(new.fact()).is_none() => old.merge(new),
            (Item::Array(items), Item::Table(new)) if new.counts(items.len()) => {
                for (key, value) in new.entries {
                    let item = key.name.parse().ok().and_then(|i: usize| items.get_mut(i));
                    if let Some(item) = item
                        && let Err(new) = item.merge(value)
                    {
                        *item = new;
                    }
                }
            }
            (_, item) => return Err(Self { item, ..over }),
        }
        Ok(())
    }
}

/// The known name that a key misspells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Meant<'n> {
    /// The name can replace the key.
    Free(&'n str),
    /// The table has this name too.
    Taken(&'n str),
    /// The key resembles no known name.
    Unknown,
}

impl Table {
    /// Gives each key that is not `known` the known name that it probably misspells, and returns these keys as they were
    /// written, each with that name. A key that resembles no known name stays.
    ///
    /// After one message about the key, the rest of the table is then read as it was meant.
    pub(crate) fn correct<'n>(&mut self, known: &[&'n str]) -> Vec<(Key, Meant<'n>)> {
        let (right, wrong): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.entries).into_iter().partition(|(key, _)| known.contains(&key.name.as_str()));
        self.entries = right;
        let mut corrected = Vec::new();
        for (key, value) in wrong {
            // A name that is there already is not what was meant, unless both are tables, as in `in.x` and `inn.y`.
            let is_open = |name: &&str| match self.get(name) {
                Some(there) => there.as_section().is_some() && value.as_section().is_some(),
                None => true,
            };
            let open = known.iter().copied().filter(is_open);
            let meant = suggest_name(&key.name, open).or_else(|| suggest_name(&key.name, known.iter().copied()));
            let is_free = meant.is_none_or(|name| is_open(&name));
            // Two headers of the same section are a syntax error, but `[nodes.a]` and `[nodes.b]` are not.
            let is_nested =
                value.as_section().is_some_and(|table| table.entries.iter().all(|(_, v)| v.as_table().is_some()));
            let is_dotted = value.span == key.span;
            let is_taken = meant.is_some_and(|name| self.get(name).is_some()) && !is_nested && !is_dotted;
            if is_free {
                let name = meant.map_or_else(|| key.name.clone(), str::to_owned);
                self.merge(Self { entries: vec![(Key { name, span: key.span.clone() }, value)] });
            }
            corrected.push((
                key,
                match meant {
                    Some(name) if is_taken => Meant::Taken(name),
                    Some(name) => Meant::Free(name),
                    None => Meant::Unknown,
                },
            ));
        }
        self.entries.sort_by_key(|(key, _)| key.span.start);
        corrected
    }
}

impl Value {
    /// Returns the table, or `None` for other values.
    #[must_use]
    pub const fn as_table(&self) -> Option<&Table> {
        match &self.item {
            Item::Table(table) => Some(table),
            _ => None,
        }
    }

    /// Returns the table, unless it refers to a fact.
    pub(crate) fn as_section(&self) -> Option<&Table> {
        self.as_table().filter(|table| table.fact().is_none())
    }

    /// Returns the facts to which the value and the values in it refer.
    pub(crate) fn facts(&self) -> Vec<FactRef<'_>> {
        match &self.item {
            Item::Array(items) => items.iter().flat_map(Self::facts).collect(),
            Item::Table(table) => match table.fact() {
                Some(fact) => vec![fact],
                None => table.entries.iter().flat_map(|(_, value)| value.facts()).collect(),
            },
            _ => Vec::new(),
        }
    }

    /// Returns whether the value, or an entry of it, is a string at this place.
    pub(crate) fn has_text_at(&self, span: &Range<usize>) -> bool {
        match &self.item {
            Item::String(_) => self.span == *span,
            Item::Array(items) => items.iter().any(|item| item.has_text_at(span)),
            _ => false,
        }
    }

    /// Returns the string, or `None` for other values.
    #[must_use]
    pub fn as_str(&self) -> Option<&str> {
        match &self.item {
            Item::String(text) => Some(text),
            _ => None,
        }
    }

    /// Deserializes the value, or returns `None` if it is of another type.
    #[must_use]
    pub fn read<T: DeserializeOwned>(&self) -> Option<T> {
        toml::Value::try_from(self).ok()?.try_into().ok()
    }

    /// Describes the value for a message, for example `the string "x"`.
    #[must_use]
    pub fn described(&self) -> String {
        match &self.item {
            Item::String(text) => format!("the string \"{text}\""),
            Item::Integer(number) => format!("{number}"),
            Item::Float(number) => format!("{number}"),
            Item::Boolean(value) => format!("{value}"),
            Item::Datetime(text) => format!("the date {text}"),
            Item::Array(items) => format!("a list of {}", items.len()),
            Item::Table(_) => "a table".into(),
        }
    }

    /// Converts a fact of a device, with the span of the place in the graph that refers to it.
    #[must_use]
    pub fn from_toml(value: &toml::Value, span: &Range<usize>) -> Self {
        let item = match value {
            toml::Value::String(text) => Item::String(text.clone()),
            toml::Value::Integer(number) => Item::Integer(*number),
            toml::Value::Float(number) => Item::Float(*number),
            toml::Value::Boolean(value) => Item::Boolean(*value),
            toml::Value::Datetime(date) => Item::Datetime(date.to_string()),
            toml::Value::Array(items) => Item::Array(items.iter().map(|item| Self::from_toml(item, span)).collect()),
            toml::Value::Table(table) => {
                let entry = |(name, value): (&String, &toml::Value)| {
                    (Key { name: name.clone(), span: span.clone() }, Self::from_toml(value, span))
                };
                Item::Table(Table { entries: table.iter().map(entry).collect() })
            }
        };
        Self { span: span.clone(), item }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::source::{SourceMap, parse_table};

    fn parse(sources: &mut SourceMap, text: &str) -> Table {
        let value = parse_table(sources.add_file(Path::new("x.toml"), text)).unwrap();
        value.as_table().unwrap().clone()
    }

    #[test]
    fn tables_merge_and_everything_else_replaces_with_its_own_place() {
        let mut sources = SourceMap::default();
        let mut base = parse(&mut sources, "[a]\nx = 1\ny = [1, 2, 3]\n[a.b]\nz = 'old'");
        base.merge(parse(&mut sources, "a.y = [9]\na.b.z = 'new'\na.w = true"));
        let a = base.get("a").unwrap().as_table().unwrap();
        assert_eq!(a.get("x").unwrap().item, Item::Integer(1));
        let Item::Array(y) = &a.get("y").unwrap().item else { panic!("a list") };
        assert_eq!(y.len(), 1);
        let z = a.get("b").unwrap().as_table().unwrap().get("z").unwrap();
        assert_eq!((z.as_str(), sources.locate(z.span.start).as_str()), (Some("new"), "x.toml:2:9"));
        assert_eq!(sources.locate(a.get("x").unwrap().span.start), "x.toml:2:5");
    }
}
