//! Silences the warnings that a section `[allow]` names.

use crate::graph::load::FlatGraph;
use crate::graph::plan::AllowedWarning;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Removes the warnings that the graph or its bench allows, and returns them by code.
///
/// It warns of an entry of the graph that silences nothing. A bench is for several graphs, so its entries may.
pub(crate) fn silence(flat: &FlatGraph, warnings: &mut Diagnostics) -> Vec<AllowedWarning> {
    let of_bench = flat.bench.iter().flat_map(|bench| &bench.allow);
    let mut allowed = Vec::new();
    for (entry, is_own) in flat.allow.iter().map(|entry| (entry, true)).chain(of_bench.map(|entry| (entry, false))) {
        let before = warnings.len();
        let is_elsewhere = |place: usize| entry.within.as_ref().is_some_and(|within| !within.contains(&place));
        warnings.retain(|warning| warning.code != entry.code || is_elsewhere(warning.span.start));
        match before - warnings.len() {
            0 if is_own && entry.within.is_none() => {
                let message = format!("the graph has no warning `{}` to allow", entry.key.name);
                warnings
                    .push(Diagnostic::new(Code::UnusedAllow, entry.key.span.clone(), message).help("remove the line"));
            }
            0 => {}
            count => allowed.push(AllowedWarning { code: entry.code, reason: entry.reason.clone(), count }),
        }
    }
    allowed
}
