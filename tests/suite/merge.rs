//! Parts, what is set in them and `--set`: values end where they should, and a mistake shows where its value stands.
//!
//! Two instances of a part of `data/merge` add lengths to zero, so that every port tells which values are in force.

use std::fs;

use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::Scalar;
use tactflow_runtime::source::Code;
use tactflow_tests::catalogue;

use crate::course::{loaded, shipped};
use tactflow_runtime::engine::Engine;

/// A pad that nobody presses, in metres.
const BENCH: &str = "devices.pad.type = \"mock_pad\"\ndevices.pad.unit = \"m\"\nbind.pad = \"pad\"\n";

/// The graph with `first` among what it says of its first part.
fn request(first: &str) -> Request {
    let text = format!(
        "[graph]\nclock = \"pad\"\n[roles]\npad = \"tactile_pad\"\n\
         [nodes.source]\ntype = \"tactile_source\"\nin.image = \"pad.image\"\n\
         [parts.second]\nfile = \"data/merge/outer.toml\"\nin.value = \"first.value\"\n\
         [parts.first]\nfile = \"data/merge/outer.toml\"\nin.value = \"source.sum\"\n{first}\n"
    );
    Request { bench_text: Some(BENCH.into()), ..Request::text(text) }
}

/// What is on some ports after the first tick.
fn values<const N: usize>(request: &Request, ports: [&str; N]) -> [f64; N] {
    let mut engine = Engine::new(loaded(request));
    engine.tick(0).unwrap();
    ports.map(|port| {
        let found = engine.ports().iter().find(|(planned, _)| planned.name == port);
        let (_, id) = found.unwrap_or_else(|| panic!("there is no port `{port}`"));
        *engine.bus().slot::<Scalar>(*id)
    })
}

const PORTS: [&str; 4] = ["first.inner.one.value", "first.inner.two.value", "first.last.value", "second.last.value"];

#[test]
fn every_layer_lies_over_the_one_below() {
    let cases: [(&str, &[&str], [f64; 4], &str); 13] = [
        ("", &[], [2.0, 12.0, 112.0, 224.0], "the outer part over the inner"),
        ("set.last.by = 200.0", &[], [2.0, 12.0, 212.0, 324.0], "the graph over a part"),
        ("set.inner.one.by = 3.0", &[], [3.0, 13.0, 113.0, 225.0], "the graph over a part in a part"),
        ("set.inner.two.by = 20.0", &[], [2.0, 22.0, 122.0, 234.0], "beside what the outer part sets"),
        (
            "set.last.by = 200.0",
            &["parts.first.set.last.by=300"],
            [2.0, 12.0, 312.0, 424.0],
            "the command line over all",
        ),
        ("", &["parts.first.set.inner.one.by=7"], [7.0, 17.0, 117.0, 229.0], "the command line, two parts deep"),
        ("set.inner.one.by = 3.0", &["parts.first.set.inner.two.by=0"], [3.0, 3.0, 103.0, 215.0], "beside each other"),
        (
            "",
            &["parts.first.set.last.by=1", "parts.first.set.last.by=5"],
            [2.0, 12.0, 17.0, 129.0],
            "the last one wins",
        ),
        ("", &["parts.second.set.inner.one.by=0"], [2.0, 12.0, 112.0, 222.0], "the second instance alone"),
        ("set.last.in.value = \"inner.half\"", &[], [2.0, 12.0, 102.0, 214.0], "a wire, in the part's own scope"),
        (
            "",
            &["parts.second.in.value=first.half"],
            [2.0, 12.0, 112.0, 114.0],
            "a wire into a part, from an export of one",
        ),
        ("set.last.by = { from = \"pad.threshold\" }", &[], [2.0, 12.0, 12.015, 124.015], "a fact over a number"),
        (
            "set.last.by = { from = \"pad.threshold\" }",
            &["devices.pad.threshold=0.5"],
            [2.0, 12.0, 12.5, 124.5],
            "a fact that the command line sets",
        ),
    ];
    for (first, set, expected, what) in cases {
        let request = set.iter().fold(request(first), |request, set| request.set(*set));
        assert_eq!(values(&request, PORTS), expected, "{what}");
    }
}

#[test]
fn a_number_over_a_fact_replaces_it() {
    let fact = "set.last.by = { from = \"pad.threshold\" }";
    let request = request(fact).set("parts.first.set.last.by=0.25");
    assert_eq!(values(&request, ["first.last.value"]), [12.25]);
}

/// Code, place and message of everything that is wrong.
fn mistakes(request: &Request) -> Vec<(&'static str, String, String)> {
    let Err(report) = compile(&catalogue(), request) else { panic!("it loads") };
    let told = |diagnostic: &tactflow_runtime::source::Diagnostic| {
        (diagnostic.code.name(), report.sources.locate(diagnostic.span.start), diagnostic.message.clone())
    };
    report.diagnostics.iter().map(told).collect()
}

#[test]
fn a_mistake_shows_where_the_value_stands_that_is_in_force() {
    let wrong = "expected a number [m], found the string \"x\"";
    let cases: [(&str, &[&str], &str, &str, &str); 8] = [
        ("set.last.by = \"x\"", &[], "bad-value", "graph.toml:14:15", wrong),
        ("set.inner.one.by = \"x\"", &[], "bad-value", "graph.toml:14:20", wrong),
        ("set.last.by = 1.0", &["parts.first.set.last.by=x"], "bad-value", "command line:1:25", wrong),
        ("", &["parts.first.set.inner.two.by=x"], "bad-value", "command line:1:30", wrong),
        ("", &["parts.first.set.last.bye=1"], "unknown-key", "command line:1:22", "`bye` is not a parameter here"),
        (
            "set.inner.one.in.value = \"inputs.vale\"",
            &[],
            "unknown-port",
            "graph.toml:14:34",
            "the part has no input `vale`",
        ),
        (
            "set.last.by = { from = \"pad.thresh\" }",
            &[],
            "unknown-fact",
            "graph.toml:14:29",
            "the device of role `pad` has no fact `thresh`",
        ),
        ("set.inner.three.by = 1.0", &[], "unknown-key", "graph.toml:14:11", "the part has no node or part `three`"),
    ];
    for (first, set, code, place, message) in cases {
        let request = set.iter().fold(request(first), |request, set| request.set(*set));
        assert_eq!(mistakes(&request), [(code, place.to_owned(), message.to_owned())], "{first} {set:?}");
    }
}

#[test]
fn a_value_that_a_good_one_lies_over_is_no_mistake() {
    let request = request("set.last.by = \"x\"").set("parts.first.set.last.by=300");
    assert_eq!(values(&request, ["first.last.value"]), [312.0]);
}

#[test]
fn what_a_node_refuses_when_it_is_built_shows_at_the_value_in_force_too() {
    let wrong = "1e300 is too large: a tactel is a 32-bit float";
    let request = shipped("finger_press.toml").set("parts.touch.set.binarize.threshold=1e300");
    assert_eq!(mistakes(&request), [("bad-value", "command line:1:36".to_owned(), wrong.to_owned())]);
}

#[test]
fn one_mistake_in_a_part_of_two_instances_is_told_once() {
    let request = request("set.inner.one.by = \"x\"").set("parts.second.set.inner.one.by=y");
    let places: Vec<String> = mistakes(&request).into_iter().map(|(_, place, _)| place).collect();
    assert_eq!(places, ["graph.toml:14:20", "command line:1:31"]);
}

#[test]
fn a_fact_over_a_table_replaces_it() {
    let table = shipped("hybrid.toml").set("parts.touch.set.calibrate.device={ gain = 2.0, unit = 'N' }");
    let fact = table.clone().set("parts.touch.set.calibrate.device={ from = \"pad.calibration\" }");
    let plain = shipped("hybrid.toml");
    let devices = [plain, table, fact].map(|request| {
        let plan = loaded(&request);
        let node = plan.outline().nodes.iter().find(|node| node.name == "touch.calibrate").unwrap();
        let settings = node.settings.iter().filter(|setting| setting.path.starts_with("device"));
        settings.map(|setting| format!("{:?}", setting.value.item)).collect::<String>()
    });
    let gains = devices.each_ref().map(|device| ["Float(1.0)", "Float(2.0)"].map(|gain| device.contains(gain)));
    assert_eq!(gains, [[true, false], [false, true], [true, false]], "{devices:?}");
}

#[test]
fn what_is_no_single_assignment_is_no_set() {
    for text in ["", "# nothing", "[nodes.pid]", "nodes.pid.gains.x.kp", "graph.max_gap_ms=1\ngraph.clock='arm'"] {
        let report = compile(&catalogue(), &shipped("hybrid.toml").set(text)).err();
        let text = report.unwrap_or_else(|| panic!("{text:?} passes")).render(false);
        assert!(text.contains("this is not `key=value`"), "{text}");
    }
}

#[test]
fn a_mistake_in_a_part_that_is_used_twice_is_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let part = "[inputs]\nvalue = \"a sum\"\n[nodes.moving_average]\ntype = \"moving_average\"\nin.value = \"inputs.value\"\nwindw = 3\n";
    fs::write(folder.path().join("part.toml"), part).unwrap();
    let parts = ["one", "two"].map(|name| format!("[parts.{name}]\nfile = \"part.toml\"\nin.value = \"pad.image\"\n"));
    let graph = folder.path().join("graph.toml");
    fs::write(&graph, format!("graph.clock = \"pad\"\nroles.pad = \"tactile_pad\"\n{}", parts.concat())).unwrap();
    let request = Request { bench_text: Some(BENCH.into()), ..Request::file(&graph) };
    let report = compile(&catalogue(), &request).err().unwrap();
    let unknown = report.diagnostics.iter().filter(|found| found.code == Code::UnknownKey).count();
    assert_eq!(unknown, 1, "{}", report.render(false));
}

#[test]
fn parts_that_multiply_are_stopped() {
    let folder = tempfile::tempdir().unwrap();
    for i in 0..40 {
        let inner = ["a", "b"].map(|name| format!("[parts.{name}]\nfile = \"p{}.toml\"\n", i + 1));
        fs::write(folder.path().join(format!("p{i}.toml")), inner.concat()).unwrap();
    }
    fs::write(folder.path().join("p40.toml"), "").unwrap();
    let graph = folder.path().join("graph.toml");
    fs::write(&graph, "graph.rate_hz = 100\n[parts.p]\nfile = \"p0.toml\"\n").unwrap();
    let request = Request { bench_text: Some(String::new()), ..Request::file(&graph) };
    let report = compile(&catalogue(), &request).err().unwrap();
    assert_eq!(report.diagnostics[0].code, Code::EndlessPart, "{}", report.render(false));
}
