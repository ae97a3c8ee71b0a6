//! Tests of what the driver does with single measurements: when it checks again, and what moves the target.

use std::sync::{Arc, Mutex};

use tactflow_runtime::node::FilePath;

use super::super::opened;
use super::super::wire::tests::datagram;
use super::*;
use crate::arm::model::load;
use crate::arm::mount::Mount;
use crate::devices::testing::{Puppet, read};

const ARM: &str = "urdf = 'builtin:lwr4p.urdf'\ntip = 'lwr_7_link'\n";
const HOME: Joints = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0];
/// Velocity of all joints [rad/s].
const MOVE: Joints = [0.1; 7];

/// A driver, whose measurements come from the test.
struct Rig {
    puppet: Puppet,
    fri: Arc<Mutex<Fri>>,
    now: Instant,
}

impl Rig {
    /// A driver that was checked once and may move.
    fn ready() -> Self {
        Self::of(ARM)
    }

    fn of(params: &str) -> Self {
        let (description, fri) = opened(read(params)).unwrap();
        let mut rig = Self { puppet: Puppet::start(description), fri: Arc::new(Mutex::new(fri)), now: Instant::now() };
        rig.puppet.command("velocity", &[0.0; 7]);
        assert!(rig.advance(0.0, 0.0));
        rig.step();
        rig
    }

    /// Has the driver take a measurement in the state command: the elbow is this far from its command [rad], and the pose
    /// is wrong by so much along x [m]. Returns whether the driver follows commands.
    fn advance(&mut self, deflection: f64, wrong: f64) -> bool {
        self.now += Duration::from_millis(4);
        let (fri, now, report) = (Arc::clone(&self.fri), self.now, report(deflection, wrong));
        self.puppet.has(move |link| fri.lock().unwrap().advance(&report, now, link))
    }

    /// Has the driver move its target, and returns by how much it did [rad].
    fn step(&mut self) -> f64 {
        let (fri, now) = (Arc::clone(&self.fri), self.now);
        self.puppet.has(move |link| {
            let fri = &mut *fri.lock().unwrap();
            let before = fri.target.position()[0];
            fri.step(&report(0.0, 0.0), now, link);
            fri.target.position()[0] - before
        })
    }

    /// Has the driver refuse the commands, as a lease that is lost does, and take this.
    fn halt(&mut self, deflection: f64) {
        self.puppet.has(|link| link.refuse("it halts"));
        self.advance(deflection, 0.0);
        self.step();
    }

    /// The operator resumes, and the graph moves.
    fn resume(&mut self) {
        self.puppet.resume();
        self.puppet.command("velocity", &MOVE);
    }
}

/// A measurement in the state command, with the drives on, in joint impedance control.
fn report(deflection: f64, wrong: f64) -> Report {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/robots/lwr4p.urdf").into();
    let chain = load(&FilePath { path, span: 0..0, builtin: None }, "lwr_7_link", &Mount::NONE).unwrap();
    let mut measured = HOME;
    measured[3] += deflection;
    let tip = chain.forward(&measured, &mut [Twist::default(); 7]).0;
    let mut pose: Vec<f32> = tip.to_matrix().transpose().as_slice()[..12].iter().map(|value| *value as f32).collect();
    pose[3] += wrong as f32;
    let [measured, commanded] = [measured, HOME].map(|posture| posture.map(|q| q as f32));
    let fields: [(usize, &[f32]); 4] = [(148, &[0.004]), (216, &measured), (244, &pose), (292, &commanded)];
    Report::decode(&datagram(&fields, &[(144, 2), (146, 3), (180, 0x7F), (182, 3)])).unwrap()
}

/// An arm that has only rested since the run began may have been guided elsewhere during a halt.
#[test]
fn the_first_motion_begins_at_the_start_whatever_was_checked_before() {
    let mut rig = Rig::of(&format!("{ARM}start = {HOME:?}\nstart_bounds = {{ posture = 0.02, deflection = 1.0 }}"));
    rig.halt(0.0);
    rig.resume();
    assert!(!rig.advance(0.04, 0.0) && rig.step() == 0.0);
    let refusal = rig.puppet.refusal().unwrap();
    assert!(refusal.contains("`start_bounds.posture`"), "{refusal}");
    let moves = (0..1000).any(|_| {
        rig.resume();
        rig.advance(0.0, 0.0) && rig.step() > 0.0
    });
    assert!(moves);
    rig.halt(0.04);
    rig.resume();
    assert!(rig.advance(0.04, 0.0), "it was there once");
}

#[test]
fn it_checks_again_when_the_operator_has_resumed() {
    let mut rig = Rig::ready();
    rig.halt(0.0);
    rig.resume();
    assert!(!rig.advance(0.0, 0.01) && rig.step() == 0.0, "the pose is wrong");
    let refusal = rig.puppet.refusal().unwrap();
    assert!(refusal.contains("they are 10.0 mm and 0.0° apart"), "{refusal}");
    // A busy machine may lose the lease again.
    let moves = (0..1000).any(|_| {
        rig.resume();
        rig.advance(0.0, 0.0) && rig.step() > 0.0
    });
    assert!(moves);
}

/// Each cycle asks twice: for the checks, and for the velocity.
#[test]
fn a_resume_in_the_middle_of_a_cycle_moves_nothing_before_the_checks() {
    let mut rig = Rig::ready();
    for _ in 0..5 {
        rig.halt(0.0);
        assert!(rig.advance(0.0, 0.0), "it could follow, but nobody has resumed");
        rig.resume();
        assert_eq!(rig.step(), 0.0, "nothing is checked yet");
        assert!(!rig.advance(0.0, 0.01), "the pose is wrong");
        assert_eq!(rig.step(), 0.0);
        rig.resume();
        assert!(rig.advance(0.0, 0.0));
    }
    // The halt and the resume may both come in the middle of a cycle.
    rig.puppet.command("velocity", &[0.0; 7]);
    assert!(rig.advance(0.0, 0.0));
    rig.puppet.has(|link| link.refuse("it halts"));
    rig.resume();
    assert_eq!(rig.step(), 0.0);
    assert!(!rig.advance(0.0, 0.01));
}

#[test]
fn an_arm_that_presses_goes_on_after_a_halt_and_one_that_was_pushed_away_does_not() {
    let mut rig = Rig::ready();
    // It presses while it follows, by more than the bound of the start.
    for deflection in [0.03, 0.06, 0.09] {
        assert!(rig.advance(deflection, 0.0));
        rig.step();
    }
    rig.halt(0.09);
    // Somebody pushes it on meanwhile, and then lets it go.
    assert!(rig.advance(0.2, 0.0));
    rig.resume();
    assert!(!rig.advance(0.2, 0.0) && rig.step() == 0.0);
    let refusal = rig.puppet.refusal().unwrap();
    assert!(refusal.contains("differ by more than 0.05 rad, and by 0.0900 rad when it moved last"), "{refusal}");
    rig.resume();
    assert!(rig.advance(0.1, 0.0));
    // A new session knows nothing of this.
    rig.halt(0.09);
    let fri = Arc::clone(&rig.fri);
    let now = rig.now;
    rig.puppet.has(move |link| fri.lock().unwrap().begin_session(&report(0.09, 0.0), now, link));
    rig.resume();
    assert!(!rig.advance(0.09, 0.0));
    rig.resume();
    assert!(rig.advance(0.04, 0.0));
}
