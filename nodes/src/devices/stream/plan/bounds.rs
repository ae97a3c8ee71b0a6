//! The largest pad that a description can state.

/// Maximum number of bytes of a frame, and of values of a text.
pub(crate) const MAX_LENGTH: usize = 1 << 16;
/// Maximum number of values of an image, with those of all axes.
pub(crate) const MAX_VALUES: usize = 1 << 18;
/// Maximum number of bytes of a value in a text, with its separator.
pub(crate) const MAX_WORD: usize = 32;
