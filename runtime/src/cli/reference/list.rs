//! `list`: all entries of the catalogue, one line each.

use clap::ValueEnum;

use super::entry::{Category, Entry, entries};
use crate::cli::shell::command::OutputFormat;
use crate::cli::shell::{NOT_LOADED, Shell};
use crate::cli::text::prose::{Definition, Element, PageStyle};

/// List nodes, devices, roles, signal kinds and built-in files
#[derive(clap::Parser)]
#[command(
    name = "list",
    after_help = "Examples:
  tactflow list                  everything
  tactflow list nodes            only the nodes
  tactflow list nodes edge       the nodes whose name, summary or documentation contains `edge`"
)]
pub(crate) struct ListArgs {
    /// Category (nodes, devices, roles, kinds or files) and search words: an entry must contain all words
    #[arg(value_name = "WORD")]
    words: Vec<String>,
    /// Output format
    #[arg(long, value_enum, default_value_t = OutputFormat::Text, value_name = "FORMAT")]
    format: OutputFormat,
}

pub(crate) fn list(args: ListArgs, shell: &Shell) -> u8 {
    let category = |word: &str| Category::from_str(word.strip_suffix('s').unwrap_or(word), false).ok();
    let categories: Vec<Category> = args.words.iter().filter_map(|word| category(word)).collect();
    let words = args.words.iter().filter(|word| category(word).is_none());
    let words: Vec<String> = words.map(|word| word.to_lowercase()).collect();
    let mut found = entries(shell.catalogue());
    found.retain(|entry| {
        let text = format!("{} {} {}", entry.name, entry.summary, entry.doc).to_lowercase();
        (categories.is_empty() || categories.contains(&entry.category))
            && words.iter().all(|word| text.contains(word.as_str()))
    });
    if args.format == OutputFormat::Json {
        shell.say_json(&found.iter().map(ListedJson::of).collect::<Vec<_>>());
    } else if found.is_empty() {
        shell.error(format_args!(
            "nothing in the catalogue matches `{}`\nhelp: `tactflow list` prints everything",
            args.words.join(" ")
        ));
    } else {
        shell.say(&PageStyle::new(shell.has_colour()).render(&elements(&found)));
    }
    if found.is_empty() { NOT_LOADED } else { 0 }
}

/// An entry of the list as JSON.
#[derive(serde::Serialize)]
struct ListedJson<'a> {
    category: Category,
    name: &'a str,
    summary: &'a str,
    group: &'a str,
}

impl<'a> ListedJson<'a> {
    fn of(entry: &'a Entry) -> Self {
        Self { category: entry.category, name: &entry.name, summary: &entry.summary, group: entry.group }
    }
}

/// Puts the entries of each group below the title of the group.
fn elements(entries: &[Entry]) -> Vec<Element> {
    let mut elements = Vec::new();
    for group in entries.chunk_by(|a, b| (a.category, a.group) == (b.category, b.group)) {
        let item = |entry: &Entry| Definition {
            name: entry.name.clone(),
            summary: entry.summary.clone(),
            details: Vec::new(),
        };
        let items = group.iter().map(item).collect();
        elements.extend([Element::Heading(title(&group[0])), Element::Definitions(items)]);
    }
    elements
}

fn title(first: &Entry) -> String {
    match (first.category, first.group) {
        (Category::Node, "") => "Nodes".to_owned(),
        (Category::Node, group) => format!("Nodes, {group}"),
        (Category::Device, _) => "Devices: a bench binds roles to them".to_owned(),
        (Category::Role, _) => "Roles: the sensors and robots that a task needs".to_owned(),
        (Category::Kind, _) => "Kinds: the signals on wires".to_owned(),
        (Category::File, _) => "Built-in files: usable wherever a graph names a file".to_owned(),
    }
}
