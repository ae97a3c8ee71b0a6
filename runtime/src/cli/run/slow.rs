//! The fraction of the limits that a run uses.

use super::commissioning::{UNCOMMISSIONED_FRACTION, uncommissioned};
use crate::cli::shell::Shell;
use crate::graph::{self, Compiled, Request};
use crate::source::SourceMap;

/// Parses a fraction of the limits: a parser for arguments.
pub(super) fn fraction(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| *number > 0.0 && *number <= 1.0);
    number.ok_or_else(|| format!("`{text}` is not a number above 0 and up to 1, such as 0.1"))
}

/// Compiles a graph, slowly if it moves a real arm that is not commissioned and nobody asked for a speed. Returns the
/// request that was compiled. `seen` gets the files that were read, also those of a graph with mistakes.
///
/// # Errors
/// The exit code, after the mistakes are printed.
pub(super) fn compile(
    request: &Request,
    shell: &Shell,
    seen: &mut dyn FnMut(&SourceMap),
) -> Result<(Compiled, Request), u8> {
    let mut compiled = |request: &Request| {
        let compiled = graph::compile(shell.catalogue(), request);
        seen(compiled.as_ref().map_or_else(|report| &report.sources, |plan| &plan.sources));
        compiled.map_err(|report| shell.reject(&report))
    };
    let plan = compiled(request)?;
    if request.slow.is_some() {
        return Ok((plan, request.clone()));
    }
    let missing = uncommissioned(&plan).map_err(|message| shell.refuse(message))?;
    let Some((device, bench)) = missing.first() else { return Ok((plan, request.clone())) };
    shell.warning(format_args!(
        "device `{device}` has not passed `tactflow doctor {bench} --move`, so this run uses {UNCOMMISSIONED_FRACTION} of the limits of \
         speed and acceleration; `--slow 1` uses all of them"
    ));
    let slow = request.clone().slow(UNCOMMISSIONED_FRACTION);
    Ok((compiled(&slow)?, slow))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fraction_is_above_zero_and_up_to_one() {
        assert_eq!((fraction("0.1"), fraction("1")), (Ok(0.1), Ok(1.0)));
        for wrong in ["0", "-0.1", "1.1", "nan", "ten", ""] {
            assert!(fraction(wrong).is_err(), "{wrong}");
        }
    }
}
