//! A pad with three axes: it fills the role of a pad with one, a task that feels the drag of an object holds it, and its
//! vector images are recorded, exported and shown.

use std::fs;

use serde_json::Value;
use tactflow_runtime::engine::Engine;
use tactflow_runtime::fault::Cause;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::harness::{FedRole, GraphRig};
use tactflow_runtime::signal::{Image, ImageShape, Scalar, Unit, VectorImage, VectorImageShape};
use tactflow_tests::{catalogue, workspace};

use crate::record::has_python_module;
use crate::tool::{peer, said, say, tool};

fn hold() -> Request {
    Request::file(workspace().join("graphs/hold_without_slip.toml"))
}

fn engine(request: &Request) -> Engine {
    Engine::new(compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false))))
}

/// Runs for a while, and calls `each` after every tick with the time [s].
fn run(request: &Request, until_s: f64, mut each: impl FnMut(&Engine, f64)) {
    let mut engine = engine(request);
    while let Some(next) = engine.next().filter(|next| (*next as f64) < until_s * 1e9) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        each(&engine, next as f64 * 1e-9);
    }
}

fn number(engine: &Engine, port: &str) -> f64 {
    engine.get::<Scalar>(port).copied().unwrap_or(f64::NAN)
}

#[test]
fn a_task_for_one_axis_runs_on_a_pad_with_three_and_no_bit_changes() {
    let folder = workspace().join("graphs");
    let bench = fs::read_to_string(folder.join("benches/dragged_box.toml")).unwrap();
    let bench = bench.replace("\"../", &format!("\"{}/", folder.display()));
    let trace = |bench: String| {
        let request = Request { bench_text: Some(bench), ..Request::file(folder.join("force.toml")) };
        let mut trace: Vec<u64> = Vec::new();
        run(&request, 1.5, |engine, _| {
            trace.push(number(engine, "touch.pressure").to_bits());
            let image = engine.get::<Image>("pad.image").into_iter();
            trace.extend(image.flat_map(Image::cells).map(|cell| u64::from(cell.to_bits())));
        });
        trace
    };
    let one = bench.replace("vectors = { }", "");
    assert_ne!(one, bench);
    let (one, three) = (trace(one), trace(bench));
    assert!(one == three && one.len() > 300 * 256);
}

#[test]
fn a_pad_with_one_axis_cannot_fill_the_role_of_three() {
    let ball = workspace().join("graphs/benches/ball.toml");
    let request = Request { bench: Some(ball), ..hold() };
    let report = compile(&catalogue(), &request).err().unwrap().render(false);
    assert!(report.contains("device `bench` cannot fill the role `pad` of type `three_axis_pad`"), "{report}");
    assert!(report.contains("it can fill: `tactile_pad`, "), "{report}");
}

/// Runs the task. Returns the smallest true margin of friction after the contact has settled, the greatest drag [N], and
/// the last true force with the one that the drag needs for the margin 0.4 [N].
fn holds(request: &Request) -> (f64, f64, [f64; 2]) {
    let (mut margin, mut most, mut last) = (f64::INFINITY, 0.0_f64, [0.0; 2]);
    run(request, 13.9, |engine, time| {
        let [force, drag] = ["truth.force", "truth.tangential"].map(|port| number(engine, port));
        most = most.max(drag);
        last = [force, drag / (0.4 * (1.0 - 0.4))];
        if time > 2.5 {
            margin = margin.min(1.0 - drag / (0.4 * force));
        }
    });
    (margin, most, last)
}

#[test]
fn the_task_holds_the_box_and_presses_no_harder_than_friction_needs() {
    let (margin, drag, [force, needed]) = holds(&hold());
    assert!(margin > 0.1 && drag > 1.3, "margin {margin}, drag {drag} N");
    // The measured drag and the torque add to the force that the true drag alone needs.
    assert!(force > 0.95 * needed && force < 1.15 * needed, "{force} N, and {needed} N are needed");
    // With a coefficient of friction that is far too high the box slips: the drag reaches the limit of friction.
    let (margin, drag, _) = holds(&hold().set("nodes.grip.friction=4.0"));
    assert!(margin < 0.01 && drag < 0.7, "margin {margin}, drag {drag} N");
}

#[test]
fn vectors_that_are_wrong_do_not_press_harder() {
    // The largest true force until the end, and whether it was a failure.
    let most = |set: &str| {
        let (mut engine, mut most) = (engine(&hold().set(set)), 0.0_f64);
        while let Some(next) = engine.next().filter(|next| (*next as f64) < 13.5e9) {
            if engine.tick(next).is_err() {
                return (most, true);
            }
            most = most.max(number(&engine, "truth.force"));
        }
        (most, false)
    };
    let (healthy, has_failed) = most("nodes.grip.keep_margin=0.4");
    assert!(healthy > 5.0 && healthy < 8.0 && !has_failed, "{healthy} N");
    // z that is dead, z with the wrong sign, x and y that are dead.
    for (gain, fails) in [("[1e-3, 1e-3, 1e-9]", false), ("[1e-3, 1e-3, -1e-3]", true), ("[1e-9, 1e-9, 1e-3]", false)] {
        let (force, has_failed) = most(&format!("nodes.forces.gain={gain}"));
        assert!(force < 1.3 * healthy, "{gain}: {force} N, and {healthy} N with sound vectors");
        assert_eq!(has_failed, fails, "{gain}");
    }
}

#[test]
fn a_vector_that_is_not_finite_is_a_fault_of_the_pad() {
    let shape = ImageShape { rows: 2, cols: 2, pitch: [0.005; 2], unit: Unit::NEWTON };
    let pad = FedRole::new("pad", "three_axis_pad", 4.0);
    let pad = pad.output("image", shape.clone()).output("vectors", VectorImageShape(shape));
    let graph = "graph.clock = 'pad'\nroles.pad = 'three_axis_pad'\n[nodes.normal]\ntype = 'normal_image'\n\
                 in.vectors = 'pad.vectors'\n";
    let mut rig = GraphRig::new(catalogue(), graph, vec![pad]).unwrap_or_else(|r| panic!("{}", r.render(false)));
    for (ms, z) in [(0.0, 1.0), (4.0, f32::NAN)] {
        let mut vectors = VectorImage::zeros(2, 2);
        vectors.cells_mut()[3] = [0.5, -0.5, z];
        rig.feed("pad.image", ms, Image::zeros(2, 2));
        rig.feed("pad.vectors", ms, vectors);
        match rig.tick(ms) {
            Ok(()) => assert_eq!(rig.get::<Image>("normal.image").unwrap().cells(), [0.0, 0.0, 0.0, 1.0]),
            Err(fault) => {
                let port = fault.port.as_deref();
                assert_eq!((fault.node.as_str(), port, &fault.cause), ("pad", Some("vectors"), &Cause::NotFinite));
                assert_eq!(ms, 4.0);
                return;
            }
        }
    }
    panic!("NaN passed");
}

#[test]
fn vector_images_are_recorded_exported_compared_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let graph = workspace().join("graphs/hold_without_slip.toml");
    let graph = graph.to_str().unwrap();
    let [one, other, archive] = [path("one.mcap"), path("other.mcap"), path("one.npz")];
    let said = say(&["run", graph, "--for", "1s", "--record", &one]);
    assert!(said.code == 0 && said.out.contains("arrows: x and y of the tactels"), "{}{}", said.out, said.err);
    say(&["run", graph, "--for", "1s", "--set", "devices.bench.seed=2", "--record", &other]);
    let said = say(&["replay", &one]);
    assert!(said.code == 0 && said.out.contains("the same to the last bit"), "{}{}", said.out, said.err);
    let said = say(&["diff", &one, &other]);
    let row = said.out.lines().find(|line| line.starts_with("pad.vectors "));
    assert!(row.is_some_and(|row| row.contains("`row 0, column 0, ")), "{}", said.out);
    let said = say(&["export", &one, &archive]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    if !["numpy", "mcap"].iter().all(|module| has_python_module(module)) {
        return;
    }
    // Other libraries read the shapes and the numbers.
    let found: Value = serde_json::from_str(&peer("three_axes.py", &[&one, &archive])).unwrap();
    assert_eq!(found["shapes"], serde_json::json!([[250, 16, 16, 3], [211, 16, 16, 3]]));
    assert_eq!(found["same"], true, "the recording and the archive have the same numbers");
    assert_eq!(found["units"], serde_json::json!(["raw", "N"]));
}

/// A node in Python that adds up the drag of a vector image.
const DRAG: &str = r#"
import tactflow
from tactflow import Scalar, VectorImage


@tactflow.node
def drag(vectors: VectorImage["N"]) -> {"along": Scalar["N"], "across": Scalar["N"]}:
    """How the pad is dragged."""
    if vectors is None:
        return {}
    along, across, _ = vectors.cells.sum(axis=(0, 1), dtype=float)
    return {"along": along, "across": across}


tactflow.main(drag)
"#;

#[test]
fn a_program_reads_vector_images() {
    if !has_python_module("numpy") {
        return;
    }
    let (folder, package) = (tempfile::tempdir().unwrap(), workspace().join("nodes/python"));
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fs::write(path("drag.py"), DRAG).unwrap();
    let signature = path("drag.node.toml");
    let stated =
        said(tool(&["signature", "--out", &signature, "--", "python3", &path("drag.py")]).env("PYTHONPATH", &package));
    assert_eq!((stated.code, stated.err.as_str()), (0, ""), "{}", stated.out);
    let graph = "graph.clock = 'pad'\nroles.pad = 'three_axis_pad'\nbind.pad = 'pad'\n\
        [devices.pad]\ntype = 'mock_pad'\nfor_s = 0.2\npress = [{ drag = [0.6, -0.2] }]\n\
        [nodes.drag]\ntype = 'process'\nsignature = 'drag.node.toml'\ncommand = ['python3', 'drag.py']\n\
        in.vectors = 'pad.vectors'\n";
    fs::write(path("graph.toml"), graph).unwrap();
    let said = said(tool(&["run", &path("graph.toml"), "--out", &path("run.csv")]).env("PYTHONPATH", &package));
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let table = fs::read_to_string(path("run.csv")).unwrap();
    let mut lines = table.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let last: Vec<&str> = lines.next_back().unwrap().split(',').collect();
    let value = |name: &str| last[names.iter().position(|known| *known == name).unwrap()].parse::<f64>().unwrap();
    assert!((value("drag.along") - 0.6).abs() < 1e-5 && (value("drag.across") + 0.2).abs() < 1e-5, "{last:?}");
}
