//! What others offer in a domain, as the tool lists it, and as a message about a wrong topic names it.

use serde_json::json;

use super::{Robot, end, run};
use crate::tool::{said, tool};

#[test]
fn the_topics_of_a_domain_are_listed_and_those_of_this_process_are_not() {
    let Some(robot) = Robot::start(75, json!({})) else { return };
    let listed = said(&mut tool(&["ros2", "topics", "--domain", "75"]));
    assert_eq!((listed.code, listed.err.as_str()), (0, ""), "{}", listed.out);
    let rows: Vec<Vec<&str>> = listed.out.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(rows[0], ["topic", "type", "publishers", "readers"]);
    for expected in [
        ["/command", "trajectory_msgs/msg/JointTrajectory", "0", "1"],
        ["/joint_states", "sensor_msgs/msg/JointState", "1", "0"],
        ["/tactile", "sensor_msgs/msg/Image", "1", "0"],
    ] {
        assert!(rows.iter().any(|row| row[..] == expected), "{expected:?}: {}", listed.out);
    }
    // The arm that listens elsewhere is found by the type that it reads. The other device of the bench is no stranger.
    let (_folder, bench) = robot.bench(&[("command = \"/command\"", "command = \"/other\"")]);
    let elsewhere = end(run(&bench));
    let read = "nobody reads `/other` in the domain 75; messages of the type trajectory_msgs/msg/JointTrajectory are read on \
                `/command`";
    assert!(elsewhere.contains(read), "{elsewhere}");
    let (_folder, bench) = robot.bench(&[("topic = \"/tactile\"", "topic = \"/skin\"")]);
    let silent = end(run(&bench));
    let published = "nobody publishes `/skin` in the domain 75; published there: `/joint_states` \
                     (sensor_msgs/msg/JointState), `/tactile` (sensor_msgs/msg/Image)";
    assert!(silent.contains(published), "{silent}");
}

#[test]
fn an_empty_domain_is_named() {
    let listed = said(&mut tool(&["ros2", "topics", "--domain", "76", "--for", "500ms"]));
    assert_eq!((listed.code, listed.out.as_str()), (1, ""));
    assert!(listed.err.contains("no topic of ROS was seen in the domain 76 over 127.0.0.1"), "{}", listed.err);
    let refused = said(&mut tool(&["ros2", "topics", "--for", "0.5"]));
    assert!(refused.code == 2 && refused.err.contains("--for <TIME>"), "{}", refused.err);
}
