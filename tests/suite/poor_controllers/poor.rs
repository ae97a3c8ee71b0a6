//! Controllers with one mistake, each with the code of its warning.

use super::variant::{
    Variant, approaching, cleared, compared, gated, on, search, through, variant, with_area, with_feature,
};

/// Mistakes that nodes between the feature and the motion hide from a first look.
pub(super) fn poor_behind_nodes() -> Vec<(&'static str, Variant)> {
    let with = |mut changes: Vec<String>, more: &[&str]| {
        changes.extend(more.iter().map(|change| (*change).to_owned()));
        Variant { task: "hybrid", bench: None, changes }
    };
    let twist = || gated("twist_gate", "projector.twist", "sum.in.touch", "touch.present");
    let feature = |gate: &str| gated("gate", "touch.x", "error.in.x", gate);
    let other =
        |gate: &str| with(feature(gate), &["set nodes.no.type=\"not\"", "set nodes.no.in.flag=\"touch.present\""]);
    vec![
        ("low-margin", with(twist(), &["gains.x = { kp = 17.5 }"])),
        ("wrong-column", with(twist(), &["columns.x = [1, 0, 0, 0, 20, 0]"])),
        ("low-margin", with(feature("touch.present"), &["gains.x = { kp = 17.5 }"])),
        ("unfiltered-derivative", with(feature("touch.present"), &["gains.x = { kp = 3.5, kd = 0.1 }"])),
        ("unused-column", other("no.is_met")),
        (
            "unused-column",
            with(
                feature("both.is_met"),
                &[
                    "set nodes.no.type=\"not\"",
                    "set nodes.no.in.flag=\"touch.present\"",
                    "set nodes.both.type=\"all\"",
                    "set nodes.both.in.no=\"no.is_met\"",
                    "set nodes.both.in.mode=\"modes.servo\"",
                ],
            ),
        ),
        // A delay smooths nothing.
        (
            "unfiltered-derivative",
            with(
                vec!["gains.x = { kp = 3.5, kd = 0.1 }".to_owned()],
                &[
                    "set nodes.late.type=\"delay\"",
                    "set nodes.late.unit=\"m\"",
                    "set nodes.late.in.value=\"touch.x\"",
                    "set nodes.error.in.x=\"late.value\"",
                ],
            ),
        ),
        // One side of a switch is smooth.
        (
            "unfiltered-derivative",
            with(
                vec!["gains.x = { kp = 2.0, kd = 0.1 }".to_owned()],
                &[
                    "set nodes.slow.type=\"low_pass\"",
                    "set nodes.slow.in.value=\"touch.x\"",
                    "set nodes.slow.time_constant_ms=20",
                    "set nodes.held.type=\"switch\"",
                    "set nodes.held.in.on=\"touch.x\"",
                    "set nodes.held.in.off=\"slow.value\"",
                    "set nodes.held.in.select=\"touch.present\"",
                    "set nodes.error.in.x=\"held.value\"",
                ],
            ),
        ),
        ("unused-column", with(feature("modes.approach"), &[])),
    ]
}

/// Gains, filters and setpoints.
pub(super) fn poor_gains() -> Vec<(&'static str, Variant)> {
    let stiff = "gains.pressure = { kp = 2.5, ki = 0.5, within = 0.02 }";
    let slow = "time_constant_ms = 1000";
    vec![
        ("low-margin", variant("hybrid", &["gains.x = { kp = 17.5 }"])),
        // Its derivative alone takes the margins.
        ("low-margin", variant("edge", &["gains.pressure = { kp = 0.4, kd = 0.3 }"])),
        ("low-margin", variant("hybrid", &["gains.pressure = { kp = 5.0, ki = 1.0, within = 0.02 }"])),
        ("low-margin", variant("hybrid", &["gains.pressure = { kp = 0.1, ki = 0.5, within = 0.02 }"])),
        ("low-margin", variant("position", &["gains.x = { kp = 17.5 }"])),
        ("low-margin", variant("edge", &[stiff])),
        ("low-margin", variant("edge", &["gains.orientation = { kp = 30.0, ki = 30.0, within = 0.05, limit = 0.7 }"])),
        ("low-margin", variant("carry", &["set parts.right.set.pid.gains.force.kp=8.0"])),
        ("low-margin", variant("two_arms", &["set parts.left.set.pid.gains.x.kp=8.0"])),
        ("low-margin", on("pen", variant("force", &[stiff]))),
        ("low-margin", on("pen", variant("hybrid", &[stiff]))),
        ("low-margin", on("toy_box", variant("force", &[stiff]))),
        ("slow-filter", variant("hybrid", &[slow])),
        ("slow-filter", variant("edge", &[slow])),
        ("slow-filter", on("pen", variant("force", &[slow]))),
        // The gain is too large for the period of a slow pad, and not for that of the graph.
        (
            "low-margin",
            variant(
                "two_arms",
                &[
                    "set devices.right.rate_hz=25",
                    "set parts.right.set.answer.stiffness.lag_ms=200",
                    "set parts.right.set.pid.gains.x.kp=40",
                    "set parts.right.set.pid.gains.x.rise=20",
                ],
            ),
        ),
        ("unusual-gain", on("pen", variant("force", &["gains.pressure = { kp = 0.5, limit = 0.0002 }"]))),
        ("unreachable-setpoint", variant("force", &["set limits.blind_mm=4.0"])),
        ("unreachable-setpoint", approaching("after_ms = 30000, after_travel_mm = 150", &[])),
        ("unforced-rolling", variant("explore", &["set modes.scan.set.projector.select=[0, 0, 0, 0, 0, 1]"])),
        ("slow-filter", variant("edge", &["set nodes.direction.window=250"])),
        ("slow-filter", variant("cable", &["set nodes.direction.window=250"])),
        ("unfiltered-derivative", variant("hybrid", &["gains.x = { kp = 3.5, kd = 0.1 }"])),
        ("unfiltered-derivative", variant("position", &["gains.y = { kp = 3.5, kd = 0.05 }"])),
        ("unfiltered-derivative", variant("explore", &["gains.y = { kp = 2.0, kd = 0.02 }"])),
        ("windup", variant("hybrid", &["gains.pressure = { kp = 0.5, ki = 0.1 }"])),
        ("windup", on("pen", variant("force", &["gains.pressure = { kp = 0.5, ki = 0.1 }"]))),
        ("windup", variant("edge", &["gains.orientation = { kp = 6.0, ki = 6.0 }"])),
        ("windup", variant("edge", &["gains.orientation = { kp = 6.0, ki = 6.0, within = 1.5 }"])),
        ("windup", variant("hybrid", &["gains.x = { kp = 3.3, ki = 1.0, limit = 0.2 }"])),
        ("windup", variant("hybrid", &["gains.pressure = { kp = 0.5, ki = 0.1, within = 5.0 }"])),
        ("unstable-gain", variant("hybrid", &["gains.x = { kp = 600.0 }"])),
        // By the sampling alone: 1.2 times the error in each period.
        ("low-margin", on("held_ball", variant("hybrid", &["gains.x = { kp = 300.0 }"]))),
        ("unusual-gain", variant("hybrid", &["gains.x = { kp = -3.5 }", "columns.x = [1, 0, 0, 0, 20, 0]"])),
        ("unreachable-setpoint", variant("force", &["setpoint = { pressure = 4.0 }"])),
        ("unreachable-setpoint", variant("force", &["setpoint = { pressure = 0.005 }"])),
        ("unreachable-setpoint", variant("carry", &["set parts.right.set.error.setpoint.force=7.0"])),
        ("unusual-value", variant("seek_ridge", &["set nodes.ridge.on_above=0.985"])),
        ("unusual-value", variant("position", &["setpoint = { x = 0.2, y = 0.0 }"])),
        // Contacts that cannot be read check nothing.
        (
            "unusual-value",
            variant(
                "hybrid",
                &["set facts.arm.contacts=[{ object = \"ball\", pressure = { vz = 10.0, resonance = 5.0 } }]"],
            ),
        ),
    ]
}

/// Projectors and modes.
pub(super) fn poor_modes() -> Vec<(&'static str, Variant)> {
    let searching = |task: &'static str| Variant { task, bench: None, changes: search("0.03") };
    let mut swept = searching("hybrid");
    swept.changes.push("set modes.search.set.reach.twist=[0.03, 0, 0, 0, 0, 0]".into());
    let after_a_clearance =
        Variant { task: "hybrid", bench: None, changes: [search("0.03"), cleared("-0.01")].concat() };
    vec![
        ("unused-column", variant("hybrid", &["select = [1, 1, 0, 0, 0, 0]"])),
        ("unused-column", variant("edge", &["select = [0, 0, 1, 0, 0, 0]"])),
        ("unused-column", variant("hybrid", &["columns.y = [0, 0, 0, 0, 0, 0]", "select = [1, 0, 1, 0, 0, 0]"])),
        ("idle-axis", variant("force", &["select = [1, 0, 1, 0, 0, 0]"])),
        ("idle-axis", variant("hybrid", &["select = [1, 1, 1, 0, 0, 1]"])),
        ("unforced-rolling", variant("rolling", &["select = [1, 1, 0, 1, 1, 0]"])),
        ("unforced-rolling", variant("position", &["select = [1, 1, 0, 1, 1, 0]"])),
        ("unforced-rolling", variant("explore", &["select = [1, 1, 0, 1, 1, 1]"])),
        ("line-position", variant("cable", &["select = [1, 1, 1, 0, 0, 1]"])),
        ("line-position", on("bent_cable", variant("cable", &["select = [1, 1, 1, 1, 0, 1]"]))),
        ("chattering-modes", variant("position", &["set modes.servo.go.below=0.07"])),
        ("chattering-modes", variant("position", &["set modes.servo.go.below=0.055", "set modes.servo.go.for_ms=100"])),
        (
            "chattering-modes",
            variant("position", &["set modes.press.go.above=0.03", "set modes.press.go.hysteresis=0.01"]),
        ),
        ("fast-recovery", searching("hybrid")),
        ("fast-recovery", searching("edge")),
        ("fast-recovery", after_a_clearance),
        // A sweep along the object, and a press that begins with a contact.
        ("fast-recovery", swept),
        ("fast-recovery", variant("position", &["set modes.servo.on_lost.to=\"press\""])),
        ("unused-column", variant("hybrid", &["columns.y = [0.8, -1, 0, 20, 0, 0]", "select = [1, 0, 1, 0, 0, 0]"])),
    ]
}

/// Mistakes that two nodes make together, or that only the bench or another node shows.
pub(super) fn poor_sums() -> Vec<(&'static str, Variant)> {
    // A second controller of x that only rolls: of that, nothing is known.
    let rolled = |gain: &str| {
        variant(
            "hybrid",
            &[
                gain,
                "set nodes.second_error={ type = \"feature_error\", in.x = \"touch.x\", setpoint.x = 0.0 }",
                "set nodes.second_pid={ type = \"pid\", in.error = \"second_error.error\", gains.x.kp = 1.0 }",
                "set nodes.roll={ type = \"inverse_jacobian\", in.control = \"second_pid.control\", columns.x = [0, 0, 0, 0, -20, 0] }",
                "set nodes.only={ type = \"twist_gate\", in.value = \"roll.twist\", in.gate = \"modes.servo\" }",
                "set nodes.sum.in.roll=\"only.value\"",
            ],
        )
    };
    let gated_above = |above: &str| {
        let mut changes = gated("gate", "touch.x", "error.in.x", "firm.is_met");
        changes.extend(
            ["set nodes.firm.type=\"compare\"", "set nodes.firm.in.value=\"touch.pressure\""].map(str::to_owned),
        );
        changes.push(format!("set nodes.firm.above={above}"));
        Variant { task: "hybrid", bench: None, changes }
    };
    vec![
        // The same motion is added twice.
        ("low-margin", variant("hybrid", &["gains.y = { kp = 1.0 }", "set nodes.sum.in.twice=\"projector.twist\""])),
        (
            "low-margin",
            variant(
                "edge",
                &[
                    "gains.pressure = { kp = 0.2 }",
                    "set nodes.sum.in.twice=\"projector.twist\"",
                    "set nodes.sum.in.thrice=\"projector.twist\"",
                ],
            ),
        ),
        ("low-margin", rolled("gains.x = { kp = 30.0 }")),
        // The entry of the other column is larger.
        ("low-margin", rolled("gains.x = { kp = 15.0 }")),
        // The bench says the opposite of geometry.
        ("wrong-column", variant("hybrid", &["set facts.arm.contacts=[{ object = \"ball\", x = { vx = 1.0 } }]"])),
        (
            "wrong-column",
            variant("force", &["set facts.arm.contacts=[{ object = \"ball\", pressure = { vz = -3.5 } }]"]),
        ),
        (
            "unusual-value",
            variant("hybrid", &["set facts.arm.contacts=[{ object = \"ball\", presure = { vz = 3.5 } }]"]),
        ),
        ("windup", variant("hybrid", &["gains.pressure = { kp = 0.4, ki = 0.08, within = 0.2 }"])),
        ("chattering-modes", variant("force", &compared("set nodes.firm.above=2.0"))),
        (
            "chattering-modes",
            variant(
                "position",
                &["set modes.servo.go.when=\"touch.moments.pressure\"", "set modes.servo.go.below=0.06"],
            ),
        ),
        ("unused-column", gated_above("4.0")),
        // Two controllers of forces that press together.
        (
            "low-margin",
            with_feature(
                "edge",
                "force",
                "touch.force",
                "[0, 0, 0.02, 0, 0, 0]",
                &[
                    "set nodes.error.setpoint.force=4.0",
                    "set facts.arm.contacts=[{ object = \"pen\", pressure = { vz = 3.5, resonance_hz = 6.0, latency_ms = 18.0 }, force = { vz = 175.0, resonance_hz = 6.0, latency_ms = 18.0 } }]",
                    "gains.pressure = { kp = 2.0 }",
                ],
            ),
        ),
    ]
}

/// Motions against each other, and against the object.
pub(super) fn opposed() -> Vec<(&'static str, Variant)> {
    vec![
        ("opposed-motion", variant("explore", &["set modes.park.set.projector.select=[1, 1, 1, 1, 1, 1]"])),
        (
            "opposed-motion",
            variant(
                "hybrid",
                &[
                    "set nodes.hold.type=\"hold_pose\"",
                    "set nodes.hold.in.pose=\"move.sensor_pose\"",
                    "set nodes.hold.speed_m_per_s=0.02",
                    "set nodes.sum.in.hold=\"hold.twist\"",
                ],
            ),
        ),
        ("opposed-motion", variant("square", &["set modes.retreat.set.reach.twist=[0, 0, 0.015, 0, 0, 0]"])),
        ("opposed-motion", variant("square", &["set nodes.path.in_plane=false"])),
        // The fix leaves the control of the force.
        ("opposed-motion", variant("square", &["in_plane = false"])),
        ("opposed-motion", variant("guided", &["speed_rad_per_s = 0.1\nspeed_m_per_s = 0.02"])),
        ("opposed-motion", variant("edge", &["set modes.servo.set.reach.twist=[0, 0, 0.02, 0, 0, 0]"])),
        // A motion that only a contact lets pass.
        (
            "opposed-motion",
            variant(
                "edge",
                &[
                    "set nodes.press.type=\"twist_source\"",
                    "set nodes.press.twist=[0, 0, 0.02, 0, 0, 0]",
                    "set nodes.felt.type=\"twist_gate\"",
                    "set nodes.felt.in.value=\"press.twist\"",
                    "set nodes.felt.in.gate=\"touch.present\"",
                    "set nodes.sum.in.felt=\"felt.value\"",
                ],
            ),
        ),
        (
            "opposed-motion",
            with_feature(
                "edge",
                "force",
                "touch.force",
                "[0, 0, 0.001, 0, 0, 0]",
                &[
                    "set nodes.error.setpoint.force=4.0",
                    "set nodes.pid.gains.force.ki=0.2",
                    "set nodes.pid.gains.force.within=0.5",
                ],
            ),
        ),
        // It rests 2.9 mm beside the middle.
        ("opposed-motion", variant("hybrid", &["set modes.servo.set.reach.twist=[0.01, 0, 0, 0, 0, 0]"])),
        // The motion of the approach passes a projector that selects nothing then.
        (
            "no-approach",
            variant(
                "hybrid",
                &[
                    "set nodes.last.type=\"projector\"",
                    "set nodes.last.in.twist=\"damping.twist\"",
                    "set nodes.last.select=[1, 1, 1, 0, 0, 0]",
                    "set modes.approach.set.last.select=[0, 0, 0, 0, 0, 0]",
                    "set parts.move.in.twist=\"last.twist\"",
                ],
            ),
        ),
    ]
}

/// What only a second look at the modes, the nodes or `[live]` shows.
pub(super) fn at_second_sight() -> Vec<(&'static str, Variant)> {
    vec![
        // The opposite of one flag leads back, and no other flag stands beside it.
        ("chattering-modes", through("not")),
        ("chattering-modes", through("any")),
        // The line is turned to y, and longer than the pad.
        (
            "line-position",
            with_feature("edge", "y", "touch.y", "[0, -1, 0, 0, 0, 0]", &["select = [0, 1, 1, 0, 0, 1]"]),
        ),
        // Also if the mode ends by itself, after a time in which the sensor moves on.
        (
            "line-position",
            with_feature(
                "edge",
                "y",
                "touch.y",
                "[0, -1, 0, 0, 0, 0]",
                &["select = [0, 1, 1, 0, 0, 1]", "set modes.servo.done={ after_ms = 9000 }"],
            ),
        ),
        // Without a threshold there is no interpolated area.
        ("unused-column", with_feature("hybrid", "area", "size.interpolated", "[0, 0, 0.1, 0, 0, 0]", &with_area(&[]))),
        // Nor where a mode waits for it.
        (
            "unused-column",
            variant("hybrid", &with_area(&["set modes.servo.done={ when = \"size.interpolated\", above = 0.001 }"])),
        ),
        // An integral that is too large for any gain in the same ratio.
        ("low-margin", variant("hybrid", &["gains.x = { kp = 2.0, ki = 30.0, within = 0.003 }"])),
        (
            "low-margin",
            variant(
                "hybrid",
                &[
                    "gains.x = { kp = 2.0, ki = 0.5, within = 0.003 }",
                    "set live.pid.gains.x.ki={ min = 0.0, max = 5000.0, rate = 10.0 }",
                ],
            ),
        ),
        // What an operator may set while the arm moves.
        ("low-margin", variant("hybrid", &["set live.pid.gains.y.kp.max=20.0"])),
        ("low-margin", variant("hybrid", &["set live.pid.gains.y.kp.max=11.0"])),
        // The bench states no response of a place, but the arm has springs in its joints.
        ("low-margin", variant("explore", &["set nodes.pid.gains.x.kp=20.0"])),
        // The bench states no contact, but how late its pad is.
        (
            "low-margin",
            on(
                "simulated",
                variant(
                    "position",
                    &[
                        "set nodes.pid.gains.y.kp=10.0",
                        "set devices.bench.rate_hz=50",
                        "set devices.bench.latency_s=0.08",
                    ],
                ),
            ),
        ),
        // Without a larger gain that keeps the margins.
        (
            "low-margin",
            variant(
                "hybrid",
                &["gains.x = { kp = 3.3, ki = 0.0 }", "set live.pid.gains.x.ki={ min = 0.0, max = 500.0, rate = 1.0 }"],
            ),
        ),
    ]
}

/// Filters that are too short or too long together, and motions that last beside a control.
pub(super) fn poor_filters_and_motions() -> Vec<(&'static str, Variant)> {
    vec![
        // The median of three samples lets as much noise pass as the mean of two.
        (
            "unfiltered-derivative",
            variant(
                "hybrid",
                &[
                    "set nodes.few.type=\"median\"",
                    "set nodes.few.in.value=\"touch.x\"",
                    "set nodes.few.window=3",
                    "set nodes.error.in.x=\"few.value\"",
                    "gains.x = { kp = 2.0, kd = 0.2 }",
                ],
            ),
        ),
        // Two filters are slow, and one alone could not be fast enough.
        (
            "slow-filter",
            variant(
                "edge",
                &[
                    "set nodes.few.type=\"median\"",
                    "set nodes.few.in.value=\"line.orientation\"",
                    "set nodes.few.window=101",
                    "set nodes.direction.in.value=\"few.value\"",
                    "set nodes.direction.window=101",
                    "gains.orientation = { kp = 5.0 }",
                ],
            ),
        ),
        // A force that rests a fifth above its setpoint.
        (
            "opposed-motion",
            variant(
                "edge",
                &["gains.pressure = { kp = 0.4 }", "set modes.servo.set.reach.twist=[0, 0, 0.008, 0, 0, 0]"],
            ),
        ),
        // Four seconds are enough for the contact to rest beside its setpoint.
        (
            "opposed-motion",
            variant(
                "hybrid",
                &[
                    "set modes.servo.set.reach.twist=[0.01, 0, 0, 0, 0, 0]",
                    "set modes.servo.go={ to = \"rest\", after_ms = 4000 }",
                    "set modes.rest.on_lost={ of = \"touch.present\", after_ms = 100, to = \"approach\" }",
                ],
            ),
        ),
    ]
}
