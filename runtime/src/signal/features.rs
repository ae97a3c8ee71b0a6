//! A vector of named features, each with a unit and a freshness of its own.

use super::all_finite;
use super::freshness::{Freshness, Mark, Stamp};
use super::unit::Unit;

/// One feature, as known at load.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Feature {
    /// Its name in the graph file.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
}

/// What is known of a feature vector at load.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FeaturesShape {
    /// The features, in the order of the components.
    pub features: Vec<Feature>,
}

impl FeaturesShape {
    /// Names of the features, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.features.iter().map(|feature| feature.name.as_str())
    }

    /// The same features with another unit each.
    #[must_use]
    pub fn map_units(&self, unit: impl Fn(Unit) -> Unit) -> Self {
        let map = |feature: &Feature| Feature { name: feature.name.clone(), unit: unit(feature.unit) };
        Self { features: self.features.iter().map(map).collect() }
    }
}

/// One component of a feature vector.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Component {
    value: f64,
    mark: Mark,
}

impl Component {
    /// The value, of no meaning while it is absent, and its mark.
    pub(crate) const fn parts(&self) -> (&f64, &Mark) {
        (&self.value, &self.mark)
    }

    /// The value, if there is one.
    #[must_use]
    pub fn get(&self) -> Option<f64> {
        self.mark.is_present().then_some(self.value)
    }

    /// Freshness as seen in `tick`.
    #[must_use]
    pub const fn freshness(&self, tick: u64) -> Freshness {
        self.mark.freshness(tick)
    }

    /// Stamp of the value.
    #[must_use]
    pub const fn stamp(&self) -> Stamp {
        self.mark.stamp()
    }
}

/// Named features. What a step neither sets nor loses stays as it is, and is held.
#[derive(Debug, Clone, Default)]
pub struct Features {
    components: Box<[Component]>,
    /// Tick and stamp of the step that has the buffer.
    now: (u64, Stamp),
}

impl PartialEq for Features {
    fn eq(&self, other: &Self) -> bool {
        self.components == other.components
    }
}

impl Features {
    /// Takes over a value of the same shape, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.components.clone_from(&other.components);
    }

    /// As many absent components as there are features.
    #[must_use]
    pub fn absent(count: usize) -> Self {
        Self { components: vec![Component::default(); count].into(), now: Default::default() }
    }

    /// The same for a step in `tick` with that stamp.
    pub(crate) fn at(self, tick: u64, stamp: Stamp) -> Self {
        Self { now: (tick, stamp), ..self }
    }

    /// Tick and stamp of the step that has the buffer.
    pub(crate) const fn now(&self) -> (u64, Stamp) {
        self.now
    }

    /// Writes a sample of a device: a value for each feature, or `None` where there is none. The graph stamps it when it
    /// arrives, so a device needs no number of a tick.
    pub fn fill(&mut self, values: &[Option<f64>]) {
        if values.len() != self.components.len() {
            // The inlet names the device and both numbers.
            *self = Self::absent(values.len());
        }
        for (component, value) in self.components.iter_mut().zip(values) {
            let mark = Mark::new(0, Stamp::TIMELESS, value.is_some());
            *component = Component { value: value.unwrap_or_default(), mark };
        }
    }

    /// Becomes the successor of `previous`: what is there is new in `tick`, and what is not there any more is lost.
    pub(super) fn follow(&mut self, previous: &Self, tick: u64, stamp: Stamp) {
        for (component, previous) in self.components.iter_mut().zip(&previous.components) {
            if component.mark.is_present() {
                component.mark.renew(tick, stamp);
            } else {
                component.mark = previous.mark;
                component.mark.lose(tick);
            }
        }
    }

    /// The components.
    #[must_use]
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// Component `i` is new in `tick`.
    pub fn set(&mut self, i: usize, value: f64, tick: u64, stamp: Stamp) {
        let component = &mut self.components[i];
        component.value = value;
        component.mark.renew(tick, stamp);
    }

    /// Component `i` goes away in `tick`.
    pub fn lose(&mut self, i: usize, tick: u64) {
        self.components[i].mark.lose(tick);
    }

    /// Every component goes away in `tick`.
    pub fn lose_all(&mut self, tick: u64) {
        for component in &mut self.components {
            component.mark.lose(tick);
        }
    }

    /// Mark of the whole vector: there if any component is, changed if any changed, as old as the oldest.
    pub(crate) fn mark(&self, tick: u64) -> Mark {
        let (mut any, mut changed, mut stamp) = (false, false, Stamp::TIMELESS);
        for Component { mark, .. } in &self.components {
            changed |= mark.changed_in(tick);
            any |= mark.is_present();
            stamp = if mark.is_present() { stamp.oldest(mark.stamp()) } else { stamp };
        }
        Mark::new(if changed { tick } else { u64::MAX }, stamp, any)
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.components.iter().all(|c| !c.mark.is_present() || all_finite(&[c.value]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_is_as_fresh_as_its_newest_and_as_old_as_its_oldest_component() {
        let stamp = |nanos| Stamp { nanos, device: 0 };
        let mut features = Features::absent(2);
        assert_eq!(features.mark(1).freshness(1), Freshness::Absent);
        features.set(0, 1.0, 1, stamp(10));
        assert_eq!(features.mark(1).freshness(1), Freshness::New);
        features.set(1, 1.0, 2, stamp(20));
        assert_eq!((features.mark(2).freshness(2), features.mark(2).stamp()), (Freshness::New, stamp(10)));
        assert_eq!(features.mark(3).freshness(3), Freshness::Held);
        features.lose(0, 4);
        assert_eq!((features.mark(4).freshness(4), features.mark(4).stamp()), (Freshness::New, stamp(20)));
        features.lose(1, 5);
        assert_eq!(features.mark(5).freshness(5), Freshness::Lost);
        assert_eq!(features.mark(6).freshness(6), Freshness::Absent);
    }
}
