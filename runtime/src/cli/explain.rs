//! `check --explain`: the page of a code, which says what it means and shows an example that is wrong and one that is right.

use super::shell::{Shell, unknown};
use crate::source::Code;

/// Prints the page of a code, or all codes with what each means if `name` is empty.
pub(super) fn explain(name: &str, shell: &Shell) -> u8 {
    if name.is_empty() {
        let width = Code::ALL.iter().map(|code| code.name().len()).max().unwrap_or_default();
        let meaning = |code: &Code| code.page().split("\n\n").nth(1).unwrap_or_default();
        let first = |text: &str| text.split(". ").next().unwrap_or_default().trim_end_matches('.').to_owned();
        let lines = Code::ALL.iter().map(|code| format!("{:width$}  {}", code.name(), first(meaning(code))));
        shell.say(&lines.collect::<Vec<_>>().join("\n"));
        return 0;
    }
    match Code::ALL.iter().find(|code| code.name() == name) {
        Some(code) => {
            shell.say(code.page().trim_end());
            0
        }
        None => {
            let names = Code::ALL.iter().map(|code| code.name());
            shell.refuse(unknown("code", name, names, "`tactflow check --explain` lists all codes"))
        }
    }
}
