//! The ports of a program in the graph: its inputs are reports, and its outputs are samples.

use std::borrow::Cow;

use tactflow_runtime::device::{AnyReport, Commands, Description, Output, ReportAge, RoleType, Samples};
use tactflow_runtime::node::{Need, PortSpec};
use tactflow_runtime::signal::{Features, Flag, FlagShape, Image, Kind, Scalar, ScalarShape, VectorImage};

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
    VectorImage(Output<VectorImage>),
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
            OutputShape::VectorImage(shape) => (Kind::VectorImage, shape.0.unit.to_string()),
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
                OutputShape::VectorImage(shape) => AnyOutput::VectorImage(role.output(name, shape)),
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

    /// Returns the next question, with all inputs, if there is one. `now` is the stamp of values that were computed from
    /// no sample [ns].
    pub(super) fn question(&mut self, commands: &Commands, now: i64) -> Option<Question> {
        let ages: Vec<ReportAge> = self.inputs.iter().map(|input| commands.report_age(*input)).collect();
        let stamp = next_stamp(&ages, &self.seen, self.last, now)?;
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
                (AnyOutput::VectorImage(port), Value::VectorImage(cells)) => {
                    samples.write(*port, stamp, number).cells_mut().copy_from_slice(cells);
                }
                (AnyOutput::Scalar(port), _) => samples.clear(*port, stamp, number),
                (AnyOutput::Flag(port), _) => samples.clear(*port, stamp, number),
                (AnyOutput::Features(port), _) => samples.clear(*port, stamp, number),
                (AnyOutput::Image(port), _) => samples.clear(*port, stamp, number),
                (AnyOutput::VectorImage(port), _) => samples.clear(*port, stamp, number),
            }
        }
    }
}

/// Returns the stamp of the next question: the oldest of the new inputs that are later than the last question. An input
/// with a long latency may be older than that. It is new in the question, and neither delays it nor makes it older than
/// the last one.
fn next_stamp(ages: &[ReportAge], seen: &[u64], last: Option<i64>, now: i64) -> Option<i64> {
    let new = ages.iter().zip(seen).filter(|(age, seen)| age.is_present && age.count != **seen);
    let stamps = new.map(|(age, _)| if age.stamp == i64::MAX { now } else { age.stamp });
    stamps.filter(|stamp| last.is_none_or(|last| *stamp > last)).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// The newest value at a time, of an input with a period and a latency [ms].
    fn newest(now: i64, [period, latency]: [i64; 2]) -> ReportAge {
        let number = (now / MS - latency).div_euclid(period);
        ReportAge { is_present: number >= 0, stamp: number * period * MS, count: (number + 1).max(0) as u64 }
    }

    /// How many questions there are in 4 s of ticks at 250 Hz, and how many values of each input are new in them.
    fn asked(inputs: [[i64; 2]; 2]) -> (usize, [usize; 2]) {
        let (mut seen, mut last, mut questions, mut new) = ([0; 2], None, 0, [0; 2]);
        for tick in 0..1000 {
            let now = 4 * tick * MS;
            let ages = inputs.map(|input| newest(now, input));
            let Some(stamp) = next_stamp(&ages, &seen, last, now) else { continue };
            assert!(last.is_none_or(|last| stamp > last), "answers are in the order of their stamps");
            questions += 1;
            last = Some(stamp);
            for i in 0..2 {
                new[i] += usize::from(ages[i].count != std::mem::replace(&mut seen[i], ages[i].count));
            }
        }
        (questions, new)
    }

    #[test]
    fn an_input_with_a_long_latency_delays_no_question() {
        assert_eq!(asked([[4, 0], [4, 0]]), (1000, [1000, 1000]));
        // A pad without latency beside a camera at 30 Hz with 50 ms, in either order.
        assert_eq!(asked([[4, 0], [33, 50]]), (1000, [1000, 120]));
        assert_eq!(asked([[33, 50], [4, 0]]), (1000, [120, 1000]));
        // Two slow ones: a question for each value that is later than the last question.
        let (questions, new) = asked([[20, 0], [20, 13]]);
        assert!((200..=400).contains(&questions) && new[0] == 200 && new[1] >= 199, "{questions} {new:?}");
    }

    #[test]
    fn a_value_of_no_sample_has_the_time_of_the_question() {
        let timeless = ReportAge { is_present: true, stamp: i64::MAX, count: 1 };
        assert_eq!(next_stamp(&[timeless], &[0], None, 7), Some(7));
        assert_eq!(next_stamp(&[timeless], &[0], Some(7), 7), None);
        assert_eq!(next_stamp(&[timeless], &[1], None, 7), None);
    }
}
