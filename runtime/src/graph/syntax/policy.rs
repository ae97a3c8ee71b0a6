//! The section `[policy]`: what each sort of trouble does, and how old a sample may be.

use crate::node::{Map, Param, Positive, Reader, Word, Written};
use crate::source::{Item, SourceMap, Table, Value};

/// What a trouble does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Policy {
    /// It is counted.
    Count,
    /// Commands ramp to zero, and go on by themselves when the trouble is over.
    Hold,
    /// Commands ramp to zero, and wait for the operator.
    Stop,
    /// Commands ramp to zero, and the run ends.
    Fault,
}

impl Policy {
    const WORDS: [(&'static str, Self); 4] =
        [("count", Self::Count), ("hold", Self::Hold), ("stop", Self::Stop), ("fault", Self::Fault)];

    /// What it is called in a graph file.
    #[must_use]
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, policy)| *policy == self).map_or("", |(word, _)| word)
    }

    fn from(value: &Value) -> Option<Self> {
        let word = value.as_str()?;
        Self::WORDS.iter().find(|(known, _)| *known == word).map(|(_, policy)| *policy)
    }
}

impl Param for Policy {
    const EXPECTS: &'static str = "`count`, `hold`, `stop` or `fault`";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let found = Self::from(value);
        if found.is_none() {
            reader.wrong_type(value, Self::EXPECTS);
        }
        found
    }

    fn written(&self) -> Option<Written> {
        Some(self.word().into())
    }
}

/// A policy that does something: for what cannot go on as if nothing was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Firm(pub(crate) Policy);

impl Param for Firm {
    const EXPECTS: &'static str = "`hold`, `stop` or `fault`";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let found = Policy::from(value).filter(|policy| *policy != Policy::Count);
        if found.is_none() {
            reader.wrong_type(value, Self::EXPECTS);
        }
        found.map(Self)
    }

    fn written(&self) -> Option<Written> {
        self.0.written()
    }
}

crate::params! { WireTable:
    /// Where it comes from.
    from: Word,
    /// How old what comes over the wire may be [ms].
    max_age_ms: Positive,
    /// What else is done when it is older; `hold` is only that the node does without.
    stale: Policy = Policy::Hold,
}

/// How old what comes over a wire may be [ns], and what is done when it is older.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Age {
    pub(crate) max_age: i64,
    pub(crate) stale: Policy,
}

impl Age {
    pub(crate) fn of(table: &WireTable) -> Self {
        Self { max_age: (*table.max_age_ms * 1e6) as i64, stale: table.stale }
    }

    /// What holds where both hold.
    pub(crate) fn and(self, other: Option<Self>) -> Self {
        let Some(other) = other else { return self };
        Self { max_age: self.max_age.min(other.max_age), stale: self.stale.max(other.stale) }
    }
}

crate::params! { RolePolicy:
    /// How old the newest sample of the role may be [ms].
    max_age_ms: Option<Positive>,
    /// What it does when it is older.
    stale: Option<Policy>,
}

crate::params! { PolicyTable:
    /// The newest sample of a role is too old.
    stale: Policy = Policy::Hold,
    /// The clock device is silent, and a timer stands in for it.
    clock: Policy = Policy::Hold,
    /// A value is not a finite number.
    not_finite: Firm = Firm(Policy::Fault),
    /// A tick began more than a period late; with a real clock only.
    deadline: Policy = Policy::Count,
    /// A node panicked.
    panic: Firm = Firm(Policy::Fault),
    /// A device failed.
    device: Firm = Firm(Policy::Fault),
    /// How old the newest sample of a role may be; five periods of its device unless given [ms].
    max_age_ms: Option<Positive>,
    /// What holds for single roles.
    roles: Map<RolePolicy> = Map(std::collections::BTreeMap::new()),
}

impl Default for PolicyTable {
    fn default() -> Self {
        let nothing = Value { span: 0..0, item: Item::Table(Table::default()) };
        let sources = SourceMap::default();
        Self::read(&nothing, &mut Reader::new(&sources)).expect("every policy has a default")
    }
}

impl PolicyTable {
    /// How old the newest sample of a role may be, whose device samples every `period` [s], and what it does when it is
    /// older; the age in ns.
    pub(crate) fn of(&self, role: &str, period: f64) -> (i64, Policy) {
        /// As many periods of its device a sample is good for.
        const PERIODS: f64 = 5.0;
        let own = self.roles.0.get(role);
        let age = own.and_then(|own| own.max_age_ms).or(self.max_age_ms).map_or(PERIODS * period, |ms| *ms * 1e-3);
        ((age * 1e9) as i64, own.and_then(|own| own.stale).unwrap_or(self.stale))
    }
}
