//! Large graphs of a given size, one family for each way in which graphs grow.

use std::fmt::Write;

use crate::workspace;

/// Returns the text of a graph, or of one block of it, for a number.
pub type LargeGraph = fn(usize) -> String;

/// Every family: its name and its graph.
pub const FAMILIES: [(&str, LargeGraph); 8] = [
    ("chain", chain),
    ("reversed", reversed),
    ("fan_out", fan_out),
    ("fan_in", fan_in),
    ("parts", parts),
    ("modes", modes),
    ("pads", pads),
    ("twists", twists),
];

/// The start of a graph with one pad.
const HEAD: &str = r#"
[graph]
clock = "pad"

[roles]
pad = "tactile_pad"

[bind]
pad = "pad"

[devices.pad]
type = "mock_pad"
rate_hz = 250
for_s = 0.1

[nodes.source]
type = "tactile_source"
in.image = "pad.image"
flip_y = false
"#;

/// Returns a graph with one pad, `source.sum`, and the given blocks.
#[must_use]
pub fn graph(blocks: impl Iterator<Item = String>) -> String {
    HEAD.to_owned() + &blocks.collect::<String>()
}

/// Returns a filter `n` of a port.
#[must_use]
pub fn filter(name: usize, from: &str) -> String {
    format!("\n[nodes.n{name}]\ntype = \"low_pass\"\nin.value = \"{from}\"\ntime_constant_ms = 40.0\n")
}

fn link(name: usize) -> String {
    filter(name, &name.checked_sub(1).map_or("source.sum".into(), |before| format!("n{before}.value")))
}

/// Filters one after the other.
fn chain(nodes: usize) -> String {
    graph((0..nodes).map(link))
}

/// The same chain with its last node first in the file.
fn reversed(nodes: usize) -> String {
    graph((0..nodes).rev().map(link))
}

/// One source with many readers.
fn fan_out(nodes: usize) -> String {
    graph((0..nodes).map(|name| filter(name, "source.sum")))
}

/// Many sources into one input.
fn fan_in(nodes: usize) -> String {
    let mut text = fan_out(nodes) + "\n[nodes.all]\ntype = \"probe\"\nevery_ms = 1e6\n";
    for name in 0..nodes {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "in.w{name} = \"n{name}.value\"");
    }
    text
}

/// A chain of parts with three nodes each.
fn parts(nodes: usize) -> String {
    let file = workspace().join("tests/data/three_filters.toml");
    graph((0..nodes / 3).map(|name| {
        let from = name.checked_sub(1).map_or("source.sum".into(), |before| format!("p{before}.value"));
        format!(
            "\n[parts.p{name}]\nfile = {:?}\nin.value = \"{from}\"\nset.second.time_constant_ms = 20.0\n",
            file.display().to_string()
        )
    }))
}

/// As many modes as nodes, each of which sets the gain of another node.
fn modes(nodes: usize) -> String {
    let modes = nodes / 2;
    let nodes = (0..modes).map(|name| {
        let next = (name + 1) % modes;
        format!(
            "\n[nodes.n{name}]\ntype = \"pid\"\nin.error = \"error.error\"\ngains.sum = {{ kp = 1.0 }}\n\
             \n[modes.m{name}]\nset.n{name}.gains.sum = {{ kp = 2.0 }}\ngo = {{ after_ms = 10.0, to = \"m{next}\" }}\n"
        )
    });
    let error = "\n[nodes.error]\ntype = \"feature_error\"\nin.sum = \"source.sum\"\nsetpoint.sum = 1.0\n";
    graph(std::iter::once(error.to_owned()).chain(nodes)).replacen("[graph]", "[graph]\nstart = \"m0\"", 1)
}

/// As many pads as nodes, each with a device of its own.
fn pads(nodes: usize) -> String {
    let (mut roles, mut bind, mut blocks) = (String::new(), String::new(), String::new());
    for name in 0..nodes / 2 {
        // Writing to a string cannot fail.
        let _ = writeln!(roles, "pad{name} = \"tactile_pad\"");
        let _ = writeln!(bind, "pad{name} = \"device{name}\"");
        let _ = writeln!(
            blocks,
            "[devices.device{name}]\ntype = \"mock_pad\"\nrate_hz = 250\nfor_s = 0.1\n\
             [nodes.n{name}]\ntype = \"tactile_source\"\nin.image = \"pad{name}.image\"\nflip_y = false"
        );
    }
    format!("[graph]\nclock = \"pad0\"\n[roles]\n{roles}[bind]\n{bind}{blocks}")
}

/// A chain of motions, which share one frame.
fn twists(nodes: usize) -> String {
    let still = "\n[nodes.still]\ntype = \"twist_source\"\ntwist = [0, 0, 0, 0, 0, 0]\n".to_owned();
    let adders = (0..nodes).map(|name| {
        let from = name.checked_sub(1).map_or("still.twist".into(), |before| format!("n{before}.twist"));
        format!("\n[nodes.n{name}]\ntype = \"twist_adder\"\nin.before = \"{from}\"\n")
    });
    graph(std::iter::once(still).chain(adders))
}
