//! What was heard on a link: bytes, and the places where they began after a pause.

/// Bytes from a link.
#[derive(Debug, Clone, Default)]
pub(super) struct Heard {
    pub(super) bytes: Vec<u8>,
    /// Places of the first bytes after a pause.
    pub(super) pauses: Vec<usize>,
    /// Number of bytes before each question.
    pub(super) asks: Vec<usize>,
    /// Time over which they came [s].
    pub(super) seconds: f64,
}

/// A description that was guessed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Guess {
    /// What was found, a sentence each.
    pub(super) findings: Vec<String>,
    /// The keys of the description with their values, and a comment.
    pub(super) keys: Vec<(&'static str, String, &'static str)>,
}

/// Arranges a number of cells in rows and columns, as square as possible.
pub(super) fn rows_and_cols(count: usize) -> (usize, usize) {
    let rows = (1..=count.isqrt()).rev().find(|rows| count.is_multiple_of(*rows)).unwrap_or(1);
    (rows, count / rows)
}

/// Whether a number of cells is that of a usual pad: at least four rows, and at most four times as many columns.
pub(super) fn is_usual(count: usize) -> bool {
    let (rows, cols) = rows_and_cols(count);
    rows >= 4 && cols <= 4 * rows && rows.is_multiple_of(4) && cols.is_multiple_of(4)
}
