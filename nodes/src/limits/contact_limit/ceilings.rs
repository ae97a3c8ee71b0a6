//! The ceilings of the load, in the unit of the image.

use tactflow_runtime::node::{At, Mistake, Mistakes, refuse_any};
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::Code;

use super::Params;

/// The ceilings of the load, in the unit of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ceilings {
    /// Of the sum of the whole image.
    pub(super) force: f64,
    /// Of a single tactel.
    pub(super) peak: f64,
}

impl Ceilings {
    /// Chooses the pair of parameters for an image in that unit. The other pair must not be given.
    pub(super) fn new(params: &Params, unit: Unit, warnings: &mut Mistakes) -> Result<Self, Mistakes> {
        let newton = [("force_n", params.force_n), ("peak_n", params.peak_n)];
        let raw = [("force_raw", params.force_raw), ("peak_raw", params.peak_raw)];
        let (own, other) = match unit {
            Unit::NEWTON => (newton, raw),
            Unit::RAW => (raw, newton),
            _ => {
                let message = format!("the image is in `{unit}`, and no limit is: a ceiling needs an image in `N`");
                let help = "convert the image with a `calibrate` that has `unit = \"N\"`";
                return Err(Mistake::new(Code::UnitMismatch, At::Input("image".into()), message).help(help).into());
            }
        };
        let unfit = other.into_iter().filter(|(_, value)| value.is_some()).map(|(name, _)| {
            let message = format!("`{name}` does not limit an image in `{unit}`");
            let help = format!("use `{}` and `{}`, or calibrate the image", own[0].0, own[1].0);
            Mistake::new(Code::UnitMismatch, At::Param(name.into()), message).help(help)
        });
        let unfit: Vec<Mistake> = unfit.collect();
        let missing = own.into_iter().filter(|(_, value)| value.is_none() && unfit.is_empty()).map(|(name, _)| {
            let message = format!("the image is in `{unit}`, so `{name}` must limit it");
            Mistake::new(Code::MissingLimit, At::Node, message).help(format!("set `{name}` [{unit}]"))
        });
        let missing: Vec<Mistake> = missing.collect();
        refuse_any(unfit.into_iter().chain(missing))?;
        let [force, peak] = own.map(|(_, value)| value.unwrap_or(0.0));
        if peak > force {
            let [(force, _), (peak, _)] = own;
            let message =
                format!("`{peak}` is greater than `{force}`, so it has no effect: one tactel is never above the sum");
            let warning = Mistake::new(Code::UnusualValue, At::Param(peak.into()), message);
            warnings.push(warning.help(format!("let `{peak}` be at most `{force}`")));
        }
        Ok(Self { force, peak })
    }
}
