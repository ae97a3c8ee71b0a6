//! A live device that the doctor watches.

use std::io;

use tactflow_runtime::device::{Attached, Description, Live};
use tactflow_runtime::signal::{Features, Flag, Image, Joints, Kind, Shape};

use super::Finding;
use super::arm::Posture;
use super::pad::Noise;
use super::timing::Timing;

/// A live device, and what was seen of each of its outputs.
pub(super) struct Patient {
    title: String,
    attached: Attached,
    ports: Vec<Port>,
    /// Whether the driver had ended before it was stopped.
    has_ended: bool,
}

struct Port {
    name: String,
    kind: Kind,
    /// The names of the components of a vector of features.
    parts: Vec<String>,
    timing: Timing,
    writes: u64,
    lost: Option<String>,
    content: Content,
}

/// What the values of a port tell.
enum Content {
    Noise(Noise),
    Posture(Posture),
    /// The newest value as text.
    Text(String),
    Nothing,
}

impl Patient {
    /// Starts the driver of a device.
    pub(super) fn admit(
        title: String,
        name: &str,
        description: Description,
        driver: Box<dyn Live>,
    ) -> io::Result<Self> {
        let mut attached = Attached::start(name, description, driver)?;
        // An arm is only listened to.
        attached.mute(true);
        attached.rest();
        let port = |(name, shape): (&str, &Shape)| Port {
            name: name.to_owned(),
            kind: shape.kind(),
            parts: match shape {
                Shape::Features(shape) => shape.names().map(str::to_owned).collect(),
                _ => Vec::new(),
            },
            timing: Timing::default(),
            writes: 0,
            lost: None,
            content: match shape {
                Shape::Image(shape) => Content::Noise(Noise::new(shape.clone())),
                Shape::Joints(shape) => Content::Posture(Posture::new(shape)),
                _ => Content::Nothing,
            },
        };
        let ports = attached.description().outputs().map(port).collect();
        Ok(Self { title, attached, ports, has_ended: false })
    }

    /// Receives what has arrived.
    pub(super) fn look(&mut self) {
        self.attached.receive();
        self.has_ended |= self.attached.has_ended();
        for port in &mut self.ports {
            if let Some(why) = self.attached.lost(&port.name) {
                port.lost = Some(why.to_owned());
            }
            let (stamp, writes) = self.attached.stamp(&port.name);
            if writes > port.writes {
                port.writes = writes;
                port.timing.add(stamp as f64 * 1e-9, writes, self.attached.now() as f64 * 1e-9);
                port.add(&self.attached);
            }
        }
    }

    /// Stops the driver. Returns the title and what was found in `watched` seconds.
    pub(super) fn discharge(self, watched: f64) -> (String, Vec<Finding>) {
        let mut findings = Vec::new();
        let description = self.attached.description();
        let period = description.period;
        // Ports of one device arrive together.
        if let Some(port) = self.ports.first() {
            findings.extend(port.timing.describe(&port.name, period, watched));
        }
        for port in &self.ports {
            findings.extend(port.lost.iter().map(|why| Finding::problem(format!("{} was lost: {why}", port.name))));
            // Another posture of the same joints has the same names and ranges.
            let is_first =
                self.ports.iter().find(|other| other.kind == port.kind).is_some_and(|first| first.name == port.name);
            if is_first || port.kind != Kind::Joints {
                findings.extend(port.describe());
            }
        }
        findings.extend(self.attached.counts().iter().map(|(what, count)| Finding::fine(format!("{count} {what}"))));
        if let Some(silence) = &description.on_silence {
            let proof = if description.needs_commissioning { "; this is declared and not measured" } else { "" };
            findings.push(Finding::fine(format!("without commands: {silence}{proof}")));
        }
        findings
            .extend(self.attached.refusal().map(|why| Finding::problem(format!("it does not follow commands: {why}"))));
        findings.extend(self.attached.refusal().map(|why| Finding::problem(format!("it would not move: {why}"))));
        let has_ended = self.has_ended;
        match self.attached.stop("the examination is over") {
            Err(error) => findings.push(Finding::problem(error.to_string())),
            Ok(()) if has_ended => findings.push(Finding::problem("it ended by itself")),
            Ok(()) => {}
        }
        (self.title, findings)
    }
}

impl Port {
    /// Adds the newest value.
    fn add(&mut self, attached: &Attached) {
        let name = self.name.as_str();
        match (&mut self.content, self.kind) {
            (Content::Noise(noise), _) => attached.get::<Image>(name).into_iter().for_each(|image| noise.add(image)),
            (Content::Posture(posture), _) => {
                attached.get::<Joints>(name).into_iter().for_each(|joints| posture.add(joints));
            }
            (text, Kind::Flag) => {
                let value = attached.get::<Flag>(name);
                *text = value.map_or(Content::Nothing, |value| Content::Text(value.to_string()));
            }
            (text, Kind::Features) => {
                let features = attached.get::<Features>(name);
                *text = features.map_or(Content::Nothing, |value| Content::Text(numbers(&self.parts, value)));
            }
            _ => {}
        }
    }

    fn describe(&self) -> Vec<Finding> {
        match &self.content {
            Content::Noise(noise) => noise.describe(),
            Content::Posture(posture) => posture.describe(&self.name),
            Content::Text(text) => vec![Finding::fine(format!("{}: {text}", self.name))],
            Content::Nothing => Vec::new(),
        }
    }
}

/// Writes the components with their names.
fn numbers(names: &[String], features: &Features) -> String {
    let number = |value: Option<f64>| value.map_or_else(|| "-".into(), |value| format!("{value:.3}"));
    let components = names.iter().zip(features.values()).map(|(name, value)| format!("{name} {}", number(value)));
    components.collect::<Vec<_>>().join(", ")
}
