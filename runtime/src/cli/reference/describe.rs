//! `describe`: the full documentation of one entry of the catalogue.

use clap::ValueEnum;

use super::entry::{Entry, entries};
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
    let (mut found, others): (Vec<Entry>, Vec<Entry>) =
        entries(shell.catalogue()).into_iter().partition(|entry| entry.name == args.name);
    if found.is_empty() {
        let names = others.iter().map(|entry| entry.name.as_str());
        let name = &args.name;
        let otherwise = format!(
            "`tactflow list` prints all names, and `tactflow list {name}` those whose documentation has that word"
        );
        return shell.refuse(unknown("node, device, role, kind or file", name, names, &otherwise));
    }
    if args.example {
        return print_example(&found, shell);
    }
    for entry in &mut found {
        entry.example = entry.example_graph(shell.catalogue()).ok();
    }
    match args.format {
        PageFormat::Json => shell.say_json(&found),
        PageFormat::Markdown => {
            let pages = found.iter().map(|entry| markdown(&page(entry, true), 1));
            shell.say(pages.collect::<String>().trim_end());
        }
        PageFormat::Text => {
            let style = PageStyle::new(shell.has_colour());
            let pages: Vec<String> = found.iter().map(|entry| style.render(&page(entry, true))).collect();
            shell.say(&pages.join("\n\n"));
        }
    }
    0
}

/// Prints the first example graph, or why the first entry has none.
fn print_example(found: &[Entry], shell: &Shell) -> u8 {
    let mut graphs: Vec<_> = found.iter().map(|entry| entry.example_graph(shell.catalogue())).collect();
    graphs.sort_by_key(Result::is_err);
    match graphs.swap_remove(0) {
        Ok(graph) => {
            shell.say(graph.trim_end());
            0
        }
        Err(why) => shell.refuse(why),
    }
}
