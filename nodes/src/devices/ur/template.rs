//! The placeholders and conditions in the text of a program: `{{NAME}}` and `{% if ROBOT_SOFTWARE_VERSION >= v5.9.1 %}`.

use std::cmp::Ordering;

/// The version of a controller's software: major, minor, bugfix.
pub(super) type Version = [u32; 3];

/// The name that conditions compare.
const NAME: &str = "ROBOT_SOFTWARE_VERSION";

/// Whether a text has conditions, so that it needs the version of the controller.
pub(super) fn has_conditions(text: &str) -> bool {
    text.contains("{%")
}

/// Replaces each `{{NAME}}` by its value.
///
/// # Errors
/// The first name without a value.
pub(super) fn fill(text: &str, values: &[(&str, &str)]) -> Result<String, String> {
    let (mut filled, mut rest) = (String::with_capacity(text.len()), text);
    while let Some((before, after)) = rest.split_once("{{") {
        let Some((name, after)) = after.split_once("}}") else { return Err("`{{` without `}}`".into()) };
        let name = name.trim();
        let Some((_, value)) = values.iter().find(|(known, _)| *known == name) else {
            return Err(format!("the placeholder `{{{{{name}}}}}` is unknown"));
        };
        filled.push_str(before);
        filled.push_str(value);
        rest = after;
    }
    filled.push_str(rest);
    Ok(filled)
}

/// A condition that is open: whether its block is read, and whether one of its blocks was.
struct Open {
    is_read: bool,
    was_read: bool,
    has_else: bool,
}

/// Keeps the lines whose conditions hold for a version. Each condition stands on a line of its own.
///
/// # Errors
/// The first line that is not understood, with its number.
pub(super) fn choose(text: &str, version: Version) -> Result<String, String> {
    let (mut chosen, mut open): (String, Vec<Open>) = (String::with_capacity(text.len()), Vec::new());
    for (i, line) in text.lines().enumerate() {
        let trimmed = line.trim();
        if let Some(directive) = trimmed.strip_prefix("{%").and_then(|rest| rest.strip_suffix("%}")) {
            apply(directive.trim(), version, &mut open).map_err(|why| format!("line {}: {why}", i + 1))?;
        } else if trimmed.contains("{%") {
            return Err(format!("line {}: a condition does not stand on a line of its own", i + 1));
        } else if open.iter().all(|open| open.is_read) {
            chosen.push_str(line);
            chosen.push('\n');
        }
    }
    if open.is_empty() { Ok(chosen) } else { Err("an `if` has no `endif`".into()) }
}

fn apply(directive: &str, version: Version, open: &mut Vec<Open>) -> Result<(), String> {
    let (word, condition) = directive.split_once(char::is_whitespace).unwrap_or((directive, ""));
    if word == "if" {
        let is_read = holds(condition, version)?;
        open.push(Open { is_read, was_read: is_read, has_else: false });
        return Ok(());
    }
    let Some(last) = open.last_mut() else { return Err(format!("`{word}` without an `if`")) };
    match word {
        "elif" if !last.has_else => {
            last.is_read = holds(condition, version)? && !last.was_read;
            last.was_read |= last.is_read;
        }
        "else" if !last.has_else && condition.is_empty() => {
            last.is_read = !last.was_read;
            last.has_else = true;
        }
        "endif" if condition.is_empty() => _ = open.pop(),
        _ => return Err(format!("`{directive}` is not understood")),
    }
    Ok(())
}

/// Whether a condition holds: `ROBOT_SOFTWARE_VERSION >= v5.9.1`.
fn holds(condition: &str, version: Version) -> Result<bool, String> {
    let words: Vec<&str> = condition.split_whitespace().collect();
    let unknown = || format!("the condition `{condition}` is not understood");
    let [NAME, operator, bound] = words[..] else { return Err(unknown()) };
    let bound = bound.strip_prefix('v').and_then(parsed).ok_or_else(unknown)?;
    let order = version.cmp(&bound);
    match operator {
        "<" => Ok(order == Ordering::Less),
        "<=" => Ok(order != Ordering::Greater),
        ">" => Ok(order == Ordering::Greater),
        ">=" => Ok(order != Ordering::Less),
        "==" => Ok(order == Ordering::Equal),
        "!=" => Ok(order != Ordering::Equal),
        _ => Err(unknown()),
    }
}

fn parsed(text: &str) -> Option<Version> {
    let numbers: Option<Vec<u32>> = text.split('.').map(|number| number.parse().ok()).collect();
    numbers?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn placeholders_are_filled_and_unknown_ones_are_named() {
        let values = [("HOST", "10.0.0.1"), ("PORT", "50001")];
        assert_eq!(fill("open({{HOST}}, {{ PORT }}, {{PORT}})", &values).unwrap(), "open(10.0.0.1, 50001, 50001)");
        assert_eq!(fill("{{GAIN}}", &values), Err("the placeholder `{{GAIN}}` is unknown".into()));
        assert_eq!(fill("{{HOST", &values), Err("`{{` without `}}`".into()));
    }

    const NESTED: &str = "a\n  {% if ROBOT_SOFTWARE_VERSION < v6.0.0 %}\nb\n{% if ROBOT_SOFTWARE_VERSION >= v5.23.0 %}\nc\n\
        {% else %}\nd\n{% endif %}\n{% elif ROBOT_SOFTWARE_VERSION >= v10.11.0 %}\ne\n{% else %}\nf\n{% endif %}\ng";

    #[test]
    fn the_lines_of_a_version_are_chosen() {
        for (version, lines) in [
            ([5, 22, 9], "abdg"),
            ([5, 23, 0], "abcg"),
            ([3, 15, 8], "abdg"),
            ([10, 11, 0], "aeg"),
            ([10, 10, 9], "afg"),
            ([6, 0, 0], "afg"),
        ] {
            assert_eq!(choose(NESTED, version).unwrap().replace('\n', ""), lines, "{version:?}");
        }
    }

    #[test]
    fn what_is_not_understood_is_named_with_its_line() {
        for (text, why) in [
            ("a\n{% if SIZE > v1.0.0 %}\n{% endif %}", "line 2: the condition `SIZE > v1.0.0` is not understood"),
            (
                "{% if ROBOT_SOFTWARE_VERSION > 5 %}",
                "line 1: the condition `ROBOT_SOFTWARE_VERSION > 5` is not understood",
            ),
            ("{% else %}", "line 1: `else` without an `if`"),
            ("{% if ROBOT_SOFTWARE_VERSION > v5.0.0 %}\n{% for x %}", "line 2: `for x` is not understood"),
            ("{% if ROBOT_SOFTWARE_VERSION > v5.0.0 %}", "an `if` has no `endif`"),
            ("x {% endif %}", "line 1: a condition does not stand on a line of its own"),
        ] {
            assert_eq!(choose(text, [5, 9, 1]), Err(why.into()));
        }
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(text in ".{0,200}", more in "[{}% a-z\n]{0,80}") {
            for text in [&text, &more] {
                let _ = (fill(text, &[("a", "b")]), choose(text, [5, 0, 0]));
            }
        }
    }
}
