//! What a node does for the limits of a motion, and which components of a value matter: what load proves things with.

/// What holds of the motion that a node gives. Every device's command names the limits it must have crossed; the check
/// follows its wire back and looks for them.
///
/// A node that holds a limit has an output of that name: a scalar, the share of what was wanted that it lets pass, so 1
/// when it does nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Limits {
    /// The input whose motion the node passes on: what holds of that, holds of the node's too.
    pub through: Option<&'static str>,
    /// What holds because of the node.
    pub holds: &'static [&'static str],
    /// What held of the input and need not hold of the output, so that it must come later.
    pub breaks: &'static [&'static str],
}

impl Limits {
    /// Nothing holds: what most nodes give.
    pub const NONE: Self = Self { through: None, holds: &[], breaks: &[] };

    /// What holds of an input holds of the outputs, and no more: a change of frame, say.
    #[must_use]
    pub const fn passed(input: &'static str) -> Self {
        Self { through: Some(input), ..Self::NONE }
    }
}

/// Which components of a value anything reads: those of a twist or of a feature vector, in their order. Of other kinds
/// all of them or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Components(u64);

impl Components {
    /// All of them.
    pub const ALL: Self = Self(u64::MAX);
    /// None.
    pub const NONE: Self = Self(0);

    /// Those of the first `count` for which `is_one` holds.
    #[must_use]
    pub fn of(count: usize, is_one: impl Fn(usize) -> bool) -> Self {
        (0..count).filter(|i| is_one(*i)).fold(Self::NONE, |all, i| all.or(Self(1 << Self::bit(i))))
    }

    /// Whether component `i` is one of them.
    #[must_use]
    pub const fn has(self, i: usize) -> bool {
        self.0 >> Self::bit(i) & 1 == 1
    }

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Those from the 64th on share a bit: as long as one of them counts, all do.
    const fn bit(i: usize) -> usize {
        if i < 63 { i } else { 63 }
    }

    /// Those that are in one of both.
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
