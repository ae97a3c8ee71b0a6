//! The sides of a device that fills a type of role more than once: which of them a binding means.

use crate::device::Description;
use crate::graph::net::Net;
use crate::graph::syntax::Binding;
use crate::source::{Code, Diagnostic, Edit, quoted, suggest_name};

/// Returns the index of the role of a device that a binding means, among those that `fit` the type of the role.
///
/// # Errors
/// If the device has no such side, or several sides of which the binding names none.
pub(super) fn choose(
    description: &Description,
    fit: &[usize],
    binding: &Binding,
    role: &str,
) -> Result<usize, Diagnostic> {
    let device = binding.device();
    let sides = || fit.iter().filter_map(|fill| description.fills[*fill].side.as_deref());
    let words = || quoted(sides().map(|side| format!("{device}.{side}")));
    match (binding.side(), fit) {
        (None, [only]) => Ok(*only),
        (None, _) => {
            let message = format!("device `{device}` can fill the role `{role}` on more than one side");
            let diagnostic = Diagnostic::new(Code::WrongRole, binding.word.span.clone(), message);
            Err(match named_in(role, sides()) {
                Some(side) => diagnostic.instead(device, &format!("{device}.{side}")),
                None => diagnostic.help(format!("name the side: {}", words())),
            })
        }
        (Some(side), _) => {
            let is_meant = |fill: &&usize| description.fills[**fill].side.as_deref() == Some(side);
            fit.iter().find(is_meant).copied().ok_or_else(|| {
                let message = format!("device `{device}` has no side `{side}` that can fill the role `{role}`");
                let diagnostic = Diagnostic::new(Code::WrongRole, binding.side_span(), message);
                match (suggest_name(side, sides()), sides().next()) {
                    (Some(best), _) => diagnostic.instead(side, best),
                    (None, Some(_)) => diagnostic.help(format!("its sides are {}", words())),
                    (None, None) => {
                        let whole = Edit::Replace(binding.word.part(0..binding.word.value.len()), device.to_owned());
                        diagnostic.help(format!("it has no sides: write `\"{device}\"`")).edit(whole)
                    }
                }
            })
        }
    }
}

/// Returns the side whose name is a word in the name of a role: `left` in `left_pad`.
pub(super) fn named_in<'s>(role: &str, mut sides: impl Iterator<Item = &'s str>) -> Option<&'s str> {
    sides.find(|side| role.split('_').any(|word| word == *side))
}

/// Returns the mistake of a device that fills a type of role more than once, and does not tell the sides apart.
pub(super) fn indistinct(description: &Description) -> Option<String> {
    let fills = &description.fills;
    let is_unclear = |i: &usize| {
        let rivals = fills.iter().enumerate().filter(|(j, other)| j != i && other.role == fills[*i].role);
        fills[*i].side.is_none() && rivals.clone().next().is_some()
            || rivals.map(|(_, other)| &other.side).any(|side| *side == fills[*i].side)
    };
    let unclear = (0..fills.len()).find(is_unclear)?;
    Some(format!("fills the role type `{}` more than once without a side of its own for each", fills[unclear].role))
}

/// Returns the mistakes of sensors that a bench takes from another side of a device than the arm that carries them.
///
/// `side` is the side of the device that fills a role.
pub(super) fn crossed<'d>(net: &Net<'_>, side: impl Fn(usize) -> Option<(usize, &'d str)>) -> Vec<Diagnostic> {
    let Some(bench) = &net.flat.bench else { return Vec::new() };
    let mistake = |sensor: usize| {
        // Most devices have no sides, and to find the arm takes longer.
        let (device, own) = side(sensor)?;
        let arm = net.carrier(sensor)?;
        let (other, of_arm) = side(arm)?;
        let [sensor, arm] = [sensor, arm].map(|role| net.flat.roles[role].0.name.as_str());
        let binding = bench.bind.get(sensor).filter(|_| device == other && own != of_arm)?;
        let message = format!("`{sensor}` is on `{arm}`, which is the {of_arm} side of `{}`", binding.device());
        let diagnostic = Diagnostic::new(Code::WrongRole, binding.side_span(), message);
        let diagnostic = diagnostic.note(bench.bind.get(arm)?.word.span.clone(), "the arm is bound here");
        Some(diagnostic.instead(own, of_arm))
    };
    (0..net.flat.roles.len()).filter_map(mistake).collect()
}
