//! The reference of a catalogue as pages of Markdown, to be kept under version control.

use std::fmt::Write;

use super::entry::{Category, Entry, entries};
use super::page::{capitalised, page};
use crate::catalogue::Catalogue;
use crate::cli::text::prose::markdown;

/// Returns the pages, each with the name of its file: an index, a page for each group of nodes, and one for each other
/// category.
///
/// A test can compare the pages with the files, so that they are never out of date; `tests/suite/reference.rs` does.
#[must_use]
pub fn reference(catalogue: &Catalogue) -> Vec<(String, String)> {
    let mut entries = entries(catalogue);
    entries.retain(|entry| entry.category != Category::File);
    let mut index = "# Reference\n\nEverything that a graph can use. These pages are generated from the catalogue; \
                     `tactflow describe NAME` prints the same documentation and an example graph.\n\nA capital letter, such as U in `unit U` or A in `frame A`, stands for a unit or a frame that the wires define. Within a node, the same letter is the same unit or frame. In brackets, `_` is any unit, and `$unit` is the value of the parameter `unit`.\n"
        .to_owned();
    let mut pages = Vec::new();
    for group in entries.chunk_by(|a, b| (a.category, a.group) == (b.category, b.group)) {
        let (file, title) = (file(&group[0]), title(&group[0]));
        // Writing to a string cannot fail.
        let _ = writeln!(index, "\n## [{title}]({file})\n");
        let mut text = format!("# {title}\n\n[All pages](README.md)\n\n");
        for entry in group {
            let _ = writeln!(index, "- [`{name}`]({file}#{name}): {}", entry.summary, name = entry.name);
            text.push_str(&markdown(&page(entry, false), 2));
        }
        pages.push((file, text.trim_end().to_owned() + "\n"));
    }
    pages.insert(0, ("README.md".to_owned(), index));
    pages
}

/// Returns the file of a group, named after the first word of its title or its category.
fn file(first: &Entry) -> String {
    let (word, rest) = first.group.split_once(':').unwrap_or(("", ""));
    let has_word = !rest.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric());
    if has_word { format!("{word}.md") } else { format!("{}s.md", first.category.name()) }
}

fn title(first: &Entry) -> String {
    match first.group {
        "" => capitalised(first.category.name()) + "s",
        group => capitalised(group),
    }
}
