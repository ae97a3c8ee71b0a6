//! `show`: a graph as it runs, flat, with every value and where it comes from.

use std::fmt::Write;
use std::path::PathBuf;

use clap::builder::styling::Style;
use serde::Serialize;

use super::check::milliseconds;
use super::describe::Format;
use super::json::{Place, json, place};
use super::{OnArgs, Shell};
use crate::graph::{Compiled, NO_SPAN, Origin, OutlinedBlock, OutlinedWire, PlannedPort, Setting, compile};
use crate::node::Word;
use crate::signal::Shape;
use crate::source::{Item, Key, SourceMap, Value};

/// Show a graph as it runs: every wire and value, and where it comes from
#[derive(clap::Parser)]
#[command(
    name = "show",
    after_help = "Examples:
  tactflow show graphs/hybrid.toml
  tactflow show graphs/hybrid.toml --set nodes.pid.gains.x.kp=3 --format json"
)]
pub(super) struct Show {
    /// The graph file
    graph: PathBuf,
    #[command(flatten)]
    on: OnArgs,
    /// How to print it
    #[arg(long, value_enum, default_value_t = Format::Text, value_name = "FORMAT")]
    format: Format,
}

pub(super) fn show(args: Show, shell: &Shell) -> u8 {
    let plan = match compile(shell.catalogue(), &args.on.request(args.graph.clone())) {
        Ok(plan) => plan,
        Err(report) => return shell.complain(&report),
    };
    plan.warnings().iter().for_each(|report| shell.show(report));
    match args.format {
        Format::Json => shell.say_json(&Shown::of(&plan)),
        Format::Text => {
            let title = format!(
                "# {} as it runs: {} nodes, a tick each {}\n",
                args.graph.display(),
                plan.order().count(),
                milliseconds(plan.period())
            );
            shell.say((title + &text(&plan, shell.has_colour())).trim_end());
        }
    }
    0
}

/// Nodes in the order in which they step.
fn stepped(plan: &Compiled) -> impl Iterator<Item = &OutlinedBlock> {
    plan.order().filter_map(|name| plan.outline().nodes.iter().find(|node| node.name == name))
}

fn text(plan: &Compiled, has_colour: bool) -> String {
    let (outline, sources) = (plan.outline(), plan.sources());
    let mut page = Page { text: String::new(), has_colour };
    let word = |name: &str, word: &Word| Line::new(name, &word.text, at(sources, word.span.start));
    let wire = |prefix: &str, wire: &OutlinedWire| {
        let text = format!("{prefix}{} = {}", wire.name, from(wire));
        Line { text, origin: at(sources, wire.span.start), below: String::new() }
    };
    let settings = |settings: &[Setting]| settings.iter().map(|setting| line(setting, sources)).collect::<Vec<_>>();
    let block = |block: &OutlinedBlock| {
        let mut lines = vec![word("type", &block.kind)];
        lines.extend(block.wires.iter().map(|one| wire("in.", one)));
        lines.extend(settings(&block.settings));
        lines
    };
    let (roles, commands) = (&outline.roles, &outline.commands);
    page.section("graph", &settings(&outline.settings), &[]);
    page.section("roles", &roles.iter().map(|role| word(&role.name, &role.kind)).collect::<Vec<_>>(), &[]);
    page.section("commands", &commands.iter().map(|command| wire("", command)).collect::<Vec<_>>(), &[]);
    page.section("policy", &settings(&outline.policy), &[]);
    for mode in &outline.modes {
        page.section(&format!("modes.{}", mode.name), &settings(&mode.settings), &[]);
    }
    for node in stepped(plan) {
        let gives: Vec<String> = plan.outputs(&node.name).map(|port| format!("# {}", carried(port))).collect();
        page.section(&format!("nodes.{}", node.name), &block(node), &gives);
    }
    page.section("bind", &roles.iter().map(|role| word(&role.name, &role.device)).collect::<Vec<_>>(), &[]);
    for device in &outline.devices {
        page.section(&format!("devices.{}", device.name), &block(device), &[]);
    }
    page.text
}

/// Where a wire comes from, and how old what comes over it may be, as TOML.
fn from(wire: &OutlinedWire) -> String {
    let source = toml::Value::from(wire.source.as_str());
    match wire.age {
        Some((ms, stale)) => format!("{{ from = {source}, max_age_ms = {ms}, stale = \"{}\" }}", stale.word()),
        None => source.to_string(),
    }
}

/// `file:line`.
fn at(sources: &SourceMap, at: usize) -> String {
    let file = sources.file_at(at);
    match file.name.as_str() {
        SourceMap::COMMAND_LINE => SourceMap::COMMAND_LINE.to_owned(),
        name => format!("{name}:{}", file.line_column(at).0),
    }
}

fn line(setting: &Setting, sources: &SourceMap) -> Line {
    let origin = match &setting.origin {
        Origin::Written(span) => at(sources, span.start),
        Origin::Default => "default".to_owned(),
        Origin::Fact { fact, device } => format!("fact {fact} ({})", at(sources, device.start)),
    };
    let (path, tall) = (path(&setting.path), tall(&setting.value));
    let text = if tall.is_some() { "[".to_owned() } else { written(&setting.value) };
    Line { text: format!("{path} = {text}"), origin, below: tall.map(|lines| lines + "\n]").unwrap_or_default() }
}

/// A dotted key, quoted where it must be.
fn path(path: &str) -> String {
    let is_bare =
        |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    let quoted = |name: &str| if is_bare(name) { name.to_owned() } else { toml::Value::from(name).to_string() };
    path.split('.').map(quoted).collect::<Vec<_>>().join(".")
}

/// A value as TOML, in one line.
fn written(value: &Value) -> String {
    let all = |items: Vec<String>| items.join(", ");
    match &value.item {
        Item::String(text) => toml::Value::from(text.as_str()).to_string(),
        Item::Integer(number) => number.to_string(),
        Item::Float(number) => toml::Value::from(*number).to_string(),
        Item::Boolean(value) => value.to_string(),
        Item::Datetime(text) => text.clone(),
        Item::Array(items) => format!("[{}]", all(items.iter().map(written).collect())),
        Item::Table(table) => {
            let entry = |(key, value): &(Key, Value)| format!("{} = {}", path(&key.name), written(value));
            format!("{{ {} }}", all(table.entries.iter().map(entry).collect()))
        }
    }
}

/// A list that is too long for a line: a table a line, with what is default in it, or as many values as fit.
fn tall(value: &Value) -> Option<String> {
    const WIDTH: usize = 96;
    let Item::Array(items) = &value.item else { return None };
    let is_tables = items.iter().any(|item| item.as_table().is_some());
    if !is_tables && written(value).len() <= WIDTH {
        return None;
    }
    let mut lines = vec![String::new()];
    for item in items {
        let text = format!("{},", written(item));
        let line = lines.last_mut().expect("there is one from the start");
        if line.is_empty() || is_tables || line.len() + text.len() + 1 > WIDTH {
            lines.push(format!("  {text}"));
        } else {
            line.push(' ');
            line.push_str(&text);
        }
        let defaults: Vec<&str> = item
            .as_table()
            .into_iter()
            .flat_map(|table| &table.entries)
            .filter(|(key, _)| key.span == NO_SPAN)
            .map(|(key, _)| key.name.as_str())
            .collect();
        if let Some(line) = lines.last_mut().filter(|_| !defaults.is_empty()) {
            line.push_str(&format!("  # default: {}", defaults.join(", ")));
        }
    }
    Some(lines.join("\n"))
}

/// What a port carries in this graph.
fn carried(port: &PlannedPort) -> String {
    let name = port.name.rsplit_once('.').map_or(port.name.as_str(), |(_, name)| name);
    let unit = port.shape.unit().map(|unit| format!(" [{unit}]")).unwrap_or_default();
    let shape = match &port.shape {
        Shape::Image(shape) => {
            format!(", {} x {}, pitch {} m x {} m", shape.rows, shape.cols, shape.pitch[0], shape.pitch[1])
        }
        Shape::Mask(grid) => format!(", {} x {}", grid.rows, grid.cols),
        Shape::Features(shape) => {
            let features = shape.features.iter().map(|feature| format!(" {} [{}]", feature.name, feature.unit));
            features.collect::<Vec<_>>().join(",")
        }
        Shape::Joints(shape) => format!(", {} joints", shape.joints.len()),
        Shape::Jacobian(shape) => format!(", {} joints", shape.0.joints.len()),
        _ => String::new(),
    };
    let frames: Vec<&str> = port.frames.iter().flatten().map(String::as_str).collect();
    let frames = if frames.is_empty() { String::new() } else { format!(", in {}", frames.join(" in ")) };
    format!("gives {name}: {}{unit}{shape}{frames}", port.shape.kind().name())
}

/// An assignment.
struct Line {
    text: String,
    origin: String,
    /// The rest of what does not fit in a line.
    below: String,
}

impl Line {
    fn new(name: &str, text: &str, origin: String) -> Self {
        Self { text: format!("{name} = {}", toml::Value::from(text)), origin, below: String::new() }
    }
}

struct Page {
    text: String,
    has_colour: bool,
}

impl Page {
    /// As far right as comments are put in line.
    const FARTHEST: usize = 60;

    /// A section with its assignments, each with its origin, and comments below.
    fn section(&mut self, name: &str, lines: &[Line], notes: &[String]) {
        if lines.is_empty() {
            return;
        }
        let (bold, dim) = match self.has_colour {
            true => (Style::new().bold(), Style::new().dimmed()),
            false => (Style::new(), Style::new()),
        };
        let width = |line: &Line| line.text.chars().count();
        let widths = lines.iter().map(width).filter(|width| *width <= Self::FARTHEST);
        let column = widths.max().unwrap_or(0);
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "\n{bold}[{name}]{bold:#}");
        for line in lines {
            let pad = " ".repeat(column.saturating_sub(width(line)));
            let _ = writeln!(self.text, "{}{pad}  {dim}# {}{dim:#}{}", line.text, line.origin, line.below);
        }
        for note in notes {
            let _ = writeln!(self.text, "{dim}{note}{dim:#}");
        }
    }
}

/// The JSON of a graph as it runs.
#[derive(Serialize)]
struct Shown {
    period_s: f64,
    graph: Vec<ShownSetting>,
    roles: Vec<ShownRole>,
    commands: Vec<ShownWire>,
    policy: Vec<ShownSetting>,
    modes: Vec<ShownMode>,
    nodes: Vec<ShownBlock>,
    devices: Vec<ShownBlock>,
}

#[derive(Serialize)]
struct ShownRole {
    name: String,
    r#type: String,
    device: String,
}

#[derive(Serialize)]
struct ShownMode {
    name: String,
    /// `set.…` for each value that it sets, and its exits.
    settings: Vec<ShownSetting>,
}

#[derive(Serialize)]
struct ShownBlock {
    name: String,
    r#type: String,
    place: Place,
    inputs: Vec<ShownWire>,
    params: Vec<ShownSetting>,
    outputs: Vec<ShownPort>,
}

#[derive(Serialize)]
struct ShownWire {
    name: String,
    source: String,
    /// How old what comes over it may be, and what is done when it is older; null if it does not say that.
    max_age_ms: Option<f64>,
    stale: Option<&'static str>,
    place: Place,
}

#[derive(Serialize)]
struct ShownSetting {
    path: String,
    value: serde_json::Value,
    /// `written`, `default` or `fact`.
    origin: &'static str,
    /// The fact: `role.fact`.
    fact: Option<String>,
    /// Where it is written, or where the device stands that states it.
    place: Option<Place>,
}

#[derive(Serialize)]
struct ShownPort {
    name: String,
    kind: &'static str,
    /// Of a kind that has one for the whole.
    unit: Option<String>,
    frames: Vec<Option<String>>,
}

impl Shown {
    fn of(plan: &Compiled) -> Self {
        let (outline, sources) = (plan.outline(), plan.sources());
        let wire = |wire: &OutlinedWire| ShownWire {
            name: wire.name.clone(),
            source: wire.source.clone(),
            max_age_ms: wire.age.map(|(ms, _)| ms),
            stale: wire.age.map(|(_, stale)| stale.word()),
            place: place(sources, &wire.span),
        };
        let settings = |settings: &[Setting]| settings.iter().map(|setting| shown(setting, sources)).collect();
        let block = |block: &OutlinedBlock| ShownBlock {
            name: block.name.clone(),
            r#type: block.kind.text.clone(),
            place: place(sources, &block.span),
            inputs: block.wires.iter().map(wire).collect(),
            params: settings(&block.settings),
            outputs: plan.outputs(&block.name).map(ShownPort::of).collect(),
        };
        let modes = outline.modes.iter();
        let modes = modes.map(|mode| ShownMode { name: mode.name.clone(), settings: settings(&mode.settings) });
        let roles = outline.roles.iter().map(|role| ShownRole {
            name: role.name.clone(),
            r#type: role.kind.text.clone(),
            device: role.device.text.clone(),
        });
        Self {
            period_s: plan.period(),
            graph: settings(&outline.settings),
            roles: roles.collect(),
            commands: outline.commands.iter().map(wire).collect(),
            policy: settings(&outline.policy),
            modes: modes.collect(),
            nodes: stepped(plan).map(block).collect(),
            devices: outline.devices.iter().map(|device| ShownBlock { outputs: Vec::new(), ..block(device) }).collect(),
        }
    }
}

impl ShownPort {
    fn of(port: &PlannedPort) -> Self {
        Self {
            name: port.name.clone(),
            kind: port.shape.kind().name(),
            unit: port.shape.unit().map(|unit| unit.to_string()),
            frames: port.frames.clone(),
        }
    }
}

fn shown(setting: &Setting, sources: &SourceMap) -> ShownSetting {
    let (origin, fact, span) = match &setting.origin {
        Origin::Written(span) => ("written", None, Some(span)),
        Origin::Default => ("default", None, None),
        Origin::Fact { fact, device } => ("fact", Some(fact.clone()), Some(device)),
    };
    let place = span.map(|span| place(sources, span));
    ShownSetting { path: setting.path.clone(), value: json(&setting.value), origin, fact, place }
}
