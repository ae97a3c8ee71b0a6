//! How a feature answers the motion over one contact.

use serde::{Serialize, Serializer};
use tactflow_runtime::cli::Shell;

use super::Stop;
use super::amplitudes::{Response, Unknown, agreed};
use super::experiment::{Experiment, known};
use super::fit::{ENOUGH, Fit, fit};
use super::limited::Limited;
use super::spectrum::Line;
use crate::motion::COMPONENTS;
use crate::tool::control::contacts::Answer;
use crate::tool::control::digits::{to_three_digits, to_two_digits};
use crate::tool::control::law::Feature;

/// The answer of a feature over one contact.
#[derive(Debug, Serialize)]
pub(super) struct Identified {
    pub(super) object: String,
    /// For each component that moves the feature: its number, and the fit.
    #[serde(serialize_with = "by_name")]
    pub(super) fits: Vec<(usize, Fit)>,
    /// What was measured, for each component.
    #[serde(skip)]
    pub(super) lines: Vec<Vec<Line>>,
    /// The answer to the largest motion as a multiple of that to the one before, if no two motions agree [1].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) growth: Option<f64>,
    /// The limit that acted much while it was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) limited: Option<Limited>,
    /// How far the sensor moves after a turn until the feature follows [m] or [rad]; `None` if it follows at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) play: Option<f64>,
    /// Amplitude of the motion that lifts the pad off, if no two smaller ones agree [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) lifts_off: Option<f64>,
    /// Why there is no fit.
    pub(super) refused: Option<String>,
    /// What hides the response, if there is no fit.
    #[serde(skip)]
    pub(super) unknown: Option<Unknown>,
}

/// Part of the answer by geometry below which a contact sticks [1].
const LEAST_SLIDE: f64 = 0.5;

/// Part of the response that a fit may leave unexplained [1].
const MAX_RESIDUAL: f64 = 0.3;
/// The same for a place of which no two test signals say the same: each motion has another friction [1].
const MAX_RESIDUAL_SLIDING: f64 = 0.2;

/// Measures how a feature answers each component that moves it.
pub(super) fn identify(experiment: &Experiment<'_>, object: &str, shell: &Shell) -> Result<Identified, Stop> {
    let Experiment { feature, .. } = *experiment;
    let mut found = Identified {
        object: object.to_owned(),
        fits: Vec::new(),
        lines: Vec::new(),
        growth: None,
        limited: None,
        play: None,
        lifts_off: None,
        refused: None,
        unknown: None,
    };
    for component in (0..6).filter(|i| feature.column[*i] != 0.0) {
        let (response, play) = agreed(experiment, component, shell)?;
        found.play = found.play.or_else(|| play.map(|play| to_two_digits(play, libm::round)));
        let unknown = match response.as_ref().err().map_or(Unknown::Hidden, |refusal| refusal.kind) {
            // With the same gains, a motion along another component has not lost the contact.
            Unknown::Lost if !found.fits.is_empty() => Unknown::Hidden,
            kind => kind,
        };
        let fitted = response
            .map_err(|refusal| refusal.why)
            .and_then(|response| Ok((fitted(feature, component, &response)?, response)));
        match fitted {
            Ok((fit, Response { lines, growth, limited, lifts_off })) => {
                found.fits.push((component, fit));
                found.lines.push(lines);
                found.growth = growth.or(found.growth);
                found.limited = limited.or(found.limited);
                found.lifts_off = lifts_off.or(found.lifts_off);
            }
            Err(why) => {
                (found.refused, found.unknown) = (Some(why), Some(unknown));
                break;
            }
        }
    }
    Ok(found)
}

/// Fits the response to one component.
///
/// # Errors
/// If noise or friction leave it unknown.
fn fitted(feature: &Feature, component: usize, response: &Response) -> Result<Fit, String> {
    let quantity = quantity(feature);
    let fit = fit(&response.lines, known(feature, component)).map_err(|few| {
        let all = response.lines.len();
        format!("only {few} of {all} frequencies stand out of the noise, and a fit needs {ENOUGH}")
    })?;
    let slides = response.growth.is_some() && Answer::of_geometry(quantity).is_some();
    let (most, also) = match slides {
        true => (MAX_RESIDUAL_SLIDING, ", and no two test signals agree"),
        false => (MAX_RESIDUAL, ""),
    };
    let percent = 100.0 * fit.residual;
    if fit.residual > most {
        return Err(format!(
            "a gain, a resonance and a latency leave {percent:.0} % of the response unexplained{also}"
        ));
    }
    if sticks(quantity, component, &fit) {
        return Err(format!("friction holds the contact: it follows {:.0} % of the motion", 100.0 * fit.gain.abs()));
    }
    Ok(fit)
}

/// Returns whether a feature follows a motion by less than half of what geometry says, or the wrong way.
fn sticks(quantity: &str, component: usize, fit: &Fit) -> bool {
    let slides = Answer::of_geometry(quantity).unwrap_or_default().row()[component];
    slides != 0.0 && fit.gain / slides < LEAST_SLIDE
}

/// Returns the answer of a feature to all components. The resonance and the latency are those of the first one, and the
/// measured response is that of one which is alone.
///
/// A contact that sticks follows a small motion only in part. It can slide at any time, so what geometry says counts if
/// it is more, or if the response is not known.
pub(super) fn answer(feature: &Feature, found: &Identified) -> Answer {
    let geometry = Answer::of_geometry(quantity(feature)).unwrap_or_default().row();
    if found.refused.is_some() {
        return Answer { play: found.play, ..Answer::of_geometry(quantity(feature)).unwrap_or_default() };
    }
    let mut answer = Answer::default();
    for (component, fit) in &found.fits {
        let slides = geometry[*component];
        let change = if slides.abs() > fit.gain.abs() { slides } else { to_three_digits(fit.gain) };
        answer.set_entry(*component, change);
    }
    answer.play = found.play;
    let Some((_, main)) = found.fits.first() else { return answer };
    if let ([(component, fit)], [lines]) = (&found.fits[..], &found.lines[..]) {
        answer.response = fit.response(lines, known(feature, *component));
    }
    answer.resonance_hz = main.resonance.map(|(hz, _)| to_three_digits(hz));
    answer.damping_ratio = main.resonance.map(|(_, damping)| to_three_digits(damping));
    answer.latency_ms = Some((main.latency * 1e4).round() / 10.0);
    answer
}

/// Returns the name of what a feature measures; "" for one without, which is not tuned.
pub(super) fn quantity(feature: &Feature) -> &str {
    feature.quantity().unwrap_or_default()
}

/// Writes the fits with the names of their components.
fn by_name<S: Serializer>(fits: &[(usize, Fit)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(fits.iter().map(|(component, fit)| (COMPONENTS[*component], fit)))
}
