//! Suggestions for a misspelt name.

use std::cmp::Reverse;
use std::fmt::Display;
use std::path::Path;

/// Maximum number of names that a help lists.
const MAX_LISTED_NAMES: usize = 100;

/// Returns the known name closest to a misspelt one, or `None` if none is close.
///
/// A name is close if its edit distance is at most one, plus one for every four characters of `name`. Capitals count as
/// small letters, and `-` as `_`. Among equally close names, the one with the longest common start is returned.
#[must_use]
pub fn suggest_name<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let letters = Letters::of(name);
    let plain_name = plain(name);
    let common = |other: &str| plain_name.chars().zip(other.chars()).take_while(|(a, b)| a == b).count();
    let score = |other: &str| (strsim::damerau_levenshtein(&plain_name, other), Reverse(common(other)));
    let max_distance = 1 + name.chars().count() / 4;
    let near = known.filter(|other| letters.min_distance(other) <= 1 + name.len() / 4);
    let (score, best) = near.map(|other| (score(&plain(other)), other)).min_by_key(|(score, _)| *score)?;
    (score.0 <= max_distance).then_some(best)
}

/// Returns whether `name` looks like `meant` with a typing error: a capital letter, a doubled letter, an additional `s`
/// at the end, or a missing letter.
pub(crate) fn is_typing_error(name: &str, meant: &str) -> bool {
    let has_capital = |text: &str| text.contains(|c: char| c.is_uppercase());
    match (has_capital(name), has_capital(meant)) {
        (false, false) => is_slip(name, meant) || (name.len() + 1 == meant.len() && !is_slip(meant, name)),
        (capital, _) => capital,
    }
}

/// Returns whether `long` is `short` with a doubled letter, or with an `s` at its end.
fn is_slip(long: &str, short: &str) -> bool {
    let (long, short): (Vec<char>, Vec<char>) = (long.chars().collect(), short.chars().collect());
    let at = long.iter().zip(&short).take_while(|(a, b)| a == b).count();
    let is_longer = long.len() == short.len() + 1 && long[at + 1..] == short[at..];
    is_longer && ((at > 0 && long[at] == long[at - 1]) || (at == short.len() && long[at] == 's'))
}

fn plain(name: &str) -> String {
    name.to_lowercase().replace('-', "_")
}

/// How often each letter occurs in a name: a bound of the edit distance that is much faster to compute.
struct Letters {
    counts: [i32; 64],
    is_ascii: bool,
}

impl Letters {
    fn of(name: &str) -> Self {
        let mut counts = [0; 64];
        name.bytes().for_each(|byte| counts[place(byte)] += 1);
        Self { counts, is_ascii: name.is_ascii() }
    }

    /// Returns a distance that no edit from one name to the other is shorter than.
    fn min_distance(&self, other: &str) -> usize {
        if !self.is_ascii || !other.is_ascii() {
            return 0;
        }
        let mut counts = self.counts;
        other.bytes().for_each(|byte| counts[place(byte)] -= 1);
        let (missing, surplus) =
            counts.iter().fold((0, 0), |(missing, surplus), count| (missing + count.max(&0), surplus - count.min(&0)));
        missing.max(surplus).unsigned_abs() as usize
    }
}

/// Returns the place of a letter in the counts; a capital has that of its small letter, and `-` that of `_`.
fn place(byte: u8) -> usize {
    let plain = if byte == b'-' { b'_' } else { byte.to_ascii_lowercase() };
    usize::from(plain % 64)
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
        None if known.len() > MAX_LISTED_NAMES => {
            let more = known.len() - MAX_LISTED_NAMES;
            format!("{what} here: {}, and {more} more", quoted(&known[..MAX_LISTED_NAMES]))
        }
        None => format!("{what} here: {}", quoted(&known)),
    }
}

/// Returns the help that suggests a name.
#[must_use]
pub fn did_you_mean(name: &str) -> String {
    format!("did you mean `{name}`?")
}

/// Lists names in backticks, separated by commas.
#[must_use]
pub fn quoted<N: Display>(names: impl IntoIterator<Item = N>) -> String {
    names.into_iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_names_one_looks_misspelt() {
        let pairs = [("calms", "calm"), ("caalm", "calm"), ("clm", "calm"), ("Calm", "calm"), ("clam", "calm")];
        let found = pairs.map(|(wrong, right)| (is_typing_error(wrong, right), is_typing_error(right, wrong)));
        assert_eq!(found, [(true, false), (true, false), (true, false), (true, false), (false, false)]);
    }

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
            ("pdi", "pid pad", Some("pid")),
            ("mments", "momentum moments moment", Some("moments")),
            ("pad", "pid pod", Some("pid")),
            ("threshold", "hold gate", None),
            ("größe", "grosse größen", Some("größen")),
            ("ab", "abcd x", None),
        ];
        for (name, known, expected) in cases {
            assert_eq!(suggest_name(name, known.split_whitespace()), expected, "{name}");
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
            assert!(Letters::of(a).min_distance(b) <= strsim::damerau_levenshtein(&plain(a), &plain(b)), "{a} {b}");
        }
    }
}
