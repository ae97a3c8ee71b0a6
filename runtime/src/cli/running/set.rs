//! `set`: changes live parameters of a run.

use std::collections::BTreeMap;

use super::RunArg;
use super::save::Save;
use crate::cli::shell::Shell;
use crate::socket::{Ask, WalkAnswer};

/// Change parameters of a graph that runs, which it lists in [live]
#[derive(clap::Parser)]
#[command(
    name = "set",
    after_help = "Examples:
  tactflow set pid.gains.y.kp=2
  tactflow set pid.gains.y.kp=2 pid.gains.x.kp=3    both are checked together
  tactflow set pid.gains.y.kp=2 --save              and write it to the graph file"
)]
pub(super) struct SetArgs {
    /// A parameter and its new value, in the unit that `get` prints
    #[arg(required = true, value_name = "NODE.PARAM=VALUE", value_parser = assignment)]
    values: Vec<(String, f64)>,
    /// Write the values to the graph file too; its comments and its layout stay
    #[arg(long)]
    save: bool,
    #[command(flatten)]
    run: RunArg,
}

/// Parses a parameter and a number.
fn assignment(text: &str) -> Result<(String, f64), String> {
    let form = "give a parameter and a number: pid.gains.x.kp=3";
    let (name, number) = text.split_once('=').ok_or(form)?;
    let name = name.trim();
    if let Some(short) = name.strip_prefix("nodes.") {
        return Err(format!("write `{short}`, as in [live]"));
    }
    match number.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && !name.is_empty() => Ok((name.to_owned(), value)),
        _ => Err(format!("`{}` is not a number: {form}", number.trim())),
    }
}

pub(super) fn set(args: SetArgs, shell: &Shell) -> Result<u8, u8> {
    let refuse = |message: String| shell.refuse(message);
    let mut values = BTreeMap::new();
    for (name, value) in args.values {
        if values.insert(name.clone(), value).is_some() {
            return Err(refuse(format!("`{name}` is given twice")));
        }
    }
    let mut client = args.run.connect().map_err(refuse)?;
    // What cannot be saved is refused before anything changes.
    let save = args.save.then(|| Save::prepare(&mut client, &values)).transpose().map_err(refuse)?;
    let walks: Vec<WalkAnswer> = client.ask(&Ask::Set { values }).map_err(refuse)?;
    for WalkAnswer { name, from, to, seconds } in walks {
        if from == to {
            shell.say(&format!("`{name}` is {to}"));
        } else {
            shell.say(&format!("`{name}` goes from {from} to {to} in about {seconds:.1} s"));
        }
    }
    if let Some(save) = save {
        let saved = save.write().map_err(|why| refuse(format!("the values change, and are not saved: {why}")))?;
        shell.say(saved.trim_end());
    }
    Ok(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_assignment_has_a_parameter_and_a_number() {
        assert_eq!(assignment("a.b = -1e-3"), Ok(("a.b".to_owned(), -0.001)));
        for text in ["a.b", "=1", "a.b=", "a.b=x", "a.b=nan", "a.b=inf", "nodes.a.b=1"] {
            assert!(assignment(text).is_err(), "{text}");
        }
    }
}
