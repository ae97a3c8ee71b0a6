//! What a node costs: chains of the smallest node there is.

use tactflow_runtime::harness::GraphRig;
use tactflow_tests::catalogue;
use tactflow_tests::nodes::length_by_hand;

/// A chain of `count` nodes that has ticked once.
///
/// # Panics
/// If it does not load.
pub(crate) fn chain(count: usize) -> GraphRig {
    let mut text = "[graph]\nclock = \"a\"\n[roles]\na = \"length\"\n".to_owned();
    for i in 0..count {
        let from = if i == 0 { "a.value".to_owned() } else { format!("n{}.value", i - 1) };
        text.push_str(&format!("[nodes.n{i}]\ntype = \"plus\"\nin.value = \"{from}\"\n"));
    }
    let mut rig = GraphRig::new(catalogue(), &text, vec![length_by_hand("a")])
        .unwrap_or_else(|report| panic!("{}", report.render(false)));
    rig.feed("a.value", 0.0, 1.0);
    rig.tick(0.0).expect("a chain cannot fail");
    rig
}
