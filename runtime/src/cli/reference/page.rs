//! The page of one entry of the catalogue, for `describe` and for the reference.

use super::entry::{Category, Entry, ParamEntry, PortEntry};
use crate::cli::text::prose::{Definition, Element};
use crate::source::quoted;

/// Builds the page. `has_fits` adds the ports at the other end of each wire; the reference leaves them out, so that a
/// new node changes no page of another.
pub(crate) fn page(entry: &Entry, has_fits: bool) -> Vec<Element> {
    let mut elements = vec![
        Element::Title(entry.name.clone(), entry.category.name()),
        Element::Prose(capitalised(&entry.summary) + "."),
    ];
    if !entry.doc.is_empty() {
        elements.push(Element::Prose(entry.doc.clone()));
    }
    elements.extend(entry.recorded.map(|recorded| Element::Prose(format!("Recorded with `--out`: {recorded}."))));
    elements.extend(entry.steps.map(|steps| Element::Prose(format!("The node steps {steps}."))));
    let is_kind = entry.category == Category::Kind;
    let (fits, limits) = match entry.category {
        Category::Role => ("Filled by the devices: ", "Its commands must pass through the limits: "),
        _ => ("Fills the roles: ", "Enforces the limits: "),
    };
    elements.extend(listed(fits, &entry.fits));
    elements.extend(listed(limits, &entry.limits));
    let (inputs, prefix, outputs) =
        if is_kind { ("Taken by", "", "Produced by") } else { ("Inputs", "in.", "Outputs") };
    let sections = [
        (inputs, prefix, &entry.inputs),
        (outputs, "", &entry.outputs),
        ("Commands", "", &entry.commands),
        ("Reports", "", &entry.reports),
    ];
    let sections = sections.into_iter().filter(|(_, _, ports)| !ports.is_empty() && (has_fits || !is_kind));
    for (heading, prefix, ports) in sections {
        let items = ports.iter().map(|port| port_item(port, prefix, has_fits && !is_kind)).collect();
        elements.extend([Element::Heading(heading.to_owned()), Element::Definitions(items)]);
    }
    if !entry.params.is_empty() {
        let mut items = Vec::new();
        add_params(&entry.params, "", &mut items);
        elements.extend([Element::Heading("Parameters".to_owned()), Element::Definitions(items)]);
    }
    if let Some(code) = &entry.block {
        let heading = if entry.category == Category::File { "The file" } else { "Example" };
        elements.extend([Element::Heading(heading.to_owned()), Element::Code(code.clone())]);
    }
    if entry.example.is_some() {
        let line = format!("`tactflow describe {} --example` prints a whole graph with it.", entry.name);
        elements.push(Element::Prose(line));
    }
    elements
}

/// Returns a text with a capital letter at its start.
pub(crate) fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    let first = chars.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    first + chars.as_str()
}

fn listed(title: &str, names: &[String]) -> Option<Element> {
    (!names.is_empty()).then(|| Element::Prose(format!("{title}{}.", quoted(names))))
}

fn port_item(port: &PortEntry, prefix: &str, has_fits: bool) -> Definition {
    /// Maximum number of ports that are named.
    const MAX_NAMED: usize = 8;
    let need = port.need.as_ref().map(|need| format!("; {need}")).unwrap_or_default();
    let mut details = vec![port.doc.clone()];
    if has_fits && !port.fits.is_empty() {
        let (named, rest) = port.fits.split_at(MAX_NAMED.min(port.fits.len()));
        let rest = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
        let which = if prefix.is_empty() { "to" } else { "from" };
        details.push(format!("Fits {which} {}{rest}.", quoted(named)));
    }
    Definition { name: format!("{prefix}{}", port.name), summary: carried(port) + &need, details }
}

/// Describes the kind, the unit and the frames of a port.
fn carried(port: &PortEntry) -> String {
    let is_variable = |unit: &str| unit.starts_with(|c: char| c.is_ascii_uppercase()) && unit != "N";
    let unit = match port.unit.as_deref() {
        Some("_") => ", any unit".to_owned(),
        Some("_/s") => ", any unit per second".to_owned(),
        Some(unit) if is_variable(unit) => format!(", unit {unit}"),
        Some(unit) => format!(" [{unit}]"),
        None => String::new(),
    };
    let frames: Vec<String> = port.frames.iter().map(|frame| frame_in_words(frame)).collect();
    let frames = if frames.is_empty() { String::new() } else { format!(", {}", frames.join(" in ")) };
    format!("{}{unit}{frames}", port.kind)
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
        let live = match (param.is_live, param.is_tunable) {
            (_, true) => "; live, tunable",
            (true, false) => "; live",
            (false, false) => "",
        };
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
