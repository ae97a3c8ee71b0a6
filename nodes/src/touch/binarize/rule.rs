//! The rule that chooses the tactels, from the parameters.

use tactflow_runtime::node::{Mistake, Mistakes, collect_both};

use super::{Method, Params};
use crate::touch::common::narrow;

/// How tactels are chosen.
#[derive(Debug, Clone, Copy)]
pub(super) enum Rule {
    Above(f32),
    Hysteresis { enter: f32, stay: f32 },
    Otsu { least: f32 },
}

/// Returns the rule that the parameters select.
pub(super) fn rule(params: &Params) -> Result<Rule, Mistakes> {
    let stay = params.release.map(|release| narrow("release", release)).transpose();
    let thresholds = collect_both(narrow("threshold", params.threshold), stay);
    let ((enter, stay), ()) = collect_both(thresholds, check_method(params))?;
    match (params.method, stay) {
        (Method::Otsu, _) => Ok(Rule::Otsu { least: enter }),
        (Method::Fixed, None) => Ok(Rule::Above(enter)),
        (Method::Fixed, Some(stay)) if stay < enter => Ok(Rule::Hysteresis { enter, stay }),
        (Method::Fixed, Some(_)) => {
            let message = "`release` is not lower than `threshold`";
            let help = "a tactel enters above `threshold` and stays above `release`; leave it out for one threshold";
            Err(Mistake::param("release", message).help(help).into())
        }
    }
}

fn check_method(params: &Params) -> Result<(), Mistakes> {
    if params.method == Method::Fixed || params.release.is_none() {
        return Ok(());
    }
    let message = "`release` cannot be used with `method = \"otsu\"`, whose threshold changes from image to image";
    Err(Mistake::key("release", message).help("remove `release`, or write `method = \"fixed\"`").into())
}
