//! Controllers in which two things contradict each other: two flags, two setpoints, a setpoint and its limit.

use super::variant::{Variant, leaving, variant, with_feature, with_force};

/// Features that two flags keep away, a place between two setpoints, and a force just below its limit.
pub(super) fn poor_pairs() -> Vec<(&'static str, Variant)> {
    let both = |second: &[&str]| {
        let passed = |gate: &str, value: &str, flag: &str| {
            [("type", "gate"), ("in.value", value), ("in.gate", flag)]
                .map(|(key, value)| format!("set nodes.{gate}.{key}={value:?}"))
        };
        let first =
            ["set nodes.firm.type=\"compare\"", "set nodes.firm.in.value=\"touch.force\"", "set nodes.firm.above=1.0"];
        let gates = [passed("first", "touch.x", "firm.is_met"), passed("second", "first.value", "soft.is_met")];
        let own = first.iter().chain(second).chain(&["set nodes.error.in.x=\"second.value\""]);
        let changes = own.map(|change| (*change).to_owned()).chain(gates.into_iter().flatten()).collect();
        Variant { task: "hybrid", bench: None, changes }
    };
    vec![
        ("unused-column", both(&["set nodes.soft.type=\"not\"", "set nodes.soft.in.flag=\"firm.is_met\""])),
        (
            "unused-column",
            both(&[
                "set nodes.soft.type=\"compare\"",
                "set nodes.soft.in.value=\"touch.force\"",
                "set nodes.soft.below=0.8",
                "set nodes.soft.hysteresis=0.1",
            ]),
        ),
        // One flag that is made of both.
        (
            "unused-column",
            variant(
                "hybrid",
                &[
                    "set nodes.firm.type=\"compare\"",
                    "set nodes.firm.in.value=\"touch.force\"",
                    "set nodes.firm.above=1.0",
                    "set nodes.soft.type=\"not\"",
                    "set nodes.soft.in.flag=\"firm.is_met\"",
                    "set nodes.both.type=\"all\"",
                    "set nodes.both.in.firm=\"firm.is_met\"",
                    "set nodes.both.in.soft=\"soft.is_met\"",
                    "set nodes.passed.type=\"gate\"",
                    "set nodes.passed.in.value=\"touch.x\"",
                    "set nodes.passed.in.gate=\"both.is_met\"",
                    "set nodes.error.in.x=\"passed.value\"",
                ],
            ),
        ),
        (
            "opposed-motion",
            with_feature(
                "hybrid",
                "beside",
                "touch.x",
                "[-1, 0, 0, 0, 0, 0]",
                &["gains.x = { kp = 2.0 }", "set nodes.error.setpoint.beside=0.005"],
            ),
        ),
        ("unreachable-setpoint", with_force(&["set nodes.error.setpoint.force=14.8", "set limits.force_n=15.0"])),
        // The factor of the schedule is known over the ball, and 1 where the bench states no contact.
        ("opposed-motion", leaving(&[])),
        ("opposed-motion", leaving(&["set facts.arm.contacts=[]"])),
    ]
}

/// Controllers that look alike, and are good.
pub(super) fn good_pairs() -> Vec<Variant> {
    vec![
        // Over steel, the schedule leaves 3 mm/s of the control.
        leaving(&["set facts.arm.contacts=[{ object = \"steel\", pressure = { vz = 100.0 } }]"]),
        // A place that is controlled twice, toward the same setpoint.
        with_feature("hybrid", "beside", "touch.x", "[-1, 0, 0, 0, 0, 0]", &["gains.x = { kp = 2.0 }"]),
        // Two flags that are set at the same time once the force has been large.
        variant(
            "hybrid",
            &[
                "set nodes.firm.type=\"compare\"",
                "set nodes.firm.in.value=\"touch.force\"",
                "set nodes.firm.above=1.0",
                "set nodes.firm.hysteresis=0.5",
                "set nodes.soft.type=\"compare\"",
                "set nodes.soft.in.value=\"touch.force\"",
                "set nodes.soft.below=0.8",
                "set nodes.first.type=\"gate\"",
                "set nodes.first.in.value=\"touch.x\"",
                "set nodes.first.in.gate=\"firm.is_met\"",
                "set nodes.second.type=\"gate\"",
                "set nodes.second.in.value=\"first.value\"",
                "set nodes.second.in.gate=\"soft.is_met\"",
                "set nodes.error.in.x=\"second.value\"",
            ],
        ),
    ]
}
