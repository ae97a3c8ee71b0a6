//! What a device states is compared with its roles at load; what it writes is checked while it runs.

use std::borrow::Cow;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::{
    Commands, Description, DeviceError, DeviceType, Driver, Opened, Output, RoleType, Samples, Stepped,
};
use tactflow_runtime::engine::Engine;
use tactflow_runtime::fault::Cause;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::harness::{FedRole, GraphRig};
use tactflow_runtime::node::{ParamSpec, PortSpec, Reader};
use tactflow_runtime::signal::{
    Features, FeaturesShape, Freshness, Image, ImageShape, Joints, JointsShape, Kind, Pose, Scalar, ScalarShape, Unit,
    VectorImage, VectorImageShape,
};
use tactflow_runtime::source::Value;
use tactflow_tests::nodes::length_by_hand;
use tactflow_tests::{catalogue, on_the_mock_bench};

/// A device that describes itself as a test says.
#[derive(Clone, Copy)]
struct Stated(Describe);

type Describe = fn(&mut Description);

impl DeviceType for Stated {
    fn name(&self) -> Cow<'static, str> {
        "stated".into()
    }

    fn summary(&self) -> Cow<'static, str> {
        "a device that describes itself as a test says".into()
    }

    fn params(&self) -> Vec<ParamSpec> {
        Vec::new()
    }

    fn open(&self, _: &Value, _: &mut Reader<'_>) -> Option<Opened> {
        let mut description = Description::every(0.01);
        (self.0)(&mut description);
        Some(Opened { description, driver: Driver::Stepped(Box::new(Silent)) })
    }
}

struct Silent;

impl Stepped for Silent {
    fn next(&self) -> Option<i64> {
        Some(i64::MAX)
    }

    fn exchange(&mut self, _: i64, _: &Commands, _: &mut Samples) -> Result<(), DeviceError> {
        Ok(())
    }
}

fn metres() -> ScalarShape {
    ScalarShape::of(Unit::METRE)
}

/// What a device states of the roles `length` and `velocity_arm`, and what the loader says of it.
const MISFITS: [(Describe, &str); 10] = [
    (|d| _ = d.fills("length"), "the role `length`: output `value` is missing"),
    (
        |d| {
            let mut fill = d.fills("length");
            fill.output::<Scalar>("value", metres());
            fill.output::<Scalar>("speed", metres());
        },
        "the role `length`: output `speed` is unknown (outputs here: `value`)",
    ),
    (
        |d| {
            d.fills("length").output::<Scalar>("valeu", metres());
        },
        "the role `length`: output `value` is missing; output `valeu` is unknown (did you mean `value`?)",
    ),
    (
        |d| {
            d.fills("length").output::<bool>("value", Default::default());
        },
        "the role `length`: output `value` is a flag, but the role declares a scalar",
    ),
    (
        |d| {
            d.fills("length").output::<Scalar>("value", ScalarShape::of(Unit::NEWTON));
        },
        "the role `length`: output `value` is in `N`, but the role declares `m`",
    ),
    (
        |d| {
            let mut fill = d.fills("length");
            fill.output::<Scalar>("value", metres());
            fill.output::<Scalar>("value", metres());
        },
        "the role `length`: output `value` is stated twice",
    ),
    (
        |d| {
            length(d);
            let shape = ImageShape { rows: 0, cols: 4, pitch: [0.005; 2], unit: Unit::NEWTON };
            d.fills("tactile_pad").output::<Image>("image", shape);
        },
        "the role `tactile_pad`: output `image` is an image of 0 by 4, which has no tactels",
    ),
    (
        |d| {
            length(d);
            arm(d).output::<Joints>("position", JointsShape { joints: vec![], unit: Unit::RADIAN });
        },
        "the role `velocity_arm`: output `equilibrium` is missing; command `velocity` is missing",
    ),
    (
        |d| {
            length(d);
            whole_arm(d).report::<Scalar>("contact");
        },
        "the role `velocity_arm`: report `contact` is a scalar, but the role declares a pose",
    ),
    (
        |d| {
            length(d);
            whole_arm(d).report::<Pose>("contakt");
        },
        "the role `velocity_arm`: report `contakt` is unknown (did you mean `contact`?)",
    ),
];

fn length(description: &mut Description) {
    description.fills("length").output::<Scalar>("value", metres());
}

fn arm(description: &mut Description) -> tactflow_runtime::device::Fill<'_> {
    description.fills("velocity_arm")
}

fn whole_arm(description: &mut Description) -> tactflow_runtime::device::Fill<'_> {
    let joints = JointsShape { joints: vec![], unit: Unit::RADIAN };
    let mut arm = arm(description);
    arm.command("velocity", joints.in_unit(Unit::RADIAN.per_second()));
    // The order is the device's own.
    arm.output::<Joints>("equilibrium", joints.clone());
    arm.output::<Joints>("position", joints);
    arm
}

fn load(stated: Stated) -> Result<(), String> {
    let graph = "graph.clock = 'a'\nroles.a = 'length'\nbind.a = 'ruler'\n[devices.ruler]\ntype = 'stated'\n";
    let catalogue = catalogue().device_type(Box::new(stated));
    compile(&catalogue, &Request::text(graph)).map(drop).map_err(|report| report.render(false))
}

#[test]
fn a_device_that_states_other_ports_than_its_role_does_not_load() {
    for (stated, expected) in MISFITS {
        let report = load(Stated(stated)).expect_err(expected);
        let expected = format!("error[wrong-role]: device `ruler` does not match {expected}\n");
        assert!(report.contains(&expected) && report.contains("graph.toml:4:10"), "{expected}{report}");
        assert!(report.contains("the mistake is in the device type `stated`, not in this file"), "{report}");
        assert_eq!(report.matches("error[").count(), 1, "{report}");
    }
    let unknown = load(Stated(|d| {
        length(d);
        d.fills("tactil_pad");
    }));
    let message =
        "device `ruler` states the role type `tactil_pad`, which does not exist (did you mean `tactile_pad`?)";
    assert!(unknown.as_ref().is_err_and(|report| report.contains(message)), "{unknown:?}");
    for twice in [
        (|d| (length(d), length(d)).0) as Describe,
        |d| {
            length(d);
            d.fills_on("left", "length").output::<Scalar>("value", metres());
        },
        |d| {
            for side in ["left", "left"] {
                d.fills_on(side, "length").output::<Scalar>("value", metres());
            }
        },
    ] {
        let report = load(Stated(twice)).expect_err("nothing tells them apart");
        let message = "device `ruler` fills the role type `length` more than once without a side of its own for each";
        assert!(report.contains(message) && report.matches("error[").count() == 1, "{report}");
    }
    load(Stated(length)).unwrap();
    load(Stated(|description| {
        whole_arm(description);
        length(description);
    }))
    .unwrap();
}

/// A role with a value of every kind that has a size.
fn sized() -> RoleType {
    let port = |name, kind, args: &[&'static str]| PortSpec::new(name, "", kind, args);
    RoleType {
        name: "sized".into(),
        summary: "a value of each kind that has a size".into(),
        outputs: vec![
            port("image", Kind::Image, &["U", "self"]),
            port("vectors", Kind::VectorImage, &["U", "self"]),
            port("joints", Kind::Joints, &["rad", "self"]),
            port("offsets", Kind::Features, &["_", "self"]),
        ],
        ..RoleType::default()
    }
}

fn sized_rig(policy: &str) -> GraphRig {
    let feature = |name: &str| tactflow_runtime::signal::Feature { name: name.into(), unit: Unit::METRE };
    let fed = FedRole::new("s", "sized", 10.0)
        .output("image", ImageShape { rows: 2, cols: 3, pitch: [0.01; 2], unit: Unit::NEWTON })
        .output("vectors", VectorImageShape(ImageShape { rows: 2, cols: 3, pitch: [0.01; 2], unit: Unit::NEWTON }))
        .output("joints", JointsShape { joints: vec![Default::default(); 2], unit: Unit::RADIAN })
        .output("offsets", FeaturesShape { features: vec![feature("x"), feature("y")] });
    let graph = format!("graph.clock = 's'\nroles.s = 'sized'\npolicy.device = '{policy}'\npolicy.clock = 'count'\n");
    let catalogue = Catalogue::new().role(sized());
    GraphRig::new(catalogue, &graph, [fed]).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

#[test]
fn a_value_of_the_wrong_size_is_a_fault_of_the_device_that_names_the_port_and_both_sizes() {
    type Feed = fn(&mut GraphRig);
    let cases: [(Feed, &str); 5] = [
        (
            |rig| rig.feed("s.image", 0.0, Image::zeros(3, 2)),
            "`s.image` has 3 by 2 tactels, but the device stated 2 by 3 tactels",
        ),
        (
            |rig| rig.feed("s.image", 0.0, Image::zeros(2, 4)),
            "`s.image` has 2 by 4 tactels, but the device stated 2 by 3 tactels",
        ),
        (
            |rig| rig.feed("s.vectors", 0.0, VectorImage::zeros(3, 3)),
            "`s.vectors` has 3 by 3 tactels, but the device stated 2 by 3 tactels",
        ),
        (|rig| rig.feed("s.joints", 0.0, Joints::zeros(3)), "`s.joints` has 3 joints, but the device stated 2 joints"),
        (
            |rig| rig.feed("s.offsets", 0.0, sample(&[Some(1.0)])),
            "`s.offsets` has 1 features, but the device stated 2 features",
        ),
    ];
    for (feed, why) in cases {
        let mut rig = sized_rig("fault");
        feed(&mut rig);
        let fault = rig.tick(0.0).unwrap_err();
        assert_eq!((fault.node.as_str(), &fault.cause), ("s", &Cause::Device(why.into())));
        let mut held = sized_rig("hold");
        feed(&mut held);
        held.tick(0.0).unwrap();
        held.run_for(100.0).unwrap();
        assert_eq!(held.engine.halts().len(), 1, "{why}");
        assert_eq!(held.engine.halts()[0].until, None);
        assert!(held.get::<Image>("s.image").is_none() && held.get::<Joints>("s.joints").is_none(), "{why}");
    }
}

fn sample(values: &[Option<f64>]) -> Features {
    let mut features = Features::absent(2);
    features.fill(values);
    features
}

#[test]
fn a_device_gives_features_without_the_number_of_a_tick() {
    use Freshness::{Absent, Held, Lost, New};
    let mut rig = sized_rig("fault");
    let mut seen = Vec::new();
    let course = [
        Some([Some(1.0), Some(2.0)]),
        None,
        Some([Some(3.0), None]),
        Some([Some(4.0), None]),
        Some([None, None]),
        Some([Some(5.0), Some(6.0)]),
    ];
    for (i, values) in course.into_iter().enumerate() {
        let ms = 10.0 * i as f64;
        if let Some(values) = values {
            rig.feed("s.offsets", ms, sample(&values));
        }
        rig.tick(ms).unwrap();
        let tick = rig.engine.ticks();
        let components = rig.get::<Features>("s.offsets").map(|features| {
            let [x, y] = features.components() else { panic!("two") };
            ([x.get(), y.get()], [x.freshness(tick), y.freshness(tick)], x.stamp().nanos)
        });
        seen.push((rig.freshness("s.offsets"), components));
    }
    let ms = 1_000_000;
    let expected = [
        (New, Some(([Some(1.0), Some(2.0)], [New, New], 0))),
        (Held, Some(([Some(1.0), Some(2.0)], [Held, Held], 0))),
        (New, Some(([Some(3.0), None], [New, Lost], 20 * ms))),
        (New, Some(([Some(4.0), None], [New, Absent], 30 * ms))),
        (Lost, None),
        (New, Some(([Some(5.0), Some(6.0)], [New, New], 50 * ms))),
    ];
    assert_eq!(seen, expected);
}

fn lengths(policy: &str) -> GraphRig {
    let text = format!(
        "[graph]\nclock = \"b\"\n[roles]\na = \"length\"\nb = \"length\"\n[policy]\ndevice = \"{policy}\"\n\
         stale = \"stop\"\n"
    );
    GraphRig::new(catalogue(), &text, ["a", "b"].map(length_by_hand)).unwrap_or_else(|r| panic!("{}", r.render(false)))
}

#[test]
fn a_lost_port_is_absent_and_keeps_the_halt_until_it_is_written_again() {
    for (policy, resumes) in [("hold", true), ("stop", false)] {
        let mut rig = lengths(policy);
        let mut seen = Vec::new();
        for i in 0..30 {
            let ms = 10.0 * f64::from(i);
            rig.feed("b.value", ms, 1.0);
            match i {
                5 => rig.lose("a.value", ms, "no answer"),
                6..20 => {}
                // A driver that has connected again counts from 1 again.
                20.. => rig.feed_as("a.value", ms, ms, i as u64 - 19, 1.0),
                _ => rig.feed("a.value", ms, 1.0),
            }
            rig.tick(ms).unwrap();
            seen.push((rig.get::<Scalar>("a.value").is_some(), rig.engine.is_halted()));
        }
        assert!(seen[..5].iter().all(|seen| *seen == (true, false)), "{policy}");
        assert!(seen[5..20].iter().all(|seen| *seen == (false, true)), "{policy}: {seen:?}");
        assert!(seen[20..].iter().all(|seen| *seen == (true, !resumes)), "{policy}: {seen:?}");
        // Its age does not count while it is lost, or `stale` would make a stop of every long hold.
        let halts: Vec<String> = rig.engine.halts().iter().map(|halt| halt.fault.to_string()).collect();
        assert_eq!(halts, ["`a.value` is lost: no answer in tick 6 at 0.050 s (command line:1:9)"], "{policy}");
        assert_eq!(rig.engine.counters().next().unwrap().repeated, 0, "{policy}");
    }
    let mut rig = lengths("fault");
    rig.feed("b.value", 0.0, 1.0);
    rig.lose("a.value", 0.0, "no answer");
    let fault = rig.tick(0.0).unwrap_err();
    assert_eq!((fault.node.as_str(), fault.port.as_deref()), ("a", Some("value")));
    assert_eq!(fault.cause, Cause::Lost("no answer".into()));
}

#[test]
fn a_rig_feeds_absence_and_failure_and_runs_by_the_clock_of_the_graph() {
    let mut rig = lengths("hold");
    for i in 0..10 {
        rig.feed("b.value", 10.0 * f64::from(i), 1.0);
    }
    rig.feed("a.value", 0.0, 2.0);
    rig.feed_absent("a.value", 40.0);
    rig.fail_device("a", 60.0, "its plug is out");
    rig.tick(0.0).unwrap();
    rig.run_for(30.0).unwrap();
    assert_eq!((rig.engine.ticks(), rig.get("a.value")), (4, Some(&2.0)));
    rig.run_for(10.0).unwrap();
    assert_eq!((rig.freshness("a.value"), rig.engine.is_halted()), (Freshness::Lost, false));
    rig.run_for(20.0).unwrap();
    assert!(rig.engine.is_halted());
    let fault = &rig.engine.halts()[0].fault;
    assert_eq!((fault.node.as_str(), &fault.cause), ("a", &Cause::Device("its plug is out".into())));
}

#[test]
#[should_panic(expected = "role `a` has no output `vlaue`: did you mean `value`?")]
fn a_rig_names_the_port_that_it_does_not_have() {
    lengths("hold").feed("a.vlaue", 0.0, 1.0);
}

#[test]
fn a_graph_of_a_file_runs_with_one_role_fed_and_the_others_on_its_bench() {
    let shape = ImageShape { rows: 16, cols: 16, pitch: [0.005; 2], unit: Unit::NEWTON };
    let calibration = toml::Table::from_iter([("gain".to_owned(), 1.0.into())]);
    let pad = FedRole::new("pad", "tactile_pad", 4.0).output("image", shape);
    let pad = pad
        .fact("threshold", 0.015)
        .fact("pressure", 0.1)
        .fact("calibration", calibration)
        .fact("mount", toml::Table::new());
    let request = on_the_mock_bench("force.toml");
    let mut rig = match GraphRig::open(catalogue(), request, [pad]) {
        Ok(rig) => rig,
        Err(report) => panic!("{}", report.render(false)),
    };
    let mut image = Image::zeros(16, 16);
    for cell in [7 * 16 + 7, 7 * 16 + 8, 8 * 16 + 7, 8 * 16 + 8] {
        image.cells_mut()[cell] = 1.5;
    }
    for i in 0..50 {
        rig.feed("pad.image", 4.0 * f64::from(i), image.clone());
    }
    rig.run_for(100.0).unwrap();
    // The record calls it `touch.moments.x`, the wires of the task `touch.x`: the middle [m].
    assert!(rig.get::<Scalar>("touch.x").unwrap().abs() < 1e-9);
    assert_eq!(rig.get::<Scalar>("touch.x"), rig.get::<Scalar>("touch.moments.x"));
    assert!(rig.get::<Joints>("arm.position").is_some(), "the arm of the bench");
}

/// A device that counts.
struct Counting {
    value: Output<Scalar>,
    next: i64,
}

impl Stepped for Counting {
    fn next(&self) -> Option<i64> {
        Some(self.next)
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        *samples.write(self.value, now, now as u64) = 1.0;
        samples.count("frames");
        if now == 0 {
            samples.count("bad frames");
        }
        self.next = now + 10_000_000;
        Ok(())
    }
}

struct CountingType;

impl DeviceType for CountingType {
    fn name(&self) -> Cow<'static, str> {
        "counting".into()
    }

    fn summary(&self) -> Cow<'static, str> {
        "a device that counts".into()
    }

    fn params(&self) -> Vec<ParamSpec> {
        Vec::new()
    }

    fn open(&self, _: &Value, _: &mut Reader<'_>) -> Option<Opened> {
        let mut description = Description::every(0.01);
        let value = description.fills("length").output("value", metres());
        Some(Opened { description, driver: Driver::Stepped(Box::new(Counting { value, next: 0 })) })
    }
}

#[test]
fn what_a_device_counts_is_in_the_summary_of_the_run() {
    let graph = "graph.clock = 'a'\nroles.a = 'length'\nbind.a = 'ruler'\n[devices.ruler]\ntype = 'counting'\n";
    let catalogue = || catalogue().device_type(Box::new(CountingType));
    let plan = compile(&catalogue(), &Request::text(graph)).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    for _ in 0..3 {
        let now = engine.next().unwrap();
        engine.tick(now).unwrap();
    }
    let counts: Vec<_> = engine.counts().map(|(device, counts)| (device.to_owned(), counts.to_vec())).collect();
    assert_eq!(counts, [("ruler".to_owned(), vec![("frames", 3), ("bad frames", 1)])]);
}

#[cfg(not(feature = "ros2"))]
#[test]
fn a_device_that_the_build_leaves_out_is_no_misspelling() {
    let checked = crate::tool::say(&["check", "graphs/hybrid.toml", "--bench", "tests/data/ros2_bench.toml"]);
    let text = checked.out + &checked.err;
    assert!(text.contains("this build leaves out the device type `ros2_arm`"), "{text}");
    assert!(text.contains("cargo install --path nodes --features ros2") && !text.contains("did you mean"), "{text}");
    let command = crate::tool::say(&["ros2", "publish", "pad.image", "--wait"]);
    assert!(command.code == 2 && command.err.contains("this build leaves out `ros2`\nhelp: build"), "{}", command.err);
}
