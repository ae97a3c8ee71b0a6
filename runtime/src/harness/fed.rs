//! A device whose samples come from a test.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::catalogue::Catalogue;
use crate::device::{Commands, Description, DeviceError, DeviceType, Driver, Opened, Samples, Stepped};
use crate::node::{ParamSpec, Reader};
use crate::signal::{JointsShape, Kind, ScalarShape, Shape, Unit};
use crate::source::Value;

/// A role that a test feeds.
#[derive(Debug, Clone)]
#[must_use]
pub struct FedRole {
    pub(super) name: String,
    kind: String,
    period: f64,
    pub(super) outputs: Vec<(String, Shape)>,
    commands: Vec<(String, JointsShape)>,
    facts: Vec<(String, toml::Value)>,
}

impl FedRole {
    /// Creates the role `name` of the type `kind`, with a nominal period of `period_ms`.
    ///
    /// Scalars, flags, twists and poses have no size, so only the other ports of the role need a shape.
    pub fn new(name: impl Into<String>, kind: impl Into<String>, period_ms: f64) -> Self {
        let (outputs, commands, facts) = (Vec::new(), Vec::new(), Vec::new());
        Self { name: name.into(), kind: kind.into(), period: period_ms * 1e-3, outputs, commands, facts }
    }

    /// Sets the shape of an output.
    pub fn output(mut self, name: impl Into<String>, shape: impl Into<Shape>) -> Self {
        self.outputs.push((name.into(), shape.into()));
        self
    }

    /// Sets the joints of a command.
    pub fn command(mut self, name: impl Into<String>, shape: JointsShape) -> Self {
        self.commands.push((name.into(), shape));
        self
    }

    /// States a fact that the graph uses, as in `{ from = "pad.threshold" }`.
    pub fn fact(mut self, name: impl Into<String>, value: impl Into<toml::Value>) -> Self {
        self.facts.push((name.into(), value.into()));
        self
    }

    /// Adds the outputs of the role that have no size.
    pub(super) fn complete(&mut self, catalogue: &Catalogue) {
        for port in catalogue.role_type(&self.kind).iter().flat_map(|role| &role.outputs) {
            let shape = match port.kind {
                Kind::Scalar => {
                    let unit = port.args.first().and_then(|unit| unit.parse().ok());
                    ScalarShape::of(unit.unwrap_or(Unit::default())).into()
                }
                Kind::Flag | Kind::Twist | Kind::Pose => port.kind.default_shape(),
                _ => continue,
            };
            if !self.outputs.iter().any(|(name, _)| *name == port.name) {
                self.outputs.push((port.name.to_string(), shape));
            }
        }
    }

    /// Type of the device that fills the role.
    pub(super) fn device_type(&self) -> String {
        format!("fed_{}", self.name)
    }
}

/// The next action of a fed device.
pub(super) type Event = Box<dyn FnOnce(&mut Samples) -> Result<(), DeviceError> + Send>;

/// The actions that a test has fed, each with its time [ns], in the order of the times.
pub(super) type Queue = Arc<Mutex<VecDeque<(i64, Event)>>>;

/// The device type behind a fed role.
pub(super) struct FedDevice {
    pub(super) role: FedRole,
    pub(super) queue: Queue,
}

impl DeviceType for FedDevice {
    fn name(&self) -> Cow<'static, str> {
        self.role.device_type().into()
    }

    fn summary(&self) -> Cow<'static, str> {
        "a role that a test feeds".into()
    }

    fn params(&self) -> Vec<ParamSpec> {
        Vec::new()
    }

    fn open(&self, _: &Value, _: &mut Reader<'_>) -> Option<Opened> {
        let mut description = Description::every(self.role.period);
        let mut fill = description.fills(self.role.kind.clone());
        for (name, shape) in &self.role.outputs {
            fill.output_of(name.clone(), shape.clone());
        }
        for (name, shape) in &self.role.commands {
            fill.command(name.clone(), shape.clone());
        }
        for (name, fact) in &self.role.facts {
            fill.fact(name.clone(), fact.clone());
        }
        Some(Opened { description, driver: Driver::Stepped(Box::new(FedDriver(Arc::clone(&self.queue)))) })
    }
}

struct FedDriver(Queue);

impl Stepped for FedDriver {
    /// Returns the time of the next action. Without one the device is silent, and has not ended.
    fn next(&self) -> Option<i64> {
        let queue = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        Some(queue.front().map_or(i64::MAX, |(at, _)| *at))
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        let mut queue = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        while let Some((_, event)) = queue.pop_front_if(|(at, _)| *at <= now) {
            event(samples)?;
        }
        Ok(())
    }
}
