//! `describe`: everything there is to know of one thing of the catalogue.

use clap::ValueEnum;

use super::entry::{Entries, Entry};
use super::page::page;
use super::prose::{Look, markdown};
use super::{NOT_LOADED, Shell};
use crate::source::suggest_name;

/// Describe one of them in full, with a graph to paste
#[derive(clap::Parser)]
#[command(
    name = "describe",
    after_help = "Examples:
  tactflow describe pid
  tactflow describe pid --example > try.toml && tactflow run try.toml
  tactflow describe twist"
)]
pub(super) struct Describe {
    /// Its name, as in `list`
    name: String,
    /// How to print it
    #[arg(long, value_enum, default_value_t = PageFormat::Text, value_name = "FORMAT")]
    format: PageFormat,
    /// Print the example alone
    #[arg(long, conflicts_with = "format")]
    example: bool,
}

/// How to print what is meant for a person or for a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    Text,
    Json,
}

/// How to print a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PageFormat {
    Text,
    Json,
    Markdown,
}

pub(super) fn describe(args: Describe, shell: &Shell) -> u8 {
    let entries = Entries::new(shell.catalogue());
    let all = entries.all();
    let found: Vec<Entry> = all.iter().filter(|entry| entry.name == args.name).cloned().collect();
    if found.is_empty() {
        shell.error(unknown(&args.name, &all));
        return NOT_LOADED;
    }
    let (found, missing): (Vec<Entry>, Vec<Option<String>>) =
        found.into_iter().map(|entry| entries.with_example(entry)).unzip();
    if args.example {
        return example(shell, &found, missing);
    }
    match args.format {
        PageFormat::Json => shell.say_json(&found),
        PageFormat::Markdown => {
            let pages = found.iter().map(|entry| markdown(&page(entry, true), 1));
            shell.say(pages.collect::<String>().trim_end());
        }
        PageFormat::Text => {
            let look = Look::new(shell.has_colour());
            let pages: Vec<String> = found.iter().map(|entry| look.render(&page(entry, true))).collect();
            shell.say(&pages.join("\n\n"));
        }
    }
    0
}

fn example(shell: &Shell, found: &[Entry], missing: Vec<Option<String>>) -> u8 {
    match found.iter().find_map(|entry| entry.example.as_ref()) {
        Some(example) => {
            shell.say(example.trim_end());
            0
        }
        None => {
            let why = missing.into_iter().flatten().next();
            shell.error(why.unwrap_or_else(|| format!("`{}` has no example", found[0].name)));
            NOT_LOADED
        }
    }
}

/// What is meant, or where to look.
fn unknown(name: &str, all: &[Entry]) -> String {
    let help = match suggest_name(name, all.iter().map(|entry| entry.name.as_str())) {
        Some(best) => format!("did you mean `{best}`?"),
        None => format!("`tactflow list` shows what there is, and `tactflow list {name}` where the word occurs"),
    };
    format!("there is no node, device, role, kind or file `{name}`\nhelp: {help}")
}
