//! From the command of an arm back to the twist that its task wants.

use serde::Serialize;

use super::mount::{Mount, mount};
use super::nodes::{Nodes, source, toml};

/// A node between the twist of a task and the command.
#[derive(Debug, Serialize)]
pub(crate) struct Limiter {
    pub(crate) node: String,
    #[serde(rename = "type")]
    pub(crate) kind: String,
    /// Its parameters as they are written, without those that are not set.
    pub(crate) values: Vec<(String, String)>,
}

/// Types that make the twist of a task, where the way back ends.
const MAKERS: [&str; 5] = ["twist_adder", "projector", "pivot", "inverse_jacobian", "twist_source"];

/// The way from the twist of a task to a command.
pub(crate) struct Chain {
    /// The nodes between them, the first one first.
    pub(crate) limits: Vec<Limiter>,
    /// The port of the twist before all of them.
    pub(crate) twist: String,
    /// Those of these nodes that turn the twist, from the arm back.
    pub(crate) mounts: Vec<Mount>,
}

/// Returns the way to a port.
pub(crate) fn chain(nodes: &Nodes<'_>, port: &str) -> Result<Chain, String> {
    let (mut limits, mut port, mut mounts) = (Vec::new(), port.to_owned(), Vec::new());
    let writer = |port: &str| nodes.writer(port).ok_or_else(|| format!("no node writes `{port}`"));
    let mut node = writer(&port)?;
    while !MAKERS.contains(&node.kind.text.as_str()) {
        let Some(input) = ["velocity", "twist"].into_iter().find_map(|input| source(node, input)) else { break };
        mounts.extend(mount(nodes, node));
        limits.push(Limiter {
            node: node.name.clone(),
            kind: node.kind.text.clone(),
            values: nodes.values(node).map(|(path, setting)| (path.to_owned(), toml(setting))).collect(),
        });
        input.clone_into(&mut port);
        match nodes.writer(&port) {
            Some(next) => node = next,
            None => break,
        }
    }
    limits.reverse();
    Ok(Chain { limits, twist: port, mounts })
}

/// Returns the smallest value that the limiters have for a parameter.
pub(crate) fn smallest(nodes: &Nodes<'_>, limits: &[Limiter], key: &str) -> Option<f64> {
    let blocks = limits.iter().filter_map(|limiter| nodes.node(&limiter.node));
    blocks.filter_map(|node| nodes.number(node, key)).min_by(f64::total_cmp)
}
