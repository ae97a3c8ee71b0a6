//! An arm whose stiffness is stated wrongly: `force` presses more slowly or harder, and then holds.

use crate::control_law::recorded;
use crate::tune::force_with;

/// What a run of `force` shows.
struct Press {
    /// The largest pressure [p].
    most: f64,
    /// Mean deflection for each newton, from 1 s to 2 s after the first touch, and from then on [m/N].
    learned: [f64; 2],
}

/// Runs `force` for 8 s with a stated stiffness of the joints, which are 200 N m/rad.
fn pressed(bench: &str, stated: &str) -> Press {
    let bench = format!("graphs/benches/{bench}.toml");
    let set = format!("parts.answer.set.spring.joint_n_m_per_rad={stated}");
    let rows = recorded(&["graphs/force.toml", "--bench", &bench, "--set", &set], "8s");
    let touched = rows.iter().find(|row| row.contains_key("answer.spring.deflection")).unwrap()["time"];
    let mean = |from: f64, to: f64| {
        let after = rows.iter().filter(|row| (from..to).contains(&(row["time"] - touched)));
        let each = after.filter_map(|row| Some(row.get("answer.spring.deflection")? / row.get("touch.moments.force")?));
        let each: Vec<f64> = each.collect();
        each.iter().sum::<f64>() / each.len() as f64
    };
    let pressures = rows.iter().filter_map(|row| row.get("touch.pressure.value"));
    Press { most: 10.0 * pressures.fold(0.0, |most: f64, p| most.max(*p)), learned: [mean(1.0, 2.0), mean(2.0, 9.0)] }
}

#[test]
fn a_stiffness_that_is_wrong_by_a_factor_of_two_is_corrected_in_contact() {
    for bench in ["ball", "pen", "toy_box"] {
        let right = pressed(bench, "200.0");
        assert!(right.most < 1.15, "{bench}: {}", right.most);
        for stated in ["100.0", "400.0"] {
            let wrong = pressed(bench, stated);
            assert!(wrong.most < 1.2, "{bench}, {stated} N m/rad: {}", wrong.most);
            for (learned, most) in wrong.learned.into_iter().zip(right.learned).zip([0.25, 0.1]) {
                let off = learned.0 / learned.1 - 1.0;
                assert!(off.abs() < most, "{bench}, {stated} N m/rad: {off} after {most}");
            }
        }
    }
}

#[test]
fn an_arm_that_states_no_stiffness_is_not_damped() {
    let folder = tempfile::tempdir().unwrap();
    let states = "joint_n_m_per_rad = { from = \"arm.joint_n_m_per_rad\", optional = true }\n";
    let path = force_with(folder.path(), states, "");
    let bench = "graphs/benches/ball.toml";
    let adds = |path: &str| {
        let rows = recorded(&[path, "--bench", bench], "3s");
        rows.iter().any(|row| row["damping.twist.vz"] != row["sum.twist.vz"])
    };
    assert!(adds("graphs/force.toml") && !adds(&path));
}
