//! An arm whose stiffness is stated wrongly: `force` presses more slowly or harder, and then holds.

use std::fs;

use crate::cli::in_new_folder;
use crate::control_law::recorded;
use crate::tune::shipped;

/// Runs `force` for 8 s with a stated stiffness of the joints, which are 200 N m/rad. Returns the largest pressure, and the
/// bounds of the pressure from 3 s after the first touch on [p].
fn pressed(bench: &str, stated: &str) -> [f64; 3] {
    let bench = format!("graphs/benches/{bench}.toml");
    let set = format!("nodes.spring.joint_n_m_per_rad={stated}");
    let rows = recorded(&["graphs/force.toml", "--bench", &bench, "--set", &set], "8s");
    let felt = rows.iter().filter_map(|row| Some((row["time"], 10.0 * row.get("touch.pressure.value").copied()?)));
    let felt: Vec<(f64, f64)> = felt.filter(|(_, p)| p.is_finite()).collect();
    let touched = felt[0].0;
    let held = || felt.iter().filter(|(time, _)| *time > touched + 3.0).map(|(_, p)| *p);
    let most = felt.iter().map(|(_, p)| *p).fold(0.0, f64::max);
    [most, held().fold(f64::INFINITY, f64::min), held().fold(0.0, f64::max)]
}

#[test]
fn a_stiffness_that_is_wrong_by_a_factor_of_two_is_corrected_in_contact() {
    for bench in ["ball", "pen", "toy_box"] {
        for stated in ["100.0", "400.0"] {
            let [most, low, high] = pressed(bench, stated);
            assert!(most < 1.3, "{bench}, {stated} N m/rad: {most}");
            assert!(low > 0.93 && high < 1.07, "{bench}, {stated} N m/rad: {low} to {high}");
        }
    }
}

#[test]
fn an_arm_that_states_no_stiffness_is_not_damped() {
    let (_folder, path) = in_new_folder("force.toml");
    let text = shipped("force.toml");
    let states = "joint_n_m_per_rad = { from = \"arm.joint_n_m_per_rad\", optional = true }\n";
    assert!(text.contains(states));
    fs::write(&path, text.replace(states, "")).unwrap();
    let bench = "graphs/benches/ball.toml";
    let adds = |path: &str| {
        let rows = recorded(&[path, "--bench", bench], "3s");
        rows.iter().any(|row| row["damping.twist.vz"] != row["sum.twist.vz"])
    };
    assert!(adds("graphs/force.toml") && !adds(&path));
}
