//! Suggestions for a misspelt name.

/// The name that a misspelt one is meant to be, if one is near.
#[must_use]
pub fn meant<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let score = |other: &&str| strsim::damerau_levenshtein(name, other);
    known.min_by_key(score).filter(|best| score(best) <= 1 + name.chars().count() / 4)
}

/// A way out of a misspelt name: the one that is meant, or all there are.
#[must_use]
pub fn closest<'n>(name: &str, known: impl Iterator<Item = &'n str>, what: &str) -> String {
    let known: Vec<&str> = known.collect();
    match meant(name, known.iter().copied()) {
        Some(best) => format!("did you mean `{best}`?"),
        None if known.is_empty() => format!("there are no {what} here"),
        None => format!("{what} here: {}", known.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")),
    }
}
