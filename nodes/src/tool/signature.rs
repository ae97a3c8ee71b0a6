//! `tactflow signature`: writes what a program states of itself into a file beside the graph.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tactflow_runtime::cli::{Shell, clap, duration};

use super::arguments::{may_replace, write};
use crate::devices::process::signature::{PortText, Signature};
use crate::devices::process::{ask_signature, in_shell};

/// Write the signature of a program: the ports and parameters with which a graph uses it
#[derive(clap::Parser)]
#[command(
    name = "signature",
    after_help = "A graph uses the program as a node with `type = \"process\"`. `tactflow check` reads the file and does not run the
program. When the program changes its ports, write the file once more.

Examples:
  tactflow signature -- python3 my_feature.py
  tactflow signature --out my_feature.node.toml -- ./build/my_feature

Exit codes: 0 the file is written; 2 the program states no signature, or the file cannot be written."
)]
pub(super) struct SignatureArgs {
    /// Program and its arguments
    #[arg(required = true, last = true, value_name = "COMMAND")]
    command: Vec<String>,
    /// File to write; replaces a signature, but no other file [default: NAME.node.toml]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Longest time until the program has stated its signature
    #[arg(long = "for", value_name = "TIME", value_parser = duration, default_value = "30s")]
    time: f64,
}

pub(super) fn run(args: SignatureArgs, shell: &Shell) -> Result<u8, u8> {
    let patience = Duration::from_secs_f64(args.time.clamp(0.1, 3600.0));
    // The program runs in the folder of its signature, then as now.
    let folder = args.out.as_deref().and_then(Path::parent).filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let command = in_shell(&args.command);
    let signature = ask_signature(&args.command, folder, patience);
    let signature = signature.map_err(|why| shell.refuse(format_args!("`{command}`: {why}")))?;
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from(format!("{}.node.toml", signature.name)));
    let refuse = |message: String| shell.refuse(message);
    may_replace(&out, "a signature", |text| Signature::from_toml(text).is_ok()).map_err(refuse)?;
    let text = toml::to_string(&signature).map_err(|error| shell.refuse(error))?;
    // A line break in an argument would end the comment.
    let command = command.escape_debug();
    let text = format!("# What `{command}` states of itself; `tactflow signature` writes this file.\n{text}");
    write(&out, &text).map_err(refuse)?;
    shell.say(&summary(&signature, &args.command, &out));
    Ok(0)
}

/// Describes what was written, with a block to paste.
fn summary(signature: &Signature, command: &[String], out: &Path) -> String {
    let list = |ports: &[PortText]| -> String {
        let port = |port: &PortText| format!("`{}`, {}", port.name, port.kind);
        let ports: Vec<String> = ports.iter().map(port).collect();
        if ports.is_empty() { "none".to_owned() } else { ports.join("; ") }
    };
    let file = out.file_name().unwrap_or(out.as_os_str()).to_string_lossy();
    let [command, file] =
        [toml::Value::from(command.to_vec()), toml::Value::from(&*file)].map(|value| value.to_string());
    let mut text = format!(
        "{} is written: inputs {}; outputs {}",
        out.display(),
        list(&signature.inputs),
        list(&signature.outputs)
    );
    let (section, wires) =
        if signature.inputs.is_empty() { ("devices", &[][..]) } else { ("nodes", &signature.inputs[..]) };
    let _ = write!(
        text,
        "\nuse it with\n\n[{section}.{}]\ntype = \"process\"\ncommand = {command}\nsignature = {file}",
        signature.name
    );
    for port in wires {
        let _ = write!(text, "\nin.{} = \"NODE.PORT\"", port.name);
    }
    text
}
