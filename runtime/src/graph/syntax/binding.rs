//! What a bench binds a role to: a device, or one side of a device that has several, as in `"cell.left"`.

use std::ops::Range;

use crate::node::Spanned;

/// A value of the section [bind].
#[derive(Debug, Clone)]
pub(crate) struct Binding {
    /// The value as written.
    pub(crate) word: Spanned<String>,
}

impl Binding {
    /// Returns the name of the device.
    pub(crate) fn device(&self) -> &str {
        self.parts().0
    }

    /// Returns the name of the side, or `None` if the binding names only the device.
    pub(crate) fn side(&self) -> Option<&str> {
        self.parts().1
    }

    /// Returns the name of the device with its place.
    pub(crate) fn device_word(&self) -> Spanned<String> {
        let part = || self.word.part(0..self.device().len());
        let span = self.side().map_or_else(|| self.word.span.clone(), |_| part());
        Spanned { value: self.device().to_owned(), span }
    }

    /// Returns the place of the name of the side, or of the whole if it names none.
    pub(crate) fn side_span(&self) -> Range<usize> {
        let start = self.device().len() + 1;
        self.side().map_or_else(|| self.word.span.clone(), |_| self.word.part(start..self.word.value.len()))
    }

    fn parts(&self) -> (&str, Option<&str>) {
        self.word.value.split_once('.').map_or((&*self.word.value, None), |(device, side)| (device, Some(side)))
    }
}
