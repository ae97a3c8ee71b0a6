//! `show`: a graph as it runs, with the origin of every value.

use std::fmt::Write;
use std::path::PathBuf;

use clap::builder::styling::Style;

use super::shell::Shell;
use super::shell::command::{GraphArgs, OutputFormat};
use super::text::number::milliseconds;
use crate::graph::{
    Compiled, NO_SPAN, OutlinedBlock, OutlinedWire, OutlinedWord, PlannedPort, Setting, ValueOrigin, compile,
};
use crate::signal::{Shape, VectorImageShape};
use crate::source::{Item, Key, Location, SourceMap, Value};

/// Print a graph as it runs: every wire and every value, each with the file and line it comes from
#[derive(clap::Parser)]
#[command(
    name = "show",
    after_help = "Examples:
  tactflow show graphs/hybrid.toml
  tactflow show graphs/hybrid.toml --set nodes.pid.gains.x.kp=2 --format json"
)]
pub(crate) struct ShowArgs {
    /// The graph file
    graph: PathBuf,
    #[command(flatten)]
    graph_args: GraphArgs,
    /// Output format
    #[arg(long, value_enum, default_value_t = OutputFormat::Text, value_name = "FORMAT")]
    format: OutputFormat,
}

pub(crate) fn show(args: ShowArgs, shell: &Shell) -> u8 {
    let plan = match compile(shell.catalogue(), &args.graph_args.request(args.graph.clone())) {
        Ok(plan) => plan,
        Err(report) => return shell.reject(&report),
    };
    plan.warnings().iter().for_each(|report| shell.show(report));
    match args.format {
        OutputFormat::Json => shell.say_json(plan.outline()),
        OutputFormat::Text => {
            let title = format!(
                "# {} as it runs: {} nodes, one tick every {}\n",
                args.graph.display(),
                plan.order().count(),
                milliseconds(plan.period())
            );
            shell.say((title + &text(&plan, shell.has_colour())).trim_end());
        }
    }
    0
}

fn text(plan: &Compiled, has_colour: bool) -> String {
    let outline = plan.outline();
    let mut page = TomlPage { text: String::new(), has_colour };
    let assign = |text: String, place: &Location| Assignment { text, origin: at(place), below: String::new() };
    let word = |name: &str, word: &OutlinedWord| {
        assign(format!("{name} = {}", toml::Value::from(word.text.as_str())), &word.place)
    };
    let wire =
        |prefix: &str, wire: &OutlinedWire| assign(format!("{prefix}{} = {}", wire.name, from(wire)), &wire.place);
    let settings = |settings: &[Setting]| settings.iter().map(assignment).collect::<Vec<_>>();
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
    for task in &outline.tasks {
        page.section(&format!("graph of {}", task.name), &settings(&task.settings), &[]);
        page.section(&format!("policy of {}", task.name), &settings(&task.policy), &[]);
    }
    for mode in &outline.modes {
        page.section(&format!("modes.{}", mode.name), &settings(&mode.settings), &[]);
    }
    for (node, planned) in outline.nodes.iter().zip(&plan.plan.nodes) {
        let outputs: Vec<String> = planned.ports.iter().map(|port| format!("# {}", carried(port))).collect();
        page.section(&format!("nodes.{}", node.name), &block(node), &outputs);
    }
    page.section("bind", &roles.iter().map(|role| word(&role.name, &role.device)).collect::<Vec<_>>(), &[]);
    for device in &outline.devices {
        page.section(&format!("devices.{}", device.name), &block(device), &[]);
    }
    page.text
}

/// Writes a wire as TOML: its port, and its maximum age if it has one.
fn from(wire: &OutlinedWire) -> String {
    let source = toml::Value::from(wire.source.as_str());
    match wire.max_age_ms.zip(wire.stale) {
        Some((ms, stale)) => format!("{{ from = {source}, max_age_ms = {ms}, stale = \"{stale}\" }}"),
        None => source.to_string(),
    }
}

/// Writes a location as `file:line`.
fn at(place: &Location) -> String {
    match place.file.as_str() {
        SourceMap::COMMAND_LINE => SourceMap::COMMAND_LINE.to_owned(),
        file => format!("{file}:{}", place.line),
    }
}

fn assignment(setting: &Setting) -> Assignment {
    let origin = match &setting.origin {
        ValueOrigin::Written { place } => at(place),
        ValueOrigin::Default => "default".to_owned(),
        ValueOrigin::Fact { fact, place } => format!("fact {fact} ({})", at(place)),
    };
    let as_written = setting.written.as_ref().map(|value| format!(", written {}", written(value)));
    let origin = origin + as_written.as_deref().unwrap_or_default();
    let (path, tall) = (path(&setting.path), tall(&setting.value));
    let text = if tall.is_some() { "[".to_owned() } else { written(&setting.value) };
    Assignment { text: format!("{path} = {text}"), origin, below: tall.map(|lines| lines + "\n]").unwrap_or_default() }
}

/// Writes a dotted key as TOML, with quotes where they are needed.
fn path(path: &str) -> String {
    let is_bare =
        |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    let quoted = |name: &str| if is_bare(name) { name.to_owned() } else { toml::Value::from(name).to_string() };
    path.split('.').map(quoted).collect::<Vec<_>>().join(".")
}

/// Writes a value as TOML in one line.
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

/// Writes a list that is too long for one line, or returns `None` for any other value.
///
/// Each table has its own line, with the names of its defaults. Other values share lines.
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
        let line = lines.last_mut().expect("`lines` starts with one line");
        if line.is_empty() || is_tables || line.len() + text.len() + 1 > WIDTH {
            lines.push(format!("  {text}"));
        } else {
            line.push(' ');
            line.push_str(&text);
        }
        let keys = item.as_table().into_iter().flat_map(|table| &table.entries).map(|(key, _)| key);
        let defaults: Vec<&str> = keys.filter(|key| key.span == NO_SPAN).map(|key| key.name.as_str()).collect();
        if let Some(line) = lines.last_mut().filter(|_| !defaults.is_empty()) {
            line.push_str(&format!("  # default: {}", defaults.join(", ")));
        }
    }
    Some(lines.join("\n"))
}

/// Describes the signal of an output in this graph.
fn carried(port: &PlannedPort) -> String {
    let name = port.name.rsplit_once('.').map_or(port.name.as_str(), |(_, name)| name);
    let unit = port.shape.unit().map(|unit| format!(" [{unit}]")).unwrap_or_default();
    let shape = match &port.shape {
        Shape::Image(shape) | Shape::VectorImage(VectorImageShape(shape)) => {
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
    format!("output {name}: {}{unit}{shape}{frames}", port.shape.kind().name())
}

/// A key and a value, with their origin.
struct Assignment {
    text: String,
    origin: String,
    /// Further lines of a long value.
    below: String,
}

/// A page of TOML with the origin of each value in a comment.
struct TomlPage {
    text: String,
    has_colour: bool,
}

impl TomlPage {
    /// Longer lines do not move the column of comments [characters].
    const MAX_COLUMN: usize = 60;

    /// Adds a section with its assignments and their origins, and comments below. A section without any is left out.
    fn section(&mut self, name: &str, lines: &[Assignment], notes: &[String]) {
        if lines.is_empty() {
            return;
        }
        let (bold, dim) = match self.has_colour {
            true => (Style::new().bold(), Style::new().dimmed()),
            false => (Style::new(), Style::new()),
        };
        let width = |line: &Assignment| line.text.chars().count();
        let widths = lines.iter().map(width).filter(|width| *width <= Self::MAX_COLUMN);
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
