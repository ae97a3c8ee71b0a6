//! How far an arm gives way for each newton, learned while it presses; and what of its lead is a swing.

use tactflow_runtime::node::State;

/// Time constant of the high-pass filter [s]: what stays longer is no swing.
pub(super) const SETTLE_S: f64 = 0.3;
/// Time constant of the low-pass filter [s].
pub(super) const SMOOTH_S: f64 = 0.02;
/// Time of contact in which the weight of a sample decays to 37 %, and that of what is stated [s].
const MEMORY_S: f64 = 2.0;
/// Weight of the stated compliance at first, as the square of a force times the time for which it acts [N² s]. After
/// 11 ms with 3 N, what is measured counts as much.
const STATED: f64 = 0.1;
/// Its weight in the end: without a force, there is nothing to learn [N² s].
const STATED_AT_LEAST: f64 = 0.01;
/// Largest compliance, as a multiple of the stated one. With too large a one, each force looks like a swing [1].
const MAX_FACTOR: f64 = 3.0;
/// Smallest compliance, as a multiple of the stated one: that of an arm that hardly gives way [1].
const MIN_FACTOR: f64 = 0.05;

/// Measured forces are enough once they weigh this many times as much as what is stated [1].
const ENOUGH: f64 = 10.0;
/// After so long with enough forces, the swing of the first press has left what is learned [s].
const LEARNED_S: f64 = 1.0;

/// A force that misses the lead by more than this is no measurement [m].
const MOST_SWING_M: f64 = 0.01;
/// After forces have missed it for so long, what is wrong is the lead with which the contact began [s].
const MISSED_S: f64 = 0.1;

/// What is known of the spring of an arm.
#[derive(Debug, State)]
pub(super) struct Spring {
    /// Weight of the stated compliance; `None` before the first contact [N² s].
    stated: Option<f64>,
    /// Sum of the lead times the deflection that is stated, of samples with decaying weights [m² s].
    products: f64,
    /// Sum of the squares of the deflection that is stated, of the same samples [m² s].
    squares: f64,
    /// How many times as much as stated the arm gives way, by what was measured alone, at the last sample with enough
    /// forces; 0 before it [1].
    gives: f64,
    /// Time of contact with enough forces [s].
    learning: f64,
    /// The contact, while there is one.
    contact: Option<Contact>,
    /// For how long each force has missed the lead [s].
    missed: f64,
}

/// The filters during one contact.
#[derive(Debug, Clone, Copy)]
struct Contact {
    /// Lead without any force: what friction and gravity take [m].
    rest: f64,
    /// What has stayed [m].
    stayed: f64,
    /// The swing [m].
    swing: f64,
}

/// How the spring of an arm is bent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bent {
    /// By the force [m].
    pub(super) deflection: f64,
    /// By a swing [m].
    pub(super) swing: f64,
}

impl Bent {
    /// Whether both are numbers.
    pub(super) const fn is_finite(self) -> bool {
        self.deflection.is_finite() && self.swing.is_finite()
    }
}

impl Spring {
    /// Takes the next lead [m] and force [N], `dt` [s] after the last ones, of an arm with this stated compliance [m/N].
    /// Returns `None`, and takes nothing, if the force is no measurement: a frame of garbage would be learned. A contact
    /// that began with such a frame begins again.
    pub(super) fn next(&mut self, compliance: f64, lead: f64, force: f64, dt: f64) -> Option<Bent> {
        let stated = compliance * force;
        let begun = || Contact { rest: lead - self.factor(compliance) * stated, stayed: 0.0, swing: 0.0 };
        let mut contact = self.contact.unwrap_or_else(begun);
        let lead = lead - contact.rest;
        if (lead - self.factor(compliance) * stated - contact.stayed).abs() > MOST_SWING_M {
            self.missed += dt;
            if self.missed > MISSED_S {
                self.release();
            }
            return None;
        }
        self.missed = 0.0;
        let kept = 1.0 - share(dt, MEMORY_S);
        self.stated = Some((kept * self.stated.unwrap_or(STATED)).max(STATED_AT_LEAST));
        self.products = kept * self.products + lead * stated * dt;
        self.squares = kept * self.squares + stated * stated * dt;
        if self.squares > ENOUGH * self.weight(compliance) {
            self.learning += dt;
            self.gives = (self.products / self.squares).clamp(MIN_FACTOR, MAX_FACTOR);
        }
        let deflection = self.factor(compliance) * stated;
        contact.stayed += (lead - deflection - contact.stayed) * share(dt, SETTLE_S);
        contact.swing += (lead - deflection - contact.stayed - contact.swing) * share(dt, SMOOTH_S);
        self.contact = Some(contact);
        Some(Bent { deflection, swing: contact.swing })
    }

    /// The contact ends. What has been learned of the spring stays.
    pub(super) const fn release(&mut self) {
        (self.contact, self.missed) = (None, 0.0);
    }

    /// Returns how many times as much as stated the arm gives way, once enough has been learned, and whether this is
    /// the smallest or the largest number that can be learned.
    pub(super) fn learned(&self) -> Option<(f64, bool)> {
        let is_end = [MIN_FACTOR, MAX_FACTOR].contains(&self.gives);
        (self.learning >= LEARNED_S).then_some((self.gives, is_end))
    }

    /// Returns how many times as much as stated the arm gives way. One that the force cannot bend gives way as stated.
    fn factor(&self, compliance: f64) -> f64 {
        let weight = self.weight(compliance);
        let whole = weight + self.squares;
        if whole > 0.0 { ((weight + self.products) / whole).clamp(MIN_FACTOR, MAX_FACTOR) } else { 1.0 }
    }

    /// Returns how much the stated compliance counts, beside [`Self::squares`] [m² s].
    fn weight(&self, compliance: f64) -> f64 {
        self.stated.unwrap_or(STATED) * compliance * compliance
    }
}

/// Returns the fraction of a change that a filter with this time constant passes in a step of `dt` [s].
fn share(dt: f64, time: f64) -> f64 {
    -libm::expm1(-dt / time)
}
