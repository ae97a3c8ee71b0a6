//! What `tune` has found, as text.

use std::fmt::Write;
use std::path::Path;

use tactflow_runtime::cli::table;

use super::cases::Stated;
use super::identify::Identified;
use super::propose::TunedFeature;
use super::save;
use super::settled::Held;
use super::step::{self, Step};
use super::tuned::Tuned;
use crate::tool::control::digits::{or_none, to_three_digits};

/// Columns of the table of answers.
const ANSWERS: [&str; 7] = ["contact", "motion", "per m or rad", "resonance", "damping", "latency", "frequencies"];
/// Columns of the table of margins.
const MARGINS: [&str; 6] = ["contact", "crossover", "phase margin", "gain margin", "peak", "bandwidth"];

/// Columns of the table of gains that were compared by steps.
const CLIMBED: [&str; 5] = ["kp", "error over a step", "overshoot", "error at the end", ""];

pub(super) fn text(tuned: &Tuned) -> String {
    let mut text = String::new();
    for feature in &tuned.features {
        let _ = write!(text, "`{}` in the mode `{}`\n\n", feature.name, tuned.mode);
        text += &answers(&feature.answers);
        text += &climbed(feature);
        text += &gains(feature);
        text.push('\n');
    }
    text += &settled(tuned);
    text += &lines(tuned);
    text
}

fn answers(found: &[Identified]) -> String {
    let rows = found.iter().flat_map(|one| {
        one.fits.iter().map(|(component, fit)| {
            let (hz, damping) = fit.resonance.unzip();
            [
                one.object.clone(),
                (*component).to_owned(),
                to_three_digits(fit.gain).to_string(),
                or_none(hz, "Hz", 1),
                damping.map_or_else(String::new, |damping| format!("{damping:.2}")),
                format!("{:.0} ms", fit.latency * 1e3),
                format!("{}, {:.0} % off", fit.frequencies, fit.residual * 100.0),
            ]
        })
    });
    let rows: Vec<[String; 7]> = [ANSWERS.map(str::to_owned)].into_iter().chain(rows).collect();
    let mut text = if rows.len() > 1 { table(&rows, 2, 7) } else { String::new() };
    for (object, growth) in found.iter().filter_map(|one| Some((&one.object, one.growth?))) {
        let change = 100.0 * (growth - 1.0).abs();
        let (how, which) = if growth > 1.0 { ("larger", "it") } else { ("smaller", "the one before") };
        let _ = writeln!(
            text,
            "Over `{object}`, the largest motion has an answer that is {change:.0} % {how}: {which} counts."
        );
    }
    for (object, why) in found.iter().filter_map(|one| Some((&one.object, one.refused.as_ref()?))) {
        let _ = writeln!(text, "Not measured over `{object}`: {why}.");
    }
    text
}

/// The gains that were compared by steps.
fn climbed(feature: &TunedFeature) -> String {
    let Some(size) = feature.climbed.iter().flat_map(|rung| rung.steps.iter().flatten()).next().map(|step| step.size)
    else {
        return String::new();
    };
    let rows = feature.climbed.iter().map(|rung| {
        let kp = to_three_digits(rung.gains[0]).to_string();
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        match &rung.failure {
            Some(why) => [kp, String::new(), String::new(), String::new(), why.clone()],
            None => [
                kp,
                format!("{:.2} s", rung.worst(|step| step.error_s)),
                percent(rung.worst(|step| step.overshoot)),
                percent(rung.worst(|step| step.rest)),
                String::new(),
            ],
        }
    });
    let rows: Vec<[String; 5]> = [CLIMBED.map(str::to_owned)].into_iter().chain(rows).collect();
    let size = step::size(&feature.feature, size);
    format!("So gains are compared by steps of {size}, up and down:\n\n{}", table(&rows, 0, 4))
}

fn gains(feature: &TunedFeature) -> String {
    let Some([kp, ki, kd]) = feature.new else {
        let why = if feature.is_measured() {
            "No gain keeps the margins: the motion increases the error.\n"
        } else {
            "No gains are proposed.\n"
        };
        return why.into();
    };
    let [old_kp, old_ki, old_kd] = feature.old;
    let became = format!("kp {old_kp} becomes {kp}, ki {old_ki} becomes {ki}, kd {old_kd} becomes {kd}");
    if !feature.climbed.is_empty() {
        return format!("\n{became}. Its margins are not known.\n");
    }
    let rows = feature.answers.iter().zip(&feature.margins).map(|(found, margins)| {
        [
            found.object.clone(),
            or_none(margins.crossover_hz, "Hz", 2),
            or_none(margins.phase_deg, "deg", 0),
            or_none(margins.gain_db, "dB", 1),
            format!("{:.2}", margins.peak_sensitivity),
            margins.bandwidth(),
        ]
    });
    let rows: Vec<[String; 6]> = [MARGINS.map(str::to_owned)].into_iter().chain(rows).collect();
    format!("\n{became}:\n{}", table(&rows, 1, 6))
}

fn settled(tuned: &Tuned) -> String {
    let mut text = String::new();
    for one in &tuned.settled {
        let error =
            |held: &Held| held.error.map_or_else(|| "unknown".into(), |error| to_three_digits(error).to_string());
        let (old, new) = (error(&one.old), error(&one.new));
        let _ = write!(
            text,
            "Over `{}`, the error of `{}` is {old} with the old gains and {new} with the new ones (rms)",
            one.object, one.feature
        );
        let feature = tuned.features.iter().find(|feature| feature.name == one.feature);
        if let Some(((old, new), feature)) = one.old.step.zip(one.new.step).zip(feature) {
            let (size, old, new) = (step::size(&feature.feature, new.size), followed(&old), followed(&new));
            let _ = write!(text, ". A step of {size} {old} with the old gains, and {new} with the new ones");
        }
        match &one.failure {
            Some(why) => {
                let _ = writeln!(text, ": not good, {why}.");
            }
            None => text += ".\n",
        }
    }
    text
}

/// Returns how a step is followed, for a sentence.
fn followed(step: &Step) -> String {
    let overshoot = 100.0 * step.overshoot;
    match step.rise_s {
        Some(rise) => format!("reaches 90 % in {rise:.2} s and overshoots by {overshoot:.0} %"),
        None => "does not reach 90 %".to_owned(),
    }
}

/// The lines for the files.
fn lines(tuned: &Tuned) -> String {
    let mut text = String::new();
    for feature in &tuned.features {
        let (Some([kp, ki, kd]), Some(pid)) = (feature.new, &feature.feature.pid) else { continue };
        let _ = writeln!(text, "\n[nodes.{pid}]");
        let gains = [("kp", kp), ("ki", ki), ("kd", kd)].into_iter().filter(|(_, gain)| *gain != 0.0);
        for (key, gain) in gains {
            let _ = writeln!(text, "gains.{}.{key} = {gain:?}", feature.name);
        }
    }
    if !tuned.ranges.is_empty() {
        text += "\n[live]                              # in place of the old ranges\n";
    }
    for range in &tuned.ranges {
        let _ = writeln!(text, "{} = {}", range.name, range.value());
    }
    for Stated { file, contacts } in tuned.stated() {
        let file = file.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        let file = file.unwrap_or_else(|| "the bench".into());
        let _ = writeln!(text, "\n[facts.{}]                         # in {file}\ncontacts = [", tuned.arm);
        for contact in &contacts {
            let _ = writeln!(text, "    {},", save::value(contact));
        }
        text += "]\n";
    }
    text
}
