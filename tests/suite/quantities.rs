//! Quantities that no shipped port has: the runtime knows their rules and none of their names.

use std::path::Path;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::RoleType;
use tactflow_runtime::harness::{FedRole, GraphRig};
use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, PortSpec, Setup, Tick};
use tactflow_runtime::signal::{Kind, Scalar};

use crate::tidy::{code, sources};

/// Measures how far a contact slips.
///
/// ```toml
/// [nodes.slip_meter]
/// type = "slip_meter"
/// in.slip = "skin.slip"
/// in.other = "skin.creep"
/// ```
#[derive(Describe)]
struct SlipMeter;

/// What `slip_meter` reads.
#[derive(Inputs)]
struct Inputs<'a> {
    /// The slip, and nothing that is not known to be one.
    #[port(unit = "m", frame = "A", quantity = "slip", known)]
    slip: In<'a, Scalar>,
    /// Creep, or a value whose quantity nobody knows.
    #[port(unit = "m", frame = "A", quantity = "creep", optional)]
    other: Option<In<'a, Scalar>>,
}

/// What `slip_meter` writes.
#[derive(Outputs)]
struct Outputs {
    /// The slip.
    #[port(unit = "m", frame = "A", quantity = "slip")]
    value: Out<Scalar>,
}

impl Node for SlipMeter {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new((): (), _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.value.set(*inputs.slip + inputs.other.map_or(0.0, |other| 0.0 * *other));
    }
}

fn catalogue() -> Catalogue {
    let port = |name| PortSpec::new(name, "A length.", Kind::Scalar, &["m", "self"]);
    let outputs = vec![
        port("slip").of_quantity("slip"),
        port("creep").of_quantity("creep"),
        port("anything"),
        PortSpec::new("open", "A flag.", Kind::Flag, &[]),
    ];
    let skin = RoleType { name: "skin".into(), summary: "a skin".into(), outputs, ..RoleType::default() };
    tactflow_tests::catalogue().role(skin).node::<SlipMeter>()
}

/// Returns the codes of the mistakes in a graph with that block and these wires of the meter.
fn codes(blocks: &str, wires: &str) -> Vec<&'static str> {
    let graph = format!(
        "[graph]\nrate_hz = 100\n[roles]\nskin = \"skin\"\n{blocks}\n[nodes.meter]\ntype = \"slip_meter\"\n{wires}\n\
         [nodes.seen]\ntype = \"probe\"\nin.value = \"meter.value\""
    );
    match GraphRig::new(catalogue(), &graph, [FedRole::new("skin", "skin", 10.0)]) {
        Ok(_) => Vec::new(),
        Err(report) => report.diagnostics.iter().map(|diagnostic| diagnostic.code.name()).collect(),
    }
}

#[test]
fn a_quantity_is_known_passed_on_or_refused() {
    let gate =
        |source: &str| format!("[nodes.pass]\ntype = \"gate\"\nin.value = \"{source}\"\nin.gate = \"skin.open\"");
    let delay = |source: &str| {
        let gate = gate(source).replace("nodes.pass", "nodes.gate");
        format!("{gate}\n[nodes.pass]\ntype = \"delay\"\nin.value = \"gate.value\"\nunit = \"m\"")
    };
    let switch = |on: &str, off: &str| {
        format!("[nodes.pass]\ntype = \"switch\"\nin.on = \"{on}\"\nin.off = \"{off}\"\nin.select = \"skin.open\"")
    };
    let refused = vec!["quantity-mismatch"];
    let cases = [
        (String::new(), "in.slip = \"skin.slip\"", vec![]),
        (String::new(), "in.slip = \"skin.creep\"", refused.clone()),
        (String::new(), "in.slip = \"skin.anything\"", refused.clone()),
        (String::new(), "in.slip = \"skin.slip\"\nin.other = \"skin.creep\"", vec![]),
        (String::new(), "in.slip = \"skin.slip\"\nin.other = \"skin.anything\"", vec![]),
        (String::new(), "in.slip = \"skin.slip\"\nin.other = \"skin.slip\"", refused.clone()),
        (gate("skin.slip"), "in.slip = \"pass.value\"", vec![]),
        (gate("skin.anything"), "in.slip = \"pass.value\"", refused.clone()),
        (gate("skin.creep"), "in.slip = \"pass.value\"", refused.clone()),
        (delay("skin.slip"), "in.slip = \"pass.value\"", vec![]),
        (delay("skin.anything"), "in.slip = \"pass.value\"", refused.clone()),
        (switch("skin.slip", "skin.slip"), "in.slip = \"pass.value\"", vec![]),
        (switch("skin.slip", "skin.anything"), "in.slip = \"pass.value\"", refused.clone()),
        (switch("skin.slip", "skin.creep"), "in.slip = \"pass.value\"", refused),
    ];
    for (blocks, wires, expected) in cases {
        assert_eq!(codes(&blocks, wires), expected, "{blocks}\n{wires}");
    }
}

#[test]
fn the_runtime_contains_no_name_of_a_quantity() {
    let sources = sources(&["runtime/src"]);
    // The schemas of Foxglove have words of their own.
    let is_own = |path: &Path| !path.ends_with("tests.rs") && !path.ends_with("recording/schema.rs");
    let sources = sources.iter().filter(|(path, _)| is_own(path));
    let sources: String = sources.map(|(_, text)| code(text)).collect();
    let catalogue = tactflow_nodes::catalogue();
    let roles = catalogue.roles().iter().flat_map(|role| &role.outputs);
    let nodes = catalogue.specs().flat_map(|spec| spec.inputs.iter().chain(&spec.outputs));
    let names = roles.chain(nodes).filter_map(|port| port.quantity.as_deref());
    // The axes are also coordinates, which the runtime names.
    for name in names.filter(|name| name.starts_with(|c: char| c.is_ascii_lowercase()) && name.len() > 1) {
        assert!(!sources.contains(&format!("\"{name}\"")), "the runtime knows the quantity `{name}`");
    }
}
