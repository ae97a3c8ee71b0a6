//! Controllers as an integrator may write them.

use super::variant::{Variant, approaching, cleared, compared, graph, on, search, variant, with_area, with_feature};

/// The lines of all gains of a task, with each `kp` and `ki` times a factor.
fn scaled(task: &'static str, factor: f64) -> Vec<String> {
    let text = std::fs::read_to_string(graph(task)).unwrap();
    let scale = |line: &str| {
        let mut words: Vec<String> = line.split('#').next().unwrap().split(' ').map(str::to_owned).collect();
        for at in 0..words.len().saturating_sub(2) {
            if ["kp", "ki"].contains(&words[at].as_str()) {
                let (digits, end) = words[at + 2].split_at(words[at + 2].trim_end_matches(',').len());
                words[at + 2] = format!("{}{end}", digits.parse::<f64>().unwrap() * factor);
            }
        }
        words.join(" ")
    };
    text.lines().filter(|line| line.starts_with("gains.")).map(scale).collect()
}

/// Good controllers behind a small limit, with loops through a delay, and with sides of a switch that other modes use.
pub(super) fn good_behind_nodes() -> Vec<Variant> {
    vec![
        // A gentle arm stops in time if it moves slowly: y goes on by 0.4 mm.
        variant("hybrid", &["linear_m_per_s2 = 0.02", "set limits.linear_m_per_s=0.01"]),
        // The last value is held through a delay, which closes a loop.
        variant(
            "hybrid",
            &[
                "set nodes.held.type=\"switch\"",
                "set nodes.held.in.on=\"touch.x\"",
                "set nodes.held.in.off=\"old.value\"",
                "set nodes.held.in.select=\"touch.present\"",
                "set nodes.error.in.x=\"held.value\"",
                "set nodes.old.type=\"delay\"",
                "set nodes.old.unit=\"m\"",
                "set nodes.old.in.value=\"held.value\"",
            ],
        ),
        variant(
            "hybrid",
            &[
                "set nodes.held.type=\"twist_switch\"",
                "set nodes.held.in.on=\"projector.twist\"",
                "set nodes.held.in.off=\"old.value\"",
                "set nodes.held.in.select=\"touch.present\"",
                "set nodes.sum.in.touch=\"held.value\"",
                "set nodes.old.type=\"twist_delay\"",
                "set nodes.old.in.value=\"held.value\"",
            ],
        ),
        // The newest sample passes without a contact only.
        variant(
            "hybrid",
            &[
                "gains.x = { kp = 2.0, kd = 0.1 }",
                "set nodes.slow.type=\"low_pass\"",
                "set nodes.slow.in.value=\"touch.x\"",
                "set nodes.slow.time_constant_ms=20",
                "set nodes.held.type=\"switch\"",
                "set nodes.held.in.on=\"slow.value\"",
                "set nodes.held.in.off=\"touch.x\"",
                "set nodes.held.in.select=\"touch.present\"",
                "set nodes.error.in.x=\"held.value\"",
            ],
        ),
        // A slow side of a switch that only another mode uses.
        variant(
            "hybrid",
            &[
                "set nodes.slow.type=\"low_pass\"",
                "set nodes.slow.in.value=\"touch.x\"",
                "set nodes.slow.time_constant_ms=800",
                "set nodes.held.type=\"switch\"",
                "set nodes.held.in.on=\"touch.x\"",
                "set nodes.held.in.off=\"slow.value\"",
                "set nodes.held.in.select=\"modes.servo\"",
                "set nodes.error.in.x=\"held.value\"",
            ],
        ),
    ]
}

/// Controllers as an integrator may write them.
pub(super) fn good() -> Vec<Variant> {
    let mut all = Vec::new();
    for task in ["hybrid", "edge", "explore", "rolling", "cable", "force", "position", "seek_ridge", "square"] {
        // Those of `hybrid` and `position` are already the largest that keep the margins.
        for factor in [0.3, 0.6, 0.9, if matches!(task, "hybrid" | "position") { 1.0 } else { 1.2 }] {
            all.push(Variant { task, bench: None, changes: scaled(task, factor) });
        }
    }
    for bench in ["ball", "pen", "toy_box", "held_ball", "moved_ball"] {
        for factor in [0.3, 1.0] {
            all.push(Variant { task: "hybrid", bench: Some(bench), changes: scaled("hybrid", factor) });
        }
    }
    for speed in ["0.005", "0.008"] {
        all.push(Variant { task: "edge", bench: None, changes: search(speed) });
    }
    all.extend([
        variant("hybrid", &["setpoint = { x = 0.01, y = -0.01, pressure = 0.3 }"]),
        variant("hybrid", &["setpoint = { x = 0.0, y = 0.0, pressure = 0.05 }"]),
        variant("edge", &["setpoint = { pressure = 0.2, orientation = 0.0 }"]),
        variant("edge", &["setpoint = { pressure = 0.1, orientation = -0.7 }"]),
        variant("force", &["setpoint = { pressure = 1.0 }"]),
        // Other signs and scales of the same motion.
        variant("hybrid", &["gains.x = { kp = 1.65 }", "columns.x = [-2, 0, 0, 0, 0, 0]"]),
        variant("hybrid", &["columns.x = [-1, 0, 0, 0, 20, 0]"]),
        variant("rolling", &["columns.x = [-1, 0, 0, 0, -5, 0]", "columns.y = [0, -1, 0, 5, 0, 0]"]),
        // Features left out, with their columns.
        variant(
            "hybrid",
            &[
                "-in.y",
                "-gains.y",
                "-columns.y",
                "-pid.gains.y.kp",
                "setpoint = { x = 0.0, pressure = 0.1 }",
                "select = [1, 0, 1, 0, 0, 0]",
                "+",
                "set parts.ruler.in.y=\"touch.y\"",
            ],
        ),
        variant("cable", &["select = [1, 0, 1, 0, 1, 1]"]),
        variant("edge", &["select = [1, 1, 1, 1, 1, 1]"]),
        variant("rolling", &["select = [0, 0, 1, 1, 1, 0]"]),
        variant("hybrid", &["gains.x = { kp = 3.3, kd = 0.005 }"]),
        // A task that creeps first and then approaches.
        Variant { task: "hybrid", bench: None, changes: cleared("0.002") },
        // Modes that lead to each other with a gap, or after a while.
        variant("position", &["set modes.servo.go.below=0.04"]),
        variant("position", &["set modes.servo.go.below=0.08", "set modes.servo.go.for_ms=1000"]),
        // Filters, derivatives and integrals as they should be.
        variant("hybrid", &["time_constant_ms = 200"]),
        variant("hybrid", &["time_constant_ms = 20"]),
        variant("force", &["gains.pressure = { kp = 0.5, ki = 0.1, within = 0.02, kd = 0.01 }"]),
        variant("force", &["gains.pressure = { kp = 0.5, ki = 0.1, bound = 0.01 }"]),
        variant("edge", &["gains.orientation = { kp = 6.0, ki = 6.0, limit = 0.7 }"]),
        variant("edge", &["gains.orientation = { kp = 8.0, ki = 8.0, within = 0.05, limit = 0.7 }"]),
        variant("position", &["gains.x = { kp = 2.0, ki = 0.5, within = 0.002 }"]),
        variant(
            "force",
            &[
                "set nodes.pid.in.error=\"rest.error\"",
                "set nodes.rest.type=\"deadband\"",
                "set nodes.rest.in.error=\"error.error\"",
                "set nodes.rest.width.pressure={ inner = 0.001, outer = 0.003 }",
            ],
        ),
    ]);
    all
}

/// Controllers that look like poor ones.
pub(super) fn good_at_second_sight() -> Vec<Variant> {
    vec![
        // The interpolated area has its threshold.
        with_feature(
            "hybrid",
            "area",
            "size.interpolated",
            "[0, 0, 0.1, 0, 0, 0]",
            &with_area(&["set nodes.size.threshold=0.01"]),
        ),
        // A line is held for a moment only.
        with_feature(
            "edge",
            "y",
            "touch.y",
            "[0, -1, 0, 0, 0, 0]",
            &["select = [0, 1, 1, 0, 0, 1]", "set modes.servo.done={ after_ms = 4000 }"],
        ),
        // A wide range that stays stable.
        variant("hybrid", &["set live.pid.gains.y.kp.max=8.0"]),
        // A second projector that no mode changes.
        variant(
            "hybrid",
            &[
                "set nodes.second.type=\"projector\"",
                "set nodes.second.in.twist=\"projector.twist\"",
                "set nodes.second.select=[1, 1, 1, 0, 0, 0]",
                "set nodes.sum.in.touch=\"second.twist\"",
            ],
        ),
        // A feature that rests in one mode.
        variant("hybrid", &["set modes.approach.set.pid.gains.x.kp=0.0"]),
        // A slight roll against the motion, for a pad that stays normal to a ball.
        variant("hybrid", &["columns.x = [-1, 0, 0, 0, 2, 0]", "select = [1, 1, 1, 0, 1, 0]"]),
        // The pressure is let go on purpose.
        variant(
            "force",
            &[
                "+[modes.let_go]",
                "+set.error.setpoint.pressure = 0.0",
                "+go = { to = \"approach\", when = \"touch.present\", is = \"false\", for_ms = 40 }",
                "set modes.servo.go={ to = \"let_go\", after_ms = 5000 }",
            ],
        ),
        // Back off after a loss, and approach again from there.
        variant(
            "hybrid",
            &[
                "on_lost = { of = \"touch.present\", after_ms = 100, to = \"back\" }",
                "+[modes.back]",
                "+set.projector.select = [0, 0, 0, 0, 0, 0]",
                "+set.reach.twist = [0, 0, -0.01, 0, 0, 0]",
                "+go = { to = \"again\", after_travel_mm = 10, of = \"move.sensor_pose\" }",
                "+fail = { after_ms = 5000 }",
                "+[modes.again]",
                "+set.projector.select = [0, 0, 0, 0, 0, 0]",
                "+set.reach.twist = [0, 0, 0.012, 0, 0, 0]",
                "+go = { to = \"servo\", when = \"touch.present\", for_ms = 40 }",
                "+fail = { after_ms = 10000 }",
            ],
        ),
        // A retreat with the control off, and a guarded press.
        variant("square", &["set modes.retreat.set.reach.twist=[0, 0, -0.03, 0, 0, 0]"]),
        // A comparison with a hysteresis.
        variant("force", &[&compared("set nodes.firm.above=2.0")[..], &["set nodes.firm.hysteresis=0.5"]].concat()),
    ]
}

/// Controllers whose parts act at different times, behind gates and switches.
pub(super) fn good_by_turns() -> Vec<Variant> {
    let firm = ["set nodes.firm={ type = \"compare\", in.value = \"touch.force\", above = 8.0 }"];
    let soft = [
        "set nodes.soft_pid={ type = \"pid\", in.error = \"error.error\", gains.x.kp = 1.0, gains.y.kp = 1.0, gains.pressure.kp = 0.2 }",
        "set nodes.soft={ type = \"inverse_jacobian\", in.control = \"soft_pid.control\", columns.x = [-1, 0, 0, 0, 0, 0], columns.y = [0, -1, 0, 0, 0, 0], columns.pressure = [0, 0, 1, 0, 0, 0] }",
    ];
    let hold = [
        "set nodes.hold={ type = \"hold_pose\", in.pose = \"move.sensor_pose\", speed_m_per_s = 0.02, speed_rad_per_s = 0.1 }",
    ];
    let back = "set nodes.back={ type = \"twist_source\", twist = [0, 0, -0.01, 0, 0, 0] }";
    let switch = |select: &str, on: &str, off: &str| {
        [
            format!(
                "set nodes.either={{ type = \"twist_switch\", in.select = \"{select}\", in.on = \"{on}\", in.off = \"{off}\" }}"
            ),
            "set nodes.sum.in.touch=\"either.value\"".to_owned(),
        ]
    };
    let hybrid = |fixed: &[&str], more: &[String]| Variant {
        task: "hybrid",
        bench: None,
        changes: fixed.iter().map(|change| (*change).to_owned()).chain(more.iter().cloned()).collect(),
    };
    let gate = |node: &str, value: &str, gate: &str| {
        format!("set nodes.{node}={{ type = \"twist_gate\", in.value = \"{value}\", in.gate = \"{gate}\" }}")
    };
    vec![
        // A soft controller while the force is large.
        hybrid(&[&firm[..], &soft].concat(), &switch("firm.is_met", "soft.twist", "projector.twist")),
        // The same control, selected differently.
        hybrid(
            &[
                "set nodes.both={ type = \"projector\", in.twist = \"jacobian.twist\", select = [1, 0, 1, 0, 0, 0] }",
                firm[0],
            ],
            &switch("firm.is_met", "both.twist", "projector.twist"),
        ),
        // Two controllers, each in a mode of its own.
        hybrid(
            &[&soft[..], &["set nodes.sum.in.touch=\"own.value\"", "set nodes.sum.in.soft=\"other.value\""]].concat(),
            &[gate("own", "projector.twist", "modes.servo"), gate("other", "soft.twist", "modes.approach")],
        ),
        // Held while nothing is touched.
        hybrid(&hold, &switch("touch.present", "projector.twist", "hold.twist")),
        // A retreat while the force is large.
        hybrid(&[firm[0], back], &switch("firm.is_met", "back.twist", "projector.twist")),
        // A retreat in a mode of its own.
        hybrid(&[back, "set nodes.sum.in.back=\"away.value\""], &[gate("away", "back.twist", "modes.approach")]),
        // A value that is held through a delay ends a mode.
        variant(
            "hybrid",
            &[
                "set nodes.kept={ type = \"delay\", unit = \"m\", in.value = \"smooth.value\" }",
                "set nodes.smooth={ type = \"low_pass\", in.value = \"kept.value\", time_constant_ms = 100 }",
                "set modes.servo.go={ to = \"approach\", when = \"kept.value\", above = 0.05, for_ms = 100 }",
            ],
        ),
        // It waits at rest until it is touched, and approaches in another mode.
        variant(
            "force",
            &[
                "start = \"wait\"",
                "+[modes.wait]",
                "+set.projector.select = [0, 0, 0, 0, 0, 0]",
                "+go = { to = \"servo\", when = \"touch.present\", for_ms = 40 }",
                "+fail = { after_ms = 10000 }",
                "set modes.servo.go={ to = \"approach\", on = \"again\" }",
            ],
        ),
    ]
}

/// Good controllers whose modes bound an integral, let go, or search along the object, and columns that couple a little.
pub(super) fn good_by_modes() -> Vec<Variant> {
    vec![
        // An integral in a mode that a large error ends, as `within` would.
        variant(
            "edge",
            &[
                "gains.pressure = { kp = 0.4 }",
                "set modes.servo.go={ to = \"trim\", when = \"error.error.pressure\", within = 0.01, for_ms = 500 }",
                "set modes.trim.set.pid.gains.pressure.ki=0.06",
                "set modes.trim.go={ to = \"servo\", when = \"error.error.pressure\", above = 0.02, for_ms = 20 }",
                "set modes.trim.on_lost={ of = \"touch.present\", after_ms = 100, to = \"approach\" }",
            ],
        ),
        // It lets go by its control, and moves away then.
        variant(
            "edge",
            &[
                "set modes.servo.set.error.setpoint.pressure=0.0",
                "set modes.servo.on_lost.to=\"away\"",
                "set modes.away.set.projector.select=[0, 0, 0, 0, 0, 0]",
                "set modes.away.set.reach.twist=[0, 0, -0.01, 0, 0, 0]",
                "set modes.away.done={ after_travel_mm = 10, of = \"move.sensor_pose\" }",
            ],
        ),
        // It leaves an object that presses too hard, and lifts off before it searches along the object.
        variant(
            "edge",
            &[
                "set modes.servo.go={ to = \"away\", when = \"touch.force\", above = 16.0, for_ms = 20 }",
                "set modes.away.set.projector.select=[0, 0, 0, 0, 0, 0]",
                "set modes.away.set.reach.twist=[0, 0, -0.01, 0, 0, 0]",
                "set modes.away.done={ after_travel_mm = 10, of = \"move.sensor_pose\" }",
            ],
        ),
        // It searches a lost contact along the object, as fast as it approached.
        Variant {
            task: "hybrid",
            bench: None,
            changes: [&search("0.008")[..], &["set modes.search.set.reach.twist=[0.008, 0, 0, 0, 0, 0]".to_owned()]]
                .concat(),
        },
        // The time ends the approach after 48 mm, and inside of a clear box its way does not count.
        approaching("after_ms = 6000, after_travel_mm = 150", &[]),
        approaching(
            "after_ms = 30000, after_travel_mm = 150",
            &["set facts.arm.clear_min_m=[-0.8, -0.4, 0.3]", "set facts.arm.clear_max_m=[-0.3, 0.4, 0.7]"],
        ),
        // A pad that is late bears less, and one that is not bears more.
        on(
            "simulated",
            variant(
                "position",
                &["set nodes.pid.gains.y.kp=6.0", "set devices.bench.rate_hz=50", "set devices.bench.latency_s=0.08"],
            ),
        ),
        on("simulated", variant("position", &["set nodes.pid.gains.y.kp=10.0"])),
        // Springs with much damping bear more, and a schedule leaves a tenth of the gain over steel.
        variant("explore", &["set nodes.pid.gains.x.kp=20.0", "set devices.bench.damping_ratio=0.7"]),
        variant(
            "hybrid",
            &[
                "features = [\"pressure\", \"x\"]",
                "gains.x = { kp = 14.0 }",
                "set facts.arm.contacts=[{ object = \"steel\", pressure = { vz = 100.0 } }]",
            ],
        ),
        // A pressure of twice the threshold of the pad.
        variant("force", &["setpoint = { pressure = 0.03 }"]),
        // Rolling that couples the axes a little, and a press that slides a little.
        variant("rolling", &["columns.x = [-1, 0, 0, 5, -20, 0]"]),
        variant("hybrid", &["columns.pressure = [0.3, 0, 1, 0, 0, 0]"]),
    ]
}

/// Features that move the sensor in some modes, and exits that wait for their values.
pub(super) fn good_by_exits() -> Vec<Variant> {
    vec![
        // It centres the contact from the first touch on, and goes on when the force is about that of the setpoint.
        variant("hybrid", &["set modes.approach.set.projector.select=[0, 1, 0, 0, 0, 0]"]),
        variant(
            "force",
            &["set modes.servo.done={ when = \"touch.pressure\", above = 0.09, below = 0.11, for_ms = 500 }"],
        ),
        // It goes on at a value that is passed, and at a direction that two numbers state.
        variant("force", &["set modes.servo.done={ when = \"touch.pressure\", above = 0.05, below = 0.095 }"]),
        variant(
            "edge",
            &[
                "set nodes.error.setpoint.orientation=1.5708",
                "set modes.servo.done={ when = \"touch.orientation\", above = -1.6, below = -1.5, for_ms = 500 }",
            ],
        ),
        // It reads `y` behind a filter until it holds the contact.
        variant(
            "hybrid",
            &[
                "set nodes.slow={ type = \"low_pass\", in.value = \"touch.y\", time_constant_ms = 20 }",
                "set nodes.pick={ type = \"switch\", in.on = \"touch.y\", in.off = \"slow.value\", in.select = \"modes.servo\" }",
                "set nodes.error.in.y=\"pick.value\"",
            ],
        ),
    ]
}
