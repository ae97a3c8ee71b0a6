//! Diagnostics as JSON.

use serde::Serialize;

use crate::source::Location;
use crate::source::{Diagnostic, Report};

/// A diagnostic with its location.
#[derive(Debug, Serialize)]
pub(crate) struct DiagnosticJson {
    severity: &'static str,
    code: &'static str,
    message: String,
    #[serde(flatten)]
    location: Location,
    help: Option<String>,
    notes: Vec<NoteJson>,
}

#[derive(Debug, Serialize)]
struct NoteJson {
    message: String,
    #[serde(flatten)]
    location: Location,
}

/// Converts the diagnostics of a report, in their order.
pub(crate) fn diagnosed(report: &Report) -> Vec<DiagnosticJson> {
    let one = |diagnostic: &Diagnostic| DiagnosticJson {
        severity: diagnostic.code.severity().name(),
        code: diagnostic.code.name(),
        message: diagnostic.message.clone(),
        location: report.sources.location(&diagnostic.span),
        help: diagnostic.help.clone(),
        notes: diagnostic
            .notes
            .iter()
            .map(|(span, message)| NoteJson { message: message.clone(), location: report.sources.location(span) })
            .collect(),
    };
    report.diagnostics.iter().map(one).collect()
}
