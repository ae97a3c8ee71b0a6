//! The limits that a node holds, and the components of a value that are read.

/// The limits that a node guarantees for the motion at its output. The command of a role lists the limits that it must
/// cross; the check follows its wire upstream and looks for them.
///
/// A node that holds a limit has a scalar output of that name: the fraction of the wanted motion that passes. It is 1
/// while the limit is not reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Limits {
    /// The input whose motion the node passes on. The limits of that input hold for the output as well.
    pub through: Option<&'static str>,
    /// The limits that the node adds.
    pub holds: &'static [&'static str],
    /// The limits of the input that the output may violate. They must come later.
    pub breaks: &'static [&'static str],
    /// The input that reads the sensor for which the limits hold. They hold for that sensor alone, so an arm with several
    /// sensors needs such a limiter for each. The limits of the sensor in whose frame the motion is must survive it; it
    /// may violate those of any other one.
    pub guards: Option<&'static str>,
    /// The flag that is set once a budget of the limiter is spent, so that its arm rests until the budget is refilled.
    pub spends: Option<&'static str>,
    /// The flag that is set once the node has found that its task must not go on, such as a self-test that fails. The
    /// task ends with a fault. Its cause is [`Node::found`](super::Node::found).
    pub fails: Option<&'static str>,
}

impl Limits {
    /// No limit holds. Most nodes use it.
    pub const NONE: Self = Self { through: None, holds: &[], breaks: &[], guards: None, spends: None, fails: None };

    /// The limits of an input hold for the outputs, and no others; for example in a change of frame.
    #[must_use]
    pub const fn passed(input: &'static str) -> Self {
        Self { through: Some(input), ..Self::NONE }
    }
}

/// The components of a twist or of a feature vector that something reads, in their order. For other kinds it is all or
/// none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Components(u64);

impl Components {
    /// All components.
    pub const ALL: Self = Self(u64::MAX);
    /// No component.
    pub const NONE: Self = Self(0);

    /// Returns those of the first `count` components for which `is_one` holds.
    #[must_use]
    pub fn of(count: usize, is_one: impl Fn(usize) -> bool) -> Self {
        (0..count).filter(|i| is_one(*i)).fold(Self::NONE, |all, i| all.or(Self(1 << Self::bit(i))))
    }

    /// Whether it contains component `i`.
    #[must_use]
    pub const fn has(self, i: usize) -> bool {
        self.0 >> Self::bit(i) & 1 == 1
    }

    /// Whether it contains no component.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Components from the 64th on share a bit.
    const fn bit(i: usize) -> usize {
        if i < 63 { i } else { 63 }
    }

    /// Returns the components that are in either.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_by_their_number() {
        let even = Components::of(6, |i| i % 2 == 0);
        assert!(even.has(0) && !even.has(1) && even.has(4) && !even.has(6));
        assert_eq!(even.or(Components::of(6, |i| i % 2 == 1)), Components::of(6, |_| true));
        assert!(Components::of(6, |_| false).is_empty() && !Components::ALL.is_empty());
        let last = Components::of(70, |i| i == 69);
        assert!(last.has(69) && last.has(64) && !last.has(62), "from the 64th on they count together");
    }
}
