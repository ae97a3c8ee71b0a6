//! The mean and the deviation of the numbers of a port.

use tactflow_runtime::signal::{Features, Image, Signal};

use crate::tool::guided::{CellPort, GuidedCell};

/// A signal as a list of numbers.
pub(super) trait Numbers: Signal {
    /// Calls `add` for each number; nothing is added for an absent one.
    fn each(&self, add: impl FnMut(usize, f64));
}

impl Numbers for Features {
    fn each(&self, mut add: impl FnMut(usize, f64)) {
        self.values().enumerate().for_each(|(i, value)| value.into_iter().for_each(|value| add(i, value)));
    }
}

impl Numbers for Image {
    fn each(&self, mut add: impl FnMut(usize, f64)) {
        self.cells().iter().enumerate().for_each(|(i, cell)| add(i, f64::from(*cell)));
    }
}

/// Collects the samples of a port (Welford's method).
pub(super) struct Average<T> {
    port: CellPort<T>,
    /// How often the port was written until now.
    writes: u64,
    samples: u32,
    means: Vec<f64>,
    squares: Vec<f64>,
}

impl<T: Numbers> Average<T> {
    /// Begins with the next sample of a port that has `count` numbers.
    pub(super) fn of(cell: &GuidedCell<'_>, port: CellPort<T>, count: usize) -> Self {
        Self { port, writes: cell.writes(port), samples: 0, means: vec![0.0; count], squares: vec![0.0; count] }
    }

    /// Adds the newest sample, if it is a new one.
    pub(super) fn look(&mut self, cell: &GuidedCell<'_>) {
        let writes = cell.writes(self.port);
        let Some(sample) = cell.read(self.port).filter(|_| writes > self.writes) else { return };
        self.writes = writes;
        self.samples += 1;
        let count = f64::from(self.samples);
        sample.each(|i, value| {
            let off = value - self.means[i];
            self.means[i] += off / count;
            self.squares[i] += off * (value - self.means[i]);
        });
    }

    /// Returns the means of at least `min_samples` samples.
    ///
    /// # Errors
    /// If there were fewer; `what` is what sent them.
    pub(super) fn means(&self, what: &str, min_samples: u32) -> Result<&[f64], String> {
        let samples = self.samples;
        let is_enough = samples >= min_samples;
        is_enough.then_some(&*self.means).ok_or_else(|| {
            format!("{what} sent {samples} samples, and {min_samples} are needed: does `tactflow doctor` see it?")
        })
    }

    /// Returns the standard deviation of each number.
    pub(super) fn deviations(&self) -> Vec<f64> {
        let freedom = f64::from(self.samples.saturating_sub(1).max(1));
        self.squares.iter().map(|square| (square / freedom).sqrt()).collect()
    }
}
