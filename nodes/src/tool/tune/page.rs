//! What `tune` has found, as text.

use std::fmt::Write;
use std::path::Path;

use tactflow_runtime::cli::table;
use tactflow_runtime::graph::Outline;

use super::amplitudes::Unknown;
use super::cases::Stated;
use super::climb;
use super::contact_tables;
use super::identify::Identified;
use super::limited::Limited;
use super::propose::{Bound, TunedFeature};
use super::settled::Held;
use super::step::{self, Step};
use super::tuned::Tuned;
use crate::motion::COMPONENTS;
use crate::tool::control::digits::{or_none, to_three_digits};
use crate::tool::control::law::Feature;

/// Columns of the table of answers.
const ANSWERS: [&str; 7] = ["contact", "motion", "per m or rad", "resonance", "damping", "latency", "frequencies"];
/// Columns of the table of margins.
const MARGINS: [&str; 6] = ["contact", "crossover", "phase margin", "gain margin", "peak", "bandwidth"];
/// Columns of the table of gains that were compared by steps.
const CLIMBED: [&str; 5] = ["kp", "error over a step", "overshoot", "error at the end", ""];

pub(super) fn text(tuned: &Tuned) -> String {
    let mut text = String::new();
    let resting: Vec<String> = tuned.resting.iter().map(|node| format!("`{node}`")).collect();
    if !resting.is_empty() {
        let rest = if resting.len() > 1 { "rest" } else { "rests" };
        let _ = writeln!(text, "Measured and compared while {} {rest}.\n", resting.join(" and "));
    }
    for feature in &tuned.features {
        let _ = write!(text, "`{}` in the mode `{}`\n\n", feature.name, tuned.mode);
        text += &answers(&feature.feature, &feature.answers);
        text += &climbed(feature);
        text += &gains(feature);
        text.push('\n');
    }
    text += &settled(tuned);
    text
}

fn answers(feature: &Feature, found: &[Identified]) -> String {
    let rows = found.iter().flat_map(|one| {
        one.fits.iter().map(|(component, fit)| {
            let (hz, damping) = fit.resonance.unzip();
            [
                one.object.clone(),
                COMPONENTS[*component].to_owned(),
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
    for (object, Limited { limit, share }) in found.iter().filter_map(|one| Some((&one.object, one.limited.as_ref()?)))
    {
        let share = 100.0 * share;
        let _ = writeln!(
            text,
            "Over `{object}`, `{limit}` reduced the motion in {share:.0} % of the ticks, so that the contact answers more than \
             measured: raise the limit, or keep smaller gains."
        );
    }
    for (object, play) in found.iter().filter_map(|one| Some((&one.object, one.play?))) {
        let play = feature.in_units(play);
        let _ =
            writeln!(text, "Over `{object}`, it sticks: after a turn it follows once the sensor has moved by {play}.");
    }
    for (object, lifts_off) in found.iter().filter_map(|one| Some((&one.object, one.lifts_off?))) {
        let _ = writeln!(
            text,
            "Over `{object}`, a test signal of {lifts_off} m lifts the pad off, and no two smaller ones say the same."
        );
    }
    for (object, why) in found.iter().filter_map(|one| Some((&one.object, one.refused.as_ref()?))) {
        let _ = writeln!(text, "Not measured over `{object}`: {why}.");
    }
    text
}

/// The gains that were compared by steps.
fn climbed(feature: &TunedFeature) -> String {
    if feature.climbed.is_empty() {
        return String::new();
    }
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let rows = feature.climbed.iter().map(|rung| {
        let is_whole = rung.steps.iter().all(|steps| !steps.is_empty());
        let known = |text: String| if is_whole { text } else { String::new() };
        [
            to_three_digits(rung.gains[0]).to_string(),
            known(format!("{:.2} s", rung.worst(|step| step.error_s))),
            known(percent(rung.worst(|step| step.overshoot))),
            known(percent(rung.worst(|step| step.rest))),
            rung.failure.clone().unwrap_or_default(),
        ]
    });
    let rows: Vec<[String; 5]> = [CLIMBED.map(str::to_owned)].into_iter().chain(rows).collect();
    let steps = feature.climbed.iter().flat_map(|rung| rung.steps.iter().flatten());
    let size = step::heading(&feature.feature, steps.map(|step| step.size.abs()).next());
    let worst = if feature.answers.len() > 1 { "; each number is that of the worst contact" } else { "" };
    let mut text = format!("So gains are compared by steps of {size}{worst}:\n\n");
    text += &table(&rows, 0, 4);
    // Of the smallest gains, because larger ones meet more limits.
    let limited = feature.climbed.iter().filter(|rung| rung.failure.is_none() || feature.new.is_none());
    let limited = limited.filter_map(|rung| Some((rung.gains[0], rung.limited.as_ref()?)));
    if let Some((kp, Limited { limit, share })) = limited.min_by(|(a, _), (b, _)| a.total_cmp(b)) {
        let (kp, share) = (to_three_digits(kp), 100.0 * share);
        let _ = writeln!(
            text,
            "With kp = {kp}, `{limit}` reduced the motion in {share:.0} % of the ticks. A limit hides what gains can do."
        );
    }
    if climb::is_bounded(&feature.climbed, feature.most) {
        text += "Larger gains are beyond the margins of what is known of the loop.\n";
    }
    text
}

/// Why no gains are proposed.
fn why_none(feature: &TunedFeature) -> String {
    if feature.is_measured() && !feature.is_light() {
        let is_reversed = feature.loops.iter().any(|(_, around)| around.is_reversed());
        let [kp, ki, kd] = feature.old;
        let why = match (is_reversed, [ki, kd]) {
            (true, _) => "the motion increases the error".to_owned(),
            (_, [0.0, 0.0]) => "even a small one leaves less; ask for smaller margins".to_owned(),
            _ => format!("with ki = {ki} and kd = {kd} beside kp = {kp} the loop swings; begin with ki = 0 and kd = 0"),
        };
        return format!("No gain keeps the margins: {why}.\n");
    }
    if feature.is(Unknown::NotReached) {
        return "No gains are proposed: the task must reach the mode with half of these gains; `tactflow run` shows what it \
                does.\n"
            .into();
    }
    if feature.is(Unknown::Lost) {
        let [half, quarter, eighth] = feature.tried();
        return format!(
            "No gains are proposed: with kp = {half} the test signal has ended the mode, and with {quarter} and {eighth} nothing \
             was measured either. If the feature swings in `tactflow run`, start with a kp below {eighth}. If a limit or a \
             device has ended the mode, no gain helps.\n"
        );
    }
    let why = if climb::next(&[], feature.most).is_none() {
        "even a tenth of the gains of the graph is beyond the margins of what is known of the loop".to_owned()
    } else if feature.climbed.is_empty() {
        "its setpoint cannot step, because it is 0, comes from a node, or because a node reads the flag of the mode"
            .into()
    } else if feature.climbed.iter().all(|rung| rung.limited.is_some()) {
        "a limit reduces the motion with all of them: raise it, or lower the setpoint".into()
    } else {
        format!(
            "each is near one that fails, overshoots by more than {:.0} %, or has an error of more than {:.0} % at the end of \
             the steps; a larger setpoint or more filtering lets a step stand out of the noise",
            100.0 * climb::GOOD_OVERSHOOT,
            100.0 * step::MAX_REST
        )
    };
    format!("No gains are proposed: {why}.\n")
}

fn gains(feature: &TunedFeature) -> String {
    let Some([kp, ki, kd]) = feature.new else { return why_none(feature) };
    let [old_kp, old_ki, old_kd] = feature.old;
    let rows = feature.answers.iter().zip(&feature.margins).filter_map(|(found, margins)| {
        let margins = margins.as_ref()?;
        Some([
            found.object.clone(),
            or_none(margins.crossover_hz, "Hz", 2),
            or_none(margins.phase_deg, "deg", 0),
            or_none(margins.gain_db, "dB", 1),
            format!("{:.2}", margins.peak_sensitivity),
            margins.bandwidth(),
        ])
    });
    let rows: Vec<[String; 6]> = [MARGINS.map(str::to_owned)].into_iter().chain(rows).collect();
    let table = if rows.len() > 1 { table(&rows, 1, 6) } else { String::new() };
    let mut text = format!("\nkp {old_kp} becomes {kp}, ki {old_ki} becomes {ki}, kd {old_kd} becomes {kd}:\n{table}");
    if let Some(Bound { object, margin }) = &feature.bound {
        let _ = writeln!(
            text,
            "With a tenth more, the loop over `{object}` has {margin}: that is beyond the wanted margins."
        );
    }
    for found in feature.answers.iter().filter(|found| found.refused.is_some()) {
        let _ = writeln!(text, "The margins over `{}` are not known.", found.object);
    }
    text
}

fn settled(tuned: &Tuned) -> String {
    let mut text = String::new();
    let mut left_out: Vec<(&str, &str)> =
        tuned.settled.iter().filter_map(|one| Some((&*one.object, one.left_out.as_deref()?))).collect();
    left_out.dedup();
    for (object, why) in left_out {
        let _ = writeln!(text, "Over `{object}`, the old gains are not tried again: {why}.");
    }
    for one in &tuned.settled {
        let feature = tuned.features.iter().find(|feature| feature.name == one.feature);
        let sized = |error: f64| match feature {
            Some(feature) => step::size(&feature.feature, error),
            None => to_three_digits(error).to_string(),
        };
        let error = |held: &Held| held.error.map_or_else(|| "unknown".into(), sized);
        let before =
            |text: String| one.old.as_ref().map_or_else(String::new, |_| format!("{text} with the old gains and "));
        let old = before(one.old.as_ref().map_or_else(String::new, error));
        let _ = write!(
            text,
            "Over `{}`, the error of `{}` is {old}{} with the new ones (rms)",
            one.object,
            one.feature,
            error(&one.new)
        );
        // One step over a contact that sticks is chance: the table has the mean of eight.
        let feature = feature.filter(|feature| feature.climbed.is_empty());
        let old_step = one.old.as_ref().map_or(Some(None), |old| old.step.map(Some));
        if let Some(((old, new), feature)) = old_step.zip(one.new.step).zip(feature) {
            let (size, new) = (step::size(&feature.feature, new.size), followed(&new));
            let old = before(old.as_ref().map_or_else(String::new, followed));
            let _ = write!(text, ". A step of {size} {old}{new} with the new ones");
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
pub(super) fn lines(tuned: &Tuned, outline: &Outline) -> String {
    let file = tuned.task.file().map_or_else(String::new, |file| format!("# in {}\n", name(Some(file))));
    let gains = sections(tuned.gains(outline).map(|(key, [_, gain])| (key, gain)));
    let mut text = if gains.is_empty() { String::new() } else { format!("\n{file}{gains}") };
    if !tuned.ranges.is_empty() {
        text += "\n[live]                              # in place of the old ranges\n";
    }
    for range in &tuned.ranges {
        let _ = writeln!(text, "{} = {}", range.name, range.value());
    }
    for Stated { file, contacts } in tuned.stated() {
        let file = name(file.as_deref());
        let _ = write!(text, "\n# in {file}\n{}", contact_tables::lines(&tuned.arm, &contacts));
    }
    text
}

/// Returns gains as TOML, with one section for each node or mode.
fn sections(gains: impl Iterator<Item = (String, f64)>) -> String {
    let mut sections: Vec<(String, String)> = Vec::new();
    for (key, gain) in gains {
        // Such as `nodes.pid`.
        let end = key.match_indices('.').nth(1).map_or(key.len(), |(end, _)| end);
        let (section, key) = (&key[..end], key[end..].trim_start_matches('.'));
        let line = format!("{key} = {gain:?}\n");
        match sections.iter_mut().find(|(known, _)| known == section) {
            Some((_, lines)) => *lines += &line,
            None => sections.push((section.to_owned(), line)),
        }
    }
    let sections: Vec<String> = sections.iter().map(|(section, lines)| format!("[{section}]\n{lines}")).collect();
    sections.join("\n")
}

/// Returns the name of a file; that of a bench which has none.
fn name(file: Option<&Path>) -> String {
    let name = file.and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "the bench".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gains_of_a_node_and_a_mode_stand_in_one_section_each() {
        let keys = ["nodes.pid.gains.x.kp", "modes.servo.set.pid.gains.x.ki", "nodes.pid.gains.x.kd"];
        let text = sections(keys.into_iter().map(str::to_owned).zip([1.0, 2.0, 3.0]));
        let read: toml::Table = toml::from_str(&text).unwrap();
        let gains = read["nodes"]["pid"]["gains"]["x"].as_table().unwrap();
        assert_eq!([&gains["kp"], &gains["kd"]].map(|gain| gain.as_float().unwrap()), [1.0, 3.0]);
        assert_eq!(read["modes"]["servo"]["set"]["pid"]["gains"]["x"]["ki"].as_float(), Some(2.0));
    }
}
