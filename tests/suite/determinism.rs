//! Same graph, same inputs, same bits.

use std::fs;

use crate::course::{course, loaded, shipped};
use crate::tool::say;

const GRAPHS: [(&str, usize); 2] = [("finger_press.toml", 309), ("hybrid.toml", 1000)];

#[test]
fn every_recorded_bit_comes_again() {
    for (graph, ticks) in GRAPHS {
        let [first, second] = [(); 2].map(|()| course(loaded(&shipped(graph)), usize::MAX));
        assert_eq!((first.times.len(), &first.fault), (ticks, &None), "{graph}");
        assert_eq!(first.times, second.times, "{graph}");
        for (name, bits) in &first.columns {
            assert_eq!(bits, &second.columns[name], "{graph}: `{name}`");
        }
        assert_eq!(first.columns.len(), second.columns.len(), "{graph}");
    }
}

#[test]
fn a_bit_that_differs_is_seen() {
    let plain = course(loaded(&shipped("hybrid.toml")), usize::MAX);
    let other = course(loaded(&shipped("hybrid.toml").set("nodes.pid.gains.x.kp=2.0000000000000004")), usize::MAX);
    let differs = |name: &str| plain.columns[name] != other.columns[name];
    assert!(differs("pid.control.x [m/s]") && !differs("pid.control.y [m/s]"));
    assert!(differs("move.ik.velocity.lwr_a1_joint [rad/s]"), "it goes through the whole chain");
}

#[test]
fn two_runs_write_the_same_file() {
    for ending in ["csv", "ndjson"] {
        for (graph, _) in GRAPHS {
            let folder = tempfile::tempdir().unwrap();
            let files = [(); 2].map(|()| {
                let path = folder.path().join(format!("rows.{ending}"));
                let run = say(&["run", &format!("graphs/{graph}"), "--out", path.to_str().unwrap()]);
                assert_eq!(run.code, 0, "{}", run.err);
                fs::read(path).unwrap()
            });
            assert!(!files[0].is_empty() && files[0] == files[1], "{graph} as {ending}");
        }
    }
}
