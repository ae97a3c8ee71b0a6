//! Tests of the parameters, and of what the device states.

use tactflow_runtime::device::OnSilence;
use tactflow_runtime::signal::Shape;

use super::*;
use crate::devices::testing::open;

const ARM: &str = "urdf = 'builtin:lwr4p.urdf'\ntip = 'lwr_7_link'\n";

#[test]
fn it_states_its_joints_its_silence_and_its_facts() {
    let Opened { description, .. } = open::<LwrFri>(&format!(
        "{ARM}sample_ms = 2\nsilence_ms = 150\nacceleration = 5\nhome = [0, 0, 0, 1, 0, 1, 0]"
    ))
    .unwrap();
    assert_eq!(description.period, 0.002);
    let silence = description.on_silence.clone().unwrap();
    assert_eq!((silence.reaction, silence.within), (OnSilence::Stops, 0.15));
    assert_eq!(description.roles().collect::<Vec<_>>(), ["velocity_arm", "force_sensor"]);
    let Some(Shape::Joints(shape)) = description.shape("position") else { panic!("joints") };
    let names: Vec<&str> = shape.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["a1", "a2", "e1", "a3", "a4", "a5", "a6"].map(|name| format!("lwr_{name}_joint")));
    assert!(shape.joints.iter().all(|joint| joint.acceleration == 5.0 && joint.start.is_none()));
    assert_eq!(description.fact("tip"), Some(&"lwr_7_link".into()));
    assert!(description.fact("home").is_some() && description.fact("mount").is_some());
    let Some(Shape::Features(wrench)) = description.shape("wrench") else { panic!("a wrench") };
    let units: Vec<String> =
        wrench.features.iter().map(|feature| format!("{} {}", feature.name, feature.unit)).collect();
    assert_eq!(units, ["fx N", "fy N", "fz N", "tx N m", "ty N m", "tz N m"]);
}

#[test]
fn stiffness_is_one_number_or_a_list() {
    for (params, is_good) in [
        ("stiffness = 200", true),
        ("stiffness = [200, 200, 200, 100, 100, 50, 50]\ndamping_ratio = 0.2", true),
        ("damping_ratio = [0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2]", true),
        ("stiffness = '200 N m/rad'", true),
        ("stiffness = 0", false),
        ("stiffness = [200, 200, 200, 100, 100, 50, 5000]", false),
        ("damping_ratio = 1.1", false),
    ] {
        assert_eq!(open::<LwrFri>(&format!("{ARM}{params}")).is_ok(), is_good, "{params}");
    }
}

#[test]
fn bad_settings() {
    let cases = [
        ("stiffness = [200, 200]", "the list has 2 entries, but the arm has 7 joints"),
        ("home = [0, 0]", "`home` has 2 entries, but the arm has 7 joints"),
        ("start = [0, 0]", "`start` has 2 entries, but the arm has 7 joints"),
        (
            "start = [0, 3, 0, 0, 0, 0, 0]",
            "`start` puts joint `lwr_a2_joint` at 3, outside of its range from -2.0944 to 2.0944 (rad, or m if prismatic)",
        ),
        ("krl_ints = { 17 = 1 }", "`17` is no number of an integer of KRL: they are 1 to 16"),
        ("krl_ints = { x = 1 }", "`x` is no number of an integer of KRL: they are 1 to 16"),
        ("krl_ints_at_end = { 2 = 0.5 }", "integer 2 of KRL cannot be 0.5: write a whole number of 32 bits"),
        ("controller = 'krc'", "`krc` is not an IP address"),
        ("port = 0", "expected a whole number from 1 to 65535, found 0"),
        ("sample_ms = 0.5", "expected a number from 1 to 100 [ms], found 0.5"),
    ];
    for (params, message) in cases {
        let mistakes = open::<LwrFri>(&format!("{ARM}{params}")).err().unwrap();
        assert_eq!((mistakes.len(), mistakes[0].message.as_str()), (1, message), "{params}");
    }
    let mistakes = open::<LwrFri>("urdf = 'builtin:ur5e.urdf'\ntip = 'tool0'").err().unwrap();
    assert_eq!(mistakes[0].message, "the model has 6 joints up to `tool0`, but an LWR has 7");
}
