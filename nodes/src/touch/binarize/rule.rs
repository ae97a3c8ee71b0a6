//! The rule that chooses the tactels, from the parameters.

use tactflow_runtime::node::{Mistake, Mistakes};

use super::{Method, Params};
use crate::touch::common::none;

/// How tactels are chosen.
#[derive(Debug, Clone, Copy)]
pub(super) enum Rule {
    Above(f32),
    Hysteresis { enter: f32, stay: f32 },
    Otsu { least: f32 },
}

/// Returns the rule that the parameters select.
pub(super) fn rule(params: &Params) -> Result<Rule, Mistakes> {
    let mut mistakes = Mistakes::new();
    let mut narrow = |name: &str, number: f64| {
        if !(number as f32).is_finite() {
            let message = format!("{number:e} is too large for a tactel: images are of 32-bit floats");
            mistakes.push(Mistake::param(name, message));
        }
        number as f32
    };
    let enter = narrow("threshold", params.threshold);
    let stay = params.release.map(|release| narrow("release", release));
    let rule = match (params.method, stay) {
        (Method::Fixed, None) => Rule::Above(enter),
        (Method::Otsu, None) => Rule::Otsu { least: enter },
        (Method::Fixed, Some(stay)) => {
            if stay >= enter && mistakes.is_empty() {
                let message = "`release` is not lower than `threshold`";
                let help =
                    "a tactel enters above `threshold` and stays above `release`; leave it out for one threshold";
                mistakes.push(Mistake::param("release", message).help(help));
            }
            Rule::Hysteresis { enter, stay }
        }
        (Method::Otsu, Some(_)) => {
            let message = "`release` means nothing with `method = \"otsu\"`: that threshold moves from image to image";
            mistakes.push(Mistake::key("release", message).help("leave one of the two out"));
            Rule::Above(enter)
        }
    };
    none(mistakes)?;
    Ok(rule)
}
