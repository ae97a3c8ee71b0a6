//! Suggestions for a misspelt name.

use std::fmt::Display;

/// Maximum number of names that a help lists.
const MAX_LISTED_NAMES: usize = 100;

/// Returns the known name closest to a misspelt one, or `None` if none is close.
///
/// A name is close if its edit distance is at most one, plus one for every four characters of `name`.
#[must_use]
pub fn suggest_name<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let letters = Letters::of(name);
    let (mut best, mut max_distance) = (None, 1 + name.chars().count() / 4);
    for other in known.filter(|other| letters.min_distance(other) <= 1 + name.len() / 4) {
        let distance = strsim::damerau_levenshtein(name, other);
        if distance < max_distance || best.is_none() && distance == max_distance {
            (best, max_distance) = (Some(other), distance);
        }
    }
    best
}

/// How often each letter occurs in a name: a bound of the edit distance that is much faster to compute.
struct Letters {
    counts: [i32; 64],
    is_ascii: bool,
}

impl Letters {
    fn of(name: &str) -> Self {
        let mut counts = [0; 64];
        name.bytes().for_each(|byte| counts[usize::from(byte % 64)] += 1);
        Self { counts, is_ascii: name.is_ascii() }
    }

    /// Returns a distance that no edit from one name to the other is shorter than.
    fn min_distance(&self, other: &str) -> usize {
        if !self.is_ascii || !other.is_ascii() {
            return 0;
        }
        let mut counts = self.counts;
        other.bytes().for_each(|byte| counts[usize::from(byte % 64)] -= 1);
        let (missing, surplus) =
            counts.iter().fold((0, 0), |(missing, surplus), count| (missing + count.max(&0), surplus - count.min(&0)));
        missing.max(surplus).unsigned_abs() as usize
    }
}

/// Returns the help for an unknown name: the closest known name, or the list of all known names.
///
/// `what` names the list in the plural, for example "roles".
#[must_use]
pub fn suggestion<'n>(name: &str, known: impl Iterator<Item = &'n str>, what: &str) -> String {
    let known: Vec<&str> = known.collect();
    match suggest_name(name, known.iter().copied()) {
        Some(best) => format!("did you mean `{best}`?"),
        None if known.is_empty() => format!("there are no {what} here"),
        None if known.len() > MAX_LISTED_NAMES => {
            let more = known.len() - MAX_LISTED_NAMES;
            format!("{what} here: {}, and {more} more", quoted(&known[..MAX_LISTED_NAMES]))
        }
        None => format!("{what} here: {}", quoted(&known)),
    }
}

/// Lists names in backticks, separated by commas.
pub(crate) fn quoted<N: Display>(names: impl IntoIterator<Item = N>) -> String {
    names.into_iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_the_closest_names_is_suggested() {
        let cases = [
            ("pdi", &["pid", "pad"][..], Some("pid")),
            ("mments", &["momentum", "moments", "moment"], Some("moments")),
            ("pad", &["pid", "pod"], Some("pid")),
            ("threshold", &["hold", "gate"], None),
            ("größe", &["grosse", "größen"], Some("größen")),
            ("ab", &["abcd", "x"], None),
        ];
        for (name, known, expected) in cases {
            assert_eq!(suggest_name(name, known.iter().copied()), expected, "{name}");
        }
    }

    #[test]
    fn a_long_list_is_cut() {
        let names: Vec<String> = (0..150).map(|i| format!("name_{i}")).collect();
        let help = suggestion("x", names.iter().map(String::as_str), "nodes");
        assert!(help.starts_with("nodes here: `name_0`") && help.ends_with("`name_99`, and 50 more"), "{help}");
    }

    #[test]
    fn the_bound_by_letters_is_no_longer_than_the_distance() {
        let names = ["", "a", "ab", "ba", "abc", "cab", "moments", "momentum", "n12", "n21", "N12", "größe"];
        for (a, b) in names.iter().flat_map(|a| names.map(|b| (*a, b))) {
            assert!(Letters::of(a).min_distance(b) <= strsim::damerau_levenshtein(a, b), "{a} {b}");
        }
    }
}
