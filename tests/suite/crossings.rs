//! Two arms in one graph: whatever of one arm is given to the other one, the graph does not load.

use tactflow_runtime::graph::{Request, compile};
use tactflow_tests::{catalogue, workspace};

fn two_arms() -> Request {
    Request::file(workspace().join("tests/data/two_arms/press_and_slide.toml"))
}

/// The codes of the mistakes of a request, each once; none if it loads.
fn codes(request: &Request) -> Vec<&'static str> {
    let Err(report) = compile(&catalogue(), request) else { return Vec::new() };
    let mut codes: Vec<&str> = report.diagnostics.iter().map(|diagnostic| diagnostic.code.name()).collect();
    codes.sort_unstable();
    codes.dedup();
    codes
}

#[test]
fn nothing_of_one_arm_can_be_given_to_the_other_one() {
    let crossings = [
        // The pad, the arm or both of a part.
        ("parts.left_move.roles.pad='right_pad'", "foreign-input"),
        ("parts.left_move.roles.arm='right_arm'", "foreign-fact"),
        ("parts.left_move.roles={ pad = 'right_pad', arm = 'right_arm' }", "foreign-input"),
        ("parts.left_touch.roles.pad='right_pad'", "foreign-fact"),
        // Wires.
        ("parts.left_move.in.position='right_arm.position'", "frame-mismatch"),
        ("parts.left_move.in.equilibrium='right_arm.equilibrium'", "frame-mismatch"),
        ("parts.left_move.in.image='right_touch.image'", "frame-mismatch"),
        ("parts.left_move.in.contact='right_touch.present'", "foreign-input"),
        ("parts.left_move.in.twist='right_reach.twist'", "foreign-input"),
        ("parts.left_touch.in.image='right_pad.image'", "foreign-fact"),
        ("commands.left_arm.velocity='right_move.velocity'", "frame-mismatch"),
        // Facts.
        ("parts.left_move.set.state.mount={ from = 'right_pad.mount' }", "foreign-fact"),
        ("parts.left_move.set.state.urdf={ from = 'right_arm.urdf' }", "foreign-fact"),
        ("parts.left_move.set.state.tip={ from = 'right_arm.tip' }", "foreign-fact"),
        ("parts.left_move.set.ik.posture={ from = 'right_arm.home' }", "foreign-fact"),
        ("parts.left_move.set.state.sensor='right_pad'", "foreign-input"),
        ("parts.left_touch.set.calibrate.device={ from = 'right_pad.calibration' }", "foreign-fact"),
        ("parts.left_touch.set.binarize.threshold={ from = 'right_pad.threshold' }", "foreign-fact"),
        // Which arm carries a pad.
        ("roles.left_pad={ type = 'tactile_pad', on = 'right_arm' }", "foreign-input"),
        ("roles.left_pad={ type = 'tactile_pad', on = 'right_pad' }", "unknown-port"),
        ("roles.left_pad={ type = 'tactile_pad', on = 'left_pad' }", "unknown-port"),
        ("roles.left_arm={ type = 'velocity_arm', on = 'right_arm' }", "wrong-role"),
        // Names that are no role.
        ("parts.left_move.roles.pad='left_pda'", "unknown-port"),
        ("parts.left_move.roles.padd='left_pad'", "unknown-key"),
        ("limits.left_pad.force_n=3", "unknown-port"),
        ("limits.left.force_n=3", "unknown-port"),
        // Limits of one arm, and of both.
        ("limits.left_arm.force_n=15.1", "loose-limit"),
        ("limits.right_arm.workspace_max_m=[-0.3, 0.4, 0.71]", "loose-limit"),
        ("limits.blind_mm=50.1", "loose-limit"),
        ("parts.left_move.set.contact.force_n=15.1", "loose-limit"),
        ("parts.left_move.set.joints.acceleration={ from = 'limits.none', optional = true }", "loose-limit"),
        ("parts.left_move.set.joints.acceleration={ from = 'left_arm.none', optional = true }", "loose-limit"),
        ("limits.left_arm.workspace_min_m=[-0.2, -0.4, 0.1]", "bad-value"),
    ];
    assert_eq!(codes(&two_arms()), [""; 0], "it loads as it is");
    let mut wrong = Vec::new();
    for (set, code) in crossings {
        let found = codes(&two_arms().set(set));
        if !found.contains(&code) {
            wrong.push(format!("{set}: {found:?} without {code}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_limit_of_one_arm_is_not_that_of_the_other_one() {
    let request = two_arms().set("limits.left_arm.force_n=5.0").set("limits.force_n=12").set("limits.force_n=14");
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let of = |name: &str| {
        let node = plan.outline().nodes.iter().find(|node| node.name == name).expect("a node of the graph");
        let setting = node.settings.iter().find(|setting| setting.path == "force_n").expect("a parameter of the node");
        format!("{:?}", setting.value.item)
    };
    assert_eq!([of("left_move.contact"), of("right_move.contact")], ["Integer(5)", "Integer(12)"]);
}

/// Two pads whose parts call each of them `pad`, with more lines at the second part.
fn two_pads(more: &str) -> Request {
    let graph = format!(
        "graph.clock = 'pad'\n[roles]\npad = 'tactile_pad'\npad2 = 'tactile_pad'\n\
         [parts.touch]\nfile = 'builtin:parts/touch.toml'\nin.image = 'pad.image'\n\
         [parts.touch2]\nfile = 'builtin:parts/touch.toml'\nin.image = 'pad2.image'\nroles.pad = 'pad2'\n{more}"
    );
    let bench = "[bind]\npad = 'one'\npad2 = 'two'\n[devices.one]\ntype = 'mock_pad'\nthreshold = 0.01\n\
                 [devices.two]\ntype = 'mock_pad'\nthreshold = 0.02\n";
    Request { bench_text: Some(bench.into()), ..Request::text(graph) }
}

#[test]
fn a_name_of_a_role_means_what_it_means_in_the_file_where_it_is_written() {
    let cases: [(&str, &[&str]); 5] = [
        ("", &[]),
        // The graph names its own roles, also where it sets something in a part.
        ("set.binarize.threshold = { from = 'pad2.threshold' }", &[]),
        ("set.binarize.threshold = { from = 'pad.threshold' }", &["foreign-fact"]),
        ("[graph]\nstart = 'm'\n[modes.m]\nset.touch2.binarize.threshold = { from = 'pad2.threshold' }", &[]),
        (
            "[graph]\nstart = 'm'\n[modes.m]\nset.touch2.binarize.threshold = { from = 'pad.threshold' }",
            &["foreign-fact"],
        ),
    ];
    for (more, wanted) in cases {
        let (table, rest) = more.strip_prefix("[graph]\n").map_or((None, more), |more| {
            let (start, modes) = more.split_once('\n').expect("a key and the modes");
            (Some(start), modes)
        });
        let mut request = two_pads(rest);
        request = table.into_iter().fold(request, |request, start| request.set(format!("graph.{start}")));
        assert_eq!(codes(&request), wanted, "{more}");
    }
}

#[test]
fn a_second_pad_on_an_arm_needs_a_limiter_of_its_own() {
    let hybrid =
        || Request::file(workspace().join("graphs/hybrid.toml")).bench(workspace().join("graphs/benches/mock.toml"));
    let second = |role: &str| {
        let request = hybrid().set(format!("roles.pad2={role}")).set("bind.pad2='pad2'");
        codes(&request.set("devices.pad2={ type = 'mock_pad' }"))
    };
    assert_eq!(second("'tactile_pad'"), ["unlimited-command"]);
    assert_eq!(second("{ type = 'tactile_pad', on = 'arm' }"), ["unlimited-command"]);
    assert_eq!(second("{ type = 'tactile_pad', on = 'none' }"), [""; 0], "it is on no arm");
}

/// A palm and a fingertip on one arm, each with a limiter of its own.
fn two_on_one() -> Request {
    Request::file(workspace().join("tests/data/two_pads/slide.toml"))
}

#[test]
fn nothing_of_one_pad_of_an_arm_can_be_given_to_the_other_one() {
    let third = ["bind.third='third'", "devices.third={ type = 'mock_pad' }"];
    let two_arms = [
        "roles.palm={ type = 'tactile_pad', on = 'arm' }",
        "roles.other='velocity_arm'",
        "bind.other='other'",
        "devices.other={ type = 'mock_arm', robot = 'builtin:lwr4p.toml' }",
    ];
    let crossings: [(&[&str], &str); 24] = [
        // One of the pads twice.
        (&["parts.move.roles={ pad = 'palm', second_pad = 'palm' }"], "frame-mismatch"),
        (&["parts.move.roles={ pad = 'finger', second_pad = 'finger' }"], "frame-mismatch"),
        (&["parts.move.in.second_image='touch.image'"], "frame-mismatch"),
        (&["parts.move.in.image='finger_touch.image'"], "frame-mismatch"),
        (
            &[
                "parts.move.roles={ pad = 'palm', second_pad = 'palm' }",
                "parts.move.in.second_image='touch.image'",
                "parts.move.in.second_contact='touch.present'",
            ],
            "unlimited-command",
        ),
        // Swapped in one place and not in the other one.
        (&["parts.move.roles={ pad = 'finger', second_pad = 'palm' }"], "frame-mismatch"),
        (&["parts.move.in.image='finger_touch.image'", "parts.move.in.second_image='touch.image'"], "frame-mismatch"),
        (&["parts.move.set.state.mount={ from = 'finger.mount' }"], "foreign-fact"),
        (&["parts.move.set.second_state.mount={ from = 'palm.mount' }"], "foreign-fact"),
        (&["parts.move.set.second_state.mount={ xyz = [0, 0, 0.1] }"], "bad-value"),
        (&["parts.move.set.state.sensor='finger'"], "foreign-fact"),
        (&["parts.move.set.second_state.sensor='palm'"], "foreign-fact"),
        (&["parts.move.set.second_state.sensor='arm'"], "frame-mismatch"),
        (&["parts.touch.roles.pad='finger'"], "foreign-fact"),
        (&["parts.finger_touch.in.image='palm.image'"], "foreign-fact"),
        // A pad whose limiter is missing, or is on another arm.
        (&["parts.move.file='builtin:parts/move.toml'"], "unlimited-command"),
        (&["roles.arm='bare_arm'"], "unlimited-command"),
        (&["roles.finger={ type = 'tactile_pad', on = 'none' }"], "foreign-input"),
        (&["roles.palm={ type = 'tactile_pad', on = 'none' }"], "foreign-fact"),
        (&["roles.third='tactile_pad'", third[0], third[1]], "unlimited-command"),
        (
            &[
                two_arms[0],
                two_arms[1],
                two_arms[2],
                two_arms[3],
                "roles.finger={ type = 'tactile_pad', on = 'other' }",
            ],
            "foreign-input",
        ),
        // Limits hold for both.
        (&["parts.move.set.contact.force_n=15.1"], "loose-limit"),
        (&["parts.move.set.second_contact.force_n=15.1"], "loose-limit"),
        (&["parts.move.set.second_contact.force_n={ from = 'limits.none', optional = true }"], "missing-limit"),
    ];
    assert_eq!(codes(&two_on_one()), [""; 0], "it loads as it is");
    let mut wrong = Vec::new();
    for (sets, code) in crossings {
        let found = codes(&sets.iter().fold(two_on_one(), |request, set| request.set(*set)));
        if !found.contains(&code) {
            wrong.push(format!("{sets:?}: {found:?} without {code}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // What is swapped everywhere is another graph, and each pad may have a tighter limit.
    let swapped = [
        "parts.move.roles={ pad = 'finger', second_pad = 'palm' }",
        "parts.move.in.image='finger_touch.image'",
        "parts.move.in.second_image='touch.image'",
        "parts.move.in.contact='finger_touch.present'",
        "parts.move.in.second_contact='touch.present'",
    ];
    assert_eq!(codes(&swapped.iter().fold(two_on_one(), |request, set| request.set(*set))), [""; 0]);
    assert_eq!(codes(&two_on_one().set("parts.move.set.second_contact.force_n=5.0")), [""; 0]);
}
