//! `tactflow new`: writes a file to start from.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use tactflow_runtime::cli::Shell;
use tactflow_runtime::cli::clap::{self, Parser, ValueEnum};

/// Write a file to start from: a task, a bench, a pad, a robot or a node
#[derive(Parser)]
#[command(name = "new")]
#[command(
    after_help = "The file has a comment on each line that you may want to change. A task runs as it is, on a simulated bench.

Examples:
  tactflow new task hold
  tactflow new bench cell
  tactflow new pad mat -o pads/mat.toml
  tactflow new node contact_speed

Exit codes: 0 success; 2 the file exists or cannot be written."
)]
pub(super) struct NewArgs {
    /// What to write
    #[arg(value_enum)]
    what: What,
    /// Its name: lower-case letters, digits and `_`
    #[arg(value_parser = name)]
    name: String,
    /// Write to this file; by default NAME.toml, or NAME.rs for a node
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// What can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// A task that holds a pressure, with a simulated bench
    Task,
    /// A cell with a pad and an arm
    Bench,
    /// A pad that `stream` reads
    Pad,
    /// A robot
    Robot,
    /// A node in Rust, with its test
    Node,
}

/// The name of the node in its template, as a type and as a struct.
const TEMPLATE_NODE: [&str; 2] = ["template_node", "TemplateNode"];

impl What {
    fn file(self, name: &str) -> PathBuf {
        let end = if self == Self::Node { "rs" } else { "toml" };
        format!("{name}.{end}").into()
    }

    fn text(self, name: &str) -> String {
        match self {
            Self::Task => include_str!("task.toml").replace("NAME", name),
            Self::Bench => include_str!("bench.toml").replace("NAME", name),
            Self::Pad => include_str!("pad.toml").replace("NAME", name),
            Self::Robot => include_str!("robot.toml").replace("NAME", name),
            Self::Node => {
                let text = include_str!("node.rs").replace(TEMPLATE_NODE[0], name);
                text.replace(TEMPLATE_NODE[1], &camel_case(name))
            }
        }
    }

    /// Says what to do with the file.
    fn next(self, file: &Path, name: &str) -> String {
        let path = file.display();
        match self {
            Self::Task => format!("next: `tactflow run {path}`"),
            Self::Bench => format!("next: correct the lines with the comment `yours`, then `tactflow doctor {path}`"),
            Self::Pad => format!(
                "next: correct it from the data sheet, and name it in a bench: `type = \"stream\"`, `sensor = \"{path}\"`"
            ),
            Self::Robot => format!("next: name it in a bench, at the device that drives the arm: `robot = \"{path}\"`"),
            Self::Node => format!(
                "next: add `mod {name};` and the line `.node::<{name}::{}>()` to your catalogue; docs/writing-a-node.md \
                 explains each part",
                camel_case(name)
            ),
        }
    }
}

pub(super) fn run(args: NewArgs, shell: &Shell) -> u8 {
    let NewArgs { what, name, out } = args;
    let file = out.unwrap_or_else(|| what.file(&name));
    let created = OpenOptions::new().write(true).create_new(true).open(&file);
    match created.and_then(|mut created| created.write_all(what.text(&name).as_bytes())) {
        Ok(()) => {
            shell.say(&format!("wrote {}\n{}", file.display(), what.next(&file, &name)));
            0
        }
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            shell.refuse(format_args!("`{}` exists, so it is not replaced: choose another name", file.display()))
        }
        Err(error) => shell.refuse(format_args!("cannot write `{}`: {error}", file.display())),
    }
}

/// Parses a name: a parser for arguments.
fn name(text: &str) -> Result<String, String> {
    let is_letter = |c: char| c.is_ascii_lowercase() || c == '_';
    let is_name =
        text.starts_with(|c: char| c.is_ascii_lowercase()) && text.chars().all(|c| is_letter(c) || c.is_ascii_digit());
    is_name.then(|| text.to_owned()).ok_or_else(|| {
        format!("`{text}` is not a name: write lower-case letters, digits and `_`, with a letter first, such as `contact_speed`")
    })
}

/// Returns a name in the form of a Rust type.
fn camel_case(name: &str) -> String {
    let word = |word: &str| {
        let mut letters = word.chars();
        let first = letters.next().map(|first| first.to_ascii_uppercase());
        first.into_iter().chain(letters).collect::<String>()
    };
    name.split('_').map(word).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_word_of_a_graph_file() {
        assert_eq!(name("contact_speed2"), Ok("contact_speed2".into()));
        for wrong in ["", "2nd", "Speed", "a-b", "a b", "a/b", "_a"] {
            assert!(name(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_node_has_its_name_in_both_forms() {
        let text = What::Node.text("contact_speed");
        assert!(text.contains("pub struct ContactSpeed {") && text.contains("type = \"contact_speed\""));
        assert!(!text.contains("emplate"));
    }
}
