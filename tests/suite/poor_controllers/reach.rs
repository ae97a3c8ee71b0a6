//! Controllers that wait for what never comes, each with the code of its warning.

use super::variant::{Variant, gated, variant, with_force};

/// Forces, places and errors that a mode never reaches, and loops that never get there.
pub(super) fn never_reached() -> Vec<(&'static str, Variant)> {
    let band = |feature: &str, width: &str, inside: &str| {
        [
            "set nodes.band.type=\"deadband\"".to_owned(),
            "set nodes.band.in.error=\"error.error\"".to_owned(),
            format!("set nodes.band.width.{feature}={width}"),
            format!("set nodes.band.inside={inside:?}"),
            "set nodes.pid.in.error=\"band.error\"".to_owned(),
        ]
    };
    let banded = |task, changes: [String; 5]| Variant { task, bench: None, changes: changes.into() };
    let window = [
        "set nodes.box.type=\"image_window\"",
        "set nodes.box.in.region=\"touch.region\"",
        "set nodes.box.size=[0.02, 0.08]",
        "set nodes.place.type=\"moments\"",
        "set nodes.place.in.image=\"touch.repaired\"",
        "set nodes.place.in.region=\"box.region\"",
        "set nodes.error.in.x=\"place.x\"",
        "set nodes.error.setpoint.x=0.015",
    ];
    vec![
        ("unreachable-setpoint", banded("edge", band("pressure", "{ inner = 0.05, outer = 0.2 }", "absent"))),
        ("unreachable-setpoint", banded("position", band("x", "{ inner = 0.05, outer = 0.06 }", "absent"))),
        ("windup", banded("edge", band("orientation", "{ inner = 0.01, outer = 0.02 }", "zero"))),
        ("unreachable-setpoint", variant("position", &window)),
        (
            "unreachable-setpoint",
            variant(
                "force",
                &["set modes.servo.go={ to = \"approach\", when = \"touch.force\", above = 25.0, for_ms = 100 }"],
            ),
        ),
        ("unreachable-setpoint", variant("force", &["set parts.touch.set.label.min_force=16.0"])),
        ("unreachable-setpoint", variant("hold_without_slip", &["set nodes.grip.least_force=20.0"])),
        // A contact that is lost before its force or its area is as small as that.
        (
            "unreachable-setpoint",
            with_force(&["set nodes.error.setpoint.force=0.3", "set parts.touch.set.label.min_force=0.4"]),
        ),
        ("unreachable-setpoint", banded("edge", band("orientation", "{ inner = 0.5, outer = 1.6 }", "absent"))),
        ("unusual-gain", variant("hybrid", &["gains.x = { kp = 0.0 }"])),
        ("unusual-gain", variant("rolling", &["gains.x = { kp = 2.0, limit = 0.0001 }"])),
        ("unusual-gain", variant("hybrid", &["linear_m_per_s2 = 0.02"])),
        ("unusual-gain", variant("edge", &["gains.pressure = { kd = 0.05 }"])),
        ("unusual-gain", variant("hybrid", &["columns.x = [-0.001, 0, 0, 0, 0, 0]"])),
        (
            "unusual-gain",
            variant("edge", &["gains.orientation = { kp = 7.0, ki = 7.0, within = 0.05, limit = 0.002 }"]),
        ),
    ]
}

/// Features that are absent whenever they are controlled.
pub(super) fn never_present() -> Vec<(&'static str, Variant)> {
    let wide = |bound: &str| {
        let mut changes = gated("gate", "touch.y", "error.in.y", "wide.is_met");
        changes.extend(["type=\"compare\"", "in.value=\"touch.area\""].map(|set| format!("set nodes.wide.{set}")));
        changes.push(format!("set nodes.wide.{bound}"));
        Variant { task: "hybrid", bench: None, changes }
    };
    vec![
        // The pad has 256 tactels.
        ("unused-column", wide("above = 300.0")),
        ("unused-column", wide("below = 0.0")),
        // Only a mode that ends at the first touch selects `y`.
        (
            "unused-column",
            variant(
                "hybrid",
                &["select = [1, 0, 1, 0, 0, 0]", "set modes.approach.set.projector.select=[0, 1, 0, 0, 0, 0]"],
            ),
        ),
        (
            "unused-column",
            variant(
                "cable",
                &[
                    "set nodes.line2.type=\"curvature\"",
                    "set nodes.line2.in.image=\"touch.repaired\"",
                    "set nodes.line2.in.region=\"middle.region\"",
                    "set nodes.bend.in.value=\"line2.rate\"",
                ],
            ),
        ),
    ]
}
