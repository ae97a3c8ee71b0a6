//! The catalogue keeps the rules of `harness::lint`, and each rule finds a node or a device that breaks it.

use std::borrow::Cow;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::{
    Commands, Description, DeviceError, DeviceType, Driver, Opened, Output, RoleType, Samples, Stepped,
};
use tactflow_runtime::harness::lint;
use tactflow_runtime::node::{
    AnyNode, Bounds, Built, Bus, Configured, Declared, Given, Limits, Mistakes, Motion, NodeSpec, NodeType, ParamSpec,
    PortId, PortSpec, Reader, Reading, Tick, Wires,
};
use tactflow_runtime::signal::{Kind, Scalar, ScalarShape, Signal, Unit};
use tactflow_runtime::source::Value;
use tactflow_tests::catalogue;

/// Allocations of what it runs.
fn count(step: &mut dyn FnMut()) -> u64 {
    allocation_counter::measure(step).count_total
}

#[test]
fn everything_is_documented_and_every_example_runs() {
    // The simulator of `lockstep` and the recording of `replay` are the reader's own: `lockstep.rs` and `replay_bench.rs`
    // run with one. What presses on the pad of the examples is round, so no image holds a line.
    let shipped = tactflow_nodes::catalogue();
    let lint_shipped = lint(&shipped).counting(count).without_example_of(&["lockstep", "replay"]);
    let of_bends = ["curvature.orientation", "curvature.turn", "curvature.length", "curvature.rate"];
    let of_lines = [&["hough.orientation", "hough.offset"], &of_bends[..]].concat();
    // The arm of the examples does not press, so nothing shows how stiff the contact is.
    let silent = [&of_lines[..], &["stiffness_estimate.ratio"]].concat();
    lint_shipped.accepting_silence_of(&silent).assert_clean();
    lint(&catalogue()).only(&["first_order_lag", "mix", "udp_pad"]).counting(count).assert_clean();
}

/// How a node misbehaves while it runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum How {
    Well,
    Allocates,
    IsSilent,
    LeavesItsRange,
    KeepsItsState,
    Panics,
}

/// A node that counts its steps, up to 1000 by its declaration.
#[derive(Clone)]
struct Counter {
    spec: NodeSpec,
    how: How,
    steps: f64,
}

fn port(name: &'static str, doc: &'static str) -> PortSpec {
    PortSpec::new(name, doc, Kind::Scalar, &["m"])
}

fn param(name: &'static str, doc: &'static str, unit: Option<&'static str>) -> ParamSpec {
    let declared = Declared { doc, unit, bounds: Some(Bounds::above(0.0)), ..Declared::new(name) };
    ParamSpec::of::<f64>(&declared, Some(|| 1.0))
}

impl Counter {
    fn new(how: How) -> Self {
        let spec = NodeSpec {
            name: "counter".into(),
            summary: "counts its steps".into(),
            doc: "It counts.".into(),
            example: "\n[nodes.counter]\ntype = \"counter\"\nin.value = \"length.value\"\n".into(),
            params: vec![param("gain", "Steps per step.", Some("1"))],
            inputs: vec![port("value", "A length.")],
            outputs: vec![port("steps", "Steps so far.")],
            every_tick: false,
            logs: false,
            limits: Limits::NONE,
        };
        Self { spec, how, steps: 0.0 }
    }
}

impl NodeType for Counter {
    fn spec(&self) -> NodeSpec {
        self.spec.clone()
    }

    fn configure(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Box<dyn Configured>> {
        let mut open = reader.table(table, &["gain"])?;
        let declared = Declared { bounds: Some(Bounds::above(0.0)), ..Declared::new("gain") };
        reader.field::<f64>(&mut open, &declared, Some(|| 1.0));
        reader.close(open);
        Some(Box::new(self.clone()))
    }
}

impl Configured for Counter {
    fn build(self: Box<Self>, _: Given) -> Result<Built, Mistakes> {
        let outputs = vec![ScalarShape::of(Unit::METRE).within(0.0, 1000.0).into()];
        let (motion, warnings) = (Motion::Any, Mistakes::new());
        Ok(Built { node: self, outputs, motion, reading: Reading::Other, is_uncalibrated: false, warnings })
    }
}

impl AnyNode for Counter {
    fn step(&mut self, tick: &Tick, bus: &mut Bus, _: &Wires, outputs: &[PortId]) {
        assert!(self.how != How::Panics || self.steps < 3.0, "tired");
        self.steps += 1.0;
        if self.how == How::Allocates {
            drop(std::hint::black_box(vec![1_u8; 100]));
        }
        if self.how == How::IsSilent {
            return;
        }
        let sign = if self.how == How::LeavesItsRange { -1.0 } else { 1.0 };
        Scalar::arena_mut(&mut bus.arenas)[outputs[0].slot as usize] = sign * self.steps;
        bus.marks[outputs[0].mark as usize].renew(tick.index, tick.stamp);
    }

    fn lose(&mut self, tick: u64, bus: &mut Bus, outputs: &[PortId]) {
        bus.marks[outputs[0].mark as usize].lose(tick);
    }

    fn reset(&mut self) {
        if self.how != How::KeepsItsState {
            self.steps = 0.0;
        }
    }
}

/// A length that grows.
struct Ruler {
    value: Output<Scalar>,
    next: i64,
    is_silent: bool,
}

impl Stepped for Ruler {
    fn next(&self) -> Option<i64> {
        Some(self.next).filter(|next| *next < 2_000_000_000)
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        if now >= self.next && !self.is_silent {
            *samples.write(self.value, now, now as u64) = 1.0;
        }
        self.next = now + 10_000_000;
        Ok(())
    }
}

struct RulerType {
    is_silent: bool,
}

impl DeviceType for RulerType {
    fn name(&self) -> Cow<'static, str> {
        "ruler".into()
    }

    fn summary(&self) -> Cow<'static, str> {
        "a length that grows".into()
    }

    fn doc(&self) -> Cow<'static, str> {
        "It grows.".into()
    }

    fn example(&self) -> Cow<'static, str> {
        "\n[roles]\nlength = \"length\"\n\n[bind]\nlength = \"it\"\n\n[devices.it]\ntype = \"ruler\"\n".into()
    }

    fn params(&self) -> Vec<ParamSpec> {
        Vec::new()
    }

    fn open(&self, _: &Value, _: &mut Reader<'_>) -> Option<Opened> {
        let mut description = Description::every(0.01);
        let value = description.fills("length").output("value", ScalarShape::of(Unit::METRE));
        let ruler = Ruler { value, next: 0, is_silent: self.is_silent };
        Some(Opened { description, driver: Driver::Stepped(Box::new(ruler)) })
    }
}

fn role(name: &'static str, doc: &'static str) -> RoleType {
    RoleType { name: name.into(), summary: "a length".into(), outputs: vec![port("value", doc)], ..RoleType::default() }
}

/// What lint says of a counter beside a ruler, the first line of each violation.
fn said(counter: Counter) -> Vec<String> {
    let world =
        Catalogue::new().role(role("length", "A length.")).device_type(Box::new(RulerType { is_silent: false }));
    lines(&world.node_type(Box::new(counter)))
}

fn lines(catalogue: &Catalogue) -> Vec<String> {
    let violations = lint(catalogue).counting(count).violations();
    violations.iter().map(|violation| violation.to_string().lines().next().unwrap().to_owned()).collect()
}

#[test]
fn a_node_that_keeps_the_rules_is_clean() {
    assert_eq!(said(Counter::new(How::Well)), [""; 0]);
}

#[test]
fn what_a_step_does_wrong_is_found() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let cases = [
        (How::Allocates, "`counter`: a step allocates (200 of 200 steps)"),
        (How::IsSilent, "`counter`: output `steps`: no step of its example writes it (200 steps)"),
        (How::LeavesItsRange, "`counter`: output `steps`: it is -1, and the node declares 0 to 1000"),
        (
            How::KeepsItsState,
            "`counter`: output `steps`: after a reset its value differs from that of a new node with the same inputs",
        ),
    ];
    for (how, expected) in cases {
        assert_eq!(said(Counter::new(how)), [expected], "{how:?}");
    }
    let panics = said(Counter::new(How::Panics));
    std::panic::set_hook(hook);
    assert!(panics[0].starts_with("`counter`: its example fails: node `counter` panicked: tired"), "{panics:?}");
}

#[test]
fn what_a_node_declares_wrong_is_found() {
    type Spoil = fn(&mut NodeSpec);
    let cases: [(Spoil, &str); 13] = [
        (|spec| spec.summary = "".into(), "`counter`: its summary has to be one line without a full stop"),
        (|spec| spec.summary = "It counts.".into(), "`counter`: its summary has to be one line without a full stop"),
        (|spec| spec.doc = " ".into(), "`counter`: it has no reference (`DOC`)"),
        (|spec| spec.inputs[0].doc = "".into(), "`counter`: input `value`: it has no doc"),
        (|spec| spec.outputs[0].doc = "".into(), "`counter`: output `steps`: it has no doc"),
        (|spec| spec.params[0].doc = String::new(), "`counter`: parameter `gain`: it has no doc"),
        (|spec| spec.params[0].unit = None, "`counter`: parameter `gain`: it has no unit"),
        (
            |spec| spec.params[0].fields = vec![param("Inner", "A number.", Some("1"))],
            "`counter`: parameter `gain.Inner`: a name is `snake_case`",
        ),
        (|spec| spec.outputs[0].name = "Steps".into(), "`counter`: output `Steps`: a name is `snake_case`"),
        (|spec| spec.params.push(spec.params[0].clone()), "`counter`: parameter `gain`: it is declared twice"),
        (
            |spec| spec.params[0].default = Some("-1.0".into()),
            "`counter`: parameter `gain`: its default -1.0 is not accepted:",
        ),
        (|spec| spec.example = "".into(), "`counter`: it has no example: `counter` has no example"),
        (
            |spec| spec.example = spec.example.replace("length.value", "length.valeu").into(),
            "`counter`: its example does not load:",
        ),
    ];
    for (spoil, expected) in cases {
        let mut counter = Counter::new(How::Well);
        spoil(&mut counter.spec);
        let said = said(counter);
        assert!(said.iter().any(|line| line == expected), "{expected}\n{said:?}");
        assert!(said.iter().all(|line| line.starts_with("`counter`") || line.starts_with("`ruler`")), "{said:?}");
    }
}

#[test]
fn all_violations_are_told_at_once_and_only_of_what_is_asked_for() {
    let mut counter = Counter::new(How::LeavesItsRange);
    counter.spec.doc = "".into();
    counter.spec.params[0].unit = None;
    let catalogue = Catalogue::new()
        .role(role("length", "A length."))
        .role(role("Other", ""))
        .device_type(Box::new(RulerType { is_silent: true }))
        .node_type(Box::new(counter));
    let said = lines(&catalogue);
    for expected in [
        "`counter`: it has no reference (`DOC`)",
        "`counter`: parameter `gain`: it has no unit",
        "`Other`: a name is `snake_case`",
        "`Other`: output `value`: it has no doc",
        "`ruler`: output `value`: the device never writes it in its example",
        // The ruler gives it nothing to count.
        "`counter`: output `steps`: no step of its example writes it (0 steps)",
    ] {
        assert!(said.iter().any(|line| line == expected), "{expected}\n{said:#?}");
    }
    let unknown = lint(&catalogue).only(&["Othre"]).violations();
    assert_eq!(unknown[0].to_string(), "`Othre`: the catalogue has no `Othre`: did you mean `Other`?");
    let only = lint(&catalogue).only(&["Other"]).violations();
    assert!(only.len() == 2 && only.iter().all(|violation| violation.owner == "Other"), "{only:?}");
}

#[test]
#[should_panic(expected = "2 violations:\n`Other`: ")]
fn the_report_of_an_assertion_has_a_line_for_each_violation() {
    lint(&Catalogue::new().role(role("Other", ""))).assert_clean();
}
