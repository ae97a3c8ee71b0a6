//! A live device that the doctor watches.

use std::io;

use tactflow_runtime::device::{Attached, Description, DeviceError, Live, Output};
use tactflow_runtime::signal::{Features, Flag, Image, Joints, Kind, Shape};

use super::arm::Posture;
use super::pad::Noise;
use super::timing::Timing;
use super::{Finding, clock};

/// A live device, and what was seen of each of its outputs.
pub(super) struct Patient {
    title: String,
    attached: Attached,
    ports: Vec<Port>,
    /// Whether the driver had ended before it was stopped.
    has_ended: bool,
}

struct Port {
    /// The side of the device, if it has several.
    side: Option<String>,
    name: String,
    kind: Kind,
    timing: Timing,
    writes: u64,
    lost: Option<String>,
    content: Content,
}

/// What the values of a port show.
enum Content {
    Noise(Output<Image>, Noise),
    Posture(Output<Joints>, Posture),
    /// The newest value.
    Flag(Output<Flag>, Option<bool>),
    /// The names of the components, and the newest value as text.
    Features(Output<Features>, Vec<String>, Option<String>),
    Other,
}

impl Patient {
    /// Starts the driver of a device.
    pub(super) fn admit(
        title: String,
        name: &str,
        description: Description,
        driver: Box<dyn Live>,
    ) -> io::Result<Self> {
        let attached = Attached::listen(name, description, driver)?;
        let description = attached.description();
        let outputs = description.outputs().zip(description.output_sides());
        let ports = outputs.map(|((name, shape), side)| Port {
            side: side.map(str::to_owned),
            name: name.to_owned(),
            kind: shape.kind(),
            timing: Timing::default(),
            writes: 0,
            lost: None,
            content: Content::of(description, side, name, shape).unwrap_or(Content::Other),
        });
        let ports = ports.collect();
        Ok(Self { title, attached, ports, has_ended: false })
    }

    /// Receives what has arrived.
    pub(super) fn look(&mut self) {
        self.attached.receive();
        self.has_ended |= self.attached.has_ended();
        for (place, port) in self.ports.iter_mut().enumerate() {
            if let Some(why) = self.attached.lost_at(place) {
                port.lost = Some(why.to_owned());
            }
            let (stamp, writes) = self.attached.stamp_at(place);
            if writes > port.writes {
                port.writes = writes;
                port.timing.add(stamp as f64 * 1e-9, writes, self.attached.now() as f64 * 1e-9);
                port.content.add(&self.attached);
            }
        }
    }

    pub(super) fn title(&self) -> &str {
        &self.title
    }

    /// Returns what was found in `watched` seconds.
    pub(super) fn findings(&self, watched: f64) -> Vec<Finding> {
        let mut findings = Vec::new();
        let description = self.attached.description();
        // Ports of one side arrive together.
        for port in self.ports.iter().filter(|port| self.is_first(port, |_| true)) {
            findings.extend(port.timing.describe(&port.label(), description.period, watched));
        }
        if let Some(first) = self.ports.first().filter(|port| port.writes > 0) {
            findings.extend(clock::describe(self.attached.clock(), description.latency, first.timing.median_age()));
        }
        for port in &self.ports {
            let name = port.label();
            // The ports of a device are usually lost together.
            let is_known = |why: &str| findings.iter().any(|finding| finding.text.ends_with(why));
            let news = port.lost.as_ref().filter(|why| !is_known(why));
            findings.extend(news.map(|why| Finding::problem(format!("{name} was lost: {why}"))));
            // Another posture of the same joints has the same names and ranges.
            if port.kind != Kind::Joints || self.is_first(port, |other| other.kind == port.kind) {
                findings.extend(port.content.describe(&name));
            }
        }
        findings.extend(self.attached.counts().iter().map(|(what, count)| Finding::fine(format!("{count} {what}"))));
        if let Some(silence) = &description.on_silence {
            let proof = if description.needs_commissioning { "; this is declared and not measured" } else { "" };
            findings.push(Finding::fine(format!("without commands: {silence}{proof}")));
        }
        findings.extend(self.readiness());
        findings
    }

    /// Says whether an arm would move.
    fn readiness(&self) -> Option<Finding> {
        let is_lost = self.ports.iter().any(|port| port.lost.is_some());
        if let Some(why) = self.attached.refusal().filter(|_| !is_lost) {
            return Some(Finding::problem(format!("it would not move: {why}")));
        }
        let waits = |port: &Port| port.name == "safety" && matches!(port.content, Content::Flag(_, Some(false)));
        let text =
            "it waits for its controller, which does not follow commands yet: this is usual, as nothing is sent to it";
        self.ports.iter().any(waits).then(|| Finding::fine(text))
    }

    /// Whether a port is the first one of its side among those that `is_alike`.
    fn is_first(&self, port: &Port, is_alike: impl Fn(&Port) -> bool) -> bool {
        let first = self.ports.iter().find(|other| other.side == port.side && is_alike(other));
        first.is_some_and(|first| std::ptr::eq(first, port))
    }

    /// Stops the driver.
    ///
    /// # Errors
    /// Why it failed, or that it had ended before.
    pub(super) fn stop(self) -> Result<(), DeviceError> {
        self.attached.stop("the examination is over")?;
        if self.has_ended { Err("it ended by itself".into()) } else { Ok(()) }
    }
}

impl Port {
    /// Returns the name of the port, with its side if there are several.
    fn label(&self) -> String {
        self.side.as_ref().map_or_else(|| self.name.clone(), |side| format!("{side}.{}", self.name))
    }
}

impl Content {
    /// Returns what to watch of an output, or `None` if its values are not watched.
    fn of(description: &Description, side: Option<&str>, name: &str, shape: &Shape) -> Option<Self> {
        Some(match shape {
            Shape::Image(shape) => Self::Noise(description.output_on(side, name)?, Noise::new(shape.clone())),
            Shape::Joints(shape) => Self::Posture(description.output_on(side, name)?, Posture::new(shape)),
            Shape::Flag(_) => Self::Flag(description.output_on(side, name)?, None),
            Shape::Features(shape) => {
                let names = shape.names().map(str::to_owned).collect();
                Self::Features(description.output_on(side, name)?, names, None)
            }
            _ => return None,
        })
    }

    /// Adds the newest value.
    fn add(&mut self, attached: &Attached) {
        match self {
            Self::Noise(port, noise) => attached.read(*port).into_iter().for_each(|image| noise.add(image)),
            Self::Posture(port, posture) => attached.read(*port).into_iter().for_each(|joints| posture.add(joints)),
            Self::Flag(port, value) => *value = attached.read(*port).copied(),
            Self::Features(port, names, text) => *text = attached.read(*port).map(|value| numbers(names, value)),
            Self::Other => {}
        }
    }

    /// Describes the values of the port `name`.
    fn describe(&self, name: &str) -> Vec<Finding> {
        match self {
            Self::Noise(_, noise) => noise.describe(name),
            Self::Posture(_, posture) => posture.describe(name),
            Self::Flag(_, Some(value)) => vec![Finding::fine(format!("{name}: {value}"))],
            Self::Features(_, _, Some(text)) => vec![Finding::fine(format!("{name}: {text}"))],
            Self::Flag(_, None) | Self::Features(_, _, None) | Self::Other => Vec::new(),
        }
    }
}

/// Writes the components with their names.
fn numbers(names: &[String], features: &Features) -> String {
    let number = |value: Option<f64>| value.map_or_else(|| "-".into(), |value| format!("{value:.3}"));
    let components = names.iter().zip(features.values()).map(|(name, value)| format!("{name} {}", number(value)));
    components.collect::<Vec<_>>().join(", ")
}
