//! The page of one entry of the catalogue, for `describe` and for the reference.

use super::entry::{Category, Entry, ParamEntry, PortEntry};
use crate::cli::text::prose::{Definition, Element};

/// Builds the page. `has_fits` adds the ports at the other end of each wire; the reference leaves them out, so that a new
/// node changes no page of another.
pub(crate) fn page(entry: &Entry, has_fits: bool) -> Vec<Element> {
    let mut elements =
        vec![Element::Title(entry.name.clone(), entry.category.name()), Element::Prose(sentence(&entry.summary))];
    if !entry.doc.is_empty() {
        elements.push(Element::Prose(entry.doc.clone()));
    }
    elements.extend(entry.recorded.map(|recorded| Element::Prose(format!("Recorded with `--out`: {recorded}."))));
    elements.extend(entry.steps.map(|steps| Element::Prose(format!("Steps {steps}."))));
    match entry.category {
        Category::Device => elements.extend(listed("Fills the roles: ", &entry.fits)),
        Category::Role => elements.extend(listed("Filled by the devices: ", &entry.fits)),
        _ => {}
    }
    match entry.category {
        Category::Role => elements.extend(listed("Its commands must cross the limits: ", &entry.limits)),
        _ => elements.extend(listed("Enforces the limits: ", &entry.limits)),
    }
    let (inputs, outputs) = match entry.category {
        Category::Kind => ("Taken by", "Produced by"),
        _ => ("Inputs", "Outputs"),
    };
    if entry.category != Category::Kind || has_fits {
        let is_kind = entry.category == Category::Kind;
        let sections = [
            (inputs, "in.", &entry.inputs),
            (outputs, "", &entry.outputs),
            ("Commands", "", &entry.commands),
            ("Reports", "", &entry.reports),
        ];
        for (heading, prefix, ports) in sections.into_iter().filter(|(_, _, ports)| !ports.is_empty()) {
            let prefix = if is_kind { "" } else { prefix };
            elements.push(Element::Heading(heading.to_owned()));
            elements.push(Element::Definitions(
                ports.iter().map(|port| port_item(port, prefix, has_fits && !is_kind)).collect(),
            ));
        }
    }
    if !entry.params.is_empty() {
        let mut items = Vec::new();
        add_params(&entry.params, "", &mut items);
        elements.extend([Element::Heading("Parameters".to_owned()), Element::Definitions(items)]);
    }
    match (&entry.example, &entry.block) {
        (Some(example), _) => {
            elements.extend([Element::Heading("Example graph".to_owned()), Element::Code(example.clone())]);
        }
        (None, Some(block)) => {
            let heading = if entry.category == Category::File { "The file" } else { "Example" };
            elements.extend([Element::Heading(heading.to_owned()), Element::Code(block.clone())]);
        }
        (None, None) => {}
    }
    elements
}

/// Turns a summary into a sentence.
fn sentence(summary: &str) -> String {
    let mut chars = summary.chars();
    let first = chars.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", chars.as_str())
}

fn listed(title: &str, names: &[String]) -> Option<Element> {
    let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    (!names.is_empty()).then(|| Element::Prose(format!("{title}{}.", names.join(", "))))
}

fn port_item(port: &PortEntry, prefix: &str, has_fits: bool) -> Definition {
    /// Maximum number of ports that are named.
    const MAX_NAMED: usize = 8;
    let mut summary = carried(port);
    if let Some(need) = port.need {
        summary.push_str("; ");
        summary.push_str(need);
    }
    let mut details = vec![port.doc.clone()];
    if has_fits && !port.fits.is_empty() {
        let names: Vec<String> = port.fits.iter().take(MAX_NAMED).map(|name| format!("`{name}`")).collect();
        let rest = port.fits.len().saturating_sub(MAX_NAMED);
        let rest = if rest > 0 { format!(" and {rest} more") } else { String::new() };
        let which = if prefix.is_empty() { "to" } else { "from" };
        details.push(format!("Fits {which} {}{rest}.", names.join(", ")));
    }
    Definition { name: format!("{prefix}{}", port.name), summary, details }
}

/// Describes the kind, the unit and the frames of a port.
fn carried(port: &PortEntry) -> String {
    let mut words = port.kind.to_owned();
    match port.unit.as_deref() {
        Some("_") => words.push_str(", any unit"),
        Some("_/s") => words.push_str(", any unit per second"),
        Some(unit) if unit.starts_with(|c: char| c.is_ascii_uppercase()) && unit != "N" => {
            words.push_str(&format!(", unit {unit}"));
        }
        Some(unit) => words.push_str(&format!(" [{unit}]")),
        None => {}
    }
    let frames: Vec<String> = port.frames.iter().map(|frame| frame_in_words(frame)).collect();
    if !frames.is_empty() {
        words.push_str(&format!(", {}", frames.join(" in ")));
    }
    words
}

fn frame_in_words(frame: &str) -> String {
    match frame.strip_prefix('$') {
        Some(param) => format!("the frame that `{param}` names"),
        None if frame == "self" => "its own frame".to_owned(),
        None => format!("frame {frame}"),
    }
}

fn add_params(specs: &[ParamEntry], path: &str, items: &mut Vec<Definition>) {
    for param in specs {
        let name = format!("{path}{}", param.name);
        let default = match (&param.default, param.is_required) {
            (Some(default), _) => format!("default {default}"),
            (None, true) => "required".to_owned(),
            (None, false) => "optional".to_owned(),
        };
        let live = if param.is_live { "; live" } else { "" };
        let summary = format!("{}; {default}{live}", param.takes);
        let words = param.words.iter().map(|(word, doc)| format!("`{word}`: {doc}"));
        let details = [param.doc.clone()].into_iter().chain(words).collect();
        items.push(Definition { name: name.clone(), summary, details });
        add_params(&param.fields, &format!("{name}{}", param.separator), items);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_described_in_words() {
        let cases = [
            ("scalar", Some("U"), vec!["A"], "scalar, unit U, frame A"),
            ("image", Some("N"), vec!["self"], "image [N], its own frame"),
            ("features", Some("_/s"), vec!["A"], "features, any unit per second, frame A"),
            ("pose", None, vec!["$sensor", "base"], "pose, the frame that `sensor` names in frame base"),
            ("flag", None, vec![], "flag"),
        ];
        for (kind, unit, frames, words) in cases {
            let frames = frames.into_iter().map(str::to_owned).collect();
            let port = PortEntry { kind, unit: unit.map(str::to_owned), frames, ..PortEntry::default() };
            assert_eq!(carried(&port), words);
        }
    }
}
