//! `mcap`: a recording of a whole run, as `run --record` writes it: the images of one pad.
//!
//! The images are those that the pad sent, with the times of its samples. A graph with several pads has several roles
//! with images: the bench selects one with `pad`. The port that the hint `force` names is the reference force of a
//! calibration.

use tactflow_runtime::recording::{PadError, RecordedPad};
use tactflow_runtime::source::quoted;

use super::common::reel::bounded;
use super::common::{FileFormat, Frame, Hints, Parser, Recording, Refusal, Window};

/// The first bytes of a file.
const MAGIC: &[u8] = b"\x89MCAP0\r\n";

pub(super) const FORMAT: FileFormat = FileFormat {
    name: "mcap",
    title: "a recording of a whole run (`run --record`, `.mcap`)",
    recognises: |head| head.bytes.starts_with(MAGIC),
    parser: Parser::Bytes(read),
};

fn read(bytes: &[u8], hints: &Hints) -> Result<Recording, Refusal> {
    let pad = RecordedPad::read(bytes, hints.pad.as_deref(), hints.force.as_deref()).map_err(refusal)?;
    let [rows, cols] = hints.size(Some([pad.shape.rows, pad.shape.cols]))?;
    bounded(rows, cols).map_err(Refusal::broken)?;
    let Some(((start, _), [.., (end, _)])) = pad.images.split_first() else {
        return Err(Refusal::broken(format!(
            "it has {} images of the pad, but a recording needs two",
            pad.images.len()
        )));
    };
    let duration = end.checked_sub(*start).filter(|_| pad.images.is_sorted_by(|a, b| a.0 < b.0));
    let duration = duration.ok_or_else(|| Refusal::broken("the times of its images go back"))?;
    let period = duration as f64 * 1e-9 / (pad.images.len() - 1) as f64;
    let (unit, pitch, period) = hints.complete(Some(pad.shape.unit), Some(pad.shape.pitch), Some(period))?;
    let dead = dead(&pad.facts, [rows, cols]);
    let mut cells: Vec<f32> = Vec::with_capacity(pad.images.len() * rows * cols);
    let frame = |(i, (time, _)): (usize, &(i64, Vec<f32>))| Frame {
        number: i as u64,
        time: time - start,
        window: Window::whole(rows, cols),
        start: i * rows * cols,
    };
    let frames = pad.images.iter().enumerate().map(frame).collect();
    for (_, image) in &pad.images {
        cells.extend(image.iter().map(|cell| if cell.is_finite() { *cell } else { 0.0 }));
    }
    let shape = tactflow_runtime::signal::ImageShape { rows, cols, pitch, unit };
    let threshold = pad.facts.get("threshold").and_then(toml::Value::as_float);
    let (drag, force) = (Vec::new(), pad.beside);
    Ok(Recording { format: FORMAT.name, shape, frames, cells, drag, dead, threshold, period, force })
}

/// Returns the indices of the tactels that the pad states as dead, as `[row, column]`.
fn dead(facts: &toml::Table, [rows, cols]: [usize; 2]) -> Vec<usize> {
    let places = facts.get("dead").and_then(toml::Value::as_array).into_iter().flatten();
    let index = |place: &toml::Value| {
        let at = |i: usize| usize::try_from(place.get(i)?.as_integer()?).ok();
        let (row, col) = (at(0)?, at(1)?);
        (row < rows && col < cols).then(|| row * cols + col)
    };
    let mut dead: Vec<usize> = places.filter_map(index).collect();
    dead.sort_unstable();
    dead.dedup();
    dead
}

fn refusal(error: PadError) -> Refusal {
    match error {
        PadError::Broken(message) => Refusal::broken(message),
        PadError::Unnamed(roles) if roles.is_empty() => Refusal::Broken {
            message: "the recording has no images of a pad".into(),
            help: Some("record them: `[record]` of the graph must not leave out the images of its roles".into()),
        },
        PadError::Unnamed(roles) => Refusal::Silent {
            message: format!("the recording has {} pads: {}", roles.len(), quoted(&roles)),
            help: format!(
                "select one in the bench's device, as `pad = \"{0}\"` (`tactflow features`: add `--pad {0}`)",
                roles[0]
            ),
        },
        PadError::Unknown(roles) => {
            Refusal::Contradicted { hint: "pad", message: format!("the recording has images of {}", quoted(&roles)) }
        }
        PadError::NoColumn(name) => Refusal::Broken {
            message: format!("the recording has no port `{name}`"),
            help: Some("`tactflow export run.mcap run.csv` lists all ports in its first lines".into()),
        },
    }
}
