//! The control law as text and as Markdown.

use std::fmt::Write;
use std::path::Path;

use tactflow_runtime::cli::table;

use super::law::{COMPONENTS, Feature};
use super::{Explained, ModeLaw, Motion};

/// Columns of the table of features.
const HEAD: [&str; 11] = ["feature", "setpoint", "vx", "vy", "vz", "wx", "wy", "wz", "kp, ki, kd", "delay", "measured"];

pub(super) fn text(graph: &Path, explained: &Explained) -> String {
    page(graph, explained, ["", ""], |rows| table(rows, 1, 8))
}

pub(super) fn markdown(graph: &Path, explained: &Explained) -> String {
    page(graph, explained, ["# ", "## "], |rows| {
        let line = |row: &[String; 11]| format!("| {} |\n", row.join(" | "));
        let rule = format!("|{}\n", "---|".repeat(11));
        let (head, body) = rows.split_at(1);
        head.iter().map(line).chain([rule]).chain(body.iter().map(line)).collect()
    })
}

fn page(
    graph: &Path,
    explained: &Explained,
    [title, section]: [&str; 2],
    table: impl Fn(&[[String; 11]]) -> String,
) -> String {
    let mut text = format!("{title}{}: one tick every {} ms\n", graph.display(), number(1e3 * explained.period_s));
    for motion in &explained.motions {
        for mode in &motion.modes {
            let name = mode.mode.as_ref().map(|mode| format!(" in the mode `{mode}`")).unwrap_or_default();
            let _ = write!(text, "\n{section}`{}`{name}\n\n", motion.of);
            text += &law(mode, &table);
        }
        text += &limits(motion, section);
    }
    text
}

fn law(mode: &ModeLaw, table: &impl Fn(&[[String; 11]]) -> String) -> String {
    let law = &mode.law;
    let mut text = String::new();
    let moving = |feature: &&Feature| feature.column.iter().any(|entry| *entry != 0.0) && feature.has_gain();
    let rows: Vec<[String; 11]> = law.features.iter().filter(moving).map(row).collect();
    if !rows.is_empty() {
        text += &table(&[&[HEAD.map(str::to_owned)], &rows[..]].concat());
        text += "Speeds in m/s and rad/s for an error of one unit (setpoint - measured), by kp.\n";
    }
    let off: Vec<String> =
        law.features.iter().filter(|one| !moving(one)).map(|one| format!("`{}`", one.name)).collect();
    if !off.is_empty() {
        let _ = writeln!(text, "Not controlled: {}.", off.join(", "));
    }
    for constant in &law.constants {
        let parts = COMPONENTS.iter().zip(constant.twist).filter(|(_, part)| *part != 0.0);
        let parts: Vec<String> = parts.map(|(name, part)| format!("{name} = {}", number(part))).collect();
        let _ = writeln!(text, "Constant, from `{}`: {} [m/s, rad/s].", constant.node, parts.join(", "));
    }
    for guidance in &law.guidance {
        let parts = COMPONENTS.iter().zip(guidance.passes).filter(|(_, passes)| *passes);
        let parts: Vec<&str> = parts.map(|(name, _)| *name).collect();
        let passes = if parts.is_empty() { "nothing passes".to_owned() } else { parts.join(", ") };
        let _ = writeln!(text, "Guided by `{}` (`{}`): {passes}.", guidance.port, guidance.kind);
    }
    let rest: Vec<&str> = (0..6).filter(|i| !law.moves(*i)).map(|i| COMPONENTS[i]).collect();
    if !rest.is_empty() {
        let _ = writeln!(text, "At rest: {}.", rest.join(", "));
    }
    for (key, value) in &mode.ends {
        let _ = writeln!(text, "Ends: `{key} = {value}`.");
    }
    text
}

fn row(feature: &Feature) -> [String; 11] {
    let speeds = feature.column.map(|entry| number(entry * feature.kp));
    let [vx, vy, vz, wx, wy, wz] = speeds;
    let gains = [feature.kp, feature.ki, feature.kd].map(number).join(", ");
    let filters: Vec<&str> = feature.filters.iter().map(|filter| &*filter.kind).collect();
    let delay = match filters.is_empty() {
        true => "0".to_owned(),
        false => format!("{} ms ({})", number(1e3 * feature.delay()), filters.join(", ")),
    };
    let setpoint = feature.setpoint.map(number).unwrap_or_default();
    let measured = feature.measured.clone().unwrap_or_default();
    [feature.name.clone(), setpoint, vx, vy, vz, wx, wy, wz, gains, delay, measured]
}

fn limits(motion: &Motion, section: &str) -> String {
    let mut text = String::new();
    if motion.limits.is_empty() {
        return text;
    }
    let _ = write!(text, "\n{section}From the twist to `{}`, in this order\n\n", motion.of);
    for (i, limiter) in motion.limits.iter().enumerate() {
        let values: Vec<String> = limiter.values.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        let values = if values.is_empty() { String::new() } else { format!(": {}", values.join(", ")) };
        let _ = writeln!(text, "{}. `{}` (`{}`){values}", i + 1, limiter.node, limiter.kind);
    }
    text
}

/// Writes a number with at most six significant digits.
fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (5.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.to_owned()
}
