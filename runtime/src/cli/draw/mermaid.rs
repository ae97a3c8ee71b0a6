//! A picture as a diagram in the language of Mermaid.

use super::picture::{Look, Picture};

/// Returns the picture as a flowchart.
pub(super) fn text(picture: &Picture) -> String {
    // A string of JSON is one of YAML.
    let mut text = format!("---\ntitle: {}\n---\nflowchart TB\n", serde_json::Value::from(picture.title.as_str()));
    boxes(picture, None, "    ", &mut text);
    for arrow in &picture.arrows {
        let line = if arrow.is_dashed { "-.->" } else { "-->" };
        let label = if arrow.lines.is_empty() { String::new() } else { format!("|{}|", quoted(&arrow.lines)) };
        text.push_str(&format!("    b{} {line}{label} b{}\n", arrow.from, arrow.to));
    }
    text
}

/// Writes the boxes of a group, and the groups in it.
fn boxes(picture: &Picture, group: Option<usize>, indent: &str, text: &mut String) {
    for (i, one) in picture.boxes.iter().enumerate().filter(|(_, one)| one.group == group) {
        let [open, close] = match one.look {
            Look::Inner => ["[", "]"],
            Look::Outer => ["([", "])"],
        };
        text.push_str(&format!("{indent}b{i}{open}{}{close}\n", quoted(&one.lines)));
    }
    for (i, inner) in picture.groups.iter().enumerate().filter(|(_, inner)| inner.parent == group) {
        text.push_str(&format!("{indent}subgraph g{i}[{}]\n", quoted(std::slice::from_ref(&inner.name))));
        boxes(picture, Some(i), &format!("{indent}    "), text);
        text.push_str(&format!("{indent}end\n"));
    }
}

/// Returns lines as one text. Quotation marks have an entity of Mermaid's own.
fn quoted(lines: &[String]) -> String {
    let escape =
        |line: &String| line.replace('&', "&amp;").replace('"', "#quot;").replace('<', "&lt;").replace('>', "&gt;");
    format!("\"{}\"", lines.iter().map(escape).collect::<Vec<_>>().join("<br/>"))
}
