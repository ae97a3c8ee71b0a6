//! A picture as a graph in the language of Graphviz.

use super::picture::{Look, Picture};

/// Returns the picture as a directed graph.
pub(super) fn text(picture: &Picture) -> String {
    let title = quoted(std::slice::from_ref(&picture.title));
    let mut text = format!("digraph {title} {{\n    node [shape=box];\n    edge [fontsize=9];\n");
    boxes(picture, None, "    ", &mut text);
    for arrow in &picture.arrows {
        let style = if arrow.is_dashed { ", style=dashed" } else { "" };
        text.push_str(&format!("    b{} -> b{} [label={}{style}];\n", arrow.from, arrow.to, quoted(&arrow.lines)));
    }
    text.push_str("}\n");
    text
}

/// Writes the boxes of a group, and the groups in it.
fn boxes(picture: &Picture, group: Option<usize>, indent: &str, text: &mut String) {
    for (i, one) in picture.boxes.iter().enumerate().filter(|(_, one)| one.group == group) {
        let style = if one.look == Look::Outer { ", style=rounded" } else { "" };
        text.push_str(&format!("{indent}b{i} [label={}{style}];\n", quoted(&one.lines)));
    }
    for (i, inner) in picture.groups.iter().enumerate().filter(|(_, inner)| inner.parent == group) {
        let name = quoted(std::slice::from_ref(&inner.name));
        // Only a subgraph whose name begins with `cluster` has a frame.
        text.push_str(&format!("{indent}subgraph cluster{i} {{\n{indent}    label={name};\n"));
        boxes(picture, Some(i), &format!("{indent}    "), text);
        text.push_str(&format!("{indent}}}\n"));
    }
}

fn quoted(lines: &[String]) -> String {
    let escape = |line: &String| line.replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{}\"", lines.iter().map(escape).collect::<Vec<_>>().join("\\n"))
}
