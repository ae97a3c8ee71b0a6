//! A catalogue in which one type of node fails on purpose: its nodes write NaN, or panic.

use std::any::Any;
use std::borrow::Cow;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::{DeviceType, Opened};
use tactflow_runtime::node::{
    AnyNode, Built, Bus, Components, Configured, Given, Mistakes, NodeSpec, NodeType, ParamSpec, PortId, Reader, Tick,
    Wires,
};
use tactflow_runtime::signal::{Features, Image, Jacobian, Joints, Kind, Pose, Scalar, Signal, Twist, VectorImage};
use tactflow_runtime::source::Value;

/// How the nodes fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum How {
    /// The first output that has numbers becomes NaN.
    Nan,
    /// The step panics.
    Panic,
}

/// Which nodes fail, how, and in which ticks.
#[derive(Debug, Clone)]
pub struct Sabotage {
    /// The node type.
    pub target: String,
    /// How.
    pub how: How,
    /// First tick of the failure.
    pub from: u64,
    /// First tick after the failure.
    pub to: u64,
}

/// Returns the shipped catalogue with one type of node that fails.
pub fn sabotaged(sabotage: &Sabotage) -> Catalogue {
    let sound: &'static Catalogue = Box::leak(Box::new(tactflow_nodes::catalogue()));
    let mut catalogue = Catalogue::new().files(sound.builtin_files());
    for role in sound.roles() {
        catalogue = catalogue.role(role.clone());
    }
    for device in sound.devices() {
        catalogue = catalogue.device_type(Box::new(Same(&**device)));
    }
    for node in sound.nodes() {
        let is_target = node.spec().name == sabotage.target;
        let sabotage = is_target.then(|| sabotage.clone());
        catalogue = catalogue.node_type(Box::new(Suspect { sound: &**node, sabotage }));
    }
    catalogue
}

struct Same(&'static dyn DeviceType);

impl DeviceType for Same {
    fn name(&self) -> Cow<'static, str> {
        self.0.name()
    }

    fn summary(&self) -> Cow<'static, str> {
        self.0.summary()
    }

    fn params(&self) -> Vec<ParamSpec> {
        self.0.params()
    }

    fn open(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Opened> {
        self.0.open(table, reader)
    }
}

struct Suspect {
    sound: &'static dyn NodeType,
    sabotage: Option<Sabotage>,
}

impl NodeType for Suspect {
    fn spec(&self) -> NodeSpec {
        self.sound.spec()
    }

    fn configure(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Box<dyn Configured>> {
        let sound = self.sound.configure(table, reader)?;
        let kinds = self.sound.spec().outputs.iter().map(|output| output.kind).collect();
        Some(match &self.sabotage {
            Some(sabotage) => Box::new(Armed { sound, sabotage: sabotage.clone(), kinds }),
            None => sound,
        })
    }
}

struct Armed {
    sound: Box<dyn Configured>,
    sabotage: Sabotage,
    kinds: Vec<Kind>,
}

impl Configured for Armed {
    fn build(self: Box<Self>, given: Given) -> Result<Built, Mistakes> {
        let built = self.sound.build(given)?;
        let node = Saboteur { sound: built.node, sabotage: self.sabotage, kinds: self.kinds };
        Ok(Built { node: Box::new(node), ..built })
    }
}

struct Saboteur {
    sound: Box<dyn AnyNode>,
    sabotage: Sabotage,
    kinds: Vec<Kind>,
}

impl AnyNode for Saboteur {
    fn step(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]) {
        let is_due = (self.sabotage.from..self.sabotage.to).contains(&tick.index);
        assert!(!(is_due && self.sabotage.how == How::Panic), "sabotage");
        self.sound.step(tick, bus, wires, outputs);
        if is_due {
            let there = self.kinds.iter().zip(outputs).filter(|(_, id)| bus.mark(**id).is_present());
            let there: Vec<(Kind, PortId)> = there.map(|(kind, id)| (*kind, *id)).collect();
            there.into_iter().any(|(kind, id)| spoil(bus, kind, id, tick));
        }
    }

    fn lose(&mut self, tick: u64, bus: &mut Bus, outputs: &[PortId]) {
        self.sound.lose(tick, bus, outputs);
    }

    fn reset(&mut self) {
        self.sound.reset();
    }

    fn adopt(&mut self, other: Box<dyn AnyNode>) -> Result<usize, Box<dyn AnyNode>> {
        let other = (other as Box<dyn Any>).downcast::<Self>().expect("all of the type are sabotaged");
        self.sound.adopt(other.sound)
    }

    fn switch(&mut self, configuration: usize) -> bool {
        self.sound.switch(configuration)
    }

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        self.sound.uses(wanted)
    }

    fn want(&mut self, wanted: &[Components]) -> bool {
        self.sound.want(wanted)
    }
}

/// Puts NaN into a value. Returns whether the value has numbers.
fn spoil(bus: &mut Bus, kind: Kind, id: PortId, tick: &Tick) -> bool {
    const NAN: f64 = f64::NAN;
    let (slot, arenas) = (id.slot as usize, &mut bus.arenas);
    match kind {
        Kind::Scalar => Scalar::arena_mut(arenas)[slot] = NAN,
        Kind::Features => Features::arena_mut(arenas)[slot].set(0, NAN, tick.index, tick.stamp),
        Kind::Image => Image::arena_mut(arenas)[slot].cells_mut()[0] = f32::NAN,
        Kind::VectorImage => VectorImage::arena_mut(arenas)[slot].cells_mut()[0][2] = f32::NAN,
        Kind::Twist => Twist::arena_mut(arenas)[slot].0[0] = NAN,
        Kind::Pose => Pose::arena_mut(arenas)[slot].0.translation.vector.x = NAN,
        Kind::Joints => Joints::arena_mut(arenas)[slot].0[0] = NAN,
        Kind::Jacobian => Jacobian::arena_mut(arenas)[slot].0[0].0[0] = NAN,
        Kind::Flag | Kind::Mask | Kind::Regions => return false,
    }
    true
}
