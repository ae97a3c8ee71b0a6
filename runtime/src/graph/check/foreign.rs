//! Checks that the limiters of an arm read that arm and the sensor that it moves, and no other role.

use super::frames::Frames;
use crate::graph::net::Net;
use crate::graph::plan::{PortRef, Producer};
use crate::source::{Code, Diagnostic};

/// Reports inputs of a limiter that must be known and descend from another role: neither `role`, whose command the
/// motion is, nor the sensor in whose frame the motion is.
pub(super) fn check(
    net: &Net<'_>,
    frames: &mut Frames<'_>,
    role: usize,
    limiter: usize,
    motion: PortRef,
) -> Vec<Diagnostic> {
    let Some(spec) = net.spec(limiter) else { return Vec::new() };
    let frame = frames.of(motion).into_iter().next().flatten();
    let sensor = frame.and_then(|frame| net.flat.roles.position(&frame));
    let mut found = Vec::new();
    for wire in net.wires[limiter].iter().filter(|wire| spec.inputs[wire.input].need.must_be_known) {
        let mut foreign = net.roles_of(wire.source.producer).filter(|read| *read != role && Some(*read) != sensor);
        let Some(foreign) = foreign.next() else { continue };
        let [arm, other] = [role, foreign].map(|role| net.name(Producer::Role(role)));
        let message = format!(
            "`{}` limits the motion of `{arm}`, but `{}` descends from `{other}`",
            net.flat.nodes[limiter].name,
            net.port_name(wire.source)
        );
        let own = sensor.map(|sensor| format!(" or `{}`", net.name(Producer::Role(sensor)))).unwrap_or_default();
        let diagnostic = wire.origin.diagnostic(Code::ForeignInput, message);
        found.push(
            diagnostic.help(format!("wire `in.{}` from a port that descends from `{arm}`{own} alone", wire.key.name)),
        );
    }
    found
}
