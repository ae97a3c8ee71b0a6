//! The parameter `neighbours`: 4 or 8.

use tactflow_runtime::node::{Param, Reader, Written, read_leaf};
use tactflow_runtime::source::Value;

/// Number of neighbours of a tactel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Neighbours(i64);

impl Neighbours {
    /// Those with a common edge.
    const FOUR: Self = Self(4);
    /// Those with a common edge or corner.
    pub(super) const EIGHT: Self = Self(8);
}

impl Param for Neighbours {
    const EXPECTS: &'static str = "4 or 8";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let number = read_leaf(value, reader, Self::EXPECTS).map(Self)?;
        let known = [Self::FOUR, Self::EIGHT].into_iter().find(|known| *known == number);
        known.or_else(|| reader.wrong_type(value, Self::EXPECTS))
    }

    fn written(&self) -> Option<Written> {
        Some(self.0.into())
    }
}
