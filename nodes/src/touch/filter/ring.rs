//! The newest samples of a feature, in a ring of a fixed size.

use tactflow_runtime::node::State;

/// The newest samples. A new sample replaces the oldest one of a full ring.
#[derive(State)]
pub(crate) struct Ring<T: Copy> {
    samples: Vec<T>,
    /// Index of the next sample.
    next: usize,
    /// Number of samples in the ring.
    count: usize,
}

impl<T: Copy + Default> Ring<T> {
    /// Returns an empty ring for up to `capacity` samples.
    pub(crate) fn new(capacity: usize) -> Self {
        Self { samples: vec![T::default(); capacity], next: 0, count: 0 }
    }

    pub(crate) fn push(&mut self, sample: T) {
        self.samples[self.next] = sample;
        self.next = if self.next + 1 < self.samples.len() { self.next + 1 } else { 0 };
        self.count = (self.count + 1).min(self.samples.len());
    }

    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// Removes the oldest samples as long as `is_old` is true of them.
    pub(crate) fn forget(&mut self, is_old: impl Fn(&T) -> bool) {
        while self.count > 0 && is_old(&self.samples[self.oldest()]) {
            self.count -= 1;
        }
    }

    /// Returns the samples from the oldest to the newest, in two parts.
    pub(crate) fn parts(&self) -> [&[T]; 2] {
        let oldest = self.oldest();
        let end = (oldest + self.count).min(self.samples.len());
        [&self.samples[oldest..end], &self.samples[..self.count - (end - oldest)]]
    }

    /// Returns the samples of a ring that has forgotten none, in the order of the memory.
    pub(crate) fn unordered(&self) -> &[T] {
        &self.samples[..self.count]
    }

    /// Returns the samples of a ring that has forgotten none, from the newest to the oldest.
    pub(crate) fn newest_first(&self) -> impl Iterator<Item = T> {
        (1..=self.count).map(|k| self.samples[(self.next + self.count - k) % self.count])
    }

    /// Returns the index of the oldest sample, or of the next one if the ring is empty.
    fn oldest(&self) -> usize {
        if self.next >= self.count { self.next - self.count } else { self.next + self.samples.len() - self.count }
    }
}
