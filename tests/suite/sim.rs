//! The simulated bench, as the tool runs it: its calibration, its bits, and that it closes the loop.

use std::fs;

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_tests::{catalogue, workspace};

use crate::tool::say;

fn hybrid() -> Request {
    Request::file(workspace().join("graphs/hybrid.toml"))
}

/// Runs for some time; what `column` says in each tick, NaN where it is absent.
pub(crate) fn course(request: &Request, seconds: f64, names: &[&str]) -> Vec<Vec<f64>> {
    let plan = compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let columns = tactflow_runtime::record::PortColumns::new(engine.ports());
    let at = |name: &&str| columns.list.iter().position(|column| column.name == **name).expect("the column");
    let at: Vec<usize> = names.iter().map(at).collect();
    let (mut row, mut rows) = (vec![0.0; columns.list.len()], Vec::new());
    while let Some(next) = engine.next().filter(|next| *next <= (seconds * 1e9) as i64) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        columns.read(engine.bus(), &mut row);
        rows.push(at.iter().map(|at| row[*at]).collect());
    }
    rows
}

#[test]
fn the_shipped_calibration_is_what_the_tool_makes_of_the_pads_press_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (log, made) = (path("press.csv"), path("pad.toml"));
    assert_eq!(say(&["press", "-o", &log]).code, 0);
    assert_eq!(say(&["calibrate", &log, "--load", "uniform", "-o", &made]).code, 0);
    let shipped = fs::read_to_string(workspace().join("graphs/calibrations/sim_pad.toml")).unwrap();
    assert!(fs::read_to_string(made).unwrap() == shipped, "the shipped calibration is of another pad");
    // What is something else is not replaced.
    fs::write(path("notes.csv"), "mine").unwrap();
    let refused = say(&["press", "-o", &path("notes.csv")]);
    assert!(refused.code == 2 && refused.err.contains("is not a log of `press`"), "{}", refused.err);
}

#[test]
fn a_contact_is_found_centred_and_held() {
    let names = ["truth.x", "truth.y", "truth.pressure", "touch.moments.x", "touch.moments.pressure"];
    let rows = course(&hybrid(), 4.0, &names);
    let first = rows.iter().position(|row| !row[0].is_nan()).unwrap();
    assert!((rows[first][0] - 0.01).abs() < 0.002 && (rows[first][1] + 0.01).abs() < 0.002, "{:?}", rows[first]);
    let mean = |column: usize| rows[750..].iter().map(|row| row[column]).sum::<f64>() / (rows.len() - 750) as f64;
    // Half a tactel, and a fifth of the pressure: the foam has hysteresis, and the calibration is a curve through its middle.
    assert!(mean(0).abs() < 0.0025 && mean(1).abs() < 0.0025, "{} {}", mean(0), mean(1));
    assert!((mean(2) - 0.1).abs() < 0.02, "{}", mean(2));
    assert!((mean(3) - mean(0)).abs() < 0.0005, "what is measured is what is true");
    assert!((mean(4) - mean(2)).abs() < 0.02, "{} {}", mean(4), mean(2));
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_one_others() {
    let names = ["touch.moments.x", "truth.force", "arm.position.lwr_a4_joint"];
    let bits = |seed: u64| -> Vec<u64> {
        let rows = course(&hybrid().set(format!("devices.bench.seed={seed}")), 1.5, &names);
        rows.into_iter().flatten().map(f64::to_bits).collect()
    };
    let first = bits(3);
    assert!(first == bits(3), "the same bits");
    assert!(first != bits(4), "another noise");
}

#[test]
fn a_slower_clock_and_other_pads_run_too() {
    let cases: [&[&str]; 4] = [
        &["devices.bench.rate_hz=100", "devices.bench.latency_s=0"],
        &["devices.bench.latency_s=0.0101"],
        &["devices.bench.foam.spread=0.004", "devices.bench.stiffness=600.0"],
        &["devices.bench.objects=[]"],
    ];
    for case in cases {
        let request = case.iter().fold(hybrid(), |request, set| request.set(*set));
        let rows = course(
            &request,
            2.5,
            &["truth.force", "pad.image"].map(|name| if name == "pad.image" { "truth.depth" } else { name }),
        );
        let is_touched = rows.iter().any(|row| row[0] > 0.5);
        assert_eq!(is_touched, !case[0].contains("objects"), "{case:?}");
    }
}

#[test]
fn settings_that_cannot_be_are_told_at_their_place() {
    let cases = [
        ("objects=[{ shape = 'ball', at = [0, 0, 0.1] }]", "object 1: a ball needs `radius`"),
        (
            "objects=[{ shape = 'ball', at = [0, 0, 0.1], radius = 0.1, length = 1 }]",
            "a ball does not use `length`: remove it",
        ),
        (
            "objects=[{ shape = 'cable', at = [0, 0, 0.1], radius = 0.003, points = [[0, 0, 0]] }]",
            "must be two or more",
        ),
        ("objects=[{ shape = 'box', at = [0, 0, 0.1], size = [1, 0, 1] }]", "each `size` must be greater than 0"),
        ("objects=[{ shape = 'egg', at = [0, 0, 0.1] }]", "expected one of `plane`"),
        ("step_s=0.01", "the step must be from 1e-6 to 0.002 s"),
        ("points_apart=0.002", "points must be from"),
        ("inertia=[1.0]", "`inertia` has 1 entries, but the arm has 7 joints"),
        ("foam.static_friction=0.1", "static friction must not be less than sliding friction"),
        ("foam.damping=1e4", "must be at most 10 N s/m"),
        ("foam.spread=1e20", "the spread must be from 0.0002 to 0.05 m"),
        ("stiffness=1e6", "moves too fast for a `step_s` of 0.002 s"),
        ("friction=1000.0", "moves too fast for a `step_s` of 0.002 s"),
        ("calibration='nowhere.toml'", "nowhere.toml"),
        ("rows=8", "16"),
    ];
    for (set, message) in cases {
        let report = compile(&catalogue(), &hybrid().set(format!("devices.bench.{set}"))).err();
        let text = report.unwrap_or_else(|| panic!("{set} loads")).render(false);
        assert!(text.contains(message), "{set}: {text}");
    }
}
