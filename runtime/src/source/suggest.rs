//! Suggestions for a misspelt name.

use std::cmp::Reverse;
use std::fmt::Display;
use std::path::Path;

/// Returns the known name closest to a misspelt one, or `None` if none is close.
///
/// A name is close if its edit distance is at most one, plus one for every four characters of `name`. Capitals count as
/// small letters, and `-` as `_`. Among equally close names, the one with the longest common start is returned.
#[must_use]
pub fn suggest_name<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let name = plain(name);
    let common = |other: &str| name.chars().zip(other.chars()).take_while(|(a, b)| a == b).count();
    let scored = known.map(|other| {
        let plain = plain(other);
        ((strsim::damerau_levenshtein(&name, &plain), Reverse(common(&plain))), other)
    });
    let (score, best) = scored.min_by_key(|(score, _)| *score)?;
    (score.0 <= 1 + name.chars().count() / 4).then_some(best)
}

fn plain(name: &str) -> String {
    name.to_lowercase().replace('-', "_")
}

/// Returns the path of an existing file that is like `text`, which is relative to `folder`: each of its names is right,
/// or is replaced by a similar one in the same folder.
#[must_use]
pub fn suggest_path(folder: &Path, text: &str) -> Option<String> {
    let (mut at, mut names) = (folder.to_owned(), Vec::new());
    for name in text.split('/') {
        let exists = name.is_empty() || at.join(name).exists();
        let here = if at.as_os_str().is_empty() { Path::new(".") } else { &at };
        let found = if exists { name.to_owned() } else { suggest_file(here, name)? };
        at = if name.is_empty() { Path::new("/").to_owned() } else { at.join(&found) };
        names.push(found);
    }
    at.is_file().then(|| names.join("/"))
}

/// Returns the name in a folder that is like `name`.
fn suggest_file(folder: &Path, name: &str) -> Option<String> {
    let names = std::fs::read_dir(folder).ok()?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names.collect();
    names.sort();
    suggest_name(name, names.iter().map(String::as_str)).map(str::to_owned)
}

/// Returns the help for an unknown name: the closest known name, or the list of all known names.
///
/// `what` names the list in the plural, for example "roles".
#[must_use]
pub fn suggestion<'n>(name: &str, known: impl Iterator<Item = &'n str>, what: &str) -> String {
    let known: Vec<&str> = known.collect();
    match suggest_name(name, known.iter().copied()) {
        Some(best) => did_you_mean(best),
        None if known.is_empty() => format!("there are no {what} here"),
        None => format!("{what} here: {}", quoted(&known)),
    }
}

/// Returns the help that suggests a name.
#[must_use]
pub fn did_you_mean(name: &str) -> String {
    format!("did you mean `{name}`?")
}

/// Lists names in backticks, separated by commas.
pub(crate) fn quoted<N: Display>(names: impl IntoIterator<Item = N>) -> String {
    names.into_iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_name_is_suggested() {
        let cases = [
            ("imag", "image mask", Some("image")),
            ("Image", "imago image", Some("image")),
            ("FOR-MS", "for_ms after_ms", Some("for_ms")),
            ("ki", "kp kii", Some("kii")),
            ("min_n", "max_m min_m", Some("min_m")),
            ("q", "select", None),
            ("x", "", None),
        ];
        for (name, known, expected) in cases {
            assert_eq!(suggest_name(name, known.split_whitespace()), expected, "{name}");
        }
    }
}
