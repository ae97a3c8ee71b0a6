//! What a device and a graph hand each other.

use crate::signal::{Arenas, Kind, Shape, Signal};

/// The newest sample of each port of a device.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    pub(crate) arenas: Arenas,
    pub(crate) ports: Vec<Sample>,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) kind: Kind,
    pub(crate) slot: u32,
    /// Time of the sample in the graph's clock [ns].
    pub(crate) stamp: i64,
    /// Sequence number; the same one twice is one sample.
    pub(crate) sequence: u64,
    /// How often the device has written the port.
    pub(crate) writes: u64,
    /// Whether the last write says that there is no value.
    pub(crate) is_absent: bool,
}

impl Samples {
    /// Room for a value of each shape.
    #[must_use]
    pub fn with_shapes<'s>(shapes: impl Iterator<Item = &'s Shape>) -> Self {
        let mut samples = Self::default();
        for shape in shapes {
            let slot = samples.arenas.add(shape);
            samples.ports.push(Sample { kind: shape.kind(), slot, stamp: 0, sequence: 0, writes: 0, is_absent: false });
        }
        samples
    }

    /// The value of port `port`, to be written whole: a sample taken at `stamp` [ns], the `sequence`-th of its device.
    ///
    /// # Panics
    /// If the port is not of that kind.
    pub fn write<T: Signal>(&mut self, port: usize, stamp: i64, sequence: u64) -> &mut T {
        let sample = &mut self.ports[port];
        assert_eq!(sample.kind, T::KIND, "port {port} of the device");
        (sample.stamp, sample.sequence, sample.is_absent) = (stamp, sequence, false);
        sample.writes += 1;
        &mut T::arena_mut(&mut self.arenas)[sample.slot as usize]
    }

    /// Says that port `port` has no value in the sample taken at `stamp` [ns], the `sequence`-th of its device: what the
    /// port gave before is absent from then on, until it is written again.
    pub fn clear(&mut self, port: usize, stamp: i64, sequence: u64) {
        let sample = &mut self.ports[port];
        (sample.stamp, sample.sequence, sample.is_absent) = (stamp, sequence, true);
        sample.writes += 1;
    }
}

/// The command of each command port of a device.
#[derive(Debug, Clone, Default)]
pub struct Commands {
    pub(crate) values: Vec<Box<[f64]>>,
}

impl Commands {
    /// Room for a command of each shape, all zero.
    ///
    /// # Panics
    /// If one is not a joint vector.
    #[must_use]
    pub fn with_shapes<'s>(shapes: impl Iterator<Item = &'s Shape>) -> Self {
        let zeros = |shape: &Shape| match shape {
            Shape::Joints(shape) => vec![0.0; shape.joints.len()].into(),
            other => panic!("a command cannot be {}", other.kind().with_article()),
        };
        Self { values: shapes.map(zeros).collect() }
    }

    /// Whether nothing is commanded.
    pub(crate) fn are_zero(&self) -> bool {
        self.values.iter().flatten().all(|value| *value == 0.0)
    }

    /// The command of port `port`, one value a joint.
    #[must_use]
    pub fn joints(&self, port: usize) -> &[f64] {
        &self.values[port]
    }
}
