//! The images of a simulated pad: when they are taken, and when they are available.

use std::collections::VecDeque;

use tactflow_runtime::device::{Output, Samples};
use tactflow_runtime::signal::{Image, VectorImage};

use super::imprint::Forces;
use super::readout::Readout;
use super::vector_readout::VectorReadout;

/// The times at which a simulation takes images.
#[derive(Debug, Clone)]
pub struct Beats {
    /// Time between two images [ns].
    period: i64,
    /// Time before which the last image is taken [ns].
    end: i64,
    /// Time of the last exchange [ns].
    last: Option<i64>,
}

impl Beats {
    /// Returns a beat every `period` [ns] until before `end` [ns], of which none has passed.
    #[must_use]
    pub const fn new(period: i64, end: i64) -> Self {
        Self { period, end, last: None }
    }

    /// Returns the time between two images [ns].
    #[must_use]
    pub const fn period(&self) -> i64 {
        self.period
    }

    /// Returns the time of the next image [ns].
    #[must_use]
    pub fn next(&self) -> Option<i64> {
        let next = self.last.map_or(0, |last| (last / self.period + 1) * self.period);
        (next < self.end).then_some(next)
    }

    /// Returns the time of the last image, if there is one [ns].
    #[must_use]
    pub fn end(&self) -> Option<i64> {
        (self.end < i64::MAX).then(|| (self.end - 1) / self.period * self.period)
    }

    /// Returns whether `now` [ns] is not after the last exchange.
    #[must_use]
    pub fn is_past(&self, now: i64) -> bool {
        self.last.is_some_and(|last| now <= last)
    }

    /// Returns the times of the images that are due until `now` [ns], and counts them as taken.
    pub fn pass(&mut self, now: i64) -> impl Iterator<Item = i64> + use<> {
        let (begin, period) = (self.last.unwrap_or(-1), self.period);
        self.last = Some(now);
        let first = begin.div_euclid(period) + 1;
        (first..=now.div_euclid(period)).map(move |beat| beat * period)
    }
}

/// The images of a pad between the electronics and the graph.
pub struct Frames {
    image: Output<Image>,
    readout: Readout,
    /// The second electronics of a pad with three axes.
    vectors: Option<(Output<VectorImage>, VectorReadout)>,
    latency: i64,
    /// Images that are taken but not yet available, with their stamps.
    taken: VecDeque<(i64, Frame)>,
    /// Buffers for further images.
    spare: Vec<Frame>,
    /// Number of images that were handed over.
    shown: u64,
}

/// The counts of the tactels.
#[derive(Debug, Clone)]
struct Frame {
    counts: Vec<f32>,
    /// Empty for a pad with one axis.
    vectors: Vec<[f32; 3]>,
}

impl Frames {
    /// Returns the images of a port with a number of `tactels`, taken every `period` [ns] and available `latency` [ns]
    /// later.
    #[must_use]
    pub fn new(image: Output<Image>, readout: Readout, tactels: usize, [period, latency]: [i64; 2]) -> Self {
        let frames = (latency / period) as usize + 2;
        Self {
            image,
            readout,
            vectors: None,
            latency,
            taken: VecDeque::with_capacity(frames),
            spare: vec![Frame { counts: vec![0.0; tactels], vectors: Vec::new() }; frames],
            shown: 0,
        }
    }

    /// Adds the vector images of a pad with three axes.
    #[must_use]
    pub fn with_vectors(mut self, vectors: Option<(Output<VectorImage>, VectorReadout)>) -> Self {
        if vectors.is_some() {
            self.spare.iter_mut().for_each(|frame| frame.vectors.resize(frame.counts.len(), [0.0; 3]));
        }
        Self { vectors, ..self }
    }

    /// Returns the electronics.
    #[must_use]
    pub const fn readout(&self) -> &Readout {
        &self.readout
    }

    /// Takes an image of these `forces` at `stamp` [ns], one `period` [ns] after the one before.
    pub fn take(&mut self, stamp: i64, period: i64, forces: &Forces) {
        let mut frame = match self.spare.pop() {
            Some(room) => room,
            // No buffer is free, so the oldest image, which was never read, is dropped.
            None => self.taken.pop_front().expect("all buffers are in `taken`").1,
        };
        self.readout.read(period as f64 * 1e-9, &forces.normal, &mut frame.counts);
        if let Some((_, readout)) = &mut self.vectors {
            readout.read(forces, &mut frame.vectors);
        }
        self.taken.push_back((stamp, frame));
    }

    /// Hands over the images that are available at `now` [ns].
    pub fn show(&mut self, now: i64, samples: &mut Samples) {
        while self.taken.front().is_some_and(|(stamp, _)| stamp + self.latency <= now) {
            let (stamp, frame) = self.taken.pop_front().expect("the front was just checked");
            self.shown += 1;
            samples.write(self.image, stamp, self.shown).cells_mut().copy_from_slice(&frame.counts);
            if let Some((output, _)) = &self.vectors {
                samples.write(*output, stamp, self.shown).cells_mut().copy_from_slice(&frame.vectors);
            }
            self.spare.push(frame);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_beat_passes_once() {
        let mut beats = Beats::new(4, 11);
        assert_eq!((beats.next(), beats.end()), (Some(0), Some(8)));
        assert_eq!(beats.pass(0).collect::<Vec<_>>(), [0]);
        assert_eq!(beats.pass(3).collect::<Vec<_>>(), [0; 0]);
        assert!(beats.is_past(3) && !beats.is_past(4));
        assert_eq!(beats.next(), Some(4));
        assert_eq!(beats.pass(9).collect::<Vec<_>>(), [4, 8]);
        assert_eq!(beats.next(), None);
        assert_eq!(Beats::new(4, i64::MAX).end(), None);
    }
}
