//! The frames in the ring of the socket, and its end in the thread of the socket.
//!
//! A frame is a list of 64-bit words: its length, its type, the number and the time of the tick, the time of the wall clock
//! at time zero of the graph, and the values. A port is one word that says whether it is present, and one for each of its
//! numbers; a watched one has its number before, and its stamp behind the first word. Two cells of an image are one word.

use rtrb::Consumer;
use serde::Serialize;

use crate::signal::{Shape, VectorImageShape};

/// Types of frames.
pub(super) const WATCHED: u64 = 1;
pub(super) const WHOLE: u64 = 2;
/// Words before the values of a frame.
pub(super) const HEAD: usize = 5;
/// The mode of a task without modes.
pub(super) const NO_MODE: u64 = u64::MAX;

/// How many values a port has.
#[derive(Debug, Clone, Copy)]
pub(super) enum Width {
    Numbers(usize),
    Cells(usize),
}

impl Width {
    pub(super) fn of(shape: &Shape) -> Self {
        match shape {
            Shape::Image(image) => Self::Cells(image.rows * image.cols),
            Shape::VectorImage(VectorImageShape(image)) => Self::Cells(3 * image.rows * image.cols),
            shape => Self::Numbers(shape.scalars().len()),
        }
    }

    pub(super) const fn words(self) -> usize {
        match self {
            Self::Numbers(numbers) => numbers,
            Self::Cells(cells) => cells.div_ceil(2),
        }
    }

    /// Whether a frame with everything has it.
    pub(super) const fn is_of_whole(self) -> bool {
        matches!(self, Self::Numbers(_))
    }
}

/// What a tick has written.
#[derive(Debug)]
pub(super) struct Frame {
    pub(super) tick: u64,
    /// Time of the tick [ns].
    pub(super) now: i64,
    /// Time of the wall clock at time zero of the graph [ns since 1970].
    pub(super) epoch: i64,
    pub(super) content: Content,
}

#[derive(Debug)]
pub(super) enum Content {
    /// The watched ports that have changed.
    Watched(Vec<FedValue>),
    /// Everything.
    Whole(Whole),
}

/// The value of a port after a tick.
#[derive(Debug)]
pub(super) struct FedValue {
    /// Number of the port in the feed.
    pub(super) port: usize,
    /// Time of the sample that it was computed from, in the graph's clock [ns].
    pub(super) stamp: i64,
    /// Its values, if it is present.
    pub(super) row: Option<Row>,
}

/// The values of a port.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum Row {
    Numbers(Vec<f64>),
    /// The cells of an image, row by row.
    Cells(Vec<f32>),
}

impl Row {
    /// Returns a number of a port; an image has none.
    pub(super) fn number(&self, index: usize) -> Option<f64> {
        match self {
            Self::Numbers(numbers) => numbers.get(index).copied(),
            Self::Cells(_) => None,
        }
    }
}

/// The state of a task.
#[derive(Debug)]
pub(super) struct FedTask {
    /// Number of its mode; none in a task without modes.
    pub(super) mode: Option<usize>,
    pub(super) is_halted: bool,
    pub(super) has_ended: bool,
    /// Number of halts so far.
    pub(super) halts: u64,
    /// Why it is halted, or has failed; empty if it is not.
    pub(super) reason: String,
}

/// Everything that a run shows.
#[derive(Debug)]
pub(super) struct Whole {
    pub(super) tasks: Vec<FedTask>,
    /// The value and the target of each live parameter.
    pub(super) live: Vec<[f64; 2]>,
    /// The numbers of each port, if it is present.
    pub(super) ports: Vec<Option<Vec<f64>>>,
}

/// The other end of the ring.
pub(super) struct FeedReader {
    widths: Vec<Width>,
    tasks: usize,
    live: usize,
    ring: Consumer<u64>,
    frame: Vec<u64>,
}

impl FeedReader {
    /// The end of the ring of a run with so many tasks and live parameters.
    pub(super) const fn new(widths: Vec<Width>, [tasks, live]: [usize; 2], ring: Consumer<u64>) -> Self {
        Self { widths, tasks, live, ring, frame: Vec::new() }
    }

    /// Takes the next frame, if there is one.
    pub(super) fn next(&mut self) -> Option<Frame> {
        let length = *self.ring.peek().ok()? as usize;
        self.frame.resize(length, 0);
        self.ring.pop_entire_slice(&mut self.frame).ok()?;
        let [_, kind, tick, now, epoch] = *self.frame.first_chunk::<HEAD>()?;
        let mut words = self.frame[HEAD..].iter().copied();
        let content = if kind == WATCHED {
            let mut values = Vec::new();
            while let Some(port) = words.next() {
                let (port, is_present, stamp) = (port as usize, words.next()? != 0, words.next()?.cast_signed());
                let row = take_row(&mut words, *self.widths.get(port)?)?;
                values.push(FedValue { port, stamp, row: is_present.then_some(row) });
            }
            Content::Watched(values)
        } else {
            let tasks = (0..self.tasks).map(|_| take_task(&mut words)).collect::<Option<_>>()?;
            let mut pair = || Some([words.next()?, words.next()?].map(f64::from_bits));
            let live = (0..self.live).map(|_| pair()).collect::<Option<_>>()?;
            let port = |width: &Width| match width {
                Width::Cells(_) => Some(None),
                Width::Numbers(numbers) => {
                    let is_present = words.next()? != 0;
                    let numbers = take_numbers(&mut words, *numbers)?;
                    Some(is_present.then_some(numbers))
                }
            };
            let ports = self.widths.iter().map(port).collect::<Option<_>>()?;
            Content::Whole(Whole { tasks, live, ports })
        };
        Some(Frame { tick, now: now.cast_signed(), epoch: epoch.cast_signed(), content })
    }
}

fn take_task(words: &mut impl Iterator<Item = u64>) -> Option<FedTask> {
    let (mode, flags, halts, length) = (words.next()?, words.next()?, words.next()?, words.next()? as usize);
    let text: Option<Vec<u64>> = (0..length.div_ceil(8)).map(|_| words.next()).collect();
    let mut text: Vec<u8> = text?.into_iter().flat_map(u64::to_le_bytes).collect();
    text.truncate(length);
    Some(FedTask {
        mode: (mode != NO_MODE).then_some(mode as usize),
        is_halted: flags & 1 != 0,
        has_ended: flags & 2 != 0,
        halts,
        reason: String::from_utf8(text).ok()?,
    })
}

fn take_numbers(words: &mut impl Iterator<Item = u64>, numbers: usize) -> Option<Vec<f64>> {
    (0..numbers).map(|_| words.next().map(f64::from_bits)).collect()
}

/// Takes the values of a port. `None` is a frame that is too short.
fn take_row(words: &mut impl Iterator<Item = u64>, width: Width) -> Option<Row> {
    match width {
        Width::Numbers(numbers) => take_numbers(words, numbers).map(Row::Numbers),
        Width::Cells(cells) => {
            let pairs: Option<Vec<u64>> = (0..width.words()).map(|_| words.next()).collect();
            let both = |pair: u64| [pair as u32, (pair >> 32) as u32].map(f32::from_bits);
            let mut values: Vec<f32> = pairs?.into_iter().flat_map(both).collect();
            values.truncate(cells);
            Some(Row::Cells(values))
        }
    }
}

/// Adds numbers, two as one word.
pub(super) fn extend_with_pairs(frame: &mut Vec<u64>, mut cells: impl Iterator<Item = f32>) {
    while let Some(cell) = cells.next() {
        let next = cells.next().unwrap_or(0.0);
        frame.push(u64::from(cell.to_bits()) | u64::from(next.to_bits()) << 32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cells_of_an_image_come_back_from_their_words() {
        for cells in [vec![], vec![0.5], vec![0.5, -1.0], vec![f32::NAN, 2.0, 3.0]] {
            let mut words = Vec::new();
            extend_with_pairs(&mut words, cells.iter().copied());
            let Some(Row::Cells(back)) = take_row(&mut words.into_iter(), Width::Cells(cells.len())) else { panic!() };
            let bits = |cells: &[f32]| cells.iter().map(|cell| cell.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&back), bits(&cells));
        }
        assert_eq!(take_row(&mut [1].into_iter(), Width::Cells(3)), None);
    }
}
