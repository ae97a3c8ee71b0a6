//! How far an arm gives way for each newton, learned while it presses; and what of its lead is a swing.

use tactflow_runtime::node::State;

/// Time constant of the high-pass filter [s]: what stays longer is no swing.
pub(super) const SETTLE_S: f64 = 0.3;
/// Time constant of the low-pass filter [s].
pub(super) const SMOOTH_S: f64 = 0.02;
/// Time in which the weight of a sample decays to 37 % [s].
const MEMORY_S: f64 = 2.0;
/// Weight of the stated compliance, as the square of a force times the time for which it acts [N² s].
const STATED: f64 = 1.0;
/// How many times as much or as little as stated the compliance may be [1].
const MOST: f64 = 3.0;

/// What is known of the spring of an arm.
#[derive(Debug, State)]
pub struct Spring {
    /// Sum of lead times force, of samples with decaying weights [m N s].
    products: f64,
    /// Sum of the squares of the force, of the same samples [N² s].
    squares: f64,
    /// The contact, while there is one.
    contact: Option<Contact>,
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
    /// How far it gives way to the force [m].
    pub(super) given_way: f64,
    /// What of the lead is a swing [m].
    pub(super) swing: f64,
}

impl Spring {
    /// Takes the next lead [m] and force [N], `dt` [s] after the last ones, of an arm with this stated compliance [m/N].
    pub(super) fn next(&mut self, stated: f64, lead: f64, force: f64, dt: f64) -> Bent {
        let begun = || Contact { rest: lead - self.compliance(stated) * force, stayed: 0.0, swing: 0.0 };
        let mut contact = self.contact.unwrap_or_else(begun);
        let lead = lead - contact.rest;
        let kept = 1.0 - share(dt, MEMORY_S);
        self.products = kept * self.products + lead * force * dt;
        self.squares = kept * self.squares + force * force * dt;
        let given_way = self.compliance(stated) * force;
        contact.stayed += (lead - given_way - contact.stayed) * share(dt, SETTLE_S);
        contact.swing += (lead - given_way - contact.stayed - contact.swing) * share(dt, SMOOTH_S);
        self.contact = Some(contact);
        Bent { given_way, swing: contact.swing }
    }

    /// The contact ends. What has been learned of the spring stays.
    pub(super) const fn release(&mut self) {
        self.contact = None;
    }

    /// Whether what was learned is finite: a sample that is not a number would stay in it.
    pub(super) fn is_finite(&self) -> bool {
        self.products.is_finite() && self.squares.is_finite()
    }

    fn compliance(&self, stated: f64) -> f64 {
        let learned = (STATED * stated + self.products) / (STATED + self.squares);
        learned.clamp(stated / MOST, stated * MOST)
    }
}

/// Returns the fraction of a change that a filter with this time constant passes in a step of `dt` [s].
fn share(dt: f64, time: f64) -> f64 {
    -libm::expm1(-dt / time)
}
