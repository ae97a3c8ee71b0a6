//! How late a feature moves the arm.

use std::fmt::Write;

use serde::Serialize;

use crate::tool::control::contacts::Contact;
use crate::tool::control::law::{Feature, Law};

/// The latency of one feature.
#[derive(Debug, Serialize)]
pub(super) struct Latency {
    pub(super) feature: String,
    /// From a change of the contact to the command: half of the time between two images on average, and the filters [s].
    /// The latency of the pad is not part of it.
    pub(super) to_command_s: f64,
    /// Latency that its pad states, from the contact to the arrival of its image [s].
    pub(super) of_pad_s: f64,
    /// From the command to the image that shows its effect, over each contact that says how the feature answers.
    pub(super) to_image: Vec<ToImage>,
}

/// The latency of arm and pad over one contact.
#[derive(Debug, Serialize)]
pub(super) struct ToImage {
    pub(super) object: String,
    /// `None` where a measured response contains it [s].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) latency_s: Option<f64>,
}

/// Returns the latencies of the features that move the arm.
pub(super) fn latencies(declared: &[Contact], law: &Law) -> Vec<Latency> {
    let over = |feature: &Feature, contact: &Contact| {
        let quantity = feature.quantity()?;
        let answer = contact.answer(quantity)?;
        let stated = contact.stated_latency_s(quantity);
        let latency_s = Some(stated).filter(|_| answer.response.is_empty());
        (latency_s != Some(0.0)).then(|| ToImage { object: contact.object.clone(), latency_s })
    };
    let moving = law.features.iter().filter(|feature| feature.moves());
    let latency = |feature: &Feature| Latency {
        feature: feature.name.clone(),
        to_command_s: 0.5 * feature.period_s + feature.delay(),
        of_pad_s: feature.latency_s,
        to_image: declared.iter().filter_map(|contact| over(feature, contact)).collect(),
    };
    moving.map(latency).collect()
}

/// Says how late the features move the arm; nothing if none does.
pub(super) fn text(latencies: &[Latency]) -> String {
    if latencies.is_empty() {
        return String::new();
    }
    let to_command = grouped(latencies.iter().map(|one| (Some(one.to_command_s), format!("`{}`", one.feature))));
    let mut text = format!(
        "From a change of the contact to the command: {to_command}. This is half of the time between two images, and the \
         filters.\n"
    );
    let late = latencies.iter().filter(|one| one.of_pad_s > 0.0);
    let of_pad = grouped(late.map(|one| (Some(one.of_pad_s), format!("`{}`", one.feature))));
    if !of_pad.is_empty() {
        let _ = writeln!(text, "Latency that the pad states: {of_pad}. It counts where the bench has measured none.");
    }
    let of_object = |one: &Latency| {
        let at = |to: &ToImage| (to.latency_s, format!("`{}` over `{}`", one.feature, to.object));
        one.to_image.iter().map(at).collect::<Vec<_>>()
    };
    let to_image = grouped(latencies.iter().flat_map(of_object));
    if !to_image.is_empty() {
        let _ = writeln!(text, "From the command to the image of its effect, with the latency of the pad: {to_image}.");
    }
    text
}

/// Lists what has each latency, such as "2 ms for `x`, `y`; 70 ms for `pressure`".
fn grouped(found: impl Iterator<Item = (Option<f64>, String)>) -> String {
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for (seconds, name) in found {
        let ms = |seconds: f64| format!("{} ms", format!("{:.1}", 1e3 * seconds).trim_end_matches(".0"));
        let time = seconds.map_or_else(|| "as in the measured response".to_owned(), ms);
        match groups.iter_mut().find(|(other, _)| *other == time) {
            Some((_, names)) => names.push(name),
            None => groups.push((time, vec![name])),
        }
    }
    let of_group = |(time, names): &(String, Vec<String>)| format!("{time} for {}", names.join(", "));
    groups.iter().map(of_group).collect::<Vec<_>>().join("; ")
}
