//! Recordings: every format, and what is packed.

use tactflow_nodes::recordings::{Recording, Refusal, read};

use super::Subject;
use crate::samples::{Sample, inflated, samples};

/// Frames of a good recording.
const FRAMES: usize = 3;
/// What reading may take beside ten times the file: what is looked at first, decoded [bytes].
const BESIDE: u64 = 1 << 19;

/// The samples of a format that are not packed.
pub(super) fn plain(format: &'static str) -> Subject {
    let samples = samples(FRAMES).into_iter();
    subject(samples.filter(|sample| sample.format == format && !is_packed(sample)).collect())
}

/// The samples in archives.
pub(super) fn archives() -> Subject {
    subject(samples(FRAMES).into_iter().filter(is_packed).collect())
}

fn is_packed(sample: &Sample) -> bool {
    sample.name.ends_with(".zip") || sample.name.ends_with(".gz")
}

/// The first byte of an input selects the name of the file and the hints; the rest is the file.
fn subject(samples: Vec<Sample>) -> Subject {
    let input = |(i, sample): (usize, &Sample)| [&[i as u8], &*sample.bytes].concat();
    Subject {
        corpus: samples.iter().enumerate().map(input).collect(),
        read: Box::new(move |input| {
            let (first, file) = input.split_first().unwrap_or((&0, &[]));
            let Sample { name, hints, .. } = &samples[usize::from(*first) % samples.len()];
            reason(read(file, name, hints), name).is_none()
        }),
        max_memory: |input| 10 * input.len().max(inflated(input.get(1..).unwrap_or_default())) as u64 + BESIDE,
    }
}

/// Returns why a file was refused; `None` for a recording, which must be sound.
///
/// # Panics
/// If the reader breaks a promise.
#[must_use]
pub fn reason(outcome: Result<Recording, Refusal>, name: &str) -> Option<String> {
    let said = match outcome {
        Ok(recording) => {
            assert!(recording.is_sound(), "{name}: {:?}", recording.shape);
            return None;
        }
        Err(Refusal::Stranger) => return Some("stranger".into()),
        Err(Refusal::Damaged { text, flaws }) => {
            assert!(!flaws.is_empty(), "{name} is refused for no reason");
            for flaw in &flaws {
                assert!(text.get(flaw.span.clone()).is_some(), "{name}: {flaw:?} is not in the text");
                assert!(!flaw.message.trim().is_empty(), "{name}: {flaw:?}");
            }
            flaws[0].message.clone()
        }
        Err(Refusal::Broken { message, .. } | Refusal::Silent { message, .. }) => message,
        Err(Refusal::Contradicted { hint, message }) => format!("{hint}: {message}"),
    };
    assert!(!said.trim().is_empty() && said.len() < 2000, "{name}: {said}");
    Some(said)
}
