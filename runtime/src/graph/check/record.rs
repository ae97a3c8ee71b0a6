//! Checks that every pattern of the section [record] matches a port.

use crate::graph::plan::{RecordedPorts, matches};
use crate::graph::syntax::RecordTable;
use crate::source::{Code, Diagnostic, Diagnostics, suggest_name};

/// Returns what a recording contains, and reports patterns that match none of the `ports`.
pub(crate) fn check(table: Option<&RecordTable>, ports: &[&str], diagnostics: &mut Diagnostics) -> RecordedPorts {
    let Some(RecordTable { ports: patterns, images, max_size }) = table else { return RecordedPorts::default() };
    for pattern in patterns.iter().flatten() {
        if ports.iter().any(|port| matches(&pattern.value, port)) {
            continue;
        }
        let message = format!("`{}` matches no port", pattern.value);
        let diagnostic = Diagnostic::new(Code::UnknownPort, pattern.span.clone(), message);
        diagnostics.push(match suggest_name(&pattern.value, ports.iter().copied()) {
            Some(port) => diagnostic.instead(&pattern.value, port),
            None => diagnostic.help("`*` stands for any text: `touch.*` matches every port of the part `touch`"),
        });
    }
    RecordedPorts {
        patterns: patterns.as_ref().map(|patterns| patterns.iter().map(|pattern| pattern.value.clone()).collect()),
        has_images: *images,
        max_bytes: max_size.map(|bytes| bytes as u64),
    }
}
