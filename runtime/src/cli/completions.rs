//! `completions`: what a shell wants to know to complete the tool's arguments.

use clap::builder::{PossibleValue, PossibleValuesParser};

use super::Shell;
use super::entry::Entries;

/// Print the completions for a shell
#[derive(clap::Parser)]
#[command(
    name = "completions",
    after_help = "Examples:
  tactflow completions bash > ~/.local/share/bash-completion/completions/tactflow
  tactflow completions zsh > ~/.zfunc/_tactflow
  tactflow completions fish > ~/.config/fish/completions/tactflow.fish"
)]
pub(super) struct Completions {
    /// The shell
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

pub(super) fn completions(args: Completions, shell: &Shell) -> u8 {
    let mut text = Vec::new();
    // What `describe` takes is known here; there it is looked up, so that a name that is wrong gets an answer.
    let all = Entries::new(shell.catalogue()).all();
    let names = PossibleValuesParser::new(all.into_iter().map(|entry| PossibleValue::new(entry.name)));
    let arguments = shell.arguments().clone();
    let mut arguments =
        arguments.mut_subcommand("describe", |describe| describe.mut_arg("name", |name| name.value_parser(names)));
    clap_complete::generate(args.shell, &mut arguments, "tactflow", &mut text);
    shell.say(String::from_utf8_lossy(&text).trim_end());
    0
}
