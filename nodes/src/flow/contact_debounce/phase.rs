//! The phase of a contact, from the newest flags.
//!
//! With five samples, written oldest first, it is the debouncer of the authors' later code:
//!
//! | flags | state | code |
//! |---|---|---|
//! | 00000 | none | 0 |
//! | 00111 | initial | 1 |
//! | 11111 | stable | 2 |
//! | 11100 | leaving | 3 |
//! | any other | uncertain | 4 |
//!
//! Samples that are still missing at the start count as no contact.

/// The state of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactPhase {
    /// No sample has a contact.
    None,
    /// The newer half of the samples has a contact.
    Initial,
    /// All samples have a contact.
    Stable,
    /// The older half of the samples has a contact.
    Leaving,
    /// Anything else.
    Uncertain,
}

/// Returns the state for the newest `samples` of a history, from 1 to 64; the newest sample is the lowest bit.
#[must_use]
pub fn phase(history: u64, samples: u32) -> ContactPhase {
    let ones = |count: u32| u64::MAX.checked_shr(u64::BITS - count).unwrap_or(0);
    let (all, newer) = (ones(samples), ones(samples - samples / 2));
    let older = all ^ ones(samples / 2);
    match history & all {
        0 => ContactPhase::None,
        flags if flags == all => ContactPhase::Stable,
        flags if flags == newer => ContactPhase::Initial,
        flags if flags == older => ContactPhase::Leaving,
        _ => ContactPhase::Uncertain,
    }
}
