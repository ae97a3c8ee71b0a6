//! `draw`: the picture of a graph has all its roles, nodes and wires, and that of its modes all their exits.

use std::collections::BTreeSet;
use std::fs;

use serde_json::Value;
use tactflow_tests::workspace;

use crate::cli::in_new_folder;
use crate::tool::{peer, say};

/// What a tool draws.
fn drawn(args: &[&str]) -> String {
    let said = say(&[&["draw"], args].concat());
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{args:?}");
    said.out
}

/// What the peer reads in a picture: the numbers of boxes, frames and arrows, and all texts.
fn read(args: &[&str]) -> ([usize; 3], Vec<String>) {
    let (_folder, path) = in_new_folder("picture.svg");
    let picture = drawn(args);
    assert_eq!(picture, drawn(args), "the same graph has the same picture");
    fs::write(&path, picture).unwrap();
    let read = peer("draw.py", &[&path]);
    let mut lines = read.lines();
    let numbers: Vec<usize> = lines.next().unwrap().split(' ').map(|word| word.parse().unwrap()).collect();
    ([numbers[0], numbers[1], numbers[2]], lines.map(str::to_owned).collect())
}

fn outline(graph: &str) -> Value {
    serde_json::from_str(&say(&["show", graph, "--format", "json"]).out).unwrap()
}

/// The producer of a wire: a node or a role.
fn producer(source: &str) -> &str {
    source.rsplit_once('.').unwrap().0
}

#[test]
fn every_shipped_graph_has_a_picture_with_all_its_nodes_and_wires() {
    let mut count = 0;
    for entry in fs::read_dir(workspace().join("graphs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|end| end != "toml") {
            continue;
        }
        let graph = format!("graphs/{}", path.file_name().unwrap().to_str().unwrap());
        let ([boxes, _, arrows], texts) = read(&[&graph]);
        let outline = outline(&graph);
        let nodes = outline["nodes"].as_array().unwrap();
        let of = |block: &Value| block["inputs"].as_array().unwrap().clone();
        let commands = outline["commands"].as_array().unwrap();
        let mut wires: BTreeSet<(String, String)> = BTreeSet::new();
        let mut outer: BTreeSet<String> = BTreeSet::new();
        let is_node = |name: &str| nodes.iter().any(|node| node["name"] == name);
        let all = nodes.iter().flat_map(|node| of(node).into_iter().map(|wire| (wire, node["name"].clone())));
        let commands = commands.iter().map(|wire| {
            let role = wire["name"].as_str().unwrap().split_once('.').unwrap().0;
            (wire.clone(), Value::from(format!("{role} commands")))
        });
        for (wire, to) in all.chain(commands) {
            let from = producer(wire["source"].as_str().unwrap());
            let to = to.as_str().unwrap();
            wires.insert((from.to_owned(), to.to_owned()));
            outer.extend([from, to].into_iter().filter(|name| !is_node(name)).map(str::to_owned));
        }
        assert_eq!((boxes, arrows), (nodes.len() + outer.len(), wires.len()), "{graph}");
        for node in nodes {
            let name = node["name"].as_str().unwrap();
            let last = name.rsplit('.').next().unwrap();
            assert!(texts.iter().any(|text| text == last), "{graph}: {name}");
        }
        count += 1;
    }
    assert!(count > 10);
}

#[test]
fn a_wire_has_its_kind_unit_and_frames_and_a_part_has_a_frame() {
    let ([_, frames, _], texts) = read(&["graphs/hybrid.toml"]);
    assert_eq!(frames, 4, "touch, answer, move and ruler");
    for text in
        ["image: image [raw] in pad", "control: features x y pressure in pad", "sensor_pose: pose in pad in arm.base"]
    {
        assert!(texts.iter().any(|line| line == text), "{text}: {texts:?}");
    }
    let (_, plain) = read(&["graphs/hybrid.toml", "--plain"]);
    assert!(plain.iter().all(|text| !text.contains("image:")), "{plain:?}");
}

#[test]
fn the_modes_are_drawn_with_the_conditions_of_their_exits() {
    let ([boxes, _, arrows], texts) = read(&["graphs/square.toml", "--modes"]);
    // Four modes, start, done and fault; the start, and the exits of the file.
    assert_eq!((boxes, arrows), (7, 1 + 10));
    for text in
        ["error.error.pressure within 0.003", "touch.present is lost for 100 ms", "after 60 mm of travel", "fault"]
    {
        assert!(texts.iter().any(|line| line == text), "{text}: {texts:?}");
    }
    let none = say(&["draw", "graphs/finger_press.toml", "--modes"]);
    assert_eq!((none.code, none.err.as_str()), (2, "error: the graph has no modes to draw\n"));
}

#[test]
fn mermaid_and_dot_have_the_same_arrows_as_the_picture() {
    let ([boxes, frames, arrows], _) = read(&["graphs/carry.toml"]);
    let mermaid = drawn(&["graphs/carry.toml", "--format", "mermaid"]);
    let dot = drawn(&["graphs/carry.toml", "--format", "dot"]);
    let count = |text: &str, word: &str| text.lines().filter(|line| line.contains(word)).count();
    assert_eq!(count(&mermaid, "-->") + count(&mermaid, "-.->"), arrows);
    assert_eq!([count(&mermaid, "subgraph"), count(&mermaid, " end")], [frames; 2]);
    assert_eq!([count(&dot, " -> "), count(&dot, "subgraph cluster")], [arrows, frames]);
    assert_eq!(count(&dot, "[label="), boxes + arrows);
    assert_eq!(dot.matches('{').count(), dot.matches('}').count());
    assert!(mermaid.starts_with("---\ntitle: \"graphs/carry.toml\"\n---\n"), "a path may have a colon: {mermaid}");
}

#[test]
fn a_recording_is_drawn_with_the_time_of_each_node() {
    let (_folder, run) = in_new_folder("run.mcap");
    assert_eq!(say(&["run", "graphs/hybrid.toml", "--for", "2s", "--quiet", "--record", &run]).code, 0);
    let (plain, timed) = (drawn(&["graphs/hybrid.toml"]), drawn(&[&run]));
    let (_folder, path) = in_new_folder("picture.svg");
    fs::write(&path, &timed).unwrap();
    peer("draw.py", &[&path]);
    let nodes = outline("graphs/hybrid.toml")["nodes"].as_array().unwrap().len();
    assert_eq!((plain.matches(" µs, at most ").count(), timed.matches(" µs, at most ").count()), (0, nodes));
    // The modes are those of the graph.
    let modes = |file: &str| {
        let svg = drawn(&[file, "--modes"]);
        svg.split_once("</title>").unwrap().1.to_owned()
    };
    assert_eq!(modes(&run), modes("graphs/hybrid.toml"));
    let given = say(&["draw", &run, "--set", "nodes.pid.gains.x.kp=3"]);
    assert_eq!(given.code, 2);
    assert!(given.err.contains("a recording has its own bench and values"), "{}", given.err);
}
