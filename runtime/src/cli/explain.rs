//! `check --explain`: the page of a code, which says what it means and shows an example that is wrong and one that is right.

use super::shell::{Shell, unknown};
use crate::source::Code;

macro_rules! pages {
    ($($name:literal),* $(,)?) => {
        /// The pages by the names of their codes.
        const PAGES: &[(&str, &str)] = &[$(($name, include_str!(concat!("../../../docs/errors/", $name, ".md")))),*];
    };
}

pages! {
    "absent-port",
    "bad-clock",
    "bad-condition",
    "bad-data",
    "bad-name",
    "bad-value",
    "bound-out-of-range",
    "duplicate-name",
    "endless-part",
    "foreign-fact",
    "foreign-input",
    "frame-mismatch",
    "immediate-exit",
    "kind-mismatch",
    "late-exit",
    "loop",
    "missing-input",
    "missing-key",
    "loose-limit",
    "missing-limit",
    "no-approach",
    "not-live",
    "observed-role",
    "overlapping-conditions",
    "quantity-mismatch",
    "shape-mismatch",
    "short-time",
    "start-outside",
    "syntax",
    "unbound-role",
    "uncalibrated",
    "undriven-command",
    "ungated-motion",
    "unit-mismatch",
    "unknown-device",
    "unknown-fact",
    "unknown-frame",
    "unknown-input",
    "unknown-key",
    "unknown-mode",
    "unknown-port",
    "unknown-type",
    "unlimited-command",
    "unreachable-mode",
    "unreadable",
    "unstable-gain",
    "unused-allow",
    "unused-node",
    "unusual-gain",
    "unusual-value",
    "unwatched-device",
    "wrong-file",
    "wrong-role",
}

/// Returns the page of a code, or `None` if it has none.
#[must_use]
pub fn explanation(code: Code) -> Option<&'static str> {
    PAGES.iter().find(|(name, _)| *name == code.name()).map(|(_, page)| *page)
}

/// Prints the page of a code, or all codes with what each means if `name` is empty.
pub(super) fn explain(name: &str, shell: &Shell) -> u8 {
    if name.is_empty() {
        let width = Code::ALL.iter().map(|code| code.name().len()).max().unwrap_or_default();
        let meaning = |code: &Code| explanation(*code).and_then(|page| page.split("\n\n").nth(1)).unwrap_or_default();
        let first = |text: &str| text.split(". ").next().unwrap_or_default().trim_end_matches('.').to_owned();
        let lines = Code::ALL.iter().map(|code| format!("{:width$}  {}", code.name(), first(meaning(code))));
        shell.say(&lines.collect::<Vec<_>>().join("\n"));
        return 0;
    }
    let page = Code::ALL.iter().find(|code| code.name() == name).and_then(|code| explanation(*code));
    match page {
        Some(page) => {
            shell.say(page.trim_end());
            0
        }
        None => {
            let names = Code::ALL.iter().map(|code| code.name());
            shell.refuse(unknown("code", name, names, "`tactflow check --explain` lists all codes"))
        }
    }
}
