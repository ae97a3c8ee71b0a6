//! The section `[allow]`: the warnings that a graph or a bench silences, each with its reason.

use std::ops::Range;

use super::read::read_table;
use crate::node::{At, Mistake, Param, Reader};
use crate::source::{Code, Key, Severity, Value};

/// An entry of `[allow]`.
#[derive(Debug, Clone)]
pub(crate) struct Allowance {
    pub(crate) key: Key,
    /// The code of the warnings that it silences.
    pub(crate) code: Code,
    pub(crate) reason: String,
    /// The text of the part that allows them: those elsewhere are not silenced.
    pub(crate) within: Option<Range<usize>>,
}

/// Reads the section; entries with a mistake are left out.
pub(super) fn read_allow(value: Option<&Value>, reader: &mut Reader<'_>) -> Vec<Allowance> {
    let entries = read_table(value, reader).entries.into_iter();
    entries.filter_map(|(key, value)| read_entry(key, &value, reader)).collect()
}

fn read_entry(key: Key, value: &Value, reader: &mut Reader<'_>) -> Option<Allowance> {
    let warnings = || Code::ALL.iter().filter(|code| code.severity() == Severity::Warning);
    let code = Code::ALL.iter().find(|code| code.name() == key.name).copied();
    let Some(code) = code.filter(|code| code.severity() == Severity::Warning) else {
        let unknown = |message: String| Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), message);
        reader.mistakes.push(match code {
            Some(_) => {
                unknown(format!("`{}` is an error: only a warning can be allowed", key.name)).help("remove the line")
            }
            None => {
                let mistake = unknown(format!("there is no warning `{}`", key.name));
                mistake.suggest(&key.name, warnings().map(|code| code.name()), "warnings")
            }
        });
        return None;
    };
    let reason = String::read(value, reader)?;
    if reason.trim().is_empty() {
        let message = format!("`{}` is allowed without a reason", key.name);
        let help = format!("write why it is right here: `{} = \"the reason\"`", key.name);
        reader.mistakes.push(Mistake::new(Code::BadValue, At::Span(value.span.clone()), message).help(help));
        return None;
    }
    Some(Allowance { key, code, reason, within: None })
}
