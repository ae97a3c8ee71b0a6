//! Whatever the process can observe going wrong ends in a stop that names node, port and tick.

use std::borrow::Cow;
use std::sync::{Arc, Mutex};

use tactflow_runtime::device::{Command, Commands, DeviceError, DeviceType, Driver, Opened, Samples, Stepped};
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::fault::Cause;
use tactflow_runtime::graph::compile;
use tactflow_runtime::harness::GraphRig;
use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, ParamSpec, Reader, Setup, Tick};
use tactflow_runtime::signal::{Freshness, Scalar};
use tactflow_runtime::source::Value;
use tactflow_tests::nodes::length_by_hand;
use tactflow_tests::{catalogue, on_the_mock_bench};

fn rig(how: &str) -> GraphRig {
    let text = format!(
        "[graph]\nclock = \"a\"\n[roles]\na = \"length\"\n[nodes.first]\ntype = \"count\"\nin.value = \"a.value\"\n\
         [nodes.bad]\ntype = \"breaks\"\nin.value = \"first.steps\"\nhow = \"{how}\"\ntick = 3\n"
    );
    let rig = GraphRig::new(catalogue(), &text, vec![length_by_hand("a")]);
    rig.unwrap_or_else(|report| panic!("{}", report.render(false)))
}

fn fault(how: &str) -> tactflow_runtime::fault::Fault {
    let mut rig = rig(how);
    for i in 0..2 {
        let ms = f64::from(i) * 10.0;
        rig.feed("a.value", ms, 1.0);
        rig.tick(ms).unwrap();
    }
    rig.feed("a.value", 20.0, 1.0);
    rig.tick(20.0).unwrap_err()
}

#[test]
fn a_value_that_is_not_finite_is_stopped_at_the_port_that_made_it() {
    let fault = fault("nan");
    assert_eq!((fault.node.as_str(), fault.port.as_deref(), fault.tick), ("bad", Some("value"), 3));
    assert_eq!((fault.cause, fault.place.as_str()), (Cause::NotFinite, "graph.toml:8:8"));
}

#[test]
fn a_panic_is_a_fault_of_the_node_that_panicked() {
    let fault = fault("panic");
    assert_eq!((fault.node.as_str(), fault.tick), ("bad", 3));
    assert_eq!(fault.to_string(), "node `bad` panicked: as told in tick 3 at 0.020 s (graph.toml:8:8)");
}

#[test]
fn a_sample_that_is_not_finite_is_a_fault_of_its_role() {
    let mut rig = rig("nan");
    rig.feed("a.value", 0.0, f64::NAN);
    let fault = rig.tick(0.0).unwrap_err();
    assert_eq!((fault.node.as_str(), fault.port.as_deref(), fault.tick), ("a", Some("value"), 1));
}

/// Has no outputs, and panics in the third tick.
///
/// ```toml
/// [nodes.mute]
/// type = "mute"
/// in.value = "ruler.value"
/// ```
#[derive(Describe)]
struct Mute;

/// What `mute` reads.
#[derive(Inputs)]
struct MuteInputs<'a> {
    /// A length.
    #[port(unit = "m", frame = "_")]
    #[expect(dead_code, reason = "the node only panics")]
    value: In<'a, Scalar>,
}

impl Node for Mute {
    type Params = ();
    type Inputs<'a> = MuteInputs<'a>;
    type Outputs = ();
    type State = ();

    fn new((): (), _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
    }

    fn step(&self, tick: &Tick, _: MuteInputs<'_>, (): &mut (), (): &mut ()) {
        assert!(tick.index != 3, "as told");
    }
}

#[test]
fn after_a_panic_the_nodes_that_do_not_depend_on_it_still_step() {
    let text = "[graph]\nclock = 'a'\n[policy]\npanic = 'hold'\n[roles]\na = 'length'\n\
                [nodes.first]\ntype = 'count'\nin.value = 'a.value'\n[nodes.mute]\ntype = 'mute'\n\
                in.value = 'a.value'\n[nodes.second]\ntype = 'count'\nin.value = 'a.value'\n";
    let mut rig = GraphRig::new(catalogue().node::<Mute>(), text, vec![length_by_hand("a")])
        .unwrap_or_else(|report| panic!("{}", report.render(false)));
    assert_eq!(rig.engine.order().collect::<Vec<_>>(), ["first", "mute", "second"]);
    let mut seen = Vec::new();
    for tick in 0..5 {
        let ms = f64::from(tick) * 10.0;
        rig.feed("a.value", ms, 1.0);
        rig.tick(ms).unwrap();
        seen.push([rig.freshness("first.steps"), rig.freshness("second.steps")]);
    }
    assert_eq!(seen, [[Freshness::New; 2]; 5]);
    assert!(!rig.engine.halts().is_empty());
}

#[test]
fn a_device_that_panics_is_a_fault_of_the_device() {
    let mut rig = rig("nan");
    rig.feed("a.value", 0.0, true);
    let fault = rig.tick(0.0).unwrap_err();
    assert_eq!(fault.node, "a");
    assert!(matches!(&fault.cause, Cause::Device(message) if message.starts_with("it panicked")), "{fault}");
}

/// The hybrid task on the mock bench, whose pad gives a NaN in the middle of a press.
fn hybrid_with_a_nan() -> Engine {
    let request = on_the_mock_bench("hybrid.toml");
    let request = request.set("devices.pad.glitch=[{ at_s = 1.0, for_s = 0.1, kind = 'nan' }]");
    Engine::new(compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false))))
}

#[test]
fn after_a_fault_every_command_goes_to_zero_in_a_straight_line() {
    let mut engine = hybrid_with_a_nan();
    let fault = loop {
        let now = engine.next().unwrap();
        if let Err(fault) = engine.tick(now) {
            break fault;
        }
    };
    assert_eq!((fault.node.as_str(), fault.port.as_deref(), fault.cause), ("pad", Some("image"), Cause::NotFinite));
    let start = engine.commands("arm").unwrap();
    assert!(start.iter().any(|velocity| velocity.abs() > 0.01), "the arm moves: {start:?}");
    // The fastest joint loses 5 rad/s² in ticks of 4 ms.
    let fastest = start.iter().fold(0.0, |fastest: f64, velocity| fastest.max(velocity.abs()));
    let steps = fastest / (5.0 * 0.004);
    assert!(steps > 3.0, "{steps} steps are no line");
    for step in 1..=steps.ceil() as i32 {
        let is_still = engine.wind_down();
        let left = (1.0 - f64::from(step) / steps).max(0.0);
        let now = engine.commands("arm").unwrap();
        let is_on_the_line = now.iter().zip(&start).all(|(now, start)| (now - start * left).abs() < 1e-9);
        assert!(is_on_the_line, "step {step}: {now:?} of {start:?}");
        assert!(!is_still || left == 0.0, "step {step}");
    }
    engine.wind_down();
    assert!(engine.commands("arm").unwrap().iter().all(|velocity| *velocity == 0.0));
}

#[test]
fn a_run_that_faults_leaves_the_arm_still() {
    let mut engine = hybrid_with_a_nan();
    let outcome = run(&mut engine, &RunOptions::default(), &mut |_| {}).unwrap();
    assert!(matches!(outcome.end, End::Fault(_)), "{:?}", outcome.end);
    assert!(engine.commands("arm").unwrap().iter().all(|velocity| *velocity == 0.0));
}

/// An arm that notes what it is told.
struct Spy {
    arm: Box<dyn Stepped>,
    velocity: Command,
    told: Arc<Mutex<Vec<f64>>>,
}

impl Stepped for Spy {
    fn next(&self) -> Option<i64> {
        self.arm.next()
    }

    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        let fastest =
            commands.joints(self.velocity).iter().fold(0.0, |fastest: f64, velocity| fastest.max(velocity.abs()));
        self.told.lock().unwrap().push(fastest);
        self.arm.exchange(now, commands, samples)
    }
}

struct SpyType {
    told: Arc<Mutex<Vec<f64>>>,
}

impl DeviceType for SpyType {
    fn name(&self) -> Cow<'static, str> {
        "spy_arm".into()
    }

    fn summary(&self) -> Cow<'static, str> {
        "a mock arm that notes what it is told".into()
    }

    fn params(&self) -> Vec<ParamSpec> {
        let nodes = tactflow_nodes::catalogue();
        let arm = nodes.devices().iter().find(|device| device.name() == "mock_arm");
        arm.map(|arm| arm.params()).unwrap_or_default()
    }

    fn open(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Opened> {
        let nodes = tactflow_nodes::catalogue();
        let arm = nodes.devices().iter().find(|device| device.name() == "mock_arm")?.open(table, reader)?;
        let Driver::Stepped(arm_) = arm.driver else { return None };
        let velocity = arm.description.command("velocity")?;
        let spy = Spy { arm: arm_, velocity, told: Arc::clone(&self.told) };
        Some(Opened { description: arm.description, driver: Driver::Stepped(Box::new(spy)) })
    }
}

#[test]
fn an_arm_is_told_to_stand_still_though_the_device_before_it_has_failed() {
    let told = Arc::new(Mutex::new(Vec::new()));
    let request = on_the_mock_bench("hybrid.toml")
        .set("devices.arm.type='spy_arm'")
        .set("devices.pad.press=[{ from_s = 0.3, force = 3.0, at = [0.008, -0.004] }]")
        .set("devices.pad.glitch=[{ at_s = 0.8, for_s = 5, kind = 'unplug' }]");
    let catalogue = catalogue().device_type(Box::new(SpyType { told: Arc::clone(&told) }));
    let plan = compile(&catalogue, &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let outcome = run(&mut Engine::new(plan), &RunOptions::default(), &mut |_| {}).unwrap();
    assert!(matches!(outcome.end, End::Fault(_)), "{:?}", outcome.end);
    let told = told.lock().unwrap();
    assert!(told.iter().any(|fastest| *fastest > 0.05), "it moved");
    assert_eq!(told.last(), Some(&0.0), "{:?}", &told[told.len() - 8..]);
}
