//! Ranges of `[live]`, and what else becomes poor by what others do: an operator, a guide, a mode, or the object.

use super::variant::{Variant, on, variant};

/// Gains with a derivative, which `[live]` may change.
const DERIVATIVE: &str = "gains.x = { kp = 3.3, kd = 0.0, rise = 0.25 }";

/// Components in which a guide also rolls the sensor, and a controller that moves none.
const ROLLS: &str = "[1, 1, 0, 1, 1, 0]";
const RESTS: &str = "[0, 0, 0, 0, 0, 0]";

pub(super) fn poor_by_others() -> Vec<(&'static str, Variant)> {
    vec![
        ("unusual-gain", variant("hybrid", &["set live.pid.gains.y.kp.min=-2.0"])),
        (
            "unfiltered-derivative",
            variant("hybrid", &[DERIVATIVE, "set live.pid.gains.x.kd={ min = 0.0, max = 0.2, rate = 0.05 }"]),
        ),
        (
            "unreachable-setpoint",
            variant("hybrid", &["set live.error.setpoint.x={ min = -0.06, max = 0.06, rate = 0.01 }"]),
        ),
        ("unreachable-setpoint", pressure("{ min = 0.05, max = 5.0, rate = 0.1 }")),
        ("unreachable-setpoint", pressure("{ min = 0.005, max = 0.2, rate = 0.1 }")),
        ("unreachable-setpoint", pressure("{ min = 0.05, max = 2.95, rate = 0.1 }")),
        // A place behind a schedule of the pressure, which is 1 over the ball.
        ("low-margin", variant("hybrid", &["features = [\"pressure\", \"x\"]", "gains.x = { kp = 17.5 }"])),
        // The noise of the spare force, and spare forces that the limit does not let the sensor press.
        (
            "unfiltered-derivative",
            variant(
                "hold_without_slip",
                &[
                    "-time_constant_ms",
                    "set nodes.calm.type=\"delay\"",
                    "set nodes.calm.unit=\"N\"",
                    "gains.spare = { kp = 2.0, kd = 0.02 }",
                ],
            ),
        ),
        ("unreachable-setpoint", variant("hold_without_slip", &["setpoint = { spare = 16.0 }"])),
        (
            "unreachable-setpoint",
            variant("hold_without_slip", &["least_force = 1.0", "set modes.servo.set.grip.least_force=20.0"]),
        ),
        ("wrong-column", variant("hold_without_slip", &["columns.spare = [0, 0, -0.004, 0, 0, 0]"])),
        // A pressure that is hardly above the threshold of the pad.
        ("unreachable-setpoint", variant("edge", &["set nodes.error.setpoint.pressure=0.0155"])),
        ("unreachable-setpoint", variant("edge", &["set nodes.error.setpoint.pressure=0.017"])),
        // Nothing holds the angle of a pen that is longer than the pad.
        ("line-position", on("pen", variant("position", &["set devices.bench.objects.0.length=0.3"]))),
        // The guide rolls the sensor, and nothing presses.
        ("unforced-rolling", guided(ROLLS, RESTS, &[])),
        // What the second projector drops moves the arm beside it.
        ("idle-axis", twice(&["set nodes.sum.in.beside=\"projector.twist\""])),
    ]
}

pub(super) fn good_by_others() -> Vec<Variant> {
    vec![
        variant(
            "hybrid",
            &[
                DERIVATIVE,
                "set live.pid.gains.x.kd={ min = 0.0, max = 0.005, rate = 0.05 }",
                "set live.error.setpoint.x={ min = -0.02, max = 0.02, rate = 0.01 }",
            ],
        ),
        pressure("{ min = 0.05, max = 0.2, rate = 0.1 }"),
        variant("hold_without_slip", &["gains.spare = { kp = 9.5, kd = 0.1 }"]),
        variant("hold_without_slip", &["setpoint = { spare = 5.0 }"]),
        on("pen", variant("position", &[])),
        guided(ROLLS, "[0, 0, 1, 0, 0, 0]", &[]),
        guided(ROLLS, RESTS, &["set nodes.guidance.angular_rad_per_s=0.0"]),
        guided(ROLLS, RESTS, &["set nodes.guidance.in.gate=\"modes.press\""]),
        guided(ROLLS, RESTS, &["set modes.guided.set.reach.twist=[0, 0, -0.01, 0, 0, 0]"]),
        // The pen lies along the diagonal of the pad, which is longer.
        on(
            "pen",
            variant(
                "hybrid",
                &["set devices.bench.objects.0.length=0.09", "set devices.bench.objects.0.turn=[0, 0, 0.7854]"],
            ),
        ),
        // What the first projector selects too much, the second one drops.
        twice(&[]),
    ]
}

/// A pressure whose setpoint an operator may change.
fn pressure(range: &str) -> Variant {
    variant("edge", &["set nodes.error.setpoint.pressure=0.1", &format!("set live.error.setpoint.pressure={range}")])
}

/// A guide that may move these components, while the controller moves those.
fn guided(free: &str, controlled: &str, more: &[&str]) -> Variant {
    let free = format!("set nodes.free.select={free}");
    variant("guided", &[&[&*free, &format!("set modes.guided.set.projector.select={controlled}")], more].concat())
}

/// Two projectors, one behind the other.
fn twice(more: &[&str]) -> Variant {
    let second = [
        "select = [1, 1, 1, 0, 0, 0]",
        "set nodes.second.type=\"projector\"",
        "set nodes.second.in.twist=\"projector.twist\"",
        "set nodes.second.select=[0, 0, 1, 0, 0, 0]",
        "in.touch = \"second.twist\"",
    ];
    variant("square", &[&second[..], more].concat())
}
