//! Checks that the limiters of an arm read that arm and the sensor that it moves, and no other role.

use std::collections::BTreeSet;

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
        let makers = find_makers(net, wire.source);
        let roles = makers.iter().flat_map(|maker| net.roles_of(maker.producer));
        let mut foreign = roles.filter(|read| *read != role && Some(*read) != sensor);
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

/// Returns the roles that the inputs of a limiter which must be known descend from.
pub(super) fn read_roles(net: &Net<'_>, limiter: usize) -> Vec<usize> {
    let spec = net.spec(limiter).filter(|spec| !spec.limits.holds.is_empty());
    let Some(spec) = spec else { return Vec::new() };
    let known = net.wires[limiter].iter().filter(|wire| spec.inputs[wire.input].need.must_be_known);
    let makers = known.flat_map(|wire| find_makers(net, wire.source));
    makers.flat_map(|maker| net.roles_of(maker.producer).collect::<Vec<_>>()).collect()
}

/// Reports that a limiter works in the frame of a sensor which another arm carries.
pub(super) fn on_another_arm(
    net: &Net<'_>,
    frames: &mut Frames<'_>,
    arm: usize,
    limiter: usize,
    motion: PortRef,
) -> Option<Diagnostic> {
    let frame = frames.of(motion).into_iter().next().flatten()?;
    let sensor = net.flat.roles.position(&frame)?;
    let carrier = net.carrier(sensor).filter(|carrier| *carrier != arm && sensor != arm)?;
    // A sensor on two arms has its own diagnostic.
    if net.rival_carriers(sensor).is_some() {
        return None;
    }
    let [arm, sensor, carrier] = [arm, sensor, carrier].map(|role| net.name(Producer::Role(role)));
    let name = &net.flat.nodes[limiter].name;
    let message = format!("`{name}` limits the motion of `{arm}` in the frame of `{sensor}`, which is on `{carrier}`");
    let diagnostic = net.diagnostic_at(limiter, Code::ForeignInput, message);
    Some(diagnostic.help(format!("let the motion be in the frame of a sensor on `{arm}`")))
}

/// Reports a sensor that two parts have on different arms.
pub(super) fn on_two_arms(net: &Net<'_>, sensor: usize) -> Option<Diagnostic> {
    let rivals = net.rival_carriers(sensor)?;
    let (key, kind) = &net.flat.roles[sensor];
    let [(one, first), (other, second)] =
        rivals.map(|(task, arm)| (&net.flat.tasks[task], net.name(Producer::Role(arm))));
    let (name, kind) = (&key.name, &kind.value);
    let message = format!(
        "`{name}` moves with `{first}` in part `{}`, and with `{second}` in part `{}`",
        one.name(),
        other.name()
    );
    let mut diagnostic = Diagnostic::new(Code::ForeignInput, key.span.clone(), message);
    let parts = [one, other].into_iter().filter_map(|task| net.flat.scopes[task.scope].part.as_ref());
    diagnostic.notes.extend(parts.map(|part| (part.span.clone(), "this part takes it".to_owned())));
    let on = format!("{name} = {{ type = \"{kind}\", on = \"{second}\" }}");
    let help = format!("give each part a sensor of its own with `roles`, or say which arm carries it, as in `{on}`");
    Some(diagnostic.help(help))
}

/// Returns the ports that make the value of a port: itself, or those whose quantity its node passes on. What else the
/// node reads, such as a gate, only makes the value present or absent.
fn find_makers(net: &Net<'_>, port: PortRef) -> Vec<PortRef> {
    let is_letter = |text: &&str| text.starts_with(|c: char| c.is_ascii_uppercase());
    let (mut makers, mut open, mut seen) = (Vec::new(), vec![port], BTreeSet::new());
    while let Some(port) = open.pop() {
        if !seen.insert(port) {
            continue;
        }
        match (port.producer, net.port(port).quantity.as_deref().filter(is_letter)) {
            (Producer::Node(node), letter @ Some(_)) => {
                let passed = net.wires[node].iter().filter(|wire| net.input(node, wire).quantity.as_deref() == letter);
                open.extend(passed.map(|wire| wire.source));
            }
            _ => makers.push(port),
        }
    }
    makers
}
