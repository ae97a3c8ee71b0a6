//! `tactflow pads`: the pads whose descriptions ship.

use tactflow_runtime::cli::{OutputFormat, Shell, clap, table};

use crate::builtin::FILES;

/// List the pads whose descriptions ship
#[derive(clap::Parser)]
#[command(
    name = "pads",
    after_help = "A bench uses a description under its name, and adds the link:

  [devices.skin]
  type = \"stream\"
  sensor = \"builtin:pads/flexitac_16x32.toml\"
  link = \"serial:/dev/serial/by-id/NAME\"

Examples:
  tactflow pads
  tactflow pads flexitac         the pads whose name or summary contains `flexitac`
  tactflow describe stream       all keys of a description
  tactflow describe builtin:pads/flexitac_16x32.toml         a description that ships

Exit codes: 0 success; 2 no pad matches."
)]
pub(super) struct PadsArgs {
    /// Search words: a pad must contain all words
    #[arg(value_name = "WORD")]
    words: Vec<String>,
    /// Output format
    #[arg(long, value_enum, default_value_t = OutputFormat::Text, value_name = "FORMAT")]
    format: OutputFormat,
}

/// A pad that ships.
#[derive(serde::Serialize)]
struct Pad {
    name: String,
    /// What a bench writes as `sensor`.
    sensor: String,
    shape: Vec<i64>,
    rate_hz: f64,
    link: String,
    summary: String,
}

pub(super) fn run(args: PadsArgs, shell: &Shell) -> u8 {
    let words: Vec<String> = args.words.iter().map(|word| word.to_lowercase()).collect();
    let mut pads: Vec<Pad> = FILES.iter().filter_map(|(name, bytes)| pad(name, bytes)).collect();
    pads.retain(|pad| {
        let text = format!("{} {}", pad.name, pad.summary).to_lowercase();
        words.iter().all(|word| text.contains(word.as_str()))
    });
    if args.format == OutputFormat::Json {
        shell.say_json(&pads);
    } else if pads.is_empty() {
        let message = format!("no pad matches `{}`\nhelp: `tactflow pads` prints all", args.words.join(" "));
        return shell.refuse(message);
    } else {
        shell.say(table(&rows(&pads), 0, 0).trim_end());
    }
    if pads.is_empty() { 2 } else { 0 }
}

/// Reads the description of a pad; `None` for another file.
fn pad(name: &str, bytes: &[u8]) -> Option<Pad> {
    let stem = name.strip_prefix("pads/")?.strip_suffix(".toml")?;
    let text = std::str::from_utf8(bytes).ok()?;
    let file: toml::Table = text.parse().ok()?;
    let sensor = file.get("sensor")?.as_table()?;
    let shape = sensor.get("shape")?.as_array()?.iter().filter_map(toml::Value::as_integer).collect();
    let rate_hz = sensor.get("rate_hz")?.clone().try_into().ok()?;
    let link = match sensor.get("baud").and_then(toml::Value::as_integer) {
        Some(baud) => format!("serial, {baud} baud"),
        None => "network".to_owned(),
    };
    let summary = text.lines().next()?.trim_start_matches('#').trim().to_owned();
    Some(Pad { name: stem.to_owned(), sensor: format!("builtin:{name}"), shape, rate_hz, link, summary })
}

fn rows(pads: &[Pad]) -> Vec<[String; 5]> {
    let row = |pad: &Pad| {
        let shape: Vec<String> = pad.shape.iter().map(i64::to_string).collect();
        [pad.name.clone(), shape.join("x"), format!("{} Hz", pad.rate_hz), pad.link.clone(), pad.summary.clone()]
    };
    pads.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_description_is_listed_with_all_it_states() {
        let files = FILES.iter().filter(|(name, _)| name.starts_with("pads/")).count();
        let pads: Vec<Pad> = FILES.iter().filter_map(|(name, bytes)| pad(name, bytes)).collect();
        assert_eq!(pads.len(), files);
        assert!(files >= 9);
        for pad in &pads {
            assert!(pad.shape.len() >= 2 && pad.rate_hz > 0.0 && pad.summary.len() > 20, "{}", pad.name);
            assert!(!pad.summary.ends_with('.'), "{}", pad.summary);
        }
        let glove = pads.iter().find(|pad| pad.name == "aa550399_glove").unwrap();
        assert_eq!((&*glove.shape, &*glove.link), (&[16, 16][..], "serial, 921600 baud"));
    }
}
