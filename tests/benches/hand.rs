//! The hand: one task for each pad, all of them or the index finger alone.

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_tests::{catalogue, workspace};

/// The pads of the hand, each with the tip of its chain.
const PADS: [(&str, &str); 6] = [
    ("index", "index_tip"),
    ("palm", "palm"),
    ("thumb", "thumb_tip"),
    ("middle", "middle_tip"),
    ("ring", "ring_tip"),
    ("little", "little_tip"),
];

/// Returns the hand with its first `count` pads, pressed by scripted loads, in the middle of a press.
pub(crate) fn hand(count: usize) -> Engine {
    let graphs = workspace().join("graphs");
    let mut roles = String::from("[graph]\nclock = 'index_pad'\n[roles]\n");
    let (mut parts, mut bind, mut devices) = (String::new(), String::from("[bind]\n"), String::new());
    for (name, tip) in &PADS[..count] {
        roles += &format!("{name}_pad = 'tactile_pad'\n{name}_arm = 'velocity_arm'\n");
        parts += &format!(
            "[parts.{name}]\nfile = '{}'\nroles = {{ pad = '{name}_pad', arm = '{name}_arm' }}\n",
            graphs.join("force.toml").display()
        );
        bind += &format!("{name}_pad = '{name}_pad'\n{name}_arm = '{name}_arm'\n");
        let home = if *name == "palm" { "home = [0.0]\n" } else { "" };
        devices += &format!(
            "[devices.{name}_pad]\ntype = 'mock_pad'\nrate_hz = 250\nrows = 6\ncols = 6\npitch = 0.003\n\
             press = [{{ from_s = 0.0, at = [0.0, 0.0], force = 1.0 }}]\n\
             mount = {{ xyz = [0.012, 0.0, -0.008], rpy = [3.141592653589793, 0.0, 0.0] }}\n\
             [devices.{name}_arm]\ntype = 'mock_arm'\nrobot = '{}'\ntip = '{tip}'\n{home}",
            graphs.join("robots/hand.toml").display()
        );
    }
    let limits = "[limits]\nworkspace_min_m = [-0.5, -0.5, -0.5]\nworkspace_max_m = [0.5, 0.5, 0.5]\n";
    let request = Request { bench_text: Some(bind + &devices + limits), ..Request::text(roles + &parts) };
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    for _ in 0..100 {
        let now = engine.next().expect("the press lasts");
        engine.tick(now).expect("nothing fails");
    }
    assert!(engine.tasks().iter().skip(1).all(|task| task.mode() == Some("servo")), "every pad is in contact");
    engine
}
