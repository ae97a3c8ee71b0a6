//! A mode that stands: what moves the sensor along an object rests, so that the mode lasts as long as a measurement.

use tactflow_runtime::graph::OutlinedMode;

use crate::tool::control::law::{Constant, Guidance, Law};
use crate::tool::control::nodes::Nodes;

/// Types that move the sensor along an object, with a speed that a mode may set to 0.
const GUIDES: [&str; 3] = ["scan_guide", "ridge_guide", "follow_path"];

/// Returns the nodes that would move the sensor along an object in a mode, and the settings with which they rest there.
/// A constant motion that presses goes on.
pub(super) fn settings(nodes: &Nodes<'_>, mode: &OutlinedMode, law: &Law) -> (Vec<String>, Vec<String>) {
    let slides = |constant: &&Constant| constant.twist[2] == 0.0 && constant.twist.iter().any(|part| *part != 0.0);
    let constants = law.constants.iter().filter(slides);
    let constants = constants.map(|constant| (constant.node.clone(), "twist=[0, 0, 0, 0, 0, 0]"));
    let is_moving = |guide: &&Guidance| {
        let speed = nodes.node(guide.node()).and_then(|node| nodes.number(node, "speed_m_per_s"));
        GUIDES.contains(&&*guide.kind) && speed.is_some_and(|speed| speed > 0.0)
    };
    let guides = law.guidance.iter().filter(is_moving);
    let guides = guides.map(|guide| (guide.node().to_owned(), "speed_m_per_s=0.0"));
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
        let path = format!("{}/../graphs/{task}.toml", env!("CARGO_MANIFEST_DIR"));
        let (catalogue, request) = (crate::catalogue(), Request::file(path));
        let load = |request: &Request| compile(&catalogue, request).unwrap_or_else(|it| panic!("{}", it.render(false)));
        let compiled = load(&request);
        let index = Index::new(compiled.outline());
        let mode = compiled.outline().modes.iter().find(|one| one.name == mode).unwrap();
        let nodes = Nodes::new(&index, Some(mode));
        let (names, set) = settings(&nodes, mode, &law(&nodes, "sum.twist"));
        load(&Request { set, ..request.clone() });
        names
    }

    #[test]
    fn what_slides_or_traces_rests_and_what_presses_or_holds_does_not() {
        assert_eq!(resting("cable", "servo"), ["guide"]);
        assert_eq!(resting("square", "trace"), ["path"]);
        assert_eq!(resting("explore", "scan"), ["scan"]);
        assert_eq!(resting("position", "press"), [""; 0]);
        assert_eq!(resting("hybrid", "servo"), [""; 0]);
    }
}
