//! The page of one thing of the catalogue: for `describe`, and for the reference.

use super::entry::{Entry, Param, Port, Sort};
use super::prose::{Block, Item};

/// The page. What fits is a list of what the catalogue has today, so the reference, which a node should not change by
/// being added, goes without.
pub(super) fn page(entry: &Entry, has_fits: bool) -> Vec<Block> {
    let mut blocks = vec![Block::Title(entry.name.clone(), entry.sort.name()), Block::Prose(sentence(&entry.summary))];
    if !entry.doc.is_empty() {
        blocks.push(Block::Prose(entry.doc.clone()));
    }
    blocks.extend(entry.recorded.map(|recorded| Block::Prose(format!("Recorded with `--out`: {recorded}."))));
    blocks.extend(entry.steps.map(|steps| Block::Prose(format!("Steps {steps}."))));
    match entry.sort {
        Sort::Device => blocks.extend(listed("Fills the roles: ", &entry.fits)),
        Sort::Role => blocks.extend(listed("Filled by the devices: ", &entry.fits)),
        _ => {}
    }
    match entry.sort {
        Sort::Role => blocks.extend(listed("Its commands have crossed the limits: ", &entry.limits)),
        _ => blocks.extend(listed("Holds the limits: ", &entry.limits)),
    }
    let (inputs, outputs) = match entry.sort {
        Sort::Kind => ("Taken by", "Given by"),
        _ => ("Inputs", "Outputs"),
    };
    if entry.sort != Sort::Kind || has_fits {
        let is_kind = entry.sort == Sort::Kind;
        let sections = [
            (inputs, "in.", &entry.inputs),
            (outputs, "", &entry.outputs),
            ("Commands", "", &entry.commands),
            ("Reports", "", &entry.reports),
        ];
        for (heading, prefix, ports) in sections.into_iter().filter(|(_, _, ports)| !ports.is_empty()) {
            let prefix = if is_kind { "" } else { prefix };
            blocks.push(Block::Heading(heading.to_owned()));
            blocks.push(Block::Items(ports.iter().map(|port| port_item(port, prefix, has_fits && !is_kind)).collect()));
        }
    }
    if !entry.params.is_empty() {
        let mut items = Vec::new();
        params(&entry.params, "", &mut items);
        blocks.extend([Block::Heading("Parameters".to_owned()), Block::Items(items)]);
    }
    match (&entry.example, &entry.block) {
        (Some(example), _) => {
            blocks.extend([Block::Heading("Example: a graph that runs".to_owned()), Block::Code(example.clone())]);
        }
        (None, Some(block)) => {
            let heading = if entry.sort == Sort::File { "The file" } else { "Example" };
            blocks.extend([Block::Heading(heading.to_owned()), Block::Code(block.clone())]);
        }
        (None, None) => {}
    }
    blocks
}

/// A summary as a sentence.
fn sentence(summary: &str) -> String {
    let mut chars = summary.chars();
    let first = chars.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", chars.as_str())
}

fn listed(title: &str, names: &[String]) -> Option<Block> {
    let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    (!names.is_empty()).then(|| Block::Prose(format!("{title}{}.", names.join(", "))))
}

fn port_item(port: &Port, prefix: &str, has_fits: bool) -> Item {
    /// As many are named.
    const MOST: usize = 8;
    let mut what = carried(port);
    if let Some(need) = port.need {
        what.push_str("; ");
        what.push_str(need);
    }
    let mut more = vec![port.doc.clone()];
    if has_fits && !port.fits.is_empty() {
        let names: Vec<String> = port.fits.iter().take(MOST).map(|name| format!("`{name}`")).collect();
        let rest = port.fits.len().saturating_sub(MOST);
        let rest = if rest > 0 { format!(" and {rest} more") } else { String::new() };
        let which = if prefix.is_empty() { "to" } else { "from" };
        more.push(format!("Fits {which} {}{rest}.", names.join(", ")));
    }
    Item { name: format!("{prefix}{}", port.name), what, more }
}

/// Kind, unit and frames of a port, in words.
fn carried(port: &Port) -> String {
    let mut what = port.kind.to_owned();
    match port.unit.as_deref() {
        Some("_") => what.push_str(", any unit"),
        Some("_/s") => what.push_str(", any unit per second"),
        Some(unit) if unit.starts_with(|c: char| c.is_ascii_uppercase()) && unit != "N" => {
            what.push_str(&format!(", unit {unit}"));
        }
        Some(unit) => what.push_str(&format!(" [{unit}]")),
        None => {}
    }
    let frames: Vec<String> = port.frames.iter().map(|frame| frame_in_words(frame)).collect();
    if !frames.is_empty() {
        what.push_str(&format!(", {}", frames.join(" in ")));
    }
    what
}

fn frame_in_words(frame: &str) -> String {
    match frame.strip_prefix('$') {
        Some(param) => format!("the frame that `{param}` names"),
        None if frame == "self" => "its own frame".to_owned(),
        None => format!("frame {frame}"),
    }
}

fn params(specs: &[Param], path: &str, items: &mut Vec<Item>) {
    for param in specs {
        let name = format!("{path}{}", param.name);
        let default = match (&param.default, param.is_required) {
            (Some(default), _) => format!("default {default}"),
            (None, true) => "required".to_owned(),
            (None, false) => "may be left out".to_owned(),
        };
        let live = if param.is_live { "; live" } else { "" };
        let what = format!("{}; {default}{live}", param.takes);
        let words = param.words.iter().map(|(word, doc)| format!("`{word}`: {doc}"));
        let more = [param.doc.clone()].into_iter().chain(words).collect();
        items.push(Item { name: name.clone(), what, more });
        params(&param.fields, &format!("{name}{}", param.then), items);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_port_carries_is_said_in_words() {
        let cases = [
            ("scalar", Some("U"), vec!["A"], "scalar, unit U, frame A"),
            ("image", Some("N"), vec!["self"], "image [N], its own frame"),
            ("features", Some("_/s"), vec!["A"], "features, any unit per second, frame A"),
            ("pose", None, vec!["$sensor", "base"], "pose, the frame that `sensor` names in frame base"),
            ("flag", None, vec![], "flag"),
        ];
        for (kind, unit, frames, words) in cases {
            let frames = frames.into_iter().map(str::to_owned).collect();
            let unit = unit.map(str::to_owned);
            let port = Port { name: "p".into(), kind, unit, frames, need: None, doc: String::new(), fits: vec![] };
            assert_eq!(carried(&port), words);
        }
    }
}
