//! `completions`: what a shell wants to know to complete the tool's arguments.

use super::Shell;

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
    clap_complete::generate(args.shell, &mut shell.arguments().clone(), "tactflow", &mut text);
    shell.say(String::from_utf8_lossy(&text).trim_end());
    0
}
