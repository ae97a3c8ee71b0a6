//! Checks that each task with modes has a start mode, and that every mode can be reached from it.

use std::collections::BTreeSet;

use crate::graph::load::FlatGraph;
use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics, Edit};

/// Reports modes that are never entered, and returns the index of the start mode of each task that has modes.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) -> Vec<usize> {
    let starts = (0..net.flat.tasks.len()).filter_map(|task| check_task(net, task, diagnostics));
    starts.collect()
}

/// Checks the modes of one task, and returns the index of its start mode. A task without modes has none.
fn check_task(net: &Net<'_>, task: usize, diagnostics: &mut Diagnostics) -> Option<usize> {
    let start = find_start(net, task, diagnostics)?;
    let modes = || net.flat.modes.iter().enumerate().filter(|(_, mode)| mode.task == task);
    // An exit with a mistake may be the one that leads to a mode.
    if modes().any(|(_, mode)| mode.has_any(diagnostics)) {
        return Some(start);
    }
    let mut reached = reachable(start, task, net.flat);
    for (i, mode) in modes() {
        if reached.contains(&i) {
            continue;
        }
        let name = &mode.key.name;
        let message = format!("mode `{name}` is never entered");
        let help = format!("let an exit of another mode lead to `{name}`, or remove this mode");
        diagnostics.push(Diagnostic::new(Code::UnreachableMode, mode.key.span.clone(), message).help(help));
        // The modes that only this one leads to are not reported again.
        reached.extend(reachable(i, task, net.flat));
    }
    Some(start)
}

fn find_start(net: &Net<'_>, task: usize, diagnostics: &mut Diagnostics) -> Option<usize> {
    let mut names = net.flat.mode_names(task);
    let own = &net.flat.tasks[task];
    let Some(word) = own.table.as_ref().and_then(|table| table.start.as_ref()) else {
        if own.has_wrong_setting(diagnostics) {
            return None;
        }
        let line = format!("start = \"{}\"", names.next()?);
        let message = "the graph has modes but no start mode";
        let diagnostic = Diagnostic::new(Code::MissingKey, own.place.clone(), message);
        let diagnostic = diagnostic.help(format!("add `{line}` under [graph]"));
        diagnostics.push(diagnostic.edit(Edit::Below(own.place.clone(), line)));
        return None;
    };
    let start = net.flat.mode_numbers(task).get(word.value.as_str()).copied();
    if start.is_none() {
        diagnostics.push(Diagnostic::unknown(Code::UnknownMode, "mode", &word.value, &word.span, names));
    }
    start
}

/// Returns the modes of a task that can be reached from a mode of it.
fn reachable(start: usize, task: usize, flat: &FlatGraph) -> BTreeSet<usize> {
    let (modes, numbers) = (&flat.modes, flat.mode_numbers(task));
    let (mut reached, mut open) = (BTreeSet::from([start]), vec![start]);
    while let Some(mode) = open.pop() {
        // The written targets count, so that a mistake in an exit does not make its target unreachable too.
        let next = modes[mode].written_targets().filter_map(|to| numbers.get(to.as_str()?).copied());
        open.extend(next.filter(|to| reached.insert(*to)));
    }
    reached
}
