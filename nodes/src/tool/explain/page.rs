//! The control law as text and as Markdown.

use std::fmt::Write;
use std::path::Path;

use tactflow_runtime::cli::table;

use super::approaches::{Approach, Swing};
use super::stability::{Play, Stability};
use super::{Explained, ModeSummary, Motion, latency};
use crate::motion::COMPONENTS;
use crate::tool::control::digits::or_none;
use crate::tool::control::law::Feature;
use crate::tool::control::schedule::Schedule;

/// Columns of the table of features.
const HEAD: [&str; 11] =
    ["feature", "setpoint", "vx", "vy", "vz", "wx", "wy", "wz", "kp, ki, kd", "filter delay", "measured"];

/// Columns of the table of loops.
const LOOP_HEAD: [&str; 9] =
    ["contact", "loop", "crossover", "phase margin", "gain margin", "peak", "bandwidth", "ramp lag", "noise"];

/// Marks a loop of which the bench says nothing.
const GEOMETRY: &str = "(geometry)";

/// How a page is written.
struct Style {
    title: &'static str,
    section: &'static str,
    is_markdown: bool,
}

impl Style {
    /// Writes a table whose first row is its head; from the column `right` on, up to `left`, it is aligned to the right.
    fn table<const N: usize>(&self, rows: &[[String; N]], right: usize, left: usize) -> String {
        if !self.is_markdown {
            return table(rows, right, left);
        }
        let line = |row: &[String; N]| format!("| {} |\n", row.join(" | "));
        let rule = format!("|{}\n", "---|".repeat(N));
        let (head, body) = rows.split_at(1);
        // Without an empty line, what follows would be a row.
        head.iter().map(line).chain([rule]).chain(body.iter().map(line)).chain(["\n".to_owned()]).collect()
    }
}

pub(super) fn text(graph: &Path, explained: &Explained) -> String {
    page(graph, explained, &Style { title: "", section: "", is_markdown: false })
}

pub(super) fn markdown(graph: &Path, explained: &Explained) -> String {
    page(graph, explained, &Style { title: "# ", section: "## ", is_markdown: true })
}

fn page(graph: &Path, explained: &Explained, style: &Style) -> String {
    let Style { title, section, .. } = style;
    let mut text = format!("{title}{}: one tick every {} ms\n", graph.display(), number(1e3 * explained.period_s));
    for motion in &explained.motions {
        for mode in &motion.modes {
            let name = mode.mode.as_ref().map(|mode| format!(" in the mode `{mode}`")).unwrap_or_default();
            let _ = write!(text, "\n{section}`{}`{name}\n\n", motion.of);
            text += &law(mode, style);
            text += &mode.approaches.iter().map(approach).collect::<String>();
            text += &loops(&mode.loops, style);
        }
        text += &limits(motion, section);
    }
    text
}

fn law(mode: &ModeSummary, style: &Style) -> String {
    let law = &mode.law;
    let mut text = String::new();
    let rows: Vec<[String; 11]> = law.features.iter().filter(|one| one.moves()).map(row).collect();
    if !rows.is_empty() {
        text += &style.table(&[&[HEAD.map(str::to_owned)], &rows[..]].concat(), 1, 8);
        text += "Speeds in m/s and rad/s for an error of one unit (setpoint - measured), by kp.\n";
    }
    text += &latency::text(&mode.latencies);
    let moving = || law.features.iter().filter(|one| one.moves());
    text += &moving().flat_map(|one| one.schedules.iter().map(|schedule| scheduled(one, schedule))).collect::<String>();
    text += &moving().filter_map(rising).collect::<String>();
    text += &moving().filter_map(braked).collect::<String>();
    text += &moving().filter_map(bounded).collect::<String>();
    text += &moving().filter_map(|feature| together(feature, &mode.loops)).collect::<String>();
    let off: Vec<String> =
        law.features.iter().filter(|one| !one.moves()).map(|one| format!("`{}`", one.name)).collect();
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

/// Says what multiplies the gains of a feature.
fn scheduled(feature: &Feature, schedule: &Schedule) -> String {
    let Schedule { node, min, max, nominal, quantity } = schedule;
    let range = format!("from {} to {}", number(*min), number(*max));
    let by = match nominal {
        Some(nominal) => {
            format!("by {} / (answer of `{quantity}` to vz), {range}. A run estimates this answer", number(*nominal))
        }
        None => format!("{range}, by what this command does not know: there are no margins"),
    };
    format!("`{node}` multiplies the gains of `{}` {by}.\n", feature.name)
}

/// Says how fast the motion for a feature may begin.
fn rising(feature: &Feature) -> Option<String> {
    let (pid, rise) = (feature.pid.as_ref()?, feature.rise?);
    let (name, rise) = (&feature.name, number(rise));
    let unit = feature.unit().map_or_else(|| format!("per s2, in the unit of `{name}`"), |unit| format!("{unit}/s2"));
    Some(format!(
        "`{pid}` lets the control of `{name}` grow by at most {rise} {unit}: a large error is reduced later than by kp \
         alone.\n"
    ))
}

/// Says which motion of a feature is braked.
fn braked(feature: &Feature) -> Option<String> {
    let (pid, name, above) = (feature.pid.as_ref()?, &feature.name, number(feature.brake_above?));
    let unit = feature.unit().map_or_else(|| format!("per s, in the unit of `{name}`"), |unit| format!("{unit}/s"));
    Some(format!(
        "`{pid}` brakes `{name}` where it moves faster than kp asks for, by more than {above} {unit}. The margins leave \
         this out.\n"
    ))
}

/// Says how large the motion for a feature may become, and which errors its integral counts.
fn bounded(feature: &Feature) -> Option<String> {
    let pid = feature.pid.as_ref()?;
    let name = &feature.name;
    let unit = feature.unit().map_or_else(String::new, |unit| format!(" {unit}"));
    let per_s = feature.unit().map_or_else(String::new, |unit| format!(" {unit}/s"));
    let limit = feature.limit.map(|limit| format!("limits the control of `{name}` to {}{per_s}", number(limit)));
    let within = feature.within.filter(|_| feature.ki != 0.0);
    let within = within.map(|most| format!("integrates errors of `{name}` up to {}{unit} only", number(most)));
    let both: Vec<String> = limit.into_iter().chain(within).collect();
    (!both.is_empty()).then(|| format!("`{pid}` {}.\n", both.join(", and ")))
}

/// Says what else answers the same measurement, or presses too.
fn together(feature: &Feature, loops: &[Stability]) -> Option<String> {
    let measured = feature.measured.as_ref()?;
    let is_known = |name: &str| loops.iter().any(|one| one.feature == name && one.margins.is_some());
    let is_added = |other: &&Feature| other.measured == feature.measured || is_known(&other.name);
    let others: Vec<&Feature> = feature.beside.iter().filter(is_added).collect();
    // Once for all that add up.
    if others.is_empty() || others.iter().any(|other| other.id() < feature.id()) {
        return None;
    }
    let is_same = others.iter().all(|other| other.measured == feature.measured);
    let others: Vec<String> = others.iter().map(|other| format!("`{}` of `{}`", other.name, other.jacobian)).collect();
    let (name, jacobian, others) = (&feature.name, &feature.jacobian, others.join(" and "));
    let what = if is_same { format!("answer `{measured}`") } else { "move `vz`".into() };
    Some(format!("`{name}` of `{jacobian}` and {others} {what} together: their margins are those of the sum.\n"))
}

/// Says how far a motion goes on after a stop, and what it adds to the force at a touch.
fn approach(approach: &Approach) -> String {
    let Approach { node, is_search, speed_m_per_s, reaction_s, stopping_distance_m, swing, .. } = approach;
    let thousandths = |value: f64| number((1e6 * value).round() * 1e-3);
    let [speed, distance, reaction] = [speed_m_per_s, stopping_distance_m, reaction_s].map(|value| thousandths(*value));
    let from = if *is_search { format!("the search of `{node}`") } else { format!("`{node}`") };
    let deceleration = number(approach.deceleration_m_per_s2);
    let most = if swing.is_some() { " at most" } else { "" };
    let swing = match swing {
        Some(Swing { resonance_hz, length_m }) => {
            format!(" and a swing of {} mm at {} Hz", thousandths(*length_m), number(*resonance_hz))
        }
        None => " without the swing of a compliant arm, of which the bench states no resonance along x or y".to_owned(),
    };
    let mut text = format!(
        "From the {speed} mm/s of {from} a stop takes {distance} mm{most}: {reaction} ms until the arm follows, then {deceleration} m/s2,{swing}.\n"
    );
    for impact in &approach.impacts {
        let [stiffness, resonance] = [impact.contact_n_per_m, impact.resonance_hz].map(number);
        let _ = writeln!(
            text,
            "  The impact on `{}` adds {:.1} N at most, by {stiffness} N/m and a resonance of {resonance} Hz.",
            impact.object, impact.force_n
        );
    }
    for object in &approach.unknown_impacts {
        let _ =
            writeln!(text, "  The impact on `{object}` is not known: the bench states no resonance of its pressure.");
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

fn loops(loops: &[Stability], style: &Style) -> String {
    let mut text = String::new();
    let known: Vec<[String; 9]> = loops.iter().filter_map(margins).collect();
    if !known.is_empty() {
        text += "\n";
        text += &style.table(&[&[LOOP_HEAD.map(str::to_owned)], &known[..]].concat(), 2, 9);
        text += "The peak is that of the sensitivity. The noise is the standard deviation of the feature, as a multiple of that of its\n\
                 measurement. Without limits, dry friction, hysteresis, and what one feature does to another.\n";
    }
    if loops.iter().any(|one| one.by_geometry && one.margins.is_some()) {
        let _ = writeln!(
            text,
            "{GEOMETRY}: the bench states neither resonance nor latency nor response of this feature. Its margins leave out\n\
             the arm and are too large. The swing of the arm makes the bandwidth larger, and friction makes it smaller.\n\
             `tactflow tune` measures this, unless friction hides it."
        );
    }
    text += &loops.iter().filter_map(rolling).collect::<String>();
    text += &loops.iter().filter_map(sticking).collect::<String>();
    let found = loops.iter().filter_map(|one| Some((one, one.margins.as_ref()?)));
    let worst = found.max_by(|(_, a), (_, b)| {
        (!a.is_stable, a.peak_sensitivity)
            .partial_cmp(&(!b.is_stable, b.peak_sensitivity))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    if let Some((one, margins)) = worst.filter(|_| known.len() > 1) {
        let how = if margins.is_stable { "the largest peak" } else { "it is not stable" };
        let _ = writeln!(text, "The worst loop is that of {}: {how}.", place(one));
    }
    for one in loops.iter().filter(|one| one.margins.is_none() && !one.is_unknown) {
        let _ = writeln!(
            text,
            "No margins of {}: the bench does not say how it answers. `tactflow tune` measures it.",
            place(one)
        );
    }
    text
}

/// Says that a loop is computed without its rolling.
fn rolling(one: &Stability) -> Option<String> {
    let component = one.left_out?;
    let sign = if component == "wy" { "-" } else { "" };
    Some(format!(
        "{} also rolls with `{component}`, and the bench does not say how far the contact then moves: this part of the loop\n\
         is left out. The true loop has more gain and a larger bandwidth, and smaller margins and ramp lag. State it in `{}`\n\
         of the contact, in m per rad: `{component} = {sign}0.05` for an object with a radius of 50 mm.\n",
        place(one),
        one.feature
    ))
}

/// Says what the play of a contact does to a step.
fn sticking(one: &Stability) -> Option<String> {
    let Play { late_s, texts: [play, step], .. } = one.play.as_ref()?;
    let late = number((1e2 * late_s).round() * 1e-2);
    Some(format!(
        "{} sticks: after a turn of the motion it follows once the sensor has moved by {play}.\n\
         A step of {step} is answered up to {late} s later.\n",
        place(one)
    ))
}

/// Names a loop: its feature, and the object if the bench names one.
fn place(one: &Stability) -> String {
    let over = one.object.as_ref().map(|object| format!(" over `{object}`")).unwrap_or_default();
    format!("`{}`{over}", one.feature)
}

fn margins(one: &Stability) -> Option<[String; 9]> {
    let margins = one.margins.as_ref()?;
    // Of a loop by geometry, the swing of the arm can make it larger.
    let is_held = one.play.as_ref().is_some_and(Play::holds_a_step) && !one.by_geometry;
    let bandwidth = if is_held { margins.most_bandwidth() } else { margins.bandwidth() };
    let stable = |text: String| if margins.is_stable { text } else { "unstable".to_owned() };
    Some([
        match (&one.object, one.by_geometry) {
            (Some(object), false) => object.clone(),
            (Some(object), true) => format!("{object} {GEOMETRY}"),
            (None, _) => GEOMETRY.to_owned(),
        },
        one.feature.clone(),
        or_none(margins.crossover_hz, "Hz", 2),
        stable(or_none(margins.phase_deg, "deg", 0)),
        or_none(margins.gain_db, "dB", 1),
        stable(format!("{:.2}", margins.peak_sensitivity)),
        stable(bandwidth),
        stable(margins.ramp_lag()),
        stable(format!("{:.3}", margins.noise)),
    ])
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
