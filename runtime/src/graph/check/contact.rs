//! The ports that are present, or set, only while something touches a sensor.

use crate::graph::net::Net;
use crate::graph::plan::{PortRef, Producer};
use crate::signal::Kind;

/// What is known about the contact upstream of each node.
pub(crate) struct ContactPorts {
    /// Whether the node descends from sensors alone: from roles without commands.
    is_sensed: Vec<bool>,
    /// Whether the node, or one upstream of it, reads a mask or a list of regions.
    is_segmented: Vec<bool>,
}

impl ContactPorts {
    /// Follows all wires once, in the order of the nodes.
    pub(crate) fn new(net: &Net<'_>) -> Self {
        let nodes = net.wires.len();
        let mut found = Self { is_sensed: vec![false; nodes], is_segmented: vec![false; nodes] };
        for &node in &net.order {
            let is_segment = |kind: Kind| matches!(kind, Kind::Mask | Kind::Regions);
            let mut roles = net.roles_of(Producer::Node(node)).peekable();
            found.is_sensed[node] = roles.peek().is_some() && roles.all(|role| is_sensor(net, role));
            found.is_segmented[node] = net.wires[node].iter().any(|wire| {
                let upstream = wire.source.producer.node().is_some_and(|source| found.is_segmented[source]);
                upstream || is_segment(net.port(wire.source).kind)
            });
        }
        found
    }

    /// Returns whether a port is present, or set, only while something touches a sensor.
    ///
    /// Such a port descends from sensors alone, and the contact was segmented upstream of it. A flag or a number must also
    /// be of a known quantity: others may be set without a contact, such as the number of regions.
    pub(super) fn need(&self, net: &Net<'_>, port: PortRef) -> bool {
        let declared = net.port(port);
        let is_flag = declared.kind == Kind::Flag;
        match port.producer {
            _ if (is_flag || declared.kind == Kind::Scalar) && declared.quantity.is_none() => false,
            Producer::Role(role) => is_sensor(net, role) && is_flag,
            Producer::Task(_) => false,
            Producer::Node(node) => self.is_sensed[node] && (is_flag || self.is_segmented[node]),
        }
    }
}

/// Returns whether a role is a sensor: a device without commands, so not the arm.
pub(super) fn is_sensor(net: &Net<'_>, role: usize) -> bool {
    net.roles[role].is_some_and(|role| role.commands.is_empty())
}
