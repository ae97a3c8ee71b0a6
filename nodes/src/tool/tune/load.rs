//! How much of the limits of a force a run takes, and which larger motion keeps below them.

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::Outline;
use tactflow_runtime::node::PortId;
use tactflow_runtime::signal::Image;

use crate::tool::control::nodes::{Index, Nodes, source};

/// Largest share of a limit that a test signal may take [1]: a contact that stiffens comes on top.
const MOST: f64 = 0.9;

/// The load under one limit, as shares of it.
#[derive(Debug)]
struct Load {
    image: PortId,
    limit: String,
    /// What the limit counts, of an image.
    of: fn(&Image) -> f64,
    /// The limit, in the unit of the image.
    ceiling: f64,
    /// The largest one before the test signal, and the largest one during it [1]. Both contain the noise.
    calm: f64,
    most: f64,
}

/// What a limit counts of an image, and the keys of this limit.
struct Count {
    keys: [&'static str; 2],
    of: fn(&Image) -> f64,
}

const COUNTS: [Count; 2] =
    [Count { keys: ["force_n", "force_raw"], of: sum }, Count { keys: ["peak_n", "peak_raw"], of: peak }];

/// What the limits of a force leave to a test signal.
#[derive(Debug)]
pub(super) struct Room {
    /// Its largest amplitude with which no load comes near a limit [m] or [rad].
    pub(super) amplitude: f64,
    /// The limit that decides, for a sentence.
    pub(super) limit: String,
}

/// The loads of a run under all limits of a force, those of all pads of the graph.
#[derive(Debug)]
pub(super) struct Loads {
    loads: Vec<Load>,
}

impl Loads {
    /// The limits of a graph that runs.
    pub(super) fn new(outline: &Outline, engine: &Engine) -> Self {
        let index = Index::new(outline);
        let nodes = Nodes::new(&index, None);
        let limiters = outline.nodes.iter().filter(|node| node.kind.text.ends_with("contact_limit"));
        let loads = limiters.flat_map(|node| {
            let image = source(node, "image").and_then(|image| port(engine, image));
            let keys = COUNTS.iter().flat_map(|Count { keys, of }| keys.map(|key| (key, *of)));
            keys.filter_map(|(key, of)| {
                let (image, ceiling) = (image?, nodes.number(node, key)?);
                Some(Load { image, limit: format!("`{key}` of `{}`", node.name), of, ceiling, calm: 0.0, most: 0.0 })
            })
            .collect::<Vec<_>>()
        });
        Self { loads: loads.collect() }
    }

    /// Forgets what was read.
    pub(super) fn clear(&mut self) {
        self.loads.iter_mut().for_each(|load| (load.calm, load.most) = (0.0, 0.0));
    }

    /// Reads the loads of the last tick, before the test signal or during it.
    pub(super) fn see(&mut self, engine: &Engine, is_calm: bool) {
        for load in &mut self.loads {
            let share = engine.bus().get(load.image).map_or(0.0, load.of) / load.ceiling;
            let most = if is_calm { &mut load.calm } else { &mut load.most };
            *most = most.max(share);
        }
    }

    /// Returns the room that the limits leave, after a motion with this amplitude; `None` if it has moved no load.
    pub(super) fn room(&self, amplitude: f64) -> Option<Room> {
        let each = self.loads.iter().filter_map(|load| {
            Some(Room { amplitude: amplitude * further(load.calm, load.most)?, limit: load.limit.clone() })
        });
        each.min_by(|one, other| one.amplitude.total_cmp(&other.amplitude))
    }
}

/// Returns the largest motion that keeps a load below its limit, as a multiple of one that has moved it from `calm` to
/// `most` of this limit; `None` if that did not move it.
fn further(calm: f64, most: f64) -> Option<f64> {
    if calm >= MOST {
        return Some(0.0);
    }
    (most > calm).then(|| (MOST - calm) / (most - calm))
}

fn port(engine: &Engine, name: &str) -> Option<PortId> {
    engine.ports().iter().find(|(port, _)| port.name == name).map(|(_, id)| *id)
}

/// Returns the sum of an image; negative tactels do not count.
fn sum(image: &Image) -> f64 {
    image.cells().iter().map(|cell| f64::from(cell.max(0.0))).sum()
}

fn peak(image: &Image) -> f64 {
    image.cells().iter().copied().fold(0.0, f32::max).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_grows_until_the_load_comes_near_its_limit() {
        let near = |found: Option<f64>, expected: f64| found.is_some_and(|found| (found - expected).abs() < 1e-9);
        assert!(near(further(0.5, 0.6), 4.0) && near(further(0.5, 0.95), 0.4 / 0.45));
        assert!(near(further(0.95, 0.95), 0.0) && near(further(0.95, 0.6), 0.0), "it is there already");
        assert_eq!([further(0.5, 0.5), further(0.5, 0.4)], [None; 2], "the motion does not change the load");
    }
}
