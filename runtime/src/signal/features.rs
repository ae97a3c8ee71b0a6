//! Vectors of named features. Each feature has its own unit and freshness.

use serde::{Deserialize, Serialize};

use super::all_finite;
use super::freshness::{Freshness, Mark, Stamp};
use super::unit::Unit;

/// The name and unit of one feature.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Feature {
    /// Name in the graph file.
    pub name: String,
    /// Unit of the value.
    pub unit: Unit,
}

/// The shape of a feature vector.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FeaturesShape {
    /// The features, in the order of the components.
    pub features: Vec<Feature>,
}

impl FeaturesShape {
    /// Creates the shape from the name and the unit of each feature.
    pub fn new<'n>(features: impl IntoIterator<Item = (&'n str, Unit)>) -> Self {
        let features = features.into_iter().map(|(name, unit)| Feature { name: name.to_owned(), unit });
        Self { features: features.collect() }
    }

    /// Returns the names of the features, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.features.iter().map(|feature| feature.name.as_str())
    }

    /// Returns the same features with the unit of each replaced.
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
    /// Returns the value, which is undefined while it is absent, and its mark.
    pub(crate) const fn parts(&self) -> (&f64, &Mark) {
        (&self.value, &self.mark)
    }

    /// Returns the value, or `None` while it is absent.
    #[must_use]
    pub fn get(&self) -> Option<f64> {
        self.mark.is_present().then_some(self.value)
    }

    /// Returns the freshness in `tick`.
    pub const fn freshness(&self, tick: u64) -> Freshness {
        self.mark.freshness(tick)
    }

    /// Returns the stamp of the value.
    pub const fn stamp(&self) -> Stamp {
        self.mark.stamp()
    }
}

/// A feature vector. A component that a step neither sets nor loses keeps its value and is held.
#[derive(Debug, Clone, Default)]
pub struct Features {
    components: Box<[Component]>,
    /// Tick and stamp of the step that writes the vector.
    now: (u64, Stamp),
}

impl PartialEq for Features {
    fn eq(&self, other: &Self) -> bool {
        self.components == other.components
    }
}

impl Features {
    /// Copies a value of the same shape, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.components.clone_from(&other.components);
    }

    /// Creates `count` absent components.
    #[must_use]
    pub fn absent(count: usize) -> Self {
        Self { components: vec![Component::default(); count].into(), now: Default::default() }
    }

    /// Sets the tick and the stamp of the step that writes the vector.
    pub(crate) fn at(self, tick: u64, stamp: Stamp) -> Self {
        Self { now: (tick, stamp), ..self }
    }

    /// Returns the tick and the stamp of the step that writes the vector.
    pub(crate) const fn now(&self) -> (u64, Stamp) {
        self.now
    }

    /// Writes a sample of a device: one value per feature, `None` if it is absent. The inlet stamps the components when
    /// the sample arrives, so a device needs no tick number.
    pub fn fill(&mut self, values: &[Option<f64>]) {
        if values.len() != self.components.len() {
            // The inlet finds the wrong size and reports the device.
            *self = Self::absent(values.len());
        }
        for (component, value) in self.components.iter_mut().zip(values) {
            let mark = Mark::new(0, Stamp::TIMELESS, value.is_some());
            *component = Component { value: value.unwrap_or_default(), mark };
        }
    }

    /// Replaces `previous` in `tick`: present components are new, and components that are no longer present are lost.
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

    /// Returns the components.
    #[must_use]
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// Returns the value of each component, `None` while it is absent.
    pub fn values(&self) -> impl Iterator<Item = Option<f64>> {
        self.components.iter().map(Component::get)
    }

    /// Sets component `i`, which is new in `tick`.
    pub fn set(&mut self, i: usize, value: f64, tick: u64, stamp: Stamp) {
        let component = &mut self.components[i];
        component.value = value;
        component.mark.renew(tick, stamp);
    }

    /// Makes component `i` absent from `tick` on.
    pub fn lose(&mut self, i: usize, tick: u64) {
        self.components[i].mark.lose(tick);
    }

    /// Makes every component absent from `tick` on.
    pub fn lose_all(&mut self, tick: u64) {
        for component in &mut self.components {
            component.mark.lose(tick);
        }
    }

    /// Returns the mark of the whole vector: present if any component is, changed if any changed, as old as the oldest.
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
    fn the_vector_is_as_fresh_as_its_newest_and_as_old_as_its_oldest_component() {
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
