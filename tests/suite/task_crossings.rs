//! Two tasks in one graph: whatever of one is given to the other one, the graph does not load, and the message names
//! what is wrong.

use tactflow_runtime::graph::compile;
use tactflow_tests::catalogue;

use crate::task_folder::{Edit, Folder, LEFT_ROLES};

/// The mistakes of a graph as text, with their codes; empty if it loads.
fn mistakes(edits: &[Edit<'_>], set: &[&str]) -> (Vec<&'static str>, String) {
    let folder = Folder::new(edits);
    let request = set.iter().fold(folder.request(), |request, set| request.set(*set));
    let Err(report) = compile(&catalogue(), &request) else { return (Vec::new(), String::new()) };
    (report.diagnostics.iter().map(|diagnostic| diagnostic.code.name()).collect(), report.render(false))
}

/// Asserts that each case has a mistake of its code, whose text contains what is named.
fn assert_refused(cases: &[(&[Edit<'_>], &str, &str)]) {
    let wrong = cases.iter().filter_map(|(edits, code, names)| {
        let (codes, text) = mistakes(edits, &[]);
        let is_right = codes.contains(code) && text.contains(names);
        (!is_right).then(|| format!("{edits:?}: no {code} with {names:?} in {codes:?}\n{text}"))
    });
    let wrong: Vec<String> = wrong.collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

const TWO: &str = "two.toml";
const LEFT: &str = "left.toml";

/// Replaces the roles of the part `left`.
const fn in_left_block(text: &str) -> Edit<'_> {
    (TWO, LEFT_ROLES, text)
}

#[test]
fn it_loads_as_it_is() {
    assert_eq!(mistakes(&[], &[]).0, [""; 0]);
    // The limits of the part, the graph and the arm hold all; a bench that only the part names need not be there.
    for edit in [
        (LEFT, "", "[limits.arm]\nforce_n = 3.0"),
        (TWO, "", "[limits]\nforce_n = 3.0"),
        (TWO, "", "[limits.left_arm]\nforce_n = 3.0"),
        (LEFT, "benches/ball.toml", "benches/none.toml"),
        (LEFT, "", "[policy.roles.pad]\nmax_age_ms = 50"),
    ] {
        let (codes, text) = mistakes(&[edit], &[]);
        assert!(codes.is_empty(), "{edit:?}: {text}");
    }
}

/// Wrong roles: the changes, the code and what the message names.
const OF_ROLES: &[(&[Edit<'static>], &str, &str)] = &[
    (&[in_left_block("")], "unknown-port", "part `left` takes a role `pad`"),
    (&[in_left_block("")], "unknown-port", "`roles.arm = \"left_arm\"`"),
    (&[in_left_block("roles = { arm = 'left_arm' }")], "unknown-port", "`roles.pad = \"left_pad\"`"),
    (&[in_left_block("roles = { pad = 'left_pad' }")], "unknown-port", "`roles.arm = \"left_arm\"`"),
    (&[in_left_block("roles = { padd = 'left_pad', arm = 'left_arm' }")], "unknown-key", "did you mean `pad`?"),
    (&[in_left_block("roles = { pad = 'left_pda', arm = 'left_arm' }")], "unknown-port", "did you mean `left_pad`?"),
    (&[in_left_block("roles = { pad = 'pad', arm = 'left_arm' }")], "unknown-port", "roles here: `left_pad`"),
    (
        &[in_left_block("roles = { pad = 'right.touch', arm = 'left_arm' }")],
        "unknown-port",
        "there is no role `right.touch`",
    ),
    (&[in_left_block("roles = { pad = 'right.pad', arm = 'left_arm' }")], "unknown-port", "did you mean `right_pad`?"),
    (&[in_left_block("roles = { pad = 3, arm = 'left_arm' }")], "bad-value", "expected a string"),
    (
        &[in_left_block("roles = { pad = 'left_arm', arm = 'left_arm' }")],
        "wrong-role",
        "takes a `tactile_pad`, but `left_arm`",
    ),
    (
        &[in_left_block("roles = { pad = 'left_arm', arm = 'left_pad' }")],
        "wrong-role",
        "takes a `velocity_arm`, but `left_pad`",
    ),
    (
        &[in_left_block("roles = { pad = 'right_pad', arm = 'left_arm' }")],
        "foreign-input",
        "`right_pad` moves with `left_arm` in part `left`, and with `right_arm` in part `right`",
    ),
    (
        &[in_left_block("roles = { pad = 'left_pad', arm = 'right_arm' }")],
        "duplicate-name",
        "`right_arm.velocity` has two drivers: part `left` and part `right`",
    ),
    (
        &[in_left_block("roles = { pad = 'right_pad', arm = 'right_arm' }")],
        "duplicate-name",
        "`right_arm.contact` has two drivers",
    ),
    (&[in_left_block("role = { pad = 'left_pad', arm = 'left_arm' }")], "unknown-key", "did you mean `roles`?"),
    (
        &[
            in_left_block("roles = { pad = 'left_pad', arm = 'left_arm', pad2 = 'left_pad' }"),
            (LEFT, "[roles]", "[roles]\npad2 = 'tactile_pad'"),
        ],
        "wrong-role",
        "takes `pad2` and `pad`, and both are `left_pad`",
    ),
    (
        &[(LEFT, "pad = \"tactile_pad\"", "pad = { type = 'tactile_pad', on = 'right_arm' }")],
        "unknown-port",
        "roles here: `pad`, `arm`",
    ),
    (
        &[(TWO, "left_pad = \"tactile_pad\"", "left_pad = { type = 'tactile_pad', on = 'right_arm' }")],
        "foreign-input",
        "`left_pad`, which is on `right_arm`",
    ),
    (&[(TWO, "[parts.left]", "[parts.left_arm]")], "duplicate-name", "the name `left_arm` is used twice"),
    (&[(TWO, "[parts.left]", "[parts.modes]")], "bad-name", "`modes` is not a valid name"),
    (
        &[in_left_block("roles = { pad = 'left_pad', arm = 'left_arm' }\non_fail = 'stop'")],
        "bad-value",
        "expected one of `part`, `run`",
    ),
    (
        &[in_left_block("roles = { pad = 'left_pad', arm = 'left_arm' }\non_fial = 'run'")],
        "unknown-key",
        "did you mean `on_fail`?",
    ),
];

#[test]
fn the_roles_of_a_part_are_its_own() {
    assert_refused(OF_ROLES);
}

#[test]
fn a_mistake_of_the_roles_is_reported_once() {
    for roles in [
        "roles = { padd = 'left_pad', arm = 'left_arm' }",
        "roles = { pad = 'pad', arm = 'left_arm' }",
        "roles = { pad = 3, arm = 'left_arm' }",
        "roles = { arm = 'left_arm' }",
        "roles = { pad = 'left_arm', arm = 'left_arm' }",
        "roles = { pad = 'right_pad', arm = 'left_arm' }",
    ] {
        let (codes, text) = mistakes(&[(TWO, LEFT_ROLES, roles)], &[]);
        assert_eq!(codes.len(), 1, "{text}");
    }
}

#[test]
fn the_commands_the_limits_and_the_facts_of_a_part_are_its_own() {
    let set = in_left_block;
    let with = |text: &str| format!("{LEFT_ROLES}\n{text}");
    let (more, fact, frame) = (
        with("set.move.contact.force_n = 15.1"),
        with("set.move.ik.posture = { from = 'right_arm.home' }"),
        with("set.move.state.sensor = 'right_pad'"),
    );
    let (tight, node) = (with("set.move.contact.force_n = 10.0"), with("set.pidd.gains.x = { kp = 1 }"));
    assert_refused(&[
        (&[(LEFT, "arm.velocity =", "right_arm.velocity =")], "unknown-port", "there is no role `right_arm`"),
        (&[(LEFT, "arm.velocity =", "left_arm.velocity =")], "unknown-port", "did you mean `arm`?"),
        (&[(LEFT, "", "[limits.right_arm]\nforce_n = 3.0")], "unknown-port", "there is no role `right_arm`"),
        (&[(LEFT, "", "[limits.left_arm]\nforce_n = 3.0")], "unknown-port", "did you mean `arm`?"),
        (&[(TWO, "", "[limits.left]\nforce_n = 3.0")], "unknown-port", "there is no arm `left`"),
        (
            &[(TWO, "", "[commands]\nleft_arm.velocity = 'left.move.velocity'")],
            "duplicate-name",
            "two drivers: the graph and part `left`",
        ),
        (
            &[(TWO, "", "[commands]\nleft_arm.velocity = 'right.move.velocity'")],
            "frame-mismatch",
            "`right.move.joints.velocity` is a joint vector of `right_arm`",
        ),
        (
            &[(TWO, "", "[commands]\nright_arm.contact = 'left.ruler.pose'")],
            "duplicate-name",
            "two drivers: the graph and part `right`",
        ),
        (&[set(&more)], "loose-limit", "`force_n` of `left.move.contact` is looser than the limit"),
        (&[set(&tight), (TWO, "", "[limits.left_arm]\nforce_n = 3.0")], "loose-limit", "`left.move.contact`"),
        (
            &[(LEFT, "set.reach.twist", "set.move.contact.force_n = 20.0\nset.reach.twist")],
            "not-live",
            "`force_n` of `contact`",
        ),
        (&[set(&fact)], "foreign-fact", "write `{ from = \"left_arm.home\" }`"),
        (&[set(&frame)], "foreign-input", "in the frame of `right_pad`, which is on `right_arm`"),
        (&[set(&node)], "unknown-key", "did you mean `pid`?"),
        (
            &[(LEFT, "from = \"pad.pressure\"", "from = \"right_pad.pressure\"")],
            "foreign-fact",
            "write in [nodes.error]:",
        ),
        (&[(LEFT, "", "[policy.roles.left_pad]\nmax_age_ms = 50")], "unknown-key", "roles here: `arm`, `pad`"),
        (&[(LEFT, "", "[policy.roles.right_pad]\nmax_age_ms = 50")], "unknown-key", "there is no role `right_pad`"),
        (&[(TWO, "", "[policy.roles.pad]\nmax_age_ms = 50")], "unknown-key", "there is no role `pad`"),
    ]);
    let by_command_line = [
        ("limits.left_arm.force_n=15.1", "loose-limit"),
        ("limits.force_n=15.1", "loose-limit"),
        ("limits.arm.force_n=3", "unknown-port"),
        ("parts.left.set.move.contact.force_n=15.1", "loose-limit"),
        ("nodes.left.pid.gains.x.kp=3", "unknown-key"),
        ("parts.left.set.modes.servo.set.pid.gains.x.kp=3", "unknown-key"),
        ("graph.clock='pad'", "bad-clock"),
    ];
    for (set, code) in by_command_line {
        let (codes, text) = mistakes(&[], &[set]);
        assert!(codes.contains(&code), "{set}: {text}");
    }
}

/// The input `partner` in the file of the left task, and its wire.
fn input(from: &str) -> [(&'static str, &'static str, String); 2] {
    [
        (TWO, LEFT_ROLES, format!("{LEFT_ROLES}\nin.partner = \"{from}\"")),
        (LEFT, "", "[inputs]\npartner = \"of the other\"".into()),
    ]
}

const FAIL: &str = "fail = { after_ms = 10000, after_travel_mm = 60, of = \"move.sensor_pose\" }";
const STILL: &str = "twist = [0, 0, 0, 0, 0, 0]          #";
const GATE: &str = "twist = [0, 0, 0, 0, 0, 0]\nin.gate = \"inputs.partner\"          #";
const DONE: Edit<'static> = (LEFT, "[modes.servo]", "[modes.servo]\ndone = { when = 'inputs.partner' }");
const UNBOUND: Edit<'static> = (LEFT, FAIL, "");
/// What the left task reads of the other one, with the changes, the code and what the message names.
const OF_PORTS: &[(&str, &[Edit<'static>], &str, &str)] = &[
    ("right.touch.present", &[UNBOUND, (LEFT, STILL, GATE)], "ungated-motion", "`left.reach`"),
    ("right.modes.servo", &[UNBOUND, (LEFT, STILL, GATE)], "ungated-motion", "in mode `left.approach`"),
    (
        "right.touch.present",
        &[UNBOUND, (LEFT, "when = \"touch.present\"", "when = \"inputs.partner\"")],
        "ungated-motion",
        "`left.reach`",
    ),
    (
        "right.move.sensor_pose",
        &[(LEFT, FAIL, "fail = { after_travel_mm = 60, of = 'inputs.partner' }")],
        "ungated-motion",
        "`left.reach`",
    ),
    (
        "right.touch.present",
        &[(LEFT, FAIL, "on_lost = { of = 'inputs.partner', to = 'servo' }")],
        "ungated-motion",
        "`left.reach`",
    ),
    (
        "right.touch.present",
        &[(LEFT, "in.contact = \"touch.present\"", "in.contact = \"inputs.partner\"")],
        "foreign-input",
        "descends from `right_pad`",
    ),
    (
        "right.touch.image",
        &[(LEFT, "in.image = \"touch.image\"", "in.image = \"inputs.partner\"")],
        "frame-mismatch",
        "`left.move.blind.image` takes an image in `left_pad`",
    ),
    (
        "right.sum.twist",
        &[(LEFT, "in.twist = \"sum.twist\"", "in.twist = \"inputs.partner\"")],
        "foreign-input",
        "left.toml:",
    ),
    (
        "right.error.error",
        &[(LEFT, "in.error = \"error.error\"", "in.error = \"inputs.partner\"")],
        "foreign-input",
        "in the frame of `right_pad`",
    ),
    (
        "right.reach.twist",
        &[(LEFT, "in.reach = \"reach.twist\"", "in.reach = \"inputs.partner\"")],
        "frame-mismatch",
        "`left_pad`",
    ),
    ("right.modes.serv", &[DONE], "unknown-port", "did you mean `servo`?"),
    ("rihgt.modes.servo", &[DONE], "unknown-port", "did you mean `right`?"),
    ("right.servo", &[DONE], "unknown-port", "write `right.modes.servo`"),
    ("modes.servo", &[DONE], "unknown-port", "there is no mode `servo`"),
    (
        "right.touch.image",
        &[(LEFT, "[modes.servo]", "[modes.servo]\ndone = { when = 'inputs.partner', is = 'true' }")],
        "bad-condition",
        "`inputs.partner` is an image",
    ),
    (
        "right.modes.servo",
        &[(LEFT, "[modes.servo]", "[modes.servo]\ndone = { when = 'inputs.partnr' }")],
        "unknown-port",
        "did you mean `partner`?",
    ),
    ("right.modes.servo", &[(TWO, "in.partner", "in.partnr"), DONE], "unknown-input", "did you mean `partner`?"),
    (
        "right.modes.servo",
        &[(TWO, "in.partner = \"right.modes.servo\"", ""), DONE],
        "missing-input",
        "part `left` needs a wire to `in.partner`",
    ),
    (
        "right.modes.servo",
        &[(LEFT, "to = \"servo\"", "to = \"right.servo\"")],
        "unknown-mode",
        "there is no mode `right.servo`",
    ),
];

#[test]
fn the_ports_and_the_modes_of_the_other_task_bound_no_motion() {
    for (from, edits, code, names) in OF_PORTS {
        let wired = input(from);
        let wired: Vec<Edit<'_>> = wired.iter().map(|(file, at, to)| (*file, *at, to.as_str())).collect();
        assert_refused(&[(&[&wired, *edits].concat(), code, names)]);
    }
}

/// The modes of the graph itself.
const fn root(modes: &str) -> [Edit<'_>; 2] {
    [(TWO, "[graph]", "[graph]\nstart = 'a'"), (TWO, "", modes)]
}

/// Names that are those of another file: the changes, the code and what the message names.
const OF_NAMES: &[(&[Edit<'static>], &str, &str)] = &[
    (
        &[(LEFT, "\"touch.present\", for_ms", "\"right.modes.servo\", for_ms")],
        "unknown-port",
        "`right` belongs to the file around this one",
    ),
    (&[(LEFT, "\"touch.present\", for_ms", "\"modes.serv\", for_ms")], "unknown-port", "did you mean `servo`?"),
    (
        &[(LEFT, "in.contact = \"touch.present\"", "in.contact = \"right.touch.present\"")],
        "unknown-port",
        "there is no role, node or part `right`",
    ),
    (
        &[(LEFT, "in.image = \"pad.image\"", "in.image = \"right_pad.image\"")],
        "unknown-port",
        "there is no role, node or part `right_pad`",
    ),
    (
        &[(LEFT, "start = \"approach\"", "start = \"right.approach\"")],
        "unknown-mode",
        "modes here: `approach`, `servo`",
    ),
    (&[(LEFT, "start = \"approach\"\n", "")], "missing-key", "left.toml:2:2"),
    (
        &[(LEFT, "\"touch.image\", \"error", "\"right.touch.image\", \"error")],
        "unknown-port",
        "there is no role, node or part `right`",
    ),
    (&[(TWO, "[graph]", "[graph]\nshow = ['touch.image']")], "unknown-port", "there is no role, node or part `touch`"),
    (&[(TWO, "[graph]", "[graph]\nshow = ['lefft.touch.image']")], "unknown-port", "did you mean `left`?"),
    (
        &[(TWO, "[graph]", "[graph]\nmark = ['left.touch.x', 'right.touch.y']")],
        "foreign-input",
        "are of different sensors",
    ),
    (
        &[(TWO, "[graph]", "[graph]\nshow = ['left.touch.image']\nmark = ['right.touch.x', 'right.touch.y']")],
        "foreign-input",
        "are of different sensors",
    ),
    (
        &root("[modes.a]\nset.left.pid.gains.x = { kp = 1.0 }\ndone = { after_ms = 100 }"),
        "unknown-key",
        "which is in a part with modes of its own",
    ),
    (&root("[modes.a]\ngo = { to = 'left.servo', after_ms = 100 }"), "unknown-mode", "there is no mode `left.servo`"),
    (&root("[modes.a]\ndone = { when = 'left.modes.serv' }"), "unknown-port", "did you mean `servo`?"),
    (&root("[modes.a]\ndone = { when = 'left.servo' }"), "unknown-port", "write `left.modes.servo`"),
    (&[(TWO, "[graph]", "[graph]\nstart = 'servo'")], "unknown-mode", "there is no mode `servo`"),
    (
        &[
            (
                TWO,
                "",
                "[nodes.push]\ntype = 'twist_source'\ntwist = [0, 0, 0.01, 0, 0, 0]\nin.gate = 'right.touch.present'",
            ),
            (TWO, LEFT_ROLES, "roles = { pad = 'left_pad', arm = 'left_arm' }\nin.more = 'push.twist'"),
            (LEFT, "in.reach = \"reach.twist\"", "in.reach = \"reach.twist\"\nin.more = \"inputs.more\""),
            (LEFT, "", "[inputs]\nmore = \"a motion\""),
        ],
        "ungated-motion",
        "`push` moves the arm without a gate",
    ),
];

#[test]
fn the_names_of_one_task_are_not_those_of_the_other_one() {
    assert_refused(OF_NAMES);
}
