//! What absence does on the way from a pad to a twist, one test a sentence.

use tactflow_runtime::harness::{FedRole, GraphRig};
use tactflow_runtime::signal::{Features, Flag, Freshness, Image, ImageShape, Scalar, Twist, Unit};
use tactflow_tests::catalogue;
use tactflow_tests::nodes::length_by_hand;

const COLS: usize = 8;

/// From a pad of 8 by 8 at 100 Hz to a region.
const TOUCH: &str = "
[nodes.binarize]
type = \"binarize\"
in.image = \"pad.image\"
threshold = 0.5
[nodes.label]
type = \"label\"
in.image = \"pad.image\"
in.mask = \"binarize.mask\"
[nodes.moments]
type = \"moments\"
in.image = \"pad.image\"
in.region = \"label.region\"
";

fn rig(lengths: &[&'static str], nodes: &str) -> GraphRig {
    let declared: String = lengths.iter().map(|role| format!("{role} = \"length\"\n")).collect();
    let text = format!("[graph]\nclock = \"pad\"\n[roles]\npad = \"tactile_pad\"\n{declared}{TOUCH}{nodes}");
    let shape = ImageShape { rows: 8, cols: COLS, pitch: [0.005; 2], unit: Unit::NEWTON };
    let pad = FedRole::new("pad", "tactile_pad", 10.0).output("image", shape);
    let sources = std::iter::once(pad).chain(lengths.iter().map(|role| length_by_hand(role)));
    GraphRig::new(catalogue(), &text, sources).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

/// An image with one newton on each of these tactels, by row and column.
fn press(tactels: &[(usize, usize)]) -> Image {
    let mut image = Image::zeros(8, COLS);
    tactels.iter().for_each(|(i, j)| image.cells_mut()[i * COLS + j] = 1.0);
    image
}

/// The pad shows `image` at `ms`, and the graph ticks.
fn show(rig: &mut GraphRig, ms: f64, image: Image) {
    rig.feed("pad.image", ms, image);
    rig.tick(ms).unwrap();
}

const SQUARE: [(usize, usize); 4] = [(3, 3), (3, 4), (4, 3), (4, 4)];
const LINE: [(usize, usize); 3] = [(3, 2), (3, 3), (3, 4)];
const COUNT: &str = "[nodes.count]\ntype = \"count\"\nin.value = \"moments.x\"\n";

#[test]
fn without_contact_everything_behind_is_lost_once_and_then_absent() {
    let mut rig = rig(&[], COUNT);
    let mut seen = Vec::new();
    for (ms, image) in [(0.0, press(&SQUARE)), (10.0, press(&[])), (20.0, press(&[]))] {
        show(&mut rig, ms, image);
        seen.push((
            rig.get::<Flag>("label.present").copied(),
            rig.freshness("moments.x"),
            rig.freshness("count.steps"),
        ));
    }
    let expected = [
        (Some(true), Freshness::New, Freshness::New),
        (Some(false), Freshness::Lost, Freshness::Lost),
        (Some(false), Freshness::Absent, Freshness::Absent),
    ];
    assert_eq!(seen, expected);
}

#[test]
fn a_flicker_keeps_the_state_and_a_loss_resets_it_once() {
    // Milliseconds without contact, and the steps counted when it is back after three with it.
    for (away, steps) in [(10.0, 4.0), (20.0, 1.0), (30.0, 1.0), (300.0, 1.0)] {
        let mut rig = rig(&[], COUNT);
        for i in 0..3 {
            show(&mut rig, f64::from(i) * 10.0, press(&SQUARE));
        }
        let mut ms = 30.0;
        while ms < 30.0 + away {
            show(&mut rig, ms, press(&[]));
            ms += 10.0;
        }
        show(&mut rig, ms, press(&SQUARE));
        assert_eq!(rig.get::<Scalar>("count.steps"), Some(&steps), "{away} ms without contact");
    }
}

#[test]
fn a_single_frame_without_contact_is_a_loss_where_frames_are_slow() {
    let mut rig = rig(&[], COUNT);
    for (ms, tactels) in [(0.0, SQUARE.as_slice()), (100.0, &[]), (200.0, &SQUARE)] {
        show(&mut rig, ms, press(tactels));
    }
    assert_eq!(rig.get::<Scalar>("count.steps"), Some(&1.0));
}

#[test]
fn a_lost_input_wakes_beside_a_held_one() {
    let nodes = "
[nodes.pair]
type = \"pair\"
in.required = \"a.value\"
in.sampled = \"a.value\"
in.trigger = \"moments.x\"
";
    let mut rig = rig(&["a"], nodes);
    rig.feed("a.value", 0.0, 1.0);
    show(&mut rig, 0.0, press(&SQUARE));
    assert_eq!((rig.get("pair.steps"), rig.get("pair.there")), (Some(&1.0), Some(&1.0)));
    show(&mut rig, 10.0, press(&[]));
    assert_eq!(rig.freshness("a.value"), Freshness::Held);
    assert_eq!((rig.get("pair.steps"), rig.get("pair.there")), (Some(&2.0), Some(&0.0)));
    show(&mut rig, 20.0, press(&[]));
    assert_eq!(rig.get("pair.steps"), Some(&2.0), "an absence wakes nobody, only its beginning does");
}

const SERVO: &str = "
[nodes.error]
type = \"feature_error\"
in.pressure = \"moments.pressure\"
in.orientation = \"moments.orientation\"
setpoint = { pressure = 2.0, orientation = 0.5 }
[nodes.pid]
type = \"pid\"
in.error = \"error.error\"
gains.pressure = { ki = 1.0 }
gains.orientation = { ki = 1.0 }
[nodes.jacobian]
type = \"inverse_jacobian\"
in.control = \"pid.control\"
columns.pressure = [0, 0, 1, 0, 0, 0]
columns.orientation = [0, 0, 0, 0, 0, -1]
";

fn control(rig: &GraphRig, i: usize) -> Option<f64> {
    rig.get::<Features>("pid.control").and_then(|control| control.components()[i].get())
}

#[test]
fn a_round_patch_without_an_orientation_does_not_stop_force_control() {
    let mut rig = rig(&[], SERVO);
    let images = [LINE.as_slice(), &LINE, &SQUARE, &SQUARE, &SQUARE, &SQUARE, &LINE, &LINE];
    let mut controls = Vec::new();
    for (ms, tactels) in (0..).map(|i| f64::from(i) * 10.0).zip(images) {
        show(&mut rig, ms, press(tactels));
        controls.push((control(&rig, 0), control(&rig, 1)));
        assert_eq!(rig.freshness("jacobian.twist"), Freshness::New);
    }
    let near = |a: Option<f64>, b: Option<f64>| a.zip(b).map_or(a == b, |(a, b)| (a - b).abs() < 1e-12);
    // One newton a tactel is one too few: the pressure's integral grows by 0.01 a sample, whatever the orientation does.
    let pressure = (0..8).map(|i| Some(f64::from(i) * 0.01));
    // 0.5 rad for 10 ms; absent for 40 ms; and afresh.
    let orientation = [Some(0.0), Some(0.005), None, None, None, None, Some(0.0), Some(0.005)];
    for (i, ((p, o), expected)) in controls.iter().zip(pressure.zip(orientation)).enumerate() {
        assert!(near(*p, expected.0) && near(*o, expected.1), "sample {i}: {p:?} {o:?}, not {expected:?}");
    }
    let twist = rig.get::<Twist>("jacobian.twist").unwrap();
    assert!(near(Some(twist.0[2]), Some(0.07)) && near(Some(twist.0[5]), Some(-0.005)), "{twist:?}");
}

#[test]
fn a_feature_that_the_graph_requires_stops_the_others() {
    let nodes = SERVO.replace("setpoint =", "requires = [\"orientation\"]\nsetpoint =");
    let mut rig = rig(&[], &nodes);
    show(&mut rig, 0.0, press(&LINE));
    assert_eq!(rig.freshness("jacobian.twist"), Freshness::New);
    show(&mut rig, 10.0, press(&SQUARE));
    assert_eq!(rig.freshness("jacobian.twist"), Freshness::Lost);
}

const GUIDED: &str = "
[nodes.guide]
type = \"twist_source\"
twist = [0, 0.01, 0, 0, 0, 0]
[nodes.sum]
type = \"twist_adder\"
in.servo = \"jacobian.twist\"
in.guide = \"guide.twist\"
";

#[test]
fn generated_motion_beside_a_dead_sensor_grows_as_old_as_the_sensor() {
    for gate in ["", "in.gate = \"label.present\"\n"] {
        let nodes = format!("{SERVO}{}", GUIDED.replace("twist = [0, 0.01", &format!("{gate}twist = [0, 0.01")));
        let mut rig = rig(&[], &nodes);
        show(&mut rig, 0.0, press(&LINE));
        assert_eq!(rig.age_ms("sum.twist"), 0.0);
        for ms in [30.0, 40.0, 50.0] {
            assert_eq!(rig.engine.next().map(|nanos| nanos as f64 * 1e-6), Some(ms), "a timer ticks on");
            rig.tick(ms).unwrap();
            assert_eq!(rig.freshness("guide.twist"), Freshness::New, "it is generated in every tick");
            let age = if gate.is_empty() { 0.0 } else { ms };
            assert_eq!(rig.age_ms("guide.twist"), age, "generated motion is timeless, its gate is not");
            assert_eq!(rig.age_ms("sum.twist"), ms, "the sum is as old as the touch in it");
        }
    }
}

#[test]
fn a_gate_that_closes_stops_generated_motion() {
    let nodes = "[nodes.guide]\ntype = \"twist_source\"\nin.gate = \"label.present\"\ntwist = [0, 0.01, 0, 0, 0, 0]\n";
    let mut rig = rig(&[], nodes);
    show(&mut rig, 0.0, press(&SQUARE));
    assert_eq!(rig.freshness("guide.twist"), Freshness::New);
    show(&mut rig, 10.0, press(&[]));
    assert_eq!(rig.freshness("guide.twist"), Freshness::Lost);
}
