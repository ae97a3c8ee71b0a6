//! The reference of a catalogue as pages of Markdown: what `describe` says of everything, to be kept under version
//! control.

use std::fmt::Write;

use super::entry::{Entries, Entry, Sort};
use super::page::page;
use super::prose::markdown;
use crate::catalogue::Catalogue;

/// The pages, each with the name of its file: an index, a page for each group of nodes, and one for each other sort.
///
/// A test compares them with the files, so that they are never out of date: `tests/suite/reference.rs` shows it.
#[must_use]
pub fn reference(catalogue: &Catalogue) -> Vec<(String, String)> {
    let mut entries = Entries::new(catalogue).all();
    entries.retain(|entry| entry.sort != Sort::File);
    let mut index = "# Reference\n\nEverything a graph may be made of. These pages are generated from the catalogue; \
                     `tactflow describe NAME` says the same, and puts a whole graph around it.\n"
        .to_owned();
    let mut pages = Vec::new();
    for group in entries.chunk_by(|a, b| (a.sort, a.group) == (b.sort, b.group)) {
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

/// The file of a group: what its title starts with, or the sort.
fn file(first: &Entry) -> String {
    let (word, rest) = first.group.split_once(':').unwrap_or(("", ""));
    let has_word = !rest.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric());
    if has_word { format!("{word}.md") } else { format!("{}s.md", first.sort.name()) }
}

fn title(first: &Entry) -> String {
    match first.group {
        "" => {
            let name = first.sort.name();
            format!("{}{}s", name[..1].to_uppercase(), &name[1..])
        }
        group => format!("{}{}", group[..1].to_uppercase(), &group[1..]),
    }
}
