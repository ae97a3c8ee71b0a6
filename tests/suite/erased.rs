//! The erased contract: a node that is known only at run time, from data, without the typed one.

use tactflow_runtime::harness::GraphRig;
use tactflow_runtime::node::{
    AnyNode, Built, Bus, Configured, Declared, Given, Mistake, Mistakes, Motion, NodeSpec, NodeType, Param, PortId,
    PortSpec, Reader, Reading, Tick, Wires,
};
use tactflow_runtime::signal::{Freshness, Kind, Scalar, Shape};
use tactflow_runtime::source::Value;
use tactflow_tests::catalogue;
use tactflow_tests::nodes::length_by_hand;

/// A polynomial whose name and coefficients come from somewhere at run time.
#[derive(Clone)]
struct Polynomial {
    name: String,
    coefficients: Vec<f64>,
    logs: bool,
}

impl NodeType for Polynomial {
    fn spec(&self) -> NodeSpec {
        let port = |name| PortSpec::new(name, "A length.", Kind::Scalar, &["m"]);
        NodeSpec {
            name: self.name.clone().into(),
            summary: "a polynomial".into(),
            doc: "".into(),
            example: "".into(),
            params: Vec::new(),
            inputs: vec![port("x")],
            outputs: vec![port("y")],
            every_tick: false,
            logs: self.logs,
            limits: tactflow_runtime::node::Limits::NONE,
        }
    }

    fn configure(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Box<dyn Configured>> {
        let mut open = reader.table(table, &["scale"])?;
        let scale = reader.field::<f64>(&mut open, &Declared::new("scale"), Some(|| 1.0));
        reader.close(open);
        let coefficients = self.coefficients.iter().map(|c| c * scale.unwrap_or(1.0)).collect();
        Some(Box::new(Self { coefficients, ..self.clone() }))
    }
}

impl Configured for Polynomial {
    fn build(self: Box<Self>, given: Given) -> Result<Built, Mistakes> {
        if self.coefficients.is_empty() {
            return Err(Mistake::param("scale", "there is nothing to scale").into());
        }
        let outputs: Vec<Shape> = vec![given.inputs[0][0].1.clone()];
        let (motion, warnings) = (Motion::Any, Mistakes::new());
        Ok(Built { node: self, outputs, motion, reading: Reading::Other, is_uncalibrated: false, warnings })
    }
}

impl AnyNode for Polynomial {
    fn step(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]) {
        let from = wires.port(0).expect("`x` is required");
        let x = *bus.slot::<Scalar>(from);
        let y = self.coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
        *bus.slot_mut::<Scalar>(outputs[0]) = y;
        bus.mark_mut(outputs[0]).renew(tick.index, tick.stamp);
    }

    fn lose(&mut self, tick: u64, bus: &mut Bus, outputs: &[PortId]) {
        bus.mark_mut(outputs[0]).lose(tick);
    }

    fn reset(&mut self) {}
}

fn rig(params: &str) -> Result<GraphRig, String> {
    let node = Polynomial { name: "poly_7".into(), coefficients: vec![1.0, 0.0, 2.0], logs: false };
    let text = format!(
        "[graph]\nclock = \"a\"\n[roles]\na = \"length\"\n[nodes.p]\ntype = \"poly_7\"\nin.x = \"a.value\"\n{params}"
    );
    let rig = GraphRig::new(catalogue().node_type(Box::new(node)), &text, vec![length_by_hand("a")]);
    rig.map_err(|report| report.render(false))
}

#[test]
fn a_node_made_of_data_runs_like_any_other() {
    let mut rig = rig("scale = 10.0").unwrap();
    rig.feed("a.value", 0.0, 3.0);
    rig.tick(0.0).unwrap();
    assert_eq!((rig.get::<Scalar>("p.y"), rig.freshness("p.y")), (Some(&190.0), Freshness::New));
    rig.tick(10.0).unwrap();
    assert_eq!((rig.freshness("p.y"), rig.age_ms("p.y")), (Freshness::Held, 10.0));
}

#[test]
fn its_mistakes_show_on_their_token_like_any_other() {
    let text = rig("scal = 10.0").err().unwrap();
    assert!(text.contains("graph.toml:8:1") && text.contains("did you mean `scale`?"), "{text}");
    assert_eq!(f64::EXPECTS, "a number");
}

#[test]
#[should_panic(expected = "`poly_8` logs, so its first output must be a flag")]
fn a_node_that_logs_says_when() {
    let node = Polynomial { name: "poly_8".into(), coefficients: vec![], logs: true };
    drop(catalogue().node_type(Box::new(node)));
}
