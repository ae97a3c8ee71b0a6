//! What a recording of a whole run contains, from the section [record]. The inputs are in every recording.

use super::PlannedPort;
use crate::signal::Kind;

/// The ports of a recording, and the size of its files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedPorts {
    /// Patterns of names, of which one must match: `*` stands for any text. `None` for all ports.
    pub patterns: Option<Vec<String>>,
    /// Whether images and masks are recorded.
    pub has_images: bool,
    /// Size at which another file is begun [byte].
    pub max_bytes: Option<u64>,
}

impl Default for RecordedPorts {
    fn default() -> Self {
        Self { patterns: None, has_images: true, max_bytes: None }
    }
}

impl RecordedPorts {
    /// Whether a port is recorded.
    #[must_use]
    pub fn has(&self, port: &PlannedPort) -> bool {
        let kind = port.shape.kind();
        let is_image = kind.is_picture() || kind == Kind::Mask;
        let is_selected = |patterns: &Vec<String>| patterns.iter().any(|pattern| matches(pattern, &port.name));
        (self.has_images || !is_image) && self.patterns.as_ref().is_none_or(is_selected)
    }
}

/// Whether a name matches a pattern, in which `*` stands for any text.
pub(crate) fn matches(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = name.strip_prefix(parts.next().unwrap_or_default()) else { return false };
    let Some(last) = parts.next_back() else { return rest.is_empty() };
    // The first place of each part leaves the most for those behind it.
    for part in parts {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_any_text() {
        let cases = [
            ("pad.image", "pad.image", true),
            ("pad.image", "pad.image2", false),
            ("touch.*", "touch.x", true),
            ("touch.*", "touch.smooth.x", true),
            ("*.x", "touch.smooth.x", true),
            ("*.x", "touch.y", false),
            ("t*h.*", "touch.x", true),
            ("*", "", true),
            ("a*a", "a", false),
            ("a*a", "aa", true),
            ("a*b*a", "abba", true),
            ("a*b*b*a", "aba", false),
            ("*x*y", "xyxy", true),
            ("*\u{e4}*", "m\u{e4}h", true),
        ];
        for (pattern, name, does) in cases {
            assert_eq!(matches(pattern, name), does, "{pattern} {name}");
        }
    }

    #[test]
    fn many_stars_take_no_longer() {
        let (pattern, name) = (format!("{}b", "*a".repeat(4000)), "a".repeat(8000));
        assert!(!matches(&pattern, &name) && matches(&pattern, &(name + "b")));
    }
}
