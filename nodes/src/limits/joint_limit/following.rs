//! Whether the joints follow their commands: the way that each was commanded against the way of its equilibrium.
//!
//! A joint whose brake has closed, or whose servo has gone, makes another motion of the one that was asked for: a slide
//! becomes a push. No limiter before it can know. The equilibrium is what the commands move, so it follows them also
//! while a compliant arm is held.
//!
//! A command acts after an unknown delay L of up to 100 ms. With c(t), the sum of all commands up to t, the equilibrium
//! moves from t1 to t2 by c(t2 - L) - c(t1 - L). Whatever L is, this is at least min c - max c, over the last 100 ms before
//! t2 and before t1. This is the way that is certain.

use tactflow_runtime::node::{State, Tick};

/// The certain way from which on a joint is judged [rad].
pub(super) const JUDGED_RAD: f64 = 0.004;
/// The certain way from which on a joint can have followed, so that its account begins anew [rad].
const COUNTED_RAD: f64 = 0.001;
/// A joint that makes less than this part of its certain way is stuck [1].
const LEAST: f64 = 0.1;
/// From this part of its certain way on, a joint follows [1].
const ENOUGH: f64 = 0.15;
/// How late a command may act [s].
const DELAY_S: f64 = 0.1;
/// How late a command may act in a slow graph, in its longest ticks [1].
const DELAY_TICKS: f64 = 4.0;

/// What all joints were commanded, and how far they went.
#[derive(State)]
pub struct Following {
    joints: Vec<Account>,
    /// When the current block of the histories began [ns].
    block: Option<i64>,
    /// The joint that does not follow, its certain way and its way [rad].
    stuck: Option<(usize, [f64; 2])>,
}

/// The account of one joint.
#[derive(Debug, Clone, Copy, Default)]
struct Account {
    /// The sum of all commands [rad].
    commanded: f64,
    /// The smallest and the largest sum in the last block of time and in this one. Together they hold the last 100 ms.
    blocks: [[f64; 2]; 2],
    /// The equilibrium at the beginning of the account, and the smallest and the largest sum shortly before [rad].
    begin: Option<(f64, [f64; 2])>,
}

impl Following {
    /// Starts to watch that many joints.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self { joints: vec![Account::default(); count], block: None, stuck: None }
    }

    /// Closes all accounts: the device does not get these commands now.
    pub fn pause(&mut self) {
        self.joints.fill(Account::default());
        self.block = None;
    }

    /// Notes the commands of the last tick [rad/s] and where they have led. Returns whether a joint does not follow.
    pub fn note(&mut self, tick: &Tick, commands: &[f64], equilibrium: &[f64]) -> bool {
        let length = DELAY_S.max(DELAY_TICKS * tick.max_gap);
        let begins = (tick.now - *self.block.get_or_insert(tick.now)) as f64 * 1e-9 >= length;
        if begins {
            self.block = Some(tick.now);
        }
        let joints = self.joints.iter_mut().zip(commands).zip(equilibrium).enumerate();
        for (i, ((account, command), equilibrium)) in joints {
            let ways = account.note(command * tick.dt.min(tick.max_gap), *equilibrium, begins);
            if let (Some(ways), None) = (ways, self.stuck) {
                self.stuck = Some((i, ways));
            }
        }
        self.stuck.is_some()
    }

    /// The joint that does not follow, its certain way and its way [rad].
    #[must_use]
    pub const fn stuck(&self) -> Option<(usize, [f64; 2])> {
        self.stuck
    }
}

impl Account {
    /// Notes the way of a command and the `equilibrium` [rad]; a block of the history `begins`. Returns the certain way and
    /// the way of a joint that is stuck.
    fn note(&mut self, way: f64, equilibrium: f64, begins: bool) -> Option<[f64; 2]> {
        self.commanded += way;
        let now = self.commanded;
        if begins {
            self.blocks = [self.blocks[1], [now; 2]];
        }
        let [_, [least, most]] = &mut self.blocks;
        (*least, *most) = (least.min(now), most.max(now));
        let [[a, b], [c, d]] = self.blocks;
        let (least, most) = (a.min(c), b.max(d));
        let (from, [least_before, most_before]) = *self.begin.get_or_insert((equilibrium, [least, most]));
        // Toward the side on which the way is certain.
        let (sign, certain) =
            if least > most_before { (1.0, least - most_before) } else { (-1.0, least_before - most) };
        if certain < COUNTED_RAD {
            return None;
        }
        let way = sign * (equilibrium - from);
        if way >= ENOUGH * certain {
            self.begin = Some((equilibrium, [least, most]));
        }
        (certain >= JUDGED_RAD && way < LEAST * certain).then_some([sign * certain, sign * way])
    }
}
