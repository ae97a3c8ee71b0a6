//! The section `[policy]`: the reaction to each trouble, and the maximum age of samples.

use super::read::read_word;
use crate::node::{Map, Param, Reader, Spanned, Written};
use crate::source::Value;

/// The reaction to a trouble.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Param)]
pub enum Policy {
    /// Count it.
    Count,
    /// Ramp commands to zero, and resume when the trouble is over.
    Hold,
    /// Ramp commands to zero, and wait for the operator.
    Stop,
    /// Ramp commands to zero, and end the run.
    Fault,
}

impl Policy {
    const WORDS: [(&'static str, Self); 4] =
        [("count", Self::Count), ("hold", Self::Hold), ("stop", Self::Stop), ("fault", Self::Fault)];

    /// Returns the word in a graph file.
    #[must_use]
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, policy)| *policy == self).map_or("", |(word, _)| word)
    }
}

/// What follows when a part that is a task fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) enum OnFail {
    /// Its commands ramp to zero, and the other tasks go on.
    Part,
    /// The run ends.
    Run,
}

/// Periods after which a value is too old, unless the graph sets another limit.
pub const DEFAULT_MAX_AGE_PERIODS: f64 = 5.0;

/// Returns the default maximum age of values that arrive every `period` [s], in seconds.
pub(crate) fn default_max_age_s(period: f64) -> f64 {
    DEFAULT_MAX_AGE_PERIODS * period
}

/// Returns the default maximum age of values that arrive every `period` [s], in nanoseconds.
pub(crate) fn default_max_age_ns(period: f64) -> i64 {
    (default_max_age_s(period) * 1e9) as i64
}

/// A policy that is at least as strict as number `LEAST`, for troubles that must not be ignored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PolicyFrom<const LEAST: usize>(pub(crate) Policy);

/// A policy that halts commands.
pub(crate) type HaltingPolicy = PolicyFrom<{ Policy::Hold as usize }>;
/// A policy for a budget of motion that is spent. Its arm rests in any case.
pub(crate) type BudgetPolicy = PolicyFrom<{ Policy::Stop as usize }>;

impl<const LEAST: usize> Param for PolicyFrom<LEAST> {
    const EXPECTS: &'static str =
        if LEAST == Policy::Stop as usize { "`stop` or `fault`" } else { "`hold`, `stop` or `fault`" };

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        read_word(value, &Policy::WORDS[LEAST..], Self::EXPECTS, reader).map(Self)
    }

    fn written(&self) -> Option<Written> {
        self.0.written()
    }
}

/// A wire with a maximum age.
#[derive(Debug, Clone, Param)]
pub(crate) struct WireTable {
    /// Port that the wire reads.
    pub(crate) from: Spanned<String>,
    /// Maximum age of values on the wire.
    #[param(unit = "ms", above = 0.0)]
    pub(crate) max_age_ms: f64,
    /// Reaction to an older value, which is absent for the node in any case.
    #[param(default = Policy::Hold)]
    pub(crate) stale: Policy,
}

/// The maximum age of values on a wire, and the reaction to older ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct AgeLimit {
    /// Maximum age [ns].
    pub(crate) max_age: i64,
    pub(crate) stale: Policy,
}

impl AgeLimit {
    pub(crate) fn of(table: &WireTable) -> Self {
        Self { max_age: (table.max_age_ms * 1e6) as i64, stale: table.stale }
    }

    /// Returns the stricter combination of two limits.
    pub(crate) fn and(self, other: Option<Self>) -> Self {
        let Some(other) = other else { return self };
        Self { max_age: self.max_age.min(other.max_age), stale: self.stale.max(other.stale) }
    }
}

/// The policies of one role.
#[derive(Debug, Clone, Param)]
pub(crate) struct RolePolicy {
    /// Maximum age of the newest sample of the role.
    #[param(unit = "ms", above = 0.0)]
    pub(crate) max_age_ms: Option<f64>,
    /// Reaction to an older sample.
    pub(crate) stale: Option<Policy>,
}

/// The section `[policy]`.
#[derive(Debug, Clone, Param)]
#[param(default)]
pub(crate) struct PolicyTable {
    /// The newest sample of a role is too old.
    #[param(default = Policy::Hold)]
    pub(crate) stale: Policy,
    /// The clock device is silent, and a timer stands in for it.
    #[param(default = Policy::Hold)]
    pub(crate) clock: Policy,
    /// A value is not a finite number.
    #[param(default = PolicyFrom(Policy::Fault))]
    pub(crate) not_finite: HaltingPolicy,
    /// A tick began more than one period late. Applies to a real clock only.
    #[param(default = Policy::Count)]
    pub(crate) deadline: Policy,
    /// The budget of motion without a contact is spent. `stop` stops the arm of that limiter alone, until a contact or
    /// `resume` refills the budget.
    #[param(default = PolicyFrom(Policy::Stop))]
    pub(crate) blind: BudgetPolicy,
    /// A node panicked.
    #[param(default = PolicyFrom(Policy::Fault))]
    pub(crate) panic: HaltingPolicy,
    /// A device failed.
    #[param(default = PolicyFrom(Policy::Fault))]
    pub(crate) device: HaltingPolicy,
    /// Maximum age of the newest sample of a role. The default is five periods of its device.
    #[param(unit = "ms", above = 0.0)]
    pub(crate) max_age_ms: Option<f64>,
    /// Policies of individual roles.
    #[param(default = Map(std::collections::BTreeMap::new()))]
    pub(crate) roles: Map<RolePolicy>,
}

impl PolicyTable {
    /// Returns the age limit of a role whose device has the given sample period [s].
    pub(crate) fn age_limit(&self, role: &str, period: f64) -> AgeLimit {
        let own = self.roles.0.get(role);
        let max_age = own.and_then(|own| own.max_age_ms).or(self.max_age_ms);
        let max_age = max_age.map_or_else(|| default_max_age_ns(period), |ms| (ms * 1e-3 * 1e9) as i64);
        AgeLimit { max_age, stale: own.and_then(|own| own.stale).unwrap_or(self.stale) }
    }
}
