//! Loops that are stable, and that a change while the arm moves may make unstable.

use tactflow_runtime::graph::OutlinedRange;
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use super::stability::{KEPT, is_known, over, unmeasured};
use crate::tool::control::digits::down_to_two_digits;
use crate::tool::control::law::Feature;
use crate::tool::control::margins::margins;
use crate::tool::control::response::Loop;

/// Number of gains that are tried, each 5 % smaller than the one before: down to a ten thousandth of the largest.
const TRIED: usize = 180;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let loops = || arm.modes.iter().flat_map(|mode| mode.moving().map(move |feature| (mode, feature)));
    let of_range = |range| loops().filter_map(move |(mode, feature)| Changed::of(feature, range)?.judge(arm, mode));
    let tightest = |range| of_range(range).min_by(|(one, _), (other, _)| one.total_cmp(other));
    arm.outline.live.iter().filter_map(tightest).map(|(_, found)| found).collect()
}

/// A feature with a gain that may change.
struct Changed<'a> {
    feature: &'a Feature,
    key: &'static str,
    value: f64,
    range: &'a OutlinedRange,
}

impl<'a> Changed<'a> {
    /// Returns the feature if the range is that of one of its gains, and allows a larger one.
    fn of(feature: &'a Feature, range: &'a OutlinedRange) -> Option<Self> {
        let (node, gain) = range.name.split_once(".gains.")?;
        let (name, key) = gain.rsplit_once('.')?;
        if feature.pid.as_deref() != Some(node) || feature.name != name {
            return None;
        }
        let gains = [("kp", feature.kp), ("ki", feature.ki), ("kd", feature.kd)];
        let (key, value) = gains.into_iter().find(|(one, _)| *one == key)?;
        (value < range.max).then_some(Self { feature, key, value, range })
    }

    /// Returns the feature with another gain.
    fn with(&self, gain: f64) -> Feature {
        let mut feature = self.feature.clone();
        match self.key {
            "kp" => feature.kp = gain,
            "ki" => feature.ki = gain,
            _ => feature.kd = gain,
        }
        feature
    }

    /// Returns the warning about a range that reaches up to a gain with which a loop is unstable, and the largest gain
    /// that keeps the margins. A loop that is unstable as written has its own warning.
    fn judge(&self, arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<(f64, Diagnostic)> {
        let contacts = &*arm.contacts_or_geometry();
        if !is_known(mode, self.feature, contacts) {
            return None;
        }
        let around = |gain: f64, contact| Loop::over(&self.with(gain), contact).filter(|around| !around.is_reversed());
        let is = |holds: &dyn Fn(&Loop) -> bool, gain, contact| around(gain, contact).is_none_or(|one| holds(&one));
        let is_stable = |around: &Loop| margins(around).is_stable;
        let shaken = contacts.iter().find(|contact| !is(&is_stable, self.range.max, contact))?;
        if !is(&is_stable, self.value, shaken) {
            return None;
        }
        let holds = |gain: &f64| contacts.iter().all(|one| is(&|around| KEPT.holds(&margins(around)), *gain, one));
        let tried = std::iter::successors(Some(self.range.max), |gain| Some(gain * 0.95)).take(TRIED);
        let best = tried.take_while(|gain| *gain > self.value).find(holds).map(down_to_two_digits);
        let (key, name, range) = (self.key, &self.feature.name, self.range);
        let message = format!(
            "`{}` may become {}, and the loop of `{name}` is then unstable {}",
            range.name,
            range.max,
            over(shaken.name())
        );
        let diagnostic = Diagnostic::new(Code::LowMargin, range.span.clone(), message)
            .note(mode.place_of_gain(self.feature, key), format!("`{key}` is {} as written", self.value));
        // A range that ends below the gain as written is a mistake.
        let best = best.filter(|best| *best > self.value);
        let found = match best {
            Some(best) => {
                let kp = Some(best).filter(|_| self.key == "kp");
                let why = unmeasured(self.feature, contacts, shaken.name(), kp).unwrap_or_default();
                let help = format!("write `max = {best}` or less{why}");
                diagnostic.help(help).edit(Edit::Replace(range.span.clone(), format!("{best:?}")))
            }
            None => diagnostic.help("no larger gain keeps the margins: remove the line from `[live]`"),
        };
        Some((best.unwrap_or(self.value), found))
    }
}
