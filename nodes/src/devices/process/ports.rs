//! The ports of a program in the graph: its inputs are reports, and its outputs are samples.

use std::borrow::Cow;

use tactflow_runtime::device::{AnyReport, Commands, Description, Output, ReportAge, RoleType, Samples};
use tactflow_runtime::node::{Need, PortSpec};
use tactflow_runtime::signal::{Features, Flag, FlagShape, Image, Kind, Scalar, ScalarShape};

use super::signature::{OutputShape, PortText, Signature};
use super::wire::{Question, Value};

/// The ports of a program.
#[derive(Debug, Clone)]
pub(super) struct Ports {
    inputs: Vec<AnyReport>,
    outputs: Vec<AnyOutput>,
    /// How often each input was new when the last question was made.
    seen: Vec<u64>,
    /// Stamp of the last question [ns].
    last: Option<i64>,
    /// Number of the last question.
    number: u64,
    /// The newest question that there could have been, in new values of its inputs.
    skipped: u64,
}

#[derive(Debug, Clone)]
enum AnyOutput {
    Scalar(Output<Scalar>),
    Flag(Output<Flag>),
    Features(Output<Features>),
    Image(Output<Image>),
}

/// Returns the type of the role that a program fills.
pub(super) fn role(signature: &Signature) -> RoleType {
    let input = |(i, port): (usize, &PortText)| {
        let kind = port.input().expect("a signature is checked when it is read");
        // The frame of each input is its own.
        let frame = char::from(b'A' + (i % 26) as u8).to_string();
        spec(port, kind, port.unit.clone().unwrap_or_else(|| "_".to_owned()), frame)
    };
    let output = |port: &PortText| {
        let (kind, unit) = match port.output().expect("a signature is checked when it is read") {
            OutputShape::Scalar(unit) => (Kind::Scalar, unit.to_string()),
            OutputShape::Flag => (Kind::Flag, String::new()),
            OutputShape::Features(_) => (Kind::Features, "_".to_owned()),
            OutputShape::Image(shape) => (Kind::Image, shape.unit.to_string()),
        };
        // Outputs are in the frame of the first input.
        spec(port, kind, unit, "A".to_owned())
    };
    RoleType {
        name: signature.name.clone().into(),
        summary: signature.doc.lines().next().unwrap_or_default().to_owned().into(),
        outputs: signature.outputs.iter().map(output).collect(),
        reports: signature.inputs.iter().enumerate().map(input).collect(),
        ..RoleType::default()
    }
}

fn spec(port: &PortText, kind: Kind, unit: String, frame: String) -> PortSpec {
    let args = kind.arguments().iter().map(|argument| match *argument {
        "unit" => Cow::Owned(unit.clone()),
        _ => Cow::Owned(frame.clone()),
    });
    let args = args.collect();
    PortSpec {
        name: port.name.clone().into(),
        doc: port.doc.clone().into(),
        kind,
        args,
        quantity: None,
        need: Need::REQUIRED,
    }
}

impl Ports {
    /// States the ports of a program.
    pub(super) fn state(description: &mut Description, signature: &Signature) -> Self {
        let mut role = description.fills(signature.name.clone());
        let outputs = signature.outputs.iter().map(|port| {
            let name = port.name.clone();
            match port.output().expect("a signature is checked when it is read") {
                OutputShape::Scalar(unit) => AnyOutput::Scalar(role.output(name, ScalarShape::of(unit))),
                OutputShape::Flag => AnyOutput::Flag(role.output(name, FlagShape)),
                OutputShape::Features(shape) => AnyOutput::Features(role.output(name, shape)),
                OutputShape::Image(shape) => AnyOutput::Image(role.output(name, shape)),
            }
        });
        let outputs = outputs.collect();
        let kind = |port: &PortText| port.input().expect("a signature is checked when it is read");
        let inputs = signature.inputs.iter().map(|port| role.report_of(port.name.clone(), kind(port)));
        let inputs: Vec<AnyReport> = inputs.collect();
        Self { seen: vec![0; inputs.len()], inputs, outputs, last: None, number: 0, skipped: 0 }
    }

    /// Returns the shapes of what is wired to the inputs, for the program.
    pub(super) fn shapes(&self, commands: &Commands, signature: &Signature) -> Vec<serde_json::Value> {
        let inputs = self.inputs.iter().zip(&signature.inputs);
        let shape = |(report, port): (&AnyReport, &PortText)| {
            let shape = commands.report_shape(*report);
            // The shape of a recording is a table with its kind as the only key.
            let tagged = serde_json::to_value(shape).unwrap_or_default();
            let inner = tagged.as_object().and_then(|tagged| tagged.values().next()).cloned().unwrap_or_default();
            serde_json::json!({ "name": port.name, "kind": shape.kind().name(), "shape": inner })
        };
        inputs.map(shape).collect()
    }

    /// Returns the next question if an input is new: all inputs, with the oldest stamp of those that are new. `now` is
    /// the stamp of values that were computed from no sample [ns].
    pub(super) fn question(&mut self, commands: &Commands, now: i64) -> Option<Question> {
        let ages: Vec<ReportAge> = self.inputs.iter().map(|input| commands.report_age(*input)).collect();
        let new = ages.iter().zip(&self.seen).filter(|(age, seen)| age.is_present && age.count != **seen);
        let stamp = new.map(|(age, _)| if age.stamp == i64::MAX { now } else { age.stamp }).min()?;
        if self.last.is_some_and(|last| stamp <= last) {
            return None;
        }
        let news = ages.iter().zip(&self.seen).map(|(age, seen)| age.count - seen).max().unwrap_or(1);
        self.skipped = if self.number == 0 { 0 } else { news.saturating_sub(1) };
        self.number += 1;
        self.last = Some(stamp);
        let mut question = Question::new(self.number, stamp);
        for ((input, age), seen) in self.inputs.iter().zip(&ages).zip(&mut self.seen) {
            let is_new = age.count != std::mem::replace(seen, age.count);
            question.input(*age, is_new, |bytes| commands.report_bytes(*input, bytes));
        }
        Some(question)
    }

    /// Returns how many values came and went between the last two questions.
    pub(super) fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Writes an answer as samples of the time of its question.
    pub(super) fn write(&self, values: &[Value], stamp: i64, number: u64, samples: &mut Samples) {
        for (output, value) in self.outputs.iter().zip(values) {
            match (output, value) {
                (AnyOutput::Scalar(port), Value::Scalar(value)) => *samples.write(*port, stamp, number) = *value,
                (AnyOutput::Flag(port), Value::Flag(value)) => *samples.write(*port, stamp, number) = *value,
                (AnyOutput::Features(port), Value::Features(values)) => {
                    samples.write(*port, stamp, number).fill(values);
                }
                (AnyOutput::Image(port), Value::Image(cells)) => {
                    samples.write(*port, stamp, number).cells_mut().copy_from_slice(cells);
                }
                (AnyOutput::Scalar(port), _) => samples.clear(*port, stamp, number),
                (AnyOutput::Flag(port), _) => samples.clear(*port, stamp, number),
                (AnyOutput::Features(port), _) => samples.clear(*port, stamp, number),
                (AnyOutput::Image(port), _) => samples.clear(*port, stamp, number),
            }
        }
    }
}
