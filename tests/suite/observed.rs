//! Roles that only a scenario and the recorder may read, and samples that say that there is nothing.

use tactflow_runtime::engine::{self, Engine, RunOptions};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::harness::{FedRole, GraphRig};
use tactflow_runtime::record::PortColumns;
use tactflow_runtime::signal::{Freshness, Image, ImageShape, Unit};
use tactflow_tests::catalogue;

const TASK: &str = r#"
    graph.clock = "pad"
    roles.pad = "tactile_pad"
    [nodes.source]
    type = "tactile_source"
    in.image = "pad.image"
"#;

fn engine(bench: &str) -> Engine {
    let bench = format!("[devices.pad]\ntype = \"true_pad\"\nfrom_s = 0.02\nto_s = 0.04\n[bind]\n{bench}");
    let request = Request { bench_text: Some(bench), ..Request::text(TASK) };
    Engine::new(compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false))))
}

/// Names of the columns of a role.
fn columns(engine: &Engine, role: &str) -> Vec<String> {
    let all = PortColumns::new(engine.ports()).list.into_iter().map(|column| column.name);
    all.filter(|name| name.starts_with(&format!("{role}."))).collect()
}

#[test]
fn what_the_bench_binds_and_no_task_declares_is_recorded() {
    let expected = [
        "force",
        "tangential",
        "peak",
        "x",
        "y",
        "pressure",
        "orientation",
        "area",
        "depth",
        "tilt",
        "path",
        "distance",
        "coverage",
        "common_noise",
        "own_noise",
    ];
    for name in ["truth", "ground_truth"] {
        let engine = engine(&format!("pad = \"pad\"\n{name} = \"pad\""));
        assert_eq!(columns(&engine, name), expected.map(|port| format!("{name}.{port}")));
    }
    let unbound = engine("pad = \"pad\"");
    assert!(!unbound.ports().iter().any(|(port, _)| port.name.contains("truth")));
}

#[test]
fn a_port_that_is_cleared_is_lost_once_and_then_absent_until_it_is_written() {
    let mut engine = engine("pad = \"pad\"\ntruth = \"pad\"");
    let mut course = Vec::new();
    let options = RunOptions { duration: Some(0.05), ..RunOptions::default() };
    engine::run(&mut engine, &options, &mut |engine| {
        course.push(engine.mark("truth.x").freshness(engine.ticks()));
    })
    .unwrap();
    use Freshness::{Absent, Lost, New};
    // Touched from 20 ms to 40 ms, a sample each 4 ms.
    assert_eq!(course, [[Absent; 5].as_slice(), &[New; 5], &[Lost], &[Absent; 2]].concat());
}

#[test]
fn a_run_goes_on_without_the_truth() {
    let shape = ImageShape { rows: 2, cols: 2, pitch: [0.005; 2], unit: Unit::NEWTON };
    let pad = FedRole::new("pad", "tactile_pad", 4.0).output("image", shape.clone());
    let truth = FedRole::new("truth", "ground_truth", 4.0).output("image", shape);
    let mut rig = GraphRig::new(catalogue(), TASK, vec![pad, truth]).unwrap_or_else(|r| panic!("{}", r.render(false)));
    rig.feed("truth.force", 0.0, 1.0);
    for tick in 0..50 {
        let ms = 4.0 * f64::from(tick);
        rig.feed("pad.image", ms, Image::from_cells(2, &[0.5, 0.0, 0.0, 1.5]));
        rig.tick(ms).unwrap();
    }
    assert_eq!((rig.get("truth.force"), rig.get("source.sum")), (Some(&1.0), Some(&2.0)));
    assert!(!rig.engine.is_halted(), "nobody waits for what no wire comes from");
}
