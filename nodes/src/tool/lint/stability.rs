//! Loops that are near instability over a contact, and filters that take their margin.

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::ops::Range;

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit};

use super::arm::Arm;
use super::faster_filters::{Faster, faster, time_key};
use super::mode_law::ModeLaw;
use crate::tool::control::choose::{Wanted, factor};
use crate::tool::control::contacts::Contact;
use crate::tool::control::digits::{down_to_two_digits, to_three_digits};
use crate::tool::control::filters::Filter;
use crate::tool::control::law::Feature;
use crate::tool::control::margins::{Margins, margins, rough_margins};
use crate::tool::control::response::Loop;
use crate::tool::control::shape::Shape;
use crate::usual::FIRST_GAIN;

/// What a loop has to keep over each contact.
pub(super) const KEPT: Wanted = Wanted { peak: 1.8, gain_db: 8.0, phase_deg: 0.0 };
/// Margins that the rough sweep may show too large, and that still keep [`KEPT`].
const AMPLE: Wanted = Wanted { peak: 1.4, gain_db: 12.0, phase_deg: 55.0 };
/// Largest lag of the filters where the gain is 1, in a loop with less than [`GOOD_PHASE`] [deg]. An integrator leaves
/// 90 degrees of phase, and this is a third of them.
const MAX_LAG: f64 = 30.0;
/// Phase margin from which on no filter is too slow [deg].
const GOOD_PHASE: f64 = 50.0;
/// Delay of filters from which on they are the cause of a low margin: that of a loop with the usual 3.5 1/s [s].
const LONG_DELAY: f64 = 0.25;
/// Gain of one period at which `pid` itself warns [1].
const DIVERGES: f64 = 2.0;

/// A loop, and what its filters do to it.
struct JudgedLoop {
    margins: Margins,
    /// Lag of the filters where the gain is 1, and 0 if it never is [deg].
    lag: f64,
}

impl JudgedLoop {
    /// Returns whether the filters take the phase margin of the loop.
    fn is_slow(&self) -> bool {
        let Margins { is_stable, phase_deg, .. } = self.margins;
        let has_phase = is_stable && phase_deg.is_none_or(|phase| phase >= GOOD_PHASE);
        self.lag > MAX_LAG && !has_phase
    }

    /// Returns whether the loop keeps its margins with filters that are quick enough.
    fn is_good(&self) -> bool {
        KEPT.holds(&self.margins) && !self.is_slow()
    }
}

/// Judges a loop with the filters of a feature.
fn judge_loop(feature: &Feature, around: &Loop) -> JudgedLoop {
    let margins = margins(around);
    let omega = |hz: f64| 2.0 * std::f64::consts::PI * hz;
    let lag = |hz: f64| {
        let responses = feature.filters.iter().map(|filter| filter.shape.response(omega(hz), around.period));
        responses.map(|response| -response.arg().to_degrees()).sum()
    };
    JudgedLoop { margins, lag: margins.crossover_hz.map_or(0.0, lag) }
}

/// A loop over a contact that was not ample.
struct Found<'a> {
    object: Option<&'a str>,
    judged: JudgedLoop,
}

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let mut found = Diagnostics::new();
    let contacts = &*arm.contacts_or_geometry();
    // Most modes have the same loops.
    let mut seen = BTreeSet::new();
    for mode in &arm.modes {
        let period = mode.nodes.period();
        for feature in mode.moving().filter(|feature| feature.kp > 0.0 && feature.kp * period < DIVERGES) {
            let is_judged = is_known(mode, feature, contacts) && is_largest(feature, contacts);
            if is_judged && seen.insert(key(feature)) {
                found.extend(judge(mode, feature, contacts));
            }
        }
    }
    found
}

/// Returns whether a loop has the largest gain of those that answer its measurement together: the first one of equal
/// ones. The others have the same margins.
fn is_largest(feature: &Feature, contacts: &[Contact]) -> bool {
    let gain = |one: &Feature| {
        let answers = contacts.iter().filter_map(|contact| contact.answer(one.quantity()?));
        answers.map(|answer| (one.kp * answer.along(&one.column)).abs()).fold(0.0, f64::max)
    };
    feature.beside.iter().all(|other| match gain(feature).total_cmp(&gain(other)) {
        Ordering::Equal => feature.id() <= other.id(),
        found => found == Ordering::Greater,
    })
}

/// Returns whether geometry or a contact of the bench says how a feature answers.
pub(super) fn is_known(mode: &ModeLaw<'_>, feature: &Feature, contacts: &[Contact]) -> bool {
    let is_stated = |quantity: &str| contacts.iter().any(|contact| contact.features.contains_key(quantity));
    mode.quantity(feature).is_some() || feature.quantity().is_some_and(is_stated)
}

/// Returns what makes the loops of two features the same.
fn key(feature: &Feature) -> String {
    let of = |one: &Feature| {
        let shapes: Vec<Shape> = one.filters.iter().map(|filter| filter.shape).collect();
        format!("{:?}", (one.id(), one.column, [one.kp, one.ki, one.kd], shapes))
    };
    std::iter::once(feature).chain(&feature.beside).map(of).collect()
}

fn judge(mode: &ModeLaw<'_>, feature: &Feature, contacts: &[Contact]) -> Option<Diagnostic> {
    let loops = contacts.iter().filter_map(|contact| Some((contact, Loop::over(feature, contact)?)));
    let loops: Vec<(&Contact, Loop)> = loops.filter(|(_, around)| !around.is_reversed()).collect();
    let all: Vec<Found<'_>> = loops
        .iter()
        .filter(|(_, around)| !AMPLE.holds(&rough_margins(around)))
        .map(|(contact, around)| Found { object: contact.name(), judged: judge_loop(feature, around) })
        .collect();
    let peak = |found: &&Found<'_>| match found.judged.margins {
        Margins { is_stable: true, peak_sensitivity, .. } => peak_sensitivity,
        _ => f64::INFINITY,
    };
    let worst = |is: &dyn Fn(&Found<'_>) -> bool| {
        all.iter().filter(|found| is(found)).max_by(|one, other| peak(one).total_cmp(&peak(other)))
    };
    let low = worst(&|found| !KEPT.holds(&found.judged.margins));
    let slow = worst(&|found| found.judged.is_slow()).filter(|_| low.is_none() || feature.delay() > LONG_DELAY);
    match (slow, low) {
        (Some(slow), low) => slow_filter(mode, feature, contacts, slow)
            .or_else(|| low.map(|low| low_margin(mode, feature, (contacts, &loops), low))),
        (_, Some(low)) => Some(low_margin(mode, feature, (contacts, &loops), low)),
        _ => None,
    }
}

/// Returns how a message names a contact.
pub(super) fn over(object: Option<&str>) -> String {
    object.map_or_else(|| "by geometry alone".into(), |object| format!("over `{object}`"))
}

/// Returns the margins of a loop for a message.
fn figures(margins: &Margins) -> String {
    let peak = format!("the peak of its sensitivity is {:.2}", margins.peak_sensitivity);
    let gain = margins.gain_db.map(|db| format!("its gain margin {db:.1} dB"));
    let phase = margins.phase_deg.map(|phase| format!("its phase margin {}°", libm::floor(phase)));
    match (gain, phase) {
        (Some(gain), Some(phase)) => format!("{peak}, {gain} and {phase}"),
        (one, other) => one.or(other).map_or_else(|| peak.clone(), |one| format!("{peak}, and {one}")),
    }
}

/// Returns what to say of a pad whose latency takes more of the phase than a filter may.
fn late(feature: &Feature, contacts: &[Contact], low: &Found<'_>) -> String {
    let counts = || {
        let contact = contacts.iter().find(|contact| contact.name() == low.object)?;
        let latency = contact.latency_s(feature.quantity()?, feature.latency_s);
        Some(latency > 0.0 && latency == feature.latency_s)
    };
    let turns = low.judged.margins.crossover_hz.map_or(0.0, |hz| hz * feature.latency_s);
    match counts().unwrap_or(false) && 360.0 * turns > MAX_LAG {
        true => format!("; its pad is {} ms late", to_three_digits(1e3 * feature.latency_s)),
        false => String::new(),
    }
}

fn low_margin(
    mode: &ModeLaw<'_>,
    feature: &Feature,
    (contacts, loops): (&[Contact], &[(&Contact, Loop)]),
    low: &Found<'_>,
) -> Diagnostic {
    let (name, place) = (&feature.name, mode.place_of_gain(feature, "kp"));
    let message = match low.judged.margins.is_stable {
        true => {
            format!("the loop of `{name}` is near instability {}: {}", over(low.object), figures(&low.judged.margins))
        }
        false => format!("the loop of `{name}` is unstable {}", over(low.object)),
    };
    let message = message + &late(feature, contacts, low);
    let diagnostic = Diagnostic::new(Code::LowMargin, place, message);
    let diagnostic = match slowest(feature).filter(|_| low.judged.lag > MAX_LAG) {
        Some((_, filter)) => diagnostic.note(
            mode.place(&filter.node, ""),
            format!("the filters delay `{name}` by {:.0} ms in all, most of them this one", feature.delay() * 1e3),
        ),
        None => diagnostic,
    };
    let diagnostic = match mode.place_of_own_column(feature) {
        Some(place) => diagnostic
            .note(place, format!("{}this column counts: smaller entries here are another way out", mode.prefix())),
        None => diagnostic,
    };
    let diagnostic = feature.added(contacts).fold(diagnostic, |diagnostic, other| {
        let why = if other.measured == feature.measured { "answer the same measurement" } else { "move `vz`" };
        let note = format!("the loop of `{}` adds to it: both {why}", other.name);
        diagnostic.note(mode.place_of_gain(other, "kp"), note)
    });
    let diagnostic = scheduled(mode, feature, contacts, low.object)
        .into_iter()
        .fold(diagnostic, |diagnostic, (place, note)| diagnostic.note(place, note));
    let loops: Vec<Loop> = loops.iter().map(|(_, around)| around.clone()).collect();
    if let Some((kd, without)) = undamped(mode, feature, &loops) {
        return diagnostic
            .help(format!("remove `kd` of `{name}`: without it, the margins hold"))
            .edit(Edit::Replace(kd, without));
    }
    let Some(factor) =
        factor(&loops, KEPT).filter(|factor| *factor < 1.0).and_then(|factor| quick(feature, &loops, factor))
    else {
        return without_gain(mode, feature, &loops, diagnostic);
    };
    let gains = [("kp", feature.kp), ("ki", feature.ki), ("kd", feature.kd)];
    let gains = gains.map(|(key, gain)| (key, down_to_two_digits(gain * factor)));
    let written = gains.iter().filter(|(_, gain)| *gain != 0.0);
    let text: Vec<String> = written.clone().map(|(key, gain)| format!("`{key} = {gain}`")).collect();
    let why = unmeasured(feature, contacts, low.object, Some(feature.kp * factor)).unwrap_or_default();
    let help = format!("write {} or less in the gains of `{name}`{why}", text.join(" and "));
    let places: Vec<_> = written.map(|(key, gain)| (mode.place_of_gain(feature, key), gain)).collect();
    places.into_iter().fold(diagnostic.help(help), |diagnostic, (place, gain)| {
        diagnostic.edit(Edit::Replace(place, format!("{gain:?}")))
    })
}

/// Returns a warning with the way out of a loop that keeps its margins with no smaller gains in the same ratio: with a
/// smaller integral, if that is enough.
fn without_gain(mode: &ModeLaw<'_>, feature: &Feature, loops: &[Loop], diagnostic: Diagnostic) -> Diagnostic {
    let is_good = |around: Loop| judge_loop(feature, &around).is_good();
    let holds = |share: &f64| loops.iter().all(|around| is_good(around.with_integral_share(*share)));
    let mut shares = std::iter::successors(Some(0.9), |share| Some(share * 0.9)).take(66).filter(|_| feature.ki > 0.0);
    if let Some(ki) = shares.find(holds).map(|share| down_to_two_digits(feature.ki * share)) {
        let place = mode.place_of_gain(feature, "ki");
        return Diagnostic { span: place.clone(), ..diagnostic }
            .help(format!("write `ki = {ki}` or less in the gains of `{}`", feature.name))
            .edit(Edit::Replace(place, format!("{ki:?}")));
    }
    if let Some([kp, ki]) = both(feature, loops) {
        let help = format!("write `kp = {kp}` and `ki = {ki}` in the gains of `{}`", feature.name);
        let edits = [("kp", kp), ("ki", ki)];
        return edits.into_iter().fold(diagnostic.help(help), |diagnostic, (key, gain)| {
            diagnostic.edit(Edit::Replace(mode.place_of_gain(feature, key), format!("{gain:?}")))
        });
    }
    let has_filters = feature.filters.iter().any(|filter| filter.shape.smooths());
    diagnostic.help(match has_filters {
        true => "no smaller gain keeps the margins: use faster filters",
        false => "no smaller gain keeps the margins",
    })
}

/// Returns the largest `kp` that keeps the margins of all loops with some integral, and that integral: where the filters
/// are slow, a smaller `kp` alone leaves too much of it.
fn both(feature: &Feature, loops: &[Loop]) -> Option<[f64; 2]> {
    if feature.ki == 0.0 || feature.kd != 0.0 {
        return None;
    }
    let smaller = |ratio: f64| std::iter::successors(Some(ratio), move |share| Some(share * ratio)).take(20);
    let is_good = |factor: f64, share: f64| {
        let judged = |around: &Loop| judge_loop(feature, &around.times(factor).with_integral_share(share));
        loops.iter().all(|around| judged(around).is_good())
    };
    let found = smaller(0.8).find_map(|factor| Some([factor, smaller(0.7).find(|share| is_good(factor, *share))?]));
    let [factor, share] = found?;
    Some([feature.kp * factor, feature.ki * factor * share].map(down_to_two_digits))
}

/// Returns the gain of a loop with which the recipe of docs/control.md begins [1/s]: 0.5 / T, with all delays T.
pub(super) fn first_gain(feature: &Feature) -> f64 {
    (0.5 / (feature.delay() + feature.latency_s + 0.5 * feature.period_s)).min(FIRST_GAIN)
}

/// Returns what to say of gains that are chosen by geometry, because the bench does not say how the object answers. A
/// `kp` above that of the recipe is not named without it.
pub(super) fn unmeasured(
    feature: &Feature,
    contacts: &[Contact],
    object: Option<&str>,
    kp: Option<f64>,
) -> Option<String> {
    let contact = contacts.iter().find(|contact| contact.name() == object)?;
    let quantity = feature.quantity().filter(|quantity| contact.is_by_geometry(quantity))?;
    let first = first_gain(feature) / contact.answer(quantity)?.along(&feature.column).abs();
    let begin = kp.filter(|kp| first < *kp).map_or_else(String::new, |_| {
        format!("Begin with `kp = {}`, as in the recipe of docs/control.md. ", down_to_two_digits(first))
    });
    Some(format!(
        ". This number leaves out the arm, so the true one is smaller. {begin}The bench states neither a resonance nor a response of `{quantity}`: \
         `tactflow tune` measures it"
    ))
}

/// Returns what to say of each schedule that makes the gains larger over an object.
fn scheduled(
    mode: &ModeLaw<'_>,
    feature: &Feature,
    contacts: &[Contact],
    object: Option<&str>,
) -> Vec<(Range<usize>, String)> {
    let Some(contact) = contacts.iter().find(|contact| contact.name() == object) else { return Vec::new() };
    let larger = feature.schedules.iter().filter_map(|schedule| {
        let factor = schedule.factor(contact).filter(|factor| *factor > 1.0)?;
        let note = format!("`{}` multiplies the gains by {factor:.1} {}", schedule.node, over(object));
        Some((mode.place(&schedule.node, "max"), note))
    });
    larger.collect()
}

/// Returns the place of a derivative gain that alone takes the margins of all loops, and what stands there without it.
fn undamped(mode: &ModeLaw<'_>, feature: &Feature, loops: &[Loop]) -> Option<(Range<usize>, String)> {
    let is_good = |around: &Loop| judge_loop(feature, &around.without_derivative()).is_good();
    (feature.kd > 0.0 && loops.iter().all(is_good)).then(|| (mode.place_of_gain(feature, "kd"), "0.0".to_owned()))
}

/// Returns the largest factor on the gains, up to a first one, with which the filters are quick enough for each loop.
fn quick(feature: &Feature, loops: &[Loop], first: f64) -> Option<f64> {
    let is_quick = |factor: f64| loops.iter().all(|around| judge_loop(feature, &around.times(factor)).is_good());
    std::iter::successors(Some(first), |factor| Some(factor * 0.95)).take(40).find(|factor| is_quick(*factor))
}

/// Returns the filter with the largest delay, and its number.
fn slowest(feature: &Feature) -> Option<(usize, &Filter)> {
    let filters = feature.filters.iter().enumerate().filter(|(_, filter)| filter.shape.smooths());
    filters.max_by(|(_, one), (_, other)| one.delay_s.total_cmp(&other.delay_s))
}

fn slow_filter(mode: &ModeLaw<'_>, feature: &Feature, contacts: &[Contact], slow: &Found<'_>) -> Option<Diagnostic> {
    let (i, slowest) = slowest(feature)?;
    let key = time_key(mode, slowest);
    let name = &feature.name;
    let left = match slow.judged.margins.phase_deg.filter(|_| slow.judged.margins.is_stable) {
        Some(phase) => format!("a phase margin of {}° is left", libm::floor(phase)),
        None => "the loop is unstable".into(),
    };
    let message = format!(
        "the filters of `{name}` take {:.0}° of the phase where the gain of its loop is 1, and {left} {}: `{}` delays it by \
         {:.0} ms",
        slow.judged.lag,
        over(slow.object),
        slowest.node,
        slowest.delay_s * 1e3
    );
    let place = mode.place(&slowest.node, key.unwrap_or_default());
    let diagnostic = Diagnostic::new(Code::SlowFilter, place.clone(), message);
    let changes = faster(mode, feature, i, |feature| {
        let mut loops = contacts.iter().filter_map(|contact| Loop::over(feature, contact));
        loops.all(|around| judge_loop(feature, &around).is_good())
    });
    let Some(changes) = changes else { return Some(diagnostic.help("use faster filters, or smaller gains")) };
    let text: Vec<String> = changes.iter().map(Faster::text).collect();
    let help = format!("write {}, or smaller gains of `{name}`", text.join(" and "));
    // A default is written nowhere, so it has no text to replace.
    let written = changes.into_iter().filter(|change| !change.is_default);
    Some(written.fold(diagnostic.help(help), |diagnostic, change| {
        diagnostic.edit(Edit::Replace(change.place, change.value.to_string()))
    }))
}
