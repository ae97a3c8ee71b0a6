//! Whatever the process can observe going wrong ends in a stop that names node, port and tick.

use tactflow_runtime::fault::Cause;
use tactflow_runtime::harness::GraphRig;
use tactflow_tests::catalogue;
use tactflow_tests::nodes::length_by_hand;

fn rig(how: &str) -> GraphRig {
    let text = format!(
        "[graph]\nclock = \"a\"\n[roles]\na = \"length\"\n[nodes.first]\ntype = \"count\"\nin.value = \"a.value\"\n\
         [nodes.bad]\ntype = \"breaks\"\nin.value = \"first.steps\"\nhow = \"{how}\"\ntick = 3\n"
    );
    let rig = GraphRig::new(catalogue(), &text, vec![length_by_hand("a")]);
    rig.unwrap_or_else(|report| panic!("{}", report.render(false)))
}

fn fault(how: &str) -> tactflow_runtime::fault::Fault {
    let mut rig = rig(how);
    for i in 0..2 {
        let ms = f64::from(i) * 10.0;
        rig.feed("a", 0, ms, 1.0);
        rig.tick(ms).unwrap();
    }
    rig.feed("a", 0, 20.0, 1.0);
    rig.tick(20.0).unwrap_err()
}

#[test]
fn a_value_that_is_not_finite_is_stopped_at_the_port_that_made_it() {
    let fault = fault("nan");
    assert_eq!((fault.node.as_str(), fault.port.as_deref(), fault.tick), ("bad", Some("value"), 3));
    assert_eq!((fault.cause, fault.place.as_str()), (Cause::NotFinite, "graph.toml:8:8"));
}

#[test]
fn a_panic_is_a_fault_of_the_node_that_panicked() {
    let fault = fault("panic");
    assert_eq!((fault.node.as_str(), fault.tick), ("bad", 3));
    assert_eq!(fault.to_string(), "node `bad` panicked: as told in tick 3 at 0.020 s (graph.toml:8:8)");
}

#[test]
fn a_sample_that_is_not_finite_is_a_fault_of_its_role() {
    let mut rig = rig("nan");
    rig.feed("a", 0, 0.0, f64::NAN);
    let fault = rig.tick(0.0).unwrap_err();
    assert_eq!((fault.node.as_str(), fault.port.as_deref(), fault.tick), ("a", Some("value"), 1));
}
