//! The largest gains that keep their margins over all contacts.

use serde::Serialize;

use super::margins::{Margins, margins};
use super::response::Loop;

/// What a loop must keep in the worst case.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Wanted {
    /// Largest peak of the sensitivity [1].
    pub(crate) peak: f64,
    /// Smallest gain margin [dB].
    pub(crate) gain_db: f64,
    /// Smallest phase margin [deg].
    pub(crate) phase_deg: f64,
}

impl Default for Wanted {
    fn default() -> Self {
        Self { peak: 1.7, gain_db: 9.0, phase_deg: 50.0 }
    }
}

impl Wanted {
    /// Returns whether a loop keeps them.
    pub(crate) fn holds(self, found: &Margins) -> bool {
        self.broken(found).is_none()
    }

    /// Returns what a loop does not keep, for a sentence; `None` if it keeps all.
    fn broken(self, found: &Margins) -> Option<String> {
        let gain = found.gain_db.filter(|db| *db < self.gain_db).map(|db| format!("a gain margin of {db:.1} dB"));
        let phase = found.phase_deg.filter(|deg| *deg < self.phase_deg);
        let phase = || phase.map(|deg| format!("a phase margin of {deg:.0} deg"));
        let peak = Some(found.peak_sensitivity).filter(|peak| *peak > self.peak);
        let peak = || peak.map(|peak| format!("a peak of the sensitivity of {peak:.2}"));
        let unstable = (!found.is_stable).then(|| "no margins: it is unstable".to_owned());
        unstable.or(gain).or_else(phase).or_else(peak)
    }
}

/// Returns which of the loops allows no larger gains than these: its number, and the margin that a tenth more would break,
/// for a sentence.
pub(crate) fn bound(loops: &[Loop], wanted: Wanted) -> Option<(usize, String)> {
    let broken = |around: &Loop| wanted.broken(&margins(&around.times(STEP)));
    let bounds = loops.iter().enumerate().filter_map(|(i, around)| Some((i, around, broken(around)?)));
    let most = |around: &Loop| factor(std::slice::from_ref(around), wanted).unwrap_or_default();
    let (which, _, margin) = bounds.min_by(|(_, a, _), (_, b, _)| most(a).total_cmp(&most(b)))?;
    Some((which, margin))
}

/// Ratio of two neighbouring gains that are tried, before the last ones are halved.
const STEP: f64 = 1.1;
/// Gain of a controller around its loop in one period above which nothing is tried [1].
const MAX_SHARE: f64 = 0.5;

/// Returns the largest factor on all gains of a feature up to which each of its loops keeps the margins; `None` if there
/// is none. With an integral, the margins do not hold for very small gains.
pub(crate) fn factor(loops: &[Loop], wanted: Wanted) -> Option<f64> {
    let share = |around: &Loop| around.own_proportional().abs() * around.period;
    let is_tried = |factor: f64| loops.iter().all(|around| share(around) * factor < MAX_SHARE);
    let holds =
        |factor: f64| is_tried(factor) && loops.iter().all(|around| wanted.holds(&margins(&around.times(factor))));
    // From a crossover that is far below the rate of the graph.
    let mut low = loops.iter().map(|around| 1e-4 / share(around)).reduce(f64::min)?;
    while !holds(low) {
        low *= STEP;
        if !is_tried(low) {
            return None;
        }
    }
    while holds(low * STEP) {
        low *= STEP;
    }
    let mut high = low * STEP;
    for _ in 0..5 {
        let middle = (low * high).sqrt();
        if holds(middle) { low = middle } else { high = middle }
    }
    Some(low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::control::contacts::{Answer, Contact};
    use crate::tool::control::law::Feature;

    fn around(gain: f64, delay: f64) -> Loop {
        with_integral(gain, delay, 0.0)
    }

    fn with_integral(gain: f64, delay: f64, ki: f64) -> Loop {
        let feature = Feature {
            name: "pressure".into(),
            column: [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            kp: 1.0,
            ki,
            period_s: 1e-4,
            ..Feature::default()
        };
        Loop::new(&feature, &Answer { vz: Some(gain), ..Answer::default() }, delay)
    }

    #[test]
    fn the_loop_and_the_margin_that_allow_no_more_are_named() {
        let loops = [around(1.0, 0.05), around(1.0, 0.1)];
        let factor = factor(&loops, Wanted::default()).unwrap();
        let (slow, why) = bound(&loops.map(|around| around.times(factor)), Wanted::default()).unwrap();
        assert_eq!((slow, why.as_str()), (1, "a gain margin of 8.2 dB"));
        let loose = Wanted { gain_db: 3.0, phase_deg: 10.0, ..Wanted::default() };
        assert_eq!(bound(&[around(1.0, 0.1)], loose), None, "far from all margins");
        let found = margins(&around(6.4, 0.1));
        for (wanted, why) in [
            (Wanted { gain_db: 3.0, ..Wanted::default() }, "a peak of the sensitivity of"),
            (Wanted { gain_db: 3.0, phase_deg: 60.0, ..Wanted::default() }, "a phase margin of 53 deg"),
        ] {
            let broken = wanted.broken(&found).unwrap();
            assert!(broken.starts_with(why), "{broken}");
        }
    }

    #[test]
    fn the_gain_is_that_of_the_closed_form_and_the_worst_contact_decides() {
        // With a delay, the phase is 90 deg - kp g delay, and the gain margin pi / (2 kp g delay).
        let wanted = Wanted { peak: 9.0, gain_db: 0.0, phase_deg: 50.0 };
        let found = factor(&[around(2.0, 0.05)], wanted).unwrap();
        let exact = 40.0_f64.to_radians() / (2.0 * 0.05);
        assert!((found / exact - 1.0).abs() < 0.03, "{found} and {exact}");
        let both = factor(&[around(2.0, 0.05), around(6.0, 0.05)], wanted).unwrap();
        assert!((both / (exact / 3.0) - 1.0).abs() < 0.03, "{both}");
        let wanted = Wanted { peak: 9.0, gain_db: 9.0, phase_deg: 0.0 };
        let found = factor(&[around(2.0, 0.05)], wanted).unwrap();
        let exact = std::f64::consts::PI / (2.0 * 2.0 * 0.05) / 10.0_f64.powf(9.0 / 20.0);
        assert!((found / exact - 1.0).abs() < 0.03, "{found} and {exact}");
    }

    #[test]
    fn an_integral_does_not_hide_the_gains_that_hold() {
        let (with, without) = (with_integral(2.0, 0.05, 0.2), around(2.0, 0.05));
        let [with, without] = [with, without].map(|one| factor(&[one], Wanted::default()).unwrap());
        assert!(with < without && with > 0.8 * without, "{with} and {without}");
    }

    #[test]
    fn a_loop_beside_does_not_bound_the_gains_that_are_tried() {
        // The loop beside has nine times the gain. If it counted, nothing above a factor of 50 would be tried.
        let feature = |name: &str, kp: f64| Feature {
            name: name.into(),
            column: [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            kp,
            period_s: 0.01,
            measured: Some("moments.pressure".into()),
            ..Feature::default()
        };
        let both = Feature { beside: vec![feature("other", 9.0)], ..feature("pressure", 1.0) };
        let mut contact = Contact::unmeasured("ball".into());
        contact.features.insert("pressure".into(), Answer { vz: Some(0.1), ..Answer::default() });
        contact.latency_ms = 10.0;
        let around = Loop::over(&both, &contact).unwrap();
        let wanted = Wanted { peak: 9.0, gain_db: 0.0, phase_deg: 50.0 };
        let (found, sum) = (factor(std::slice::from_ref(&around), wanted).unwrap(), around.proportional());
        assert!((sum - 1.0).abs() < 1e-9 && found > 100.0, "{found} and {sum}");
    }

    #[test]
    fn a_reversed_loop_has_no_gain() {
        assert_eq!(factor(&[around(-2.0, 0.05)], Wanted::default()), None);
    }
}
