//! Suggestions for a misspelt name.

use std::fmt::Display;

/// Returns the known name closest to a misspelt one, or `None` if none is close.
///
/// A name is close if its edit distance is at most one, plus one for every four characters of `name`.
#[must_use]
pub fn suggest_name<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let score = |other: &&str| strsim::damerau_levenshtein(name, other);
    known.min_by_key(score).filter(|best| score(best) <= 1 + name.chars().count() / 4)
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
        None => format!("{what} here: {}", quoted(&known)),
    }
}

/// Lists names in backticks, separated by commas.
pub(crate) fn quoted<N: Display>(names: impl IntoIterator<Item = N>) -> String {
    names.into_iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}
