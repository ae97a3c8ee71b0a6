//! The images of a simulated pad: when they are taken, and when they are available.

use std::collections::VecDeque;

use tactflow_runtime::device::{Output, Samples};
use tactflow_runtime::signal::Image;

use super::readout::Readout;

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
    latency: i64,
    /// Images that are taken but not yet available, with their stamps.
    taken: VecDeque<(i64, Vec<f32>)>,
    /// Buffers for further images.
    spare: Vec<Vec<f32>>,
    /// Number of images that were handed over.
    shown: u64,
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
            latency,
            taken: VecDeque::with_capacity(frames),
            spare: vec![vec![0.0; tactels]; frames],
            shown: 0,
        }
    }

    /// Returns the electronics.
    #[must_use]
    pub const fn readout(&self) -> &Readout {
        &self.readout
    }

    /// Takes an image of these `forces` [N] at `stamp` [ns], one `period` [ns] after the one before.
    pub fn take(&mut self, stamp: i64, period: i64, forces: &[f64]) {
        let mut counts = match self.spare.pop() {
            Some(room) => room,
            // No buffer is free, so the oldest image, which was never read, is dropped.
            None => self.taken.pop_front().expect("all buffers are in `taken`").1,
        };
        self.readout.read(period as f64 * 1e-9, forces, &mut counts);
        self.taken.push_back((stamp, counts));
    }

    /// Hands over the images that are available at `now` [ns].
    pub fn show(&mut self, now: i64, samples: &mut Samples) {
        while self.taken.front().is_some_and(|(stamp, _)| stamp + self.latency <= now) {
            let (stamp, counts) = self.taken.pop_front().expect("the front was just checked");
            self.shown += 1;
            samples.write(self.image, stamp, self.shown).cells_mut().copy_from_slice(&counts);
            self.spare.push(counts);
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
