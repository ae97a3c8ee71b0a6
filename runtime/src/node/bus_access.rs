//! Access to the bus by port: the one place that turns a [`PortId`] into indices.

use super::{Bus, PortId};
use crate::signal::{Features, Freshness, Kind, Mark, Signal};

/// Where one scalar of a port is on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScalarId {
    /// The port.
    pub port: PortId,
    /// Kind of the port.
    pub kind: Kind,
    /// Index of the scalar among the port's [scalars](crate::signal::Shape::scalars).
    pub index: usize,
}

impl Bus {
    /// Returns the mark of a port.
    #[inline]
    #[must_use]
    pub fn mark(&self, port: PortId) -> &Mark {
        &self.marks[port.mark as usize]
    }

    /// Returns the mark of a port for writing.
    #[inline]
    pub fn mark_mut(&mut self, port: PortId) -> &mut Mark {
        &mut self.marks[port.mark as usize]
    }

    /// Returns the value of a port, or `None` while it is absent.
    #[inline]
    #[must_use]
    pub fn get<T: Signal>(&self, port: PortId) -> Option<&T> {
        self.mark(port).is_present().then(|| self.slot(port))
    }

    /// Returns the contents of a port's slot. They are valid only while the port is present.
    #[inline]
    #[must_use]
    pub fn slot<T: Signal>(&self, port: PortId) -> &T {
        &T::arena(&self.arenas)[port.slot as usize]
    }

    /// Returns the contents of a port's slot for writing. The mark does not change.
    #[inline]
    pub fn slot_mut<T: Signal>(&mut self, port: PortId) -> &mut T {
        &mut T::arena_mut(&mut self.arenas)[port.slot as usize]
    }

    /// Returns one scalar of a port, or `None` while it is absent. A flag is 1 or 0.
    #[inline]
    #[must_use]
    pub fn scalar(&self, ScalarId { port, kind, index }: ScalarId) -> Option<f64> {
        let mut value = [f64::NAN];
        self.arenas.read_scalars(kind, port.slot, index, &mut value);
        Some(value[0]).filter(|value| self.mark(port).is_present() && !value.is_nan())
    }

    /// Returns the freshness of one scalar in `tick`. Each feature has its own; other scalars have that of their port.
    #[inline]
    pub fn scalar_freshness(&self, ScalarId { port, kind, index }: ScalarId, tick: u64) -> Freshness {
        match kind {
            Kind::Features => self.slot::<Features>(port).components()[index].freshness(tick),
            _ => self.mark(port).freshness(tick),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{Feature, FeaturesShape, Stamp, Twist, TwistShape};

    #[test]
    fn one_feature_is_read_with_its_own_freshness() {
        let mut bus = Bus::default();
        let port = bus.add(&FeaturesShape { features: vec![Feature::default(); 2] }.into());
        let scalar = |index| ScalarId { port, kind: Kind::Features, index };
        bus.slot_mut::<Features>(port).set(1, 2.5, 7, Stamp::TIMELESS);
        bus.mark_mut(port).renew(7, Stamp::TIMELESS);
        assert_eq!((bus.scalar(scalar(0)), bus.scalar(scalar(1))), (None, Some(2.5)));
        assert_eq!(bus.scalar_freshness(scalar(0), 7), Freshness::Absent);
        assert_eq!(
            (bus.scalar_freshness(scalar(1), 7), bus.scalar_freshness(scalar(1), 8)),
            (Freshness::New, Freshness::Held)
        );
    }

    #[test]
    fn a_scalar_of_an_absent_port_is_absent() {
        let mut bus = Bus::default();
        let port = bus.add(&TwistShape.into());
        let scalar = ScalarId { port, kind: Kind::Twist, index: 4 };
        bus.slot_mut::<Twist>(port).0[4] = 0.5;
        assert_eq!((bus.scalar(scalar), bus.get::<Twist>(port)), (None, None));
        bus.mark_mut(port).renew(1, Stamp::TIMELESS);
        assert_eq!((bus.scalar(scalar), bus.scalar_freshness(scalar, 1)), (Some(0.5), Freshness::New));
        bus.mark_mut(port).lose(2);
        assert_eq!((bus.scalar(scalar), bus.scalar_freshness(scalar, 2)), (None, Freshness::Lost));
    }
}
