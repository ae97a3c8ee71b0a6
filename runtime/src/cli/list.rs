//! `list`: what a graph may be made of, a line each.

use super::describe::Format;
use super::entry::{Entries, Entry, Sort};
use super::prose::{Block, Item, Look};
use super::{NOT_LOADED, Shell};

/// List nodes, devices, roles, kinds of signals and built-in files
#[derive(clap::Parser)]
#[command(
    name = "list",
    after_help = "Examples:
  tactflow list                  everything
  tactflow list nodes            one of nodes, devices, roles, kinds, files
  tactflow list nodes edge       nodes whose name, summary or documentation has the word `edge`"
)]
pub(super) struct List {
    /// A sort (nodes, devices, roles, kinds, files), and words that must all occur
    #[arg(value_name = "WORD")]
    words: Vec<String>,
    /// How to print it
    #[arg(long, value_enum, default_value_t = Format::Text, value_name = "FORMAT")]
    format: Format,
}

pub(super) fn list(args: List, shell: &Shell) -> u8 {
    let (sorts, words): (Vec<_>, Vec<_>) =
        args.words.iter().map(|word| (sort(word), word)).partition(|(s, _)| s.is_some());
    let sorts: Vec<Sort> = sorts.into_iter().filter_map(|(sort, _)| sort).collect();
    let words: Vec<String> = words.into_iter().map(|(_, word)| word.to_lowercase()).collect();
    let entries = Entries::new(shell.catalogue());
    let mut found: Vec<Entry> = entries.all();
    found.retain(|entry| {
        let text = format!("{} {} {}", entry.name, entry.summary, entry.doc).to_lowercase();
        (sorts.is_empty() || sorts.contains(&entry.sort)) && words.iter().all(|word| text.contains(word.as_str()))
    });
    if args.format == Format::Json {
        shell.say_json(&found.iter().map(Line::of).collect::<Vec<_>>());
    } else if found.is_empty() {
        shell.error(format_args!("nothing in the catalogue speaks of `{}`", args.words.join(" ")));
    } else {
        shell.say(&Look::new(shell.has_colour()).render(&blocks(&found)));
    }
    if found.is_empty() { NOT_LOADED } else { 0 }
}

/// What the JSON of a list says of one thing.
#[derive(serde::Serialize)]
struct Line<'a> {
    sort: Sort,
    name: &'a str,
    summary: &'a str,
    group: &'a str,
}

impl<'a> Line<'a> {
    fn of(entry: &'a Entry) -> Self {
        Self { sort: entry.sort, name: &entry.name, summary: &entry.summary, group: entry.group }
    }
}

fn sort(word: &str) -> Option<Sort> {
    Sort::ALL.into_iter().find(|sort| word == sort.name() || word.strip_suffix('s') == Some(sort.name()))
}

/// Things of one group stand together, each group under its title.
fn blocks(entries: &[Entry]) -> Vec<Block> {
    let mut blocks = Vec::new();
    for group in entries.chunk_by(|a, b| (a.sort, a.group) == (b.sort, b.group)) {
        let item = |entry: &Entry| Item { name: entry.name.clone(), what: entry.summary.clone(), more: Vec::new() };
        blocks.push(Block::Heading(title(&group[0])));
        blocks.push(Block::Items(group.iter().map(item).collect()));
    }
    blocks
}

fn title(first: &Entry) -> String {
    match (first.sort, first.group) {
        (Sort::Node, "") => "Nodes".to_owned(),
        (Sort::Node, group) => format!("Nodes, {group}"),
        (Sort::Device, _) => "Devices: what roles are bound to".to_owned(),
        (Sort::Role, _) => "Roles: what a task asks of the world".to_owned(),
        (Sort::Kind, _) => "Kinds: what travels on a wire".to_owned(),
        (Sort::File, _) => "Built-in files: for wherever a graph names a file".to_owned(),
    }
}
