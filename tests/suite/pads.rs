//! Arms with two pads, and arms without one: what the check accepts, what its suggestions are worth, and what reaches
//! the arm.

use std::fs;

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::signal::Pose;
use tactflow_runtime::source::{Code, Report};
use tactflow_tests::{catalogue, workspace};

use crate::course::get;

fn load(request: &Request) -> Compiled {
    compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

fn refused(text: &str) -> Report {
    compile(&catalogue(), &Request::text(text)).err().unwrap_or_else(|| panic!("it loads:\n{text}"))
}

/// The help of the mistake about a limit that does not hold.
fn help(report: &Report) -> String {
    let found = report.diagnostics.iter().find(|found| found.code == Code::UnlimitedCommand);
    found.and_then(|found| found.help.clone()).unwrap_or_else(|| panic!("{}", report.render(false)))
}

/// The graph with two pads and its bench as one text, with absolute paths.
fn two_pads() -> String {
    let folder = workspace().join("tests/data/two_pads");
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
    let text = read("slide.toml").replace("bench = \"bench.toml\"\n", "");
    let [graph, bench] =
        [text, read("bench.toml")].map(|text| text.replace("../../..", &workspace().display().to_string()));
    let bench = bench.split("[limits]").collect::<Vec<_>>();
    let graph = graph.replace("[limits]\n", &format!("[limits]\n{}", bench[1]));
    format!("{graph}\n{}", bench[0])
}

/// Replaces a block, or adds it if there is none with its header.
fn paste(text: &str, block: &str) -> String {
    let header = block.lines().next().unwrap();
    let Some(at) = text.find(&format!("{header}\n")) else { return format!("{text}\n{block}\n") };
    let end = text[at + 1..].find("\n[").map_or(text.len(), |end| at + 1 + end);
    format!("{}{block}\n{}", &text[..at], &text[end..])
}

/// The blocks in a help, each from its header to the next one.
fn blocks(help: &str) -> Vec<String> {
    let mut blocks = Vec::<String>::new();
    for line in help.lines() {
        match (line.starts_with('['), blocks.last_mut()) {
            (true, _) => blocks.push(line.to_owned()),
            (false, Some(block)) => *block += &format!("\n{line}"),
            (false, None) => {}
        }
    }
    blocks
}

#[test]
fn with_the_part_that_the_message_names_the_graph_loads() {
    let second = ["in.second_image", "in.second_contact", "roles = { pad = \"palm\", second_pad"];
    let lines = two_pads();
    let one: Vec<String> = lines
        .lines()
        .filter(|line| !second[..2].iter().any(|start| line.starts_with(start)))
        .map(|line| match line.starts_with(second[2]) {
            true => "roles = { pad = \"palm\" }".to_owned(),
            false => line.replace("two_pad_move", "move"),
        })
        .collect();
    let one = one.join("\n");
    let help = help(&refused(&one));
    let [block] = &blocks(&help)[..] else { panic!("{help}") };
    load(&Request::text(paste(&one, block)));
}

#[test]
fn with_the_blocks_that_the_message_names_the_graph_loads() {
    let read = |name: &str| fs::read_to_string(workspace().join("tests/errors").join(name)).unwrap();
    let folder = workspace().join("tests/errors");
    let absolute = |text: String| {
        // The expected messages contain the blocks, too.
        let text: String = text.lines().filter(|line| !line.starts_with('#')).map(|line| format!("{line}\n")).collect();
        let text = text.replace("\"../../graphs", &format!("\"{}/graphs", workspace().display()));
        text.replace("\"benches/", &format!("\"{}/benches/", folder.display()))
    };
    // Two pads whose limiters are in the file itself: the taker of the motion changes, too.
    let text = absolute(read("unlimited_pad.toml"));
    let found = blocks(&help(&refused(&text)));
    assert_eq!(found.len(), 2, "{found:?}");
    let text = text.replacen(
        "[nodes.workspace]\ntype = \"workspace_limit\"\nin.twist = \"contact.twist\"",
        "[nodes.workspace]\ntype = \"workspace_limit\"\nin.twist = \"second_contact_limit.twist\"",
        1,
    );
    let fixed = found.iter().fold(text, |text, block| paste(&text, block));
    load(&Request::text(fixed));
    // A sum behind the limiters: each line replaces the wire of that name.
    let text = absolute(read("unlimited_sum.toml"));
    let fixed = blocks(&help(&refused(&text))).iter().fold(text, |text, block| {
        let (header, wire) = block.split_once('\n').unwrap();
        let key = wire.split(" = ").next().unwrap();
        let at = text.find(header).unwrap();
        let from = at + text[at..].find(&format!("{key} = ")).unwrap();
        let end = from + text[from..].find('\n').unwrap();
        format!("{}{wire}{}", &text[..from], &text[end..])
    });
    load(&Request::text(fixed));
}

#[test]
fn wherever_motions_are_added_behind_a_limiter_the_graph_does_not_load() {
    let move_part = fs::read_to_string(workspace().join("graphs/parts/move.toml")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("move.toml");
    let graph = fs::read_to_string(workspace().join("graphs/hybrid.toml")).unwrap();
    let graph = graph.replace("file = \"parts/move.toml\"", &format!("file = {:?}", part.display().to_string()));
    let graph = graph.replace("\"parts/", "\"builtin:parts/").replace("bench = \"benches/ball.toml\"\n", "");
    let request = || Request::text(graph.as_str()).bench(workspace().join("graphs/benches/ball.toml"));
    fs::write(&part, &move_part).unwrap();
    load(&request());
    for (limiter, is_free) in [
        ("inputs", true),
        ("bumpless", false),
        ("contact", false),
        ("workspace", false),
        ("blind", false),
        ("speed", false),
        ("acceleration", false),
    ] {
        let sum = format!("\n[nodes.sum]\ntype = \"twist_adder\"\nin.limited = \"{limiter}.twist\"\n");
        let text = move_part.replacen(&format!("in.twist = \"{limiter}.twist\""), "in.twist = \"sum.twist\"", 1);
        fs::write(&part, format!("{text}{sum}")).unwrap();
        match compile(&catalogue(), &request()) {
            Ok(_) => assert!(is_free, "a sum behind `{limiter}` loads"),
            Err(report) => {
                assert!(!is_free, "{}", report.render(false));
                let help = help(&report);
                assert!(help.starts_with("`move.sum` computes a new motion"), "{limiter}: {help}");
                assert!(
                    help.contains("in.limited = \"inputs.twist\"\n[nodes.bumpless]\nin.twist = \"sum.twist\""),
                    "{help}"
                );
            }
        }
    }
}

/// The speed of the origin of a pad along its normal, in the motion between two ticks: from the poses of both pads, and
/// not from a twist.
fn normal_speed(before: &IsometryMatrix3<f64>, after: &IsometryMatrix3<f64>, dt: f64) -> f64 {
    (before.rotation * Vector3::z()).dot(&(after.translation.vector - before.translation.vector)) / dt
}

#[test]
fn a_fingertip_at_its_ceiling_stops_its_own_approach_and_the_palm_still_retreats() {
    let mut engine = Engine::new(load(&Request::file(workspace().join("tests/data/two_pads/slide.toml"))));
    let pose =
        |engine: &Engine, node: &str| get::<Pose>(engine, &format!("move.{node}.sensor_pose")).map(|pose| pose.0);
    let mut last = None;
    let mut speeds = Vec::new();
    while let Some(next) = engine.next().filter(|next| *next < 3_400_000_000) {
        engine.tick(next).unwrap();
        let time = next as f64 * 1e-9;
        let (Some(palm), Some(finger)) = (pose(&engine, "state"), pose(&engine, "second_state")) else { continue };
        if let Some((before, palm_before, finger_before)) = last.replace((time, palm, finger)) {
            let dt = time - before;
            speeds.push((time, normal_speed(&palm_before, &palm, dt), normal_speed(&finger_before, &finger, dt)));
        }
    }
    let in_time = |from: f64, to: f64| speeds.iter().filter(move |(time, ..)| (from..to).contains(time));
    // Free: the palm retreats with 5 mm/s, and the fingertip approaches with 5 mm/s.
    for (time, palm, finger) in in_time(0.5, 0.99) {
        assert!((palm + 0.005).abs() < 1e-4 && (finger - 0.005).abs() < 1e-4, "{time}: {palm} and {finger}");
    }
    // The fingertip is pressed with 20 N, and its ceiling is 15 N. The palm is not reduced.
    for (time, palm, finger) in in_time(2.5, 3.4) {
        assert!((palm + 0.005).abs() < 1e-4 && finger.abs() < 1e-4, "{time}: {palm} and {finger}");
    }
}

#[test]
fn a_palm_that_loses_its_contact_does_not_push_on() {
    let slide = Request::file(workspace().join("tests/data/two_pads/slide.toml"));
    let press = "devices.palm.press=[{ from_s = 0.5, to_s = 2.0, at = [0.01, 0.0], force = 3.0 }]";
    let request = slide.set("modes.slide.set.slide.twist=[0, 0, 0.005, 0, 0, 0]").set(press);
    let mut engine = Engine::new(load(&request.set("devices.finger.press=[]")));
    let (mut last, mut speeds) = (None, Vec::new());
    while let Some(next) = engine.next().filter(|next| *next < 3_800_000_000) {
        engine.tick(next).unwrap();
        let Some(palm) = get::<Pose>(&engine, "move.state.sensor_pose").map(|pose| pose.0) else { continue };
        let time = next as f64 * 1e-9;
        if let Some((before, pose)) = last.replace((time, palm)) {
            speeds.push((time, normal_speed(&pose, &palm, time - before)));
        }
    }
    let fastest = |from: f64, to: f64| {
        let within = speeds.iter().filter(|(time, _)| (from..to).contains(time));
        within.map(|(_, speed)| *speed).fold(f64::NEG_INFINITY, f64::max)
    };
    assert!(fastest(1.0, 1.9) > 0.004, "it presses: {}", fastest(1.0, 1.9));
    // At rest after two periods of 4 ms and the time to brake, 5 mm/s at 2 m/s², until 500 ms have passed.
    assert!(fastest(2.02, 2.49) < 1e-4, "{} m/s", fastest(2.02, 2.49));
    assert!(fastest(2.6, 3.8) > 0.004, "it searches: {}", fastest(2.6, 3.8));
}

const BARE: &str = "[graph]\nclock = 'arm'\nstart = 'there'\n[roles]\narm = 'bare_arm'\n\
    [commands]\narm.velocity = 'move.velocity'\n\
    [nodes.wave]\ntype = 'twist_source'\ntwist = [0, 0, 0, 0, 0, 0]\n\
    [parts.move]\nfile = 'builtin:parts/bare_move.toml'\nin.twist = 'wave.twist'\nin.position = 'arm.position'\n\
    in.equilibrium = 'arm.equilibrium'\n\
    [modes.there]\nset.wave.twist = [0, 0, 0.02, 0, 0, 0]\ngo = { to = 'back', after_ms = 1000 }\n\
    [modes.back]\nset.wave.twist = [0, 0, -0.02, 0, 0, 0]\ndone = { after_ms = 1000 }\n\
    [limits]\nlinear_m_per_s = 0.05\nangular_rad_per_s = 0.8\nlinear_m_per_s2 = 2.0\nangular_rad_per_s2 = 10.0\n\
    workspace_min_m = [-0.8, -0.4, 0.1]\nworkspace_max_m = [-0.3, 0.4, 0.7]\n[bind]\narm = 'arm'\n";

/// The devices that can fill the role of a bare arm.
const ARMS: [&str; 2] = [
    "[devices.arm]\ntype = 'mock_arm'\nrobot = 'builtin:lwr4p.toml'\n",
    "[devices.arm]\ntype = 'sim_bench'\nfor_s = 4.0\nrobot = 'builtin:lwr4p.toml'\n\
     calibration = 'builtin:calibrations/sim_pad.toml'\nobjects = []\n",
];

#[test]
fn a_bare_arm_moves_its_tip_along_its_own_axis_there_and_back() {
    for device in ARMS {
        for (facts, tool) in [("", 0.0), ("[facts.arm]\ntool = { xyz = [0.0, 0.0, 0.1] }\n", 0.1)] {
            let mut engine = Engine::new(load(&Request::text(format!("{BARE}{device}{facts}"))));
            let mut places = Vec::new();
            while let Some(next) = engine.next().filter(|next| *next < 1_900_000_000) {
                engine.tick(next).unwrap_or_else(|fault| panic!("{device}: {fault}"));
                places.extend(get::<Pose>(&engine, "move.state.sensor_pose").map(|pose| (next, pose.0)));
            }
            let (_, start) = places[0];
            let far = places.iter().find(|(time, _)| *time >= 1_000_000_000).expect("it moves for a second").1;
            let way = start.rotation.inverse() * (far.translation.vector - start.translation.vector);
            assert!((way - Vector3::new(0.0, 0.0, 0.02)).amax() < 2e-3, "{device}: {way:?} with a tool of {tool} m");
        }
    }
}

#[test]
fn a_bare_arm_has_all_limits_but_those_of_pads() {
    let catalogue = catalogue();
    let limits = |name: &str| catalogue.role_type(name).expect("a role").limits.clone();
    let kept: Vec<_> =
        limits("velocity_arm").into_iter().filter(|l| !["force", "peak", "blind"].contains(&&**l)).collect();
    assert_eq!(limits("bare_arm"), kept);
    let [bare, arm] = ["bare_arm", "velocity_arm"].map(|name| catalogue.role_type(name).expect("a role"));
    assert_eq!((&bare.outputs, &bare.commands, &bare.reports), (&arm.outputs, &arm.commands, &arm.reports));
    // Its part is the one that the message names, and each of its limiters is needed.
    let direct = "[nodes.state]\ntype = 'arm_state'\nin.position = 'arm.position'\nsensor = 'arm'\n\
        urdf = { from = 'arm.urdf' }\ntip = { from = 'arm.tip' }\n\
        [nodes.ik]\ntype = 'ik_sink'\nin.twist = 'to_base.twist'\nin.sensor_pose = 'state.sensor_pose'\n\
        in.jacobian = 'state.jacobian'\nin.joints = 'state.joints'\n\
        [nodes.to_base]\ntype = 'adjoint'\nin.twist = 'wave.twist'\nin.pose = 'state.sensor_pose'\n";
    let start = BARE.find("[parts.move]").unwrap();
    let end = BARE.find("[modes.there]").unwrap();
    let text = format!("{}{direct}{}{}", &BARE[..start], &BARE[end..], ARMS[0]).replace("move.velocity", "ik.velocity");
    assert!(help(&refused(&text)).contains("\"builtin:parts/bare_move.toml\""), "{}", help(&refused(&text)));
}

#[test]
fn without_any_one_limiter_of_its_part_no_arm_of_another_kind_loads() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("part.toml");
    let path = part.display().to_string();
    let bare = format!("{BARE}{}", ARMS[0]).replace("builtin:parts/bare_move.toml", &path);
    let two = two_pads().replace(&workspace().join("graphs/parts/two_pad_move.toml").display().to_string(), &path);
    for (file, graph, limiters) in [("bare_move", bare, 5), ("two_pad_move", two, 8)] {
        let whole = fs::read_to_string(workspace().join(format!("graphs/parts/{file}.toml"))).unwrap();
        fs::write(&part, &whole).unwrap();
        load(&Request::text(graph.as_str()));
        let whole: toml::Table = whole.parse().unwrap();
        let catalogue = catalogue();
        let mut removed = 0;
        for (name, node) in whole["nodes"].as_table().unwrap() {
            let limits = catalogue.find_node(node["type"].as_str().unwrap()).unwrap().1.limits;
            // The limiter of the wrench is left out on a bench without a sensor of it.
            let is_there = !limits.holds.is_empty() && node.get("only_with").is_none();
            let Some(through) = limits.through.filter(|_| is_there) else { continue };
            removed += 1;
            let source = node["in"][through].as_str().unwrap();
            let mut cut = whole.clone();
            cut["nodes"].as_table_mut().unwrap().remove(name);
            let text = cut.to_string().replace(&format!("\"{name}.{through}\""), &format!("\"{source}\""));
            fs::write(&part, text).unwrap();
            let report = refused(&graph);
            let codes: Vec<Code> = report.diagnostics.iter().map(|found| found.code).collect();
            assert!(codes.contains(&Code::UnlimitedCommand), "{file} without `{name}`: {}", report.render(false));
        }
        assert_eq!(removed, limiters, "{file}");
    }
}
