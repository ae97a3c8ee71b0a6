//! `completions`: scripts that complete the arguments of the tool in a shell.

use clap::builder::{PossibleValue, PossibleValuesParser};

use super::reference::entry::entries;
use super::shell::Shell;

/// Print the completion script of a shell
#[derive(clap::Parser)]
#[command(
    name = "completions",
    after_help = "Examples:
  tactflow completions bash > ~/.local/share/bash-completion/completions/tactflow
  tactflow completions zsh > ~/.zfunc/_tactflow
  tactflow completions fish > ~/.config/fish/completions/tactflow.fish"
)]
pub(crate) struct CompletionsArgs {
    /// Shell that completes the arguments
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

pub(crate) fn completions(args: CompletionsArgs, shell: &Shell) -> u8 {
    let mut text = Vec::new();
    // `describe` itself looks the name up, so that it can suggest a similar one.
    let all = entries(shell.catalogue()).into_iter();
    let names = PossibleValuesParser::new(all.map(|entry| PossibleValue::new(entry.name)));
    let describe = |command: clap::Command| command.mut_arg("name", |name| name.value_parser(names));
    let mut arguments = shell.arguments().clone().mut_subcommand("describe", describe);
    clap_complete::generate(args.shell, &mut arguments, "tactflow", &mut text);
    shell.say(String::from_utf8_lossy(&text).trim_end());
    0
}
