//! `get`: the live parameters of a run, and the newest values of its ports.

use super::RunArg;
use crate::cli::shell::Shell;
use crate::cli::shell::command::OutputFormat;
use crate::cli::text::number::number;
use crate::cli::text::table::table;
use crate::socket::{Ask, Got, LiveState, PortState};

/// Print the live parameters of a graph that runs, and the newest values of its ports
#[derive(clap::Parser)]
#[command(
    name = "get",
    after_help = "Examples:
  tactflow get                 everything
  tactflow get pid.gains.y.kp  one parameter
  tactflow get 'touch.*'       the parameters and ports whose names begin with `touch.`
  tactflow get --run hybrid    of one of several runs"
)]
pub(super) struct GetArgs {
    /// A name, or a pattern in which `*` stands for any text
    pattern: Option<String>,
    #[command(flatten)]
    run: RunArg,
    /// Output format
    #[arg(long, value_enum, default_value_t = OutputFormat::Text, value_name = "FORMAT")]
    format: OutputFormat,
}

pub(super) fn get(args: GetArgs, shell: &Shell) -> Result<u8, u8> {
    let refuse = |message: String| shell.refuse(message);
    let mut client = args.run.connect().map_err(refuse)?;
    let got: Got = client.ask(&Ask::Get { pattern: args.pattern }).map_err(refuse)?;
    if args.format == OutputFormat::Json {
        shell.say_json(&got);
    } else {
        shell.say(text(&got).trim_end());
    }
    Ok(0)
}

fn text(got: &Got) -> String {
    let mut text = String::new();
    if !got.live.is_empty() {
        let mut rows = vec![["live parameter", "value", "target", "min", "max", "rate", "unit"].map(String::from)];
        let row = |live: &LiveState| {
            let LiveState { name, value, target, min, max, rate, unit, .. } = live;
            let moving = if value == target { value.to_string() } else { number(*value) };
            let [target, min, max] = [target, min, max].map(|value| value.to_string());
            [name.clone(), moving, target, min, max, format!("{rate}/s"), unit.clone().unwrap_or_default()]
        };
        rows.extend(got.live.iter().map(row));
        text += &table(&rows, 1, 6);
        text.push('\n');
    }
    if !got.ports.is_empty() {
        let mut rows = vec![["port", "value", "unit"].map(String::from)];
        let row = |PortState { name, value, unit }: &PortState| {
            [name.clone(), value.map_or_else(|| "absent".into(), number), unit.clone()]
        };
        rows.extend(got.ports.iter().map(row));
        text += &table(&rows, 1, 2);
    }
    text
}
