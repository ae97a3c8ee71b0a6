//! Nodes that pass signals on, in a graph: loops, and rates that differ.

use tactflow_runtime::harness::GraphRig;
use tactflow_runtime::signal::{Freshness, Scalar};
use tactflow_tests::catalogue;
use tactflow_tests::nodes::length_by_hand;

/// A running sum: each length is added to the last sum.
const SUM: &str = "
graph.clock = \"a\"
roles.a = \"length\"

[nodes.sum]
type = \"pair\"
in.required = \"a.value\"
in.sampled = \"last.value\"

[nodes.last]
type = \"delay\"
in.value = \"sum.sum\"
unit = \"m\"
";

fn rig(more: &str) -> GraphRig {
    let graph = format!("{SUM}{more}");
    GraphRig::new(catalogue(), &graph, vec![length_by_hand("a")])
        .unwrap_or_else(|report| panic!("{}", report.render(false)))
}

#[test]
fn a_loop_through_a_delay_starts_with_its_initial_value_and_never_without() {
    for (more, sums) in [("initial = 10.0", [Some(11.0), Some(13.0), Some(16.0)]), ("", [None; 3])] {
        let mut rig = rig(more);
        for (i, expected) in sums.into_iter().enumerate() {
            let ms = 10.0 * i as f64;
            rig.feed("a.value", ms, (i + 1) as f64);
            rig.tick(ms).unwrap();
            assert_eq!(rig.get::<Scalar>("sum.sum").copied(), expected, "{more} at {ms} ms");
        }
    }
}

#[test]
fn what_goes_round_is_as_old_as_the_sample_that_started_it() {
    let mut rig = rig("initial = 0.0");
    rig.feed("a.value", 0.0, 1.0);
    rig.tick(0.0).unwrap();
    assert_eq!((rig.freshness("last.value"), rig.age_ms("last.value")), (Freshness::New, 0.0), "made up");
    rig.tick(10.0).unwrap();
    assert_eq!((rig.get::<Scalar>("last.value"), rig.age_ms("last.value")), (Some(&1.0), 10.0));
}
