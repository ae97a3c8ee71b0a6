//! A mode that stands: what moves the sensor along an object rests, so that the mode lasts as long as a measurement.

use tactflow_runtime::graph::OutlinedMode;

use crate::tool::control::law::{Constant, Guidance, Law};
use crate::tool::control::nodes::Nodes;

/// Types that move the sensor along an object, with a speed that a mode may set to 0.
const GUIDES: [&str; 3] = ["scan_guide", "ridge_guide", "follow_path"];

/// Returns the nodes that would move the sensor along an object in a mode, and the settings with which they rest there.
/// A constant motion goes on to press.
pub(super) fn settings(nodes: &Nodes<'_>, mode: &OutlinedMode, law: &Law) -> (Vec<String>, Vec<String>) {
    let pressing = |constant: &Constant| [0.0, 0.0, constant.twist[2], 0.0, 0.0, 0.0];
    let constants = law.constants.iter().filter(|constant| constant.twist != pressing(constant));
    let constants = constants.map(|constant| (constant.node.clone(), format!("twist={:?}", pressing(constant))));
    let is_moving = |guide: &&Guidance| {
        let speed = nodes.node(guide.node()).and_then(|node| nodes.number(node, "speed_m_per_s"));
        GUIDES.contains(&&*guide.kind) && speed.is_some_and(|speed| speed > 0.0)
    };
    let guides = law.guidance.iter().filter(is_moving);
    let guides = guides.map(|guide| (guide.node().to_owned(), "speed_m_per_s=0.0".to_owned()));
    constants
        .chain(guides)
        .map(|(node, rests)| (node.clone(), format!("modes.{}.set.{node}.{rests}", mode.name)))
        .unzip()
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::graph::{Request, compile};

    use super::*;
    use crate::tool::control::collect::law;
    use crate::tool::control::nodes::Index;

    /// Returns what rests in a mode of a shipped task, after it has loaded with these settings.
    fn resting(task: &str, mode: &str) -> Vec<String> {
        rest(task, mode, &[]).0
    }

    /// Returns what rests in a mode of a shipped task with some settings, and how.
    fn rest(task: &str, mode: &str, changed: &[&str]) -> (Vec<String>, Vec<String>) {
        let path = format!("{}/../graphs/{task}.toml", env!("CARGO_MANIFEST_DIR"));
        let changed: Vec<String> = changed.iter().map(|set| (*set).to_owned()).collect();
        let (catalogue, request) = (crate::catalogue(), Request { set: changed.clone(), ..Request::file(path) });
        let load = |request: &Request| compile(&catalogue, request).unwrap_or_else(|it| panic!("{}", it.render(false)));
        let compiled = load(&request);
        let index = Index::new(compiled.outline());
        let mode = compiled.outline().modes.iter().find(|one| one.name == mode).unwrap();
        let nodes = Nodes::new(&index, Some(mode));
        let (names, set) = settings(&nodes, mode, &law(&nodes, "sum.twist"));
        load(&Request { set: [changed, set.clone()].concat(), ..request.clone() });
        (names, set)
    }

    #[test]
    fn what_slides_or_traces_rests_and_what_presses_or_holds_does_not() {
        assert_eq!(resting("cable", "servo"), ["guide"]);
        assert_eq!(resting("square", "trace"), ["path"]);
        assert_eq!(resting("explore", "scan"), ["scan"]);
        assert_eq!(resting("position", "press"), [""; 0]);
        assert_eq!(resting("hybrid", "servo"), [""; 0]);
        assert_eq!(resting("seek_ridge", "follow"), ["ridge"]);
    }

    #[test]
    fn what_presses_while_it_slides_goes_on_to_press() {
        let (names, set) = rest("hybrid", "servo", &["modes.servo.set.reach.twist=[0.002, 0.0, 0.001, 0.0, 0.0, 0.1]"]);
        assert_eq!(names, ["reach"]);
        assert_eq!(set, ["modes.servo.set.reach.twist=[0.0, 0.0, 0.001, 0.0, 0.0, 0.0]"]);
    }
}
