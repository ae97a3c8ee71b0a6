//! What goes on by itself after a hold, what waits for `resume`, and when `resume` is refused.

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::RoleType;
use tactflow_runtime::harness::{FedRole, GraphRig};
use tactflow_runtime::node::PortSpec;
use tactflow_runtime::signal::{Joints, JointsShape, Kind, Unit};
use tactflow_tests::catalogue;
use tactflow_tests::nodes::length_by_hand;

/// A sensor, and a motor that states the velocity that it is then commanded.
const GRAPH: &str = "
[graph]
clock = 's'
start = 'one'
[roles]
s = 'length'
m = 'motor'
[commands]
m.velocity = 'm.wish'
[modes.one]
go = { to = 'two', after_ms = 50 }
[modes.two]
";

fn motors() -> Catalogue {
    let port = |name, doc| PortSpec::new(name, doc, Kind::Joints, &["rad/s", "self"]);
    catalogue().role(RoleType {
        name: "motor".into(),
        summary: "a motor".into(),
        outputs: vec![port("wish", "The velocity that it would like.")],
        commands: vec![port("velocity", "Its velocity.")],
        ..RoleType::default()
    })
}

/// A run of the graph, 10 ms a tick.
struct Run {
    rig: GraphRig,
    tick: u32,
}

impl Run {
    fn new(policy: &str) -> Self {
        let joint = JointsShape { joints: vec![Default::default()], unit: Unit::RADIAN.per_second() };
        let motor = FedRole::new("m", "motor", 10.0).output("wish", joint.clone()).command("velocity", joint);
        let text = format!("{GRAPH}[policy]\n{policy}\n");
        let rig = GraphRig::new(motors(), &text, [length_by_hand("s"), motor]);
        Self { rig: rig.unwrap_or_else(|report| panic!("{}", report.render(false))), tick: 0 }
    }

    fn ms(&self) -> f64 {
        f64::from(self.tick) * 10.0
    }

    /// Runs for some ticks, in which these devices send samples.
    fn run(&mut self, ticks: u32, sending: &str) {
        for _ in 0..ticks {
            let ms = self.ms();
            if sending.contains('s') {
                self.rig.feed("s.value", ms, 1.0);
            }
            if sending.contains('m') {
                self.rig.feed("m.wish", ms, Joints(vec![0.5].into()));
            }
            self.rig.tick(ms).unwrap();
            self.tick += 1;
        }
    }

    fn lose(&mut self, port: &str) {
        self.rig.lose(port, self.ms(), "its plug is out");
    }

    fn resume(&mut self) -> Result<(), String> {
        self.rig.engine.send("resume")
    }

    fn moves(&self) -> bool {
        self.rig.engine.commands("m").unwrap()[0] != 0.0
    }

    /// Whether it moves, waits for `resume`, and the mode in which it is.
    fn state(&self) -> (bool, bool, &str) {
        (self.moves(), self.rig.engine.is_stopped(), self.rig.engine.mode().unwrap())
    }
}

const MOVES: (bool, bool, &str) = (true, false, "two");
const STOPPED: (bool, bool, &str) = (false, true, "two");

#[test]
fn a_sensor_that_was_lost_for_a_moment_is_no_reason_to_wait() {
    for ticks in [1, 3, 90] {
        let mut run = Run::new("device = 'hold'\nclock = 'count'");
        run.run(20, "sm");
        run.lose("s.value");
        run.run(ticks, "m");
        assert_eq!(run.state(), (false, false, "two"));
        run.run(5, "sm");
        assert_eq!(run.state(), MOVES, "after {ticks} ticks");
    }
}

#[test]
fn a_hold_of_more_than_a_second_waits_for_the_operator() {
    for policy in
        ["device = 'hold'\nclock = 'count'", "clock = 'hold'\nstale = 'count'", "stale = 'hold'\nclock = 'count'"]
    {
        let mut run = Run::new(policy);
        run.run(20, "sm");
        if policy.starts_with("device") {
            run.lose("s.value");
        }
        run.run(120, "m");
        assert_eq!(run.state(), STOPPED, "{policy}");
        let refused = run.resume().unwrap_err();
        assert!(refused.starts_with("`resume` is refused: ") && refused.contains("`s"), "{policy}: {refused}");
        assert!(refused.ends_with("; send it again when this is over"), "{policy}: {refused}");
        run.run(20, "sm");
        assert_eq!(run.state(), STOPPED, "{policy}: what was refused has no effect later");
        run.resume().unwrap();
        run.run(2, "sm");
        assert_eq!(run.state(), (true, false, "one"), "{policy}: it begins again");
    }
}

#[test]
fn a_mover_that_was_lost_waits_for_the_operator() {
    let mut run = Run::new("device = 'hold'");
    run.run(20, "sm");
    assert_eq!(run.state(), MOVES);
    run.lose("m.wish");
    run.run(1, "s");
    assert_eq!(run.state(), STOPPED, "at once");
    let refused = run.resume().unwrap_err();
    assert!(refused.starts_with("`resume` is refused: `m.wish` is lost: its plug is out in tick"), "{refused}");
    run.run(30, "sm");
    assert_eq!(run.state(), STOPPED, "it has connected again");
    run.resume().unwrap();
    run.run(2, "sm");
    assert_eq!(run.state(), (true, false, "one"), "it begins again");
}

#[test]
fn a_mover_that_has_failed_stops_for_ever() {
    let mut run = Run::new("device = 'hold'");
    run.run(20, "sm");
    run.rig.fail_device("m", run.ms(), "it burns");
    run.run(5, "s");
    assert!(run.rig.engine.is_stopped());
    let refused = run.resume().unwrap_err();
    assert!(refused.starts_with("`resume` is refused: device `m` failed: it burns"), "{refused}");
    assert!(refused.ends_with("end the run, and start it again"), "{refused}");
}

#[test]
fn what_has_not_begun_yet_is_not_lost() {
    // Both devices connect after three seconds.
    let mut run = Run::new("device = 'hold'");
    for port in ["m.wish", "s.value"] {
        run.lose(port);
    }
    run.run(300, "");
    assert!(run.rig.engine.is_halted() && !run.rig.engine.is_stopped());
    run.run(20, "sm");
    assert!(run.moves());
}

#[test]
fn a_resume_in_the_tick_of_a_new_trouble_has_no_effect() {
    let mut run = Run::new("device = 'stop'\nclock = 'count'");
    run.run(20, "sm");
    run.rig.send("stop");
    run.run(5, "sm");
    run.resume().unwrap();
    run.lose("s.value");
    run.run(5, "m");
    run.run(5, "sm");
    assert_eq!(run.state(), STOPPED);
}

#[test]
fn a_late_tick_is_no_reason_to_wait() {
    let mut run = Run::new("deadline = 'hold'");
    run.run(20, "sm");
    run.rig.engine.begin_late(15_000_000);
    run.run(1, "sm");
    assert_eq!(run.state(), (false, false, "two"));
    run.run(3, "sm");
    assert_eq!(run.state(), MOVES);
}

#[test]
fn a_mover_that_connects_again_before_the_next_tick_waits_as_well() {
    let mut run = Run::new("device = 'hold'");
    run.run(20, "sm");
    assert_eq!(run.state(), MOVES);
    // The loss and the next sample arrive in one tick.
    run.lose("m.wish");
    run.run(3, "sm");
    assert_eq!(run.state(), STOPPED);
    run.resume().unwrap();
    run.run(10, "sm");
    assert_eq!(run.state(), MOVES);
}
