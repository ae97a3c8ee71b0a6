//! Numbers as text.

/// Formats a number in at most ten characters.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    match size {
        0.0 => "0".into(),
        _ if !(1e-4..1e6).contains(&size) => format!("{value:.2e}"),
        _ if size < 1.0 => format!("{value:.5}"),
        _ if size < 100.0 => format!("{value:.3}"),
        _ => format!("{value:.1}"),
    }
}

/// Formats a time [s] in milliseconds.
pub(crate) fn milliseconds(seconds: f64) -> String {
    format!("{} ms", (seconds * 1e6).round() * 1e-3)
}

/// Formats a count with its noun: `1 run`, `2 runs`.
pub(crate) fn count_of(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Converts nanoseconds to seconds.
pub(crate) fn seconds(nanos: i64) -> f64 {
    nanos as f64 * 1e-9
}

/// Whether two values differ by rounding alone.
pub(crate) fn is_flat(low: f64, high: f64) -> bool {
    // Halves, so that no difference is infinite.
    0.5 * high - 0.5 * low <= 1e-12 + 1e-9 * high.abs().max(low.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let cases = [(0.0, "0"), (0.0123456, "0.01235"), (12.3456, "12.346"), (1234.5, "1234.5"), (-1e-9, "-1.00e-9")];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }
}
