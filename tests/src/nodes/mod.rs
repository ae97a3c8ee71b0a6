//! Nodes that make one sentence of the semantics visible each, and the role that feeds them.

pub mod breaks;
pub mod count;
pub mod first_order_lag;
pub mod line_length;
pub mod mix;
pub mod pair;
pub mod plus;
/// The node that `tactflow new node` writes.
#[path = "../../../nodes/src/tool/new/node.rs"]
pub mod template_node;
pub mod unit_delay;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::RoleType;
use tactflow_runtime::harness::FedRole;
use tactflow_runtime::node::PortSpec;
use tactflow_runtime::signal::Kind;

/// The nodes and the role.
pub fn catalogue() -> Catalogue {
    Catalogue::new()
        .role(length())
        .device::<line_length::LineLength>()
        .device::<crate::true_pad::TruePad>()
        .group("tests: nodes that make one sentence of the semantics visible each")
        .node::<breaks::Breaks>()
        .node::<count::Count>()
        .node::<first_order_lag::FirstOrderLag>()
        .node::<mix::Mix>()
        .node::<pair::Pair>()
        .node::<plus::Plus>()
        .node::<template_node::TemplateNode>()
        .node::<unit_delay::UnitDelay>()
}

/// A role that gives a length.
fn length() -> RoleType {
    RoleType {
        name: "length".into(),
        summary: "a length".into(),
        outputs: vec![PortSpec::new("value", "A length.", Kind::Scalar, &["m", "self"])],
        ..RoleType::default()
    }
}

/// The role `role` as a length that a test feeds, every 10 ms nominally.
pub fn length_by_hand(role: &str) -> FedRole {
    FedRole::new(role, "length", 10.0)
}
