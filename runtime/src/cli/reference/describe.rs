//! `describe`: the full documentation of one entry of the catalogue.

use clap::ValueEnum;

use super::entry::{Entries, Entry};
use super::page::page;
use crate::cli::shell::{Shell, unknown};
use crate::cli::text::prose::{PageStyle, markdown};

/// Print the documentation of a node, device, role, kind or built-in file, with an example graph
#[derive(clap::Parser)]
#[command(
    name = "describe",
    after_help = "Examples:
  tactflow describe pid
  tactflow describe pid --example > try.toml && tactflow run try.toml
  tactflow describe twist"
)]
pub(crate) struct DescribeArgs {
    /// Name, as printed by `tactflow list`
    name: String,
    /// Output format
    #[arg(long, value_enum, default_value_t = PageFormat::Text, value_name = "FORMAT")]
    format: PageFormat,
    /// Print only the example graph
    #[arg(long, conflicts_with = "format")]
    example: bool,
}

/// Formats of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PageFormat {
    Text,
    Json,
    Markdown,
}

pub(crate) fn describe(args: DescribeArgs, shell: &Shell) -> u8 {
    let entries = Entries::new(shell.catalogue());
    let all = entries.all();
    let found: Vec<Entry> = all.iter().filter(|entry| entry.name == args.name).cloned().collect();
    if found.is_empty() {
        let names = all.iter().map(|entry| entry.name.as_str());
        let name = &args.name;
        let otherwise = format!(
            "`tactflow list` prints all names, and `tactflow list {name}` those whose documentation has that word"
        );
        return shell.refuse(unknown("node, device, role, kind or file", name, names, &otherwise));
    }
    let (found, missing): (Vec<Entry>, Vec<Option<String>>) =
        found.into_iter().map(|entry| entries.with_example(entry)).unzip();
    if args.example {
        return print_example(shell, &found, missing);
    }
    match args.format {
        PageFormat::Json => shell.say_json(&found),
        PageFormat::Markdown => {
            let pages = found.iter().map(|entry| markdown(&page(entry, true), 1));
            shell.say(pages.collect::<String>().trim_end());
        }
        PageFormat::Text => {
            let look = PageStyle::new(shell.has_colour());
            let pages: Vec<String> = found.iter().map(|entry| look.render(&page(entry, true))).collect();
            shell.say(&pages.join("\n\n"));
        }
    }
    0
}

fn print_example(shell: &Shell, found: &[Entry], missing: Vec<Option<String>>) -> u8 {
    match found.iter().find_map(|entry| entry.example.as_ref()) {
        Some(example) => {
            shell.say(example.trim_end());
            0
        }
        None => {
            let why = missing.into_iter().flatten().next();
            shell.refuse(why.unwrap_or_else(|| format!("`{}` has no example", found[0].name)))
        }
    }
}
