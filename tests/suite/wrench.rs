//! The second ceiling: the housing of a pad meets a wall that the pad does not see. Judged by the true force on the tool.

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::{Pose, Scalar};
use tactflow_runtime::source::Code;
use tactflow_tests::{catalogue, workspace};

/// The ceiling [N].
const CEILING: f64 = 20.0;
/// What the moving mass of the arm adds when it hits the wall, which no command can take back [N]: v √(k m) with the
/// 0.0165 m/s of the approach, 20 kN/m and 11 kg. A stiff arm holds it back.
const HIT: f64 = 8.0;

/// An arm that moves along x of its pad, toward a wall at `wall` [m], with more lines of the bench.
fn toward_wall(speed: f64, stiffness: f64, bench: &str) -> Request {
    let graph = format!(
        "[graph]\nclock = 'pad'\nstart = 'there'\n[roles]\npad = 'tactile_pad'\narm = 'velocity_arm'\n\
         [commands]\narm.velocity = 'move.velocity'\n[nodes.wave]\ntype = 'twist_source'\ntwist = [0, 0, 0, 0, 0, 0]\n\
         [modes.there]\nset.wave.twist = [{speed:?}, 0, 0, 0, 0, 0]\nfail = {{ after_ms = 30000 }}\n\
         [parts.touch]\nfile = 'builtin:parts/touch.toml'\nin.image = 'pad.image'\n\
         [parts.move]\nfile = 'builtin:parts/move.toml'\nin.twist = 'wave.twist'\nin.image = 'touch.image'\n\
         in.contact = 'touch.present'\nin.position = 'arm.position'\nin.equilibrium = 'arm.equilibrium'\n\
         [limits]\nlinear_m_per_s = 0.05\nangular_rad_per_s = 0.8\nlinear_m_per_s2 = 2.0\nangular_rad_per_s2 = 10.0\n\
         force_n = 15.0\npeak_n = 3.0\nblind_s = 20.0\nblind_mm = 300.0\n"
    );
    let turn = std::f64::consts::FRAC_PI_2;
    let bench = format!(
        "[bind]\npad = 'bench'\narm = 'bench'\ntruth = 'bench'\nforce = 'bench'\n\
         [devices.bench]\ntype = 'sim_bench'\nfor_s = 6.0\ncalibration = 'builtin:calibrations/sim_pad.toml'\n\
         robot = 'builtin:lwr4p.toml'\nmount = {{ xyz = [0.0, 0.0, 0.03] }}\nstiffness = {stiffness:?}\n\
         housing = {{ ends_m = [[0.0, 0.0, 0.0], [0.15, 0.0, 0.0]], radius_m = 0.02 }}\n\
         objects = [{{ shape = 'plane', at = [0.19, 0.0, 0.0], turn = [0.0, {turn:?}, 0.0] }}]\n\
         [limits]\nworkspace_min_m = [-0.9, -0.6, 0.1]\nworkspace_max_m = [-0.1, 0.6, 0.9]\n{bench}\n"
    );
    Request { bench_text: Some(bench), ..Request::text(graph) }
}

/// Returns the largest true force and torque on the tool [N, N m], and the true force on the pad at the end.
fn largest(request: &Request) -> [f64; 3] {
    let plan = compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let (mut engine, mut largest) = (Engine::new(plan), [0.0_f64; 3]);
    let get = |engine: &Engine, port: &str| engine.get::<Scalar>(port).copied().unwrap_or_default();
    while let Some(next) = engine.next() {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        let norm = |ports: [&str; 3]| ports.map(|port| get(&engine, port).powi(2)).iter().sum::<f64>().sqrt();
        let now = [norm(["force.fx", "force.fy", "force.fz"]), norm(["force.tx", "force.ty", "force.tz"])];
        largest = [largest[0].max(now[0]), largest[1].max(now[1]), get(&engine, "truth.force")];
    }
    largest
}

#[test]
fn the_housing_stops_below_the_ceiling_and_the_pad_feels_nothing() {
    for (stiffness, hit) in [(20_000.0, 0.02), (200.0, HIT)] {
        let [force, _, pad] = largest(&toward_wall(0.05, stiffness, "wrench_n = 20.0"));
        assert!((5.0..CEILING + hit).contains(&force), "{force} N on an arm of {stiffness} N m/rad");
        assert_eq!(pad, 0.0, "the pad sees no wall");
        // A graph without the limiter, on the same bench without the sensor, presses on.
        let mut blind = toward_wall(0.05, stiffness, "");
        blind.bench_text = blind.bench_text.map(|text| text.replace("force = 'bench'\n", ""));
        let report = compile(&catalogue(), &blind).unwrap_or_else(|report| panic!("{}", report.render(false)));
        assert!(report.outline().nodes.iter().all(|node| node.name != "move.wrench"), "the limiter is not there");
        let mut loose = toward_wall(0.05, stiffness, "wrench_n = 2000.0");
        loose.set = vec!["parts.move.set.wrench.threshold_n=1.0".into()];
        let [force, ..] = largest(&loose);
        assert!(force > 1.5 * CEILING, "only the ceiling stops it: {force} N");
    }
}

#[test]
fn a_torque_has_its_own_ceiling() {
    // The wall meets the tool 0.1 m behind the origin of the tip.
    let mut request = toward_wall(0.05, 20_000.0, "wrench_n = 200.0\nwrench_n_m = 1.0");
    request.bench_text = request.bench_text.map(|text| text.replace("[0.15, 0.0, 0.0]]", "[0.15, 0.0, -0.1]]"));
    let [force, torque, _] = largest(&request);
    // The hit of a stiff arm at 5 mm/s adds less than 2 N.
    assert!((0.5..1.2).contains(&torque) && (5.0..15.0).contains(&force), "{torque} N m, {force} N");
}

#[test]
fn a_bench_with_a_sensor_of_the_force_needs_the_limit_in_each_task() {
    let without = toward_wall(0.05, 200.0, "");
    let report = compile(&catalogue(), &without).err().expect("the ceiling is missing");
    let missing = |code: Code, word: &str| {
        report.diagnostics.iter().any(|found| found.code == code && found.message.contains(word))
    };
    assert!(missing(Code::MissingLimit, "`wrench_n`"), "{}", report.render(false));
    // A part of somebody's own without the limiter is not enough.
    let (_folder, path) = crate::cli::in_new_folder("move.toml");
    let part = std::fs::read_to_string(workspace().join("graphs/parts/move.toml")).unwrap();
    let (before, rest) = part.split_once("[nodes.wrench]").unwrap();
    let (_, after) = rest.split_once("[nodes.workspace]").unwrap();
    let cut = format!("{before}[nodes.workspace]{after}").replace("\"wrench.twist\"", "\"contact.twist\"");
    std::fs::write(&path, cut).unwrap();
    let mut own = toward_wall(0.05, 200.0, "wrench_n = 20.0");
    own.text = own.text.map(|text| text.replace("builtin:parts/move.toml", &path));
    let report = compile(&catalogue(), &own).err().expect("it lacks the limit");
    let found = report.diagnostics.iter().find(|found| found.code == Code::UnlimitedCommand);
    let found = found.unwrap_or_else(|| panic!("{}", report.render(false)));
    assert!(found.message.contains("without the required limit `wrench`"), "{}", found.message);
    assert!(found.help.as_ref().unwrap().contains("wrench_limit"), "{:?}", found.help);
    // Without the sensor nothing asks for it.
    own.bench_text = own.bench_text.map(|text| text.replace("force = 'bench'\n", ""));
    assert!(compile(&catalogue(), &own).is_ok());
}

/// Where the far end of the tool is: in the frame of the tip, which is 30 mm behind the pad [m].
const END: [f64; 3] = [0.15, 0.0, -0.03];

/// Lets the tool move along x of its pad, on an arm of this stiffness and with more lines of the bench. Returns how far the surface of its end gets along
/// the x that the pad has at the start [m], and that x with the place of the pad at the start.
fn reach(stiffness: f64, bench: &str) -> (f64, [nalgebra::Vector3<f64>; 2]) {
    let mut request = toward_wall(0.05, stiffness, bench);
    let cut = |text: String| text.replace("force = 'bench'\n", "").replace("at = [0.19,", "at = [0.9,");
    request.bench_text = request.bench_text.map(cut);
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let (mut engine, mut start, mut farthest) = (Engine::new(plan), None, f64::NEG_INFINITY);
    while let Some(next) = engine.next() {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        let Some(Pose(pose)) = engine.get::<Pose>("move.state.sensor_pose") else { continue };
        let place = pose.translation.vector;
        let [x, from] = *start.get_or_insert([pose.rotation * nalgebra::Vector3::x(), place]);
        let end = place + pose.rotation * nalgebra::Vector3::from(END);
        farthest = farthest.max(x.dot(&(end - from)) + 0.02);
    }
    (farthest, start.expect("the arm states its joints"))
}

#[test]
fn the_end_of_the_tool_stops_before_a_plane() {
    let capsule = "[facts.arm]\ncapsule = { ends_m = [[0.0, 0.0, 0.0], [0.15, 0.0, 0.0]], radius_m = 0.02 }\n";
    // Without a plane, the end moves from 170 mm on.
    let (free, [x, from]) = reach(200.0, "");
    assert!(free > 0.3, "it gets {free} m far");
    // A plane 200 mm before the pad, across its x. n points to the free side.
    let (n, d) = (-x, -(x.dot(&from) + 0.2));
    let plane = format!("keep_out = [[{:?}, {:?}, {:?}, {d:?}]]\n", n.x, n.y, n.z);
    // When its equilibrium brakes, a compliant arm swings on, by the speed times the root of mass and stiffness.
    for (stiffness, swing) in [(20_000.0, 0.0005), (200.0, 0.003)] {
        let (guarded, _) = reach(stiffness, &format!("{plane}{capsule}"));
        assert!((0.195..0.2 + swing).contains(&guarded), "the surface of the end gets {guarded} m far");
    }
    let (bare, _) = reach(200.0, &plane);
    assert!(bare > 0.3, "without a capsule only the pad stays before the plane: {bare} m");
}

/// A palm of 36 tactels on a soft ball that covers all of them, with more bindings and limits.
fn palm(bind: &str, limits: &str) -> String {
    let files = workspace().join("graphs");
    let files = files.display();
    format!(
        "[bind]\npad = 'palm'\narm = 'palm'\ntruth = 'palm'\n{bind}\n[devices.palm]\ntype = 'sim_bench'\nfor_s = 12.0\n\
         calibration = '{files}/calibrations/hand_pad.toml'\nrobot = '{files}/robots/hand.toml'\ntip = 'palm'\n\
         home = [0.0]\nstiffness = 2000.0\ninertia = [0.2]\nfriction = 0.05\nrows = 6\ncols = 6\npitch = 0.003\n\
         mount = {{ xyz = [0.0, 0.0, -0.012], rpy = [{:?}, 0.0, 0.0] }}\n\
         objects = [{{ shape = 'ball', radius = 0.02, at = [0.0, 0.0, 0.03], stiffness = 200.0 }}]\n\
         [limits]\nforce_n = 4.0\npeak_n = 1.5\nworkspace_min_m = [-0.2, -0.2, -0.2]\n\
         workspace_max_m = [0.3, 0.2, 0.2]\n{limits}\n",
        std::f64::consts::PI
    )
}

/// Returns the largest true force [N] while the zeros of the palm sink.
fn largest_while_zeros_sink(bench: &str, raw_per_s: f64) -> f64 {
    let (folder, path) = crate::cli::in_new_folder("sinks.toml");
    let records = folder.path().join("records");
    std::fs::write(folder.path().join("palm.toml"), bench).unwrap();
    let scenario = format!(
        "[scenario]\ngraph = '{}'\nbench = 'palm.toml'\nfor_s = 8.0\n[check.force]\nof = 'truth.force'\nnever_above = 4.1\n\
         [[inject]]\nrole = 'pad'\nfault = 'drift'\nreading_per_s = {:?}\nfrom_s = 3.0\n",
        workspace().join("graphs/force.toml").display(),
        -raw_per_s
    );
    std::fs::write(&path, scenario).unwrap();
    let said = crate::tool::say(&["verify", &path, "--out", &records.display().to_string()]);
    let text = std::fs::read_to_string(records.join("sinks.csv"))
        .unwrap_or_else(|error| panic!("{error}: {}{}", said.out, said.err));
    let mut lines = text.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(','));
    let column = lines.next().unwrap().position(|name| name == "truth.force").expect("the bench knows the force");
    lines.filter_map(|mut row| row.nth(column)?.parse().ok()).fold(0.0, f64::max)
}

#[test]
fn a_zero_that_sinks_under_a_covered_pad_is_seen_by_the_second_ceiling_alone() {
    // No reading of the pad shows it: the arm presses on, to hold the reading.
    let blind = largest_while_zeros_sink(&palm("", ""), 200.0);
    assert!(blind > 10.0, "{blind} N");
    for raw_per_s in [50.0, 200.0, 1000.0] {
        let force = largest_while_zeros_sink(&palm("force = 'palm'", "wrench_n = 4.0"), raw_per_s);
        assert!((3.0..4.1).contains(&force), "{force} N while the zeros sink by {raw_per_s} raw per second");
    }
}
