//! Whether the joints follow their commands: the way that each was told against the way of its equilibrium.
//!
//! A joint whose brake has closed, or whose servo has gone, makes another motion of the one that was asked for: a slide
//! becomes a push. No limiter before it can know. The equilibrium is what the commands move, so it follows them also
//! while a compliant arm is held.

use tactflow_runtime::node::{State, Tick};

/// The way that a joint must have been told before it is judged [rad].
pub(super) const JUDGED_RAD: f64 = 0.004;
/// A joint that makes less than this part of its way is stuck [1].
const LEAST: f64 = 0.25;
/// From this part of its way on, a joint follows, and its account begins anew [1].
const ENOUGH: f64 = 0.5;
/// How long a joint must be stuck: longer than commands may be on their way [ns].
const PATIENCE_NS: i64 = 300_000_000;

/// The accounts of all joints.
#[derive(State)]
pub(super) struct Following {
    joints: Vec<Account>,
    /// The joint that does not follow, its told way and its way [rad].
    stuck: Option<(usize, [f64; 2])>,
}

/// The account of one joint.
#[derive(Debug, Clone, Copy, Default)]
struct Account {
    /// The equilibrium at the beginning, if the account has begun [rad].
    from: Option<f64>,
    /// The way that the joint was told since [rad].
    told: f64,
    /// Since when the joint has been stuck [ns].
    since: Option<i64>,
}

impl Following {
    pub(super) fn new(count: usize) -> Self {
        Self { joints: vec![Account::default(); count], stuck: None }
    }

    /// Closes all accounts: the device does not get these commands now.
    pub(super) fn pause(&mut self) {
        self.joints.fill(Account::default());
    }

    /// Notes the commands of the last tick [rad/s] and where they have led. Returns whether a joint does not follow.
    pub(super) fn note(&mut self, tick: &Tick, commands: &[f64], equilibrium: &[f64]) -> bool {
        if self.stuck.is_none() {
            let joints = self.joints.iter_mut().zip(commands).zip(equilibrium).enumerate();
            for (i, ((account, command), equilibrium)) in joints {
                if let Some(ways) = account.note(tick, *command, *equilibrium) {
                    self.stuck.get_or_insert((i, ways));
                }
            }
        }
        self.stuck.is_some()
    }

    /// The joint that does not follow, the way that it was told and its own [rad].
    pub(super) const fn stuck(&self) -> Option<(usize, [f64; 2])> {
        self.stuck
    }
}

impl Account {
    /// Notes a command [rad/s] and the `equilibrium` [rad]. Returns the told way and the way of a joint that is stuck.
    fn note(&mut self, tick: &Tick, command: f64, equilibrium: f64) -> Option<[f64; 2]> {
        let from = *self.from.get_or_insert(equilibrium);
        self.told += command * tick.dt.min(tick.max_gap);
        if self.told.abs() <= JUDGED_RAD {
            self.since = None;
            return None;
        }
        let way = equilibrium - from;
        let part = way / self.told;
        if part >= ENOUGH {
            *self = Self { from: Some(equilibrium), ..Self::default() };
        } else if part >= LEAST {
            self.since = None;
        } else if tick.now - *self.since.get_or_insert(tick.now) >= PATIENCE_NS {
            return Some([self.told, way]);
        }
        None
    }
}
