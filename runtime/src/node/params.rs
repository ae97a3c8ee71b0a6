//! The types that a parameter can have.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use super::bounds::Bounds;
use super::file_path::FilePath;
use super::mistake::{At, Mistake, Mistakes, refuse_any};
use super::param_spec::{Contents, Repeats, Written};
use super::reader::{Param, Reader, read_leaf};
use crate::signal::Unit;
use crate::source::{Code, quoted, suggest_name};
use crate::source::{Item, Key, Value};

macro_rules! leaves {
    ($($type:ty: $expects:literal),*) => {$(
        impl Param for $type {
            const EXPECTS: &'static str = $expects;
            fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
                read_leaf(value, reader, Self::EXPECTS)
            }
            fn written(&self) -> Option<Written> {
                Written::try_from(self).ok()
            }
        }
    )*};
}

leaves!(bool: "true or false", String: "a string");

macro_rules! whole_numbers {
    ($($type:ty),*) => {$(
        impl Param for $type {
            const EXPECTS: &'static str = "a whole number, 0 or more";
            const CONTENTS: Contents = Contents::NUMBER;
            fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
                let expects = if reader.bounds.is_some() { WHOLE_NUMBER } else { Self::EXPECTS };
                reader.number(value, expects, |number| number as f64)
            }
            fn takes(bounds: Option<&Bounds>) -> String {
                bounds.map_or_else(|| Self::EXPECTS.into(), |bounds| bounds.describe(WHOLE_NUMBER))
            }
            fn written(&self) -> Option<Written> {
                Written::try_from(self).ok()
            }
        }
    )*};
}

const WHOLE_NUMBER: &str = "a whole number";

whole_numbers!(u64, usize);

impl Param for f64 {
    const EXPECTS: &'static str = "a number";
    const CONTENTS: Contents = Contents::NUMBER;

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let number: Self = reader.number(value, Self::EXPECTS, |number| number)?;
        if number.is_finite() { Some(number) } else { reader.bad(value.span.clone(), "expected a finite number") }
    }

    fn written(&self) -> Option<Written> {
        Some((*self).into())
    }
}

/// A parameter with its place, for mistakes that are found after reading.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// The place in the source map.
    pub span: Range<usize>,
}

impl Spanned<String> {
    /// Returns the place of a part of the text, or of the whole if it is written with escapes.
    #[must_use]
    pub fn part(&self, range: Range<usize>) -> Range<usize> {
        match self.span.len().checked_sub(self.value.len()) {
            Some(around @ (0 | 2)) => {
                let start = self.span.start + around / 2;
                start + range.start..start + range.end
            }
            _ => self.span.clone(),
        }
    }
}

impl<T: Param> Param for Spanned<T> {
    const EXPECTS: &'static str = T::EXPECTS;
    const CONTENTS: Contents = T::CONTENTS;

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        Some(Self { value: T::read(value, reader)?, span: value.span.clone() })
    }

    fn takes(bounds: Option<&Bounds>) -> String {
        T::takes(bounds)
    }

    fn written(&self) -> Option<Written> {
        self.value.written()
    }
}

/// No parameters.
impl Param for () {
    const EXPECTS: &'static str = "a table";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let table = reader.table(value, &[])?;
        reader.close(table);
        Some(())
    }
}

impl Param for Unit {
    const EXPECTS: &'static str = "a unit";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let text: String = read_leaf(value, reader, Self::EXPECTS)?;
        text.parse().map_or_else(|message: String| reader.bad(value.span.clone(), message), Some)
    }

    fn written(&self) -> Option<Written> {
        Some(self.to_string().into())
    }
}

impl FilePath {
    /// Reads the whole file.
    ///
    /// # Errors
    /// If the file is not readable; the place is that of its name.
    pub fn bytes(&self) -> Result<Cow<'static, [u8]>, Mistake> {
        match &self.builtin {
            Some(bytes) => Ok(bytes.clone()),
            None => std::fs::read(&self.path).map(Cow::Owned).map_err(|error| Mistake::unreadable(self, &error)),
        }
    }
}

impl Param for FilePath {
    const EXPECTS: &'static str = "the path of a file";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let text: String = read_leaf(value, reader, Self::EXPECTS)?;
        reader.file(&text, value.span.clone())
    }

    fn written(&self) -> Option<Written> {
        Some(self.path.to_str()?.into())
    }
}

impl<T: Param> Param for Option<T> {
    const EXPECTS: &'static str = T::EXPECTS;
    const CONTENTS: Contents = T::CONTENTS;

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        T::read(value, reader).map(Some)
    }

    fn takes(bounds: Option<&Bounds>) -> String {
        T::takes(bounds)
    }

    fn when_missing() -> Option<Self> {
        Some(None)
    }

    fn written(&self) -> Option<Written> {
        self.as_ref()?.written()
    }
}

impl<T: Param> Param for Vec<T> {
    const EXPECTS: &'static str = "a list";
    const CONTENTS: Contents = Contents { repeats: Repeats::PerEntry, ..T::CONTENTS };

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let Item::Array(items) = &value.item else {
            return reader.wrong_type(value, Self::EXPECTS);
        };
        let outer = reader.entry;
        let mut read: Vec<Option<T>> = Vec::with_capacity(items.len());
        for (i, item) in items.iter().enumerate() {
            reader.entry = Some((i, items.len()));
            read.push(T::read(item, reader));
        }
        reader.entry = outer;
        read.into_iter().collect()
    }

    fn takes(bounds: Option<&Bounds>) -> String {
        format!("a list, each {}", T::takes(bounds))
    }

    fn written(&self) -> Option<Written> {
        written_list(self)
    }
}

impl<T: Param, const N: usize> Param for [T; N] {
    const EXPECTS: &'static str = match N {
        2 => "a list of 2",
        3 => "a list of 3",
        6 => "a list of 6",
        16 => "a list of 16",
        _ => "a list of the right length",
    };
    const CONTENTS: Contents = Contents { repeats: Repeats::PerEntry, ..T::CONTENTS };

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        match &value.item {
            Item::Array(items) if items.len() == N => Vec::<T>::read(value, reader)?.try_into().ok(),
            _ => reader.wrong_type(value, &format!("a list of {N}")),
        }
    }

    fn takes(bounds: Option<&Bounds>) -> String {
        format!("a list of {N}, each {}", T::takes(bounds))
    }

    fn written(&self) -> Option<Written> {
        written_list(self)
    }
}

fn written_list<T: Param>(list: &[T]) -> Option<Written> {
    list.iter().map(Param::written).collect::<Option<_>>().map(Written::Array)
}

/// A table with keys that the graph chooses, for example names of features.
#[derive(Debug, Clone, PartialEq)]
pub struct Map<T>(pub BTreeMap<String, T>);

impl<T: Param> Param for Map<T> {
    const EXPECTS: &'static str = "a table with an entry for each name";
    const CONTENTS: Contents = Contents { repeats: Repeats::PerName, ..T::CONTENTS };

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let Item::Table(table) = &value.item else {
            return reader.wrong_type(value, Self::EXPECTS);
        };
        let outer = reader.component.take();
        let read = |(key, value): &(Key, Value)| {
            reader.component = Some(key.clone());
            Some((key.name.clone(), T::read(value, reader)?))
        };
        let entries: Vec<Option<(String, T)>> = table.entries.iter().map(read).collect();
        reader.component = outer;
        entries.into_iter().collect::<Option<_>>().map(Self)
    }

    fn takes(bounds: Option<&Bounds>) -> String {
        format!("a table, for each name {}", T::takes(bounds))
    }

    fn written(&self) -> Option<Written> {
        let entries = self.0.iter().map(|(name, value)| Some((name.clone(), value.written()?)));
        entries.collect::<Option<toml::Table>>().map(Written::Table)
    }
}

impl<T> Map<T> {
    /// Returns the entries of parameter `param` in the order of the features `names`.
    ///
    /// # Errors
    /// One mistake for every feature without an entry and for every entry without a feature.
    pub fn in_order<'n>(&self, param: &str, names: impl Iterator<Item = &'n str> + Clone) -> Result<Vec<&T>, Mistakes> {
        let mut mistakes = Mistakes::new();
        let listed = || quoted(names.clone());
        let strange = self.0.keys().filter(|key| !names.clone().any(|name| name == *key)).count();
        let mut missing = names.clone().filter(|name| !self.0.contains_key(*name));
        // One missing and one unknown name are one mistake.
        let renamed = missing.next().filter(|_| strange == 1 && missing.next().is_none());
        for key in self.0.keys() {
            if !names.clone().any(|name| name == key) {
                let mistake = Mistake::key(format!("{param}.{key}"), format!("no feature is called `{key}`"));
                mistakes.push(match renamed {
                    Some(name) => mistake.instead(key, name),
                    None => mistake.suggest(key, names.clone(), "features"),
                });
            }
        }
        let is_misspelt = |name: &str| self.0.keys().any(|key| suggest_name(key, names.clone()) == Some(name));
        let is_told = |name: &str| renamed == Some(name) || is_misspelt(name);
        for name in names.clone().filter(|name| !self.0.contains_key(*name) && !is_told(name)) {
            let message = format!("`{param}` has no entry for feature `{name}`");
            let mistake = Mistake::new(Code::MissingKey, At::Key(param.into()), message);
            mistakes.push(mistake.help(format!("write an entry for `{name}`; the features here are {}", listed())));
        }
        refuse_any(mistakes)?;
        Ok(names.map(|name| &self.0[name]).collect())
    }
}
