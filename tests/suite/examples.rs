//! The examples of the nodes: together they are a graph that loads and runs.

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::source::Report;
use tactflow_tests::examples::graph_of_all;

fn load(text: String) -> Result<Compiled, Report> {
    compile(&tactflow_nodes::catalogue(), &Request::text(text))
}

#[test]
fn all_examples_load_at_once_and_run() {
    let plan =
        load(graph_of_all(&tactflow_nodes::catalogue())).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let frames = |name: &str| plan.ports().find(|port| port.name == name).unwrap().frames.clone();
    assert_eq!(frames("contact_point.z"), [Some("arm.base".to_owned())]);
    assert_eq!(frames("contact_point.pose"), ["contact_point", "arm.base"].map(|frame| Some(frame.to_owned())));
    assert_eq!(frames("edge_guard.twist"), [Some("pad".to_owned())]);
    let mut engine = Engine::new(plan);
    while let Some(now) = engine.next().filter(|_| engine.ticks() < 500) {
        engine.tick(now).unwrap_or_else(|fault| panic!("{fault}"));
    }
    assert_eq!(engine.ticks(), 500);
    assert_eq!(engine.logged().len(), 1);
}

#[test]
fn an_example_is_one_block_of_its_own_type() {
    for node in tactflow_nodes::catalogue().nodes() {
        let spec = node.spec();
        if spec.example.is_empty() {
            continue;
        }
        let example: toml::Table = spec.example.parse().unwrap();
        let blocks = example["nodes"].as_table().unwrap();
        assert_eq!((example.len(), blocks.len()), (1, 1), "{}", spec.name);
        assert_eq!(blocks.values().next().unwrap()["type"].as_str(), Some(&*spec.name));
        assert!(spec.example.starts_with("\n[nodes.") && spec.example.ends_with('\n'), "{}", spec.name);
        assert!(!spec.doc.is_empty(), "{}", spec.name);
    }
}

#[test]
fn what_is_delayed_has_the_unit_that_was_declared() {
    let text = graph_of_all(&tactflow_nodes::catalogue()).replace("N/tactel", "kPa");
    let report = load(text).err().expect("a pressure is no kPa here");
    let said = report.render(false);
    assert!(
        said.contains(
            "`moving_average.value` is in `N/tactel`, but `delay.value` takes `kPa`, the unit of the output `delay.value`"
        ),
        "{said}"
    );
    assert_eq!(report.diagnostics.len(), 1, "{said}");
}
