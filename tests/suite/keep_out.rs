//! Keep-out planes in `[limits]`: those of all files hold together, nothing removes one, and an arm stops before each.

use tactflow_nodes::limits::workspace_limit::Plane;
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::signal::Pose;
use tactflow_runtime::source::Report;
use tactflow_tests::{catalogue, workspace};

use crate::course::get;
use crate::tool::say;

/// A bare arm that moves along its tool, with more lines at the end of the task and at the end of the bench.
fn bare(twist: [f64; 6], task: &str, bench: &str) -> Request {
    let graph = format!(
        "[graph]\nclock = 'arm'\nstart = 'there'\n[roles]\narm = 'bare_arm'\n[commands]\narm.velocity = 'move.velocity'\n\
         [nodes.wave]\ntype = 'twist_source'\ntwist = [0, 0, 0, 0, 0, 0]\n\
         [modes.there]\nset.wave.twist = {twist:?}\nfail = {{ after_ms = 30000 }}\n\
         [parts.move]\nfile = 'builtin:parts/bare_move.toml'\nin.twist = 'wave.twist'\n\
         in.position = 'arm.position'\nin.equilibrium = 'arm.equilibrium'\n\
         [limits]\nlinear_m_per_s = 0.05\nangular_rad_per_s = 0.8\nlinear_m_per_s2 = 1.0\n\
         angular_rad_per_s2 = 10.0\n{task}\n"
    );
    let bench = format!(
        "[bind]\narm = 'arm'\n[devices.arm]\ntype = 'mock_arm'\nrobot = 'builtin:lwr4p.toml'\n\
         [limits]\nworkspace_min_m = [-0.9, -0.4, 0.1]\nworkspace_max_m = [-0.3, 0.4, 0.7]\n{bench}\n"
    );
    Request { bench_text: Some(bench), ..Request::text(graph) }
}

fn load(request: &Request) -> Compiled {
    compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

fn refused(request: &Request) -> Report {
    compile(&catalogue(), request).err().expect("it is refused")
}

/// The planes that the limiter of a graph gets.
fn held(plan: &Compiled) -> String {
    let limiter = plan.outline().nodes.iter().find(|node| node.name == "move.workspace").expect("a limiter");
    let setting = limiter.settings.iter().find(|setting| setting.path == "keep_out").expect("a parameter");
    serde_json::to_string(&setting.value).expect("rows of numbers")
}

#[test]
fn the_planes_of_all_files_hold_and_nothing_removes_one() {
    let request = bare([0.0; 6], "keep_out = [[0.0, 0.0, 1.0, 0.2]]", "keep_out = [[0.0, 1.0, 0.0, -0.3]]");
    assert_eq!(held(&load(&request)), "[[0.0,0.0,1.0,0.2],[0.0,1.0,0.0,-0.3]]");
    assert_eq!(held(&load(&request.clone().slow(0.1))), held(&load(&request)), "a slow run has the same planes");
    // A plane of the command line and of the arm are added; an empty list removes nothing, and a plane that is there
    // already counts once.
    let more = request.clone().set("limits.keep_out=[[0.0, -1.0, 0.0, -0.3]]").set("limits.keep_out=[]");
    let more = more.set("limits.arm.keep_out=[[0.0, 0.0, 1.0, 0.2], [-1.0, 0.0, 0.0, 0.35]]");
    let all = "[[0.0,0.0,1.0,0.2],[0.0,1.0,0.0,-0.3],[0.0,-1.0,0.0,-0.3],[-1.0,0.0,0.0,0.35]]";
    assert_eq!(held(&load(&more)), all);
    load(&bare([0.0; 6], "", ""));
    // A parameter may add a plane of its own, but leaves out none.
    let of_bench = bare([0.0; 6], "", "keep_out = [[0.0, 0.0, 1.0, 0.2], [0.0, 1.0, 0.0, -0.3]]");
    let own = |rows: &str| of_bench.clone().set(format!("parts.move.set.workspace.keep_out={rows}"));
    load(&own("[[0.0, 0.0, 1.0, 0.2], [0.0, 1.0, 0.0, -0.3], [0.0, 0.0, -1.0, -0.6]]"));
    for rows in ["[]", "[[0.0, 0.0, 1.0, 0.2]]", "{ from = 'limits.none', optional = true }"] {
        let report = refused(&own(rows));
        let codes: Vec<&str> = report.diagnostics.iter().map(|found| found.code.name()).collect();
        assert_eq!(codes, ["loose-limit"], "{rows}: {}", report.render(false));
    }
}

#[test]
fn sections_that_state_planes_in_another_form_are_refused() {
    let request = bare([0.0; 6], "keep_out = [0.0, 0.0, 1.0, 0.2]", "keep_out = [[0.0, 1.0, 0.0, -0.3]]");
    let report = refused(&request).render(false);
    assert!(report.contains("the limit `keep_out` has a list of lists, but 4 values elsewhere"), "{report}");
    let alone = refused(&bare([0.0; 6], "keep_out = [0.0, 0.0, 1.0, 0.2]", "")).render(false);
    assert!(alone.contains("expected a list of planes, found one"), "{alone}");
    assert!(alone.contains("write `[[0.0, 0.0, 1.0, 0.2]]`"), "{alone}");
}

#[test]
fn a_limiter_that_does_not_read_the_planes_is_refused() {
    let folder = crate::cli::in_new_folder("move.toml");
    let part = std::fs::read_to_string(workspace().join("graphs/parts/bare_move.toml")).unwrap();
    let line = "keep_out = { from = \"limits.keep_out\", optional = true }\n";
    assert!(part.contains(line));
    std::fs::write(&folder.1, part.replace(line, "")).unwrap();
    let mut request = bare([0.0; 6], "", "keep_out = [[0.0, 0.0, 1.0, 0.2]]");
    request.text = request.text.map(|text| text.replace("builtin:parts/bare_move.toml", &folder.1));
    let report = refused(&request).render(false);
    assert!(report.contains("`move.workspace` does not read the limit `keep_out` of its arm"), "{report}");
    assert!(report.contains("write `keep_out = { from = \"limits.keep_out\" }` in it"), "{report}");
}

#[test]
fn an_arm_stops_before_each_plane() {
    let rows = [[0.0, 0.0, 1.0, 0.42], [0.6, 0.0, 0.8, 0.0], [-0.6, 0.0, -0.8, -0.1], [0.0, 1.0, 0.0, -0.05]];
    let twists = [[0.0, 0.0, 0.05, 0.0, 0.0, 0.0], [0.0, 0.0, -0.05, 0.0, 0.0, 0.0], [0.05, 0.0, 0.0, 0.0, 0.0, 0.0]];
    let mut touched = 0;
    for row in rows {
        let plane = Plane { normal: [row[0], row[1], row[2]].into(), distance: row[3] };
        for twist in twists {
            let plan = load(&bare(twist, "", &format!("keep_out = [{row:?}]")));
            let mut engine = Engine::new(plan);
            let (mut nearest, mut is_behind) = (f64::INFINITY, false);
            while let Some(next) = engine.next().filter(|next| *next < 4_000_000_000) {
                engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
                let Some(pose) = get::<Pose>(&engine, "move.state.sensor_pose") else { continue };
                let room = plane.room(&pose.0.translation.vector);
                is_behind |= nearest.is_infinite() && room < 0.0;
                nearest = nearest.min(room);
            }
            assert!(!is_behind && nearest > -1e-4, "{twist:?} before {row:?}: {nearest} m");
            touched += usize::from(nearest < 2e-3);
        }
    }
    assert!(touched >= 3, "{touched} motions were stopped by a plane");
}

#[test]
fn show_prints_the_planes_that_hold() {
    let said = say(&["show", "graphs/hybrid.toml", "--set", "limits.keep_out=[[0.0, 0.0, 1.0, 0.12]]"]);
    assert_eq!(said.code, 0, "{}", said.err);
    let line = said.out.lines().find(|line| line.starts_with("keep_out = ")).expect("a line of the limiter");
    assert!(line.starts_with("keep_out = [[0.0, 0.0, 1.0, 0.12]]") && line.ends_with("# command line"), "{line}");
}
