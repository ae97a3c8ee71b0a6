//! The lease of a device that moves: it follows the commands while they are valid, and then comes to rest by itself.
//!
//! A command is valid for a short time. A graph that runs renews it in every tick. If the graph hangs, or the process
//! was stopped, the lease is lost: the commands ramp to zero, and those of the same epoch are refused. Only when the
//! operator resumes does the graph begin a new epoch.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::exchange::{Commands, Grant};
use crate::signal::line::approach;

/// What a device may do, from the commands of the graph and the time.
#[derive(Debug)]
pub(crate) struct Lease {
    /// The commands that the device got last.
    held: Commands,
    /// Maximum acceleration of each joint of each command [rad/s²]; infinite without a limit.
    accelerations: Vec<Vec<f64>>,
    /// Time of the last call [ns].
    at: i64,
    /// Nominal time between two calls [ns].
    period: i64,
    /// Time without a command after which the device has stopped by itself [ns].
    silence: i64,
    /// Whether `held` has reached the commands of the graph.
    follows: bool,
    shared: Arc<LeaseState>,
}

/// What the device and the graph know of a lease.
#[derive(Debug, Default)]
pub(crate) struct LeaseState {
    /// The newest epoch whose commands the device refuses.
    refused: AtomicU64,
    /// Whether the last commands that the device got are zero.
    rests: AtomicBool,
    /// Whether every further command is zero, without a ramp.
    is_cut: AtomicBool,
    /// Why the driver refuses the commands, and of which epoch.
    reason: Mutex<(u64, String)>,
}

impl LeaseState {
    /// Whether the commands of an epoch are refused.
    pub(crate) fn refuses(&self, epoch: u64) -> bool {
        self.refused.load(Ordering::Acquire) >= epoch
    }

    /// Refuses the commands of an epoch, and of all before it.
    pub(crate) fn refuse(&self, epoch: u64) {
        self.refused.fetch_max(epoch, Ordering::AcqRel);
    }

    /// Refuses the commands of an epoch because the device does not follow them: `why`. The first reason holds.
    #[cold]
    pub(crate) fn refuse_because(&self, epoch: u64, why: String) {
        let mut reason = self.reason.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.refuses(epoch) {
            *reason = (epoch, why);
        }
        self.refuse(epoch);
    }

    /// Makes every further command zero, without a ramp. Returns whether none was cut before.
    #[cold]
    pub(crate) fn cut(&self) -> bool {
        !self.is_cut.swap(true, Ordering::AcqRel)
    }

    /// Returns why the driver refuses the commands of an epoch; `None` if it gave no reason.
    #[cold]
    pub(crate) fn reason(&self, epoch: u64) -> Option<String> {
        let reason = self.reason.lock().unwrap_or_else(PoisonError::into_inner);
        (reason.0 == epoch).then(|| reason.1.clone())
    }

    /// Whether the last commands that the device got are zero.
    pub(crate) fn rests(&self) -> bool {
        self.rests.load(Ordering::Acquire)
    }
}

impl Lease {
    /// `held` are the commands at the start, which are zero.
    pub(crate) fn new(held: Commands, accelerations: Vec<Vec<f64>>, period: i64, silence: i64) -> Self {
        let shared = Arc::new(LeaseState { rests: AtomicBool::new(true), ..LeaseState::default() });
        Self { held, accelerations, at: 0, period, silence, follows: false, shared }
    }

    /// Returns what the graph knows of the lease.
    pub(crate) fn shared(&self) -> Arc<LeaseState> {
        Arc::clone(&self.shared)
    }

    /// Returns what the device may do at `now` [ns].
    pub(crate) fn hold(&mut self, granted: &Commands, now: i64) -> &Commands {
        let Grant { epoch, until, .. } = granted.grant;
        self.held.grant = granted.grant;
        let last = std::mem::replace(&mut self.at, now);
        let was_refused = self.shared.refuses(epoch);
        let has_stopped = now.saturating_sub(last) > self.silence && !self.held.are_zero();
        // Commands of zero move nothing, so they need no lease.
        let has_expired = now > until && !granted.are_zero();
        if has_stopped || has_expired {
            self.shared.refuse(epoch);
        }
        if has_stopped {
            // A ramp from the last velocity would move the device again.
            self.held.rest();
        }
        // After a time without a call, the device must not jump to what the graph reached meanwhile.
        self.follows &= now - last <= 2 * self.period;
        if self.shared.is_cut.load(Ordering::Acquire) {
            self.held.rest();
        } else if !self.shared.refuses(epoch) {
            self.follow(granted, now - last);
        } else if was_refused {
            self.ramp(now - last);
        } else {
            // The ramp begins when the commands expired, and not when that was noticed.
            self.ramp(now - last.max(until.min(now)));
        }
        self.shared.rests.store(self.held.are_zero(), Ordering::Release);
        &self.held
    }

    /// Follows the commands of the graph; approaches them first, after a time in which it did not follow.
    fn follow(&mut self, granted: &Commands, dt: i64) {
        if self.follows {
            self.held.copy_from(granted);
            return;
        }
        let dt = dt.min(2 * self.period) as f64 * 1e-9;
        self.follows = true;
        for ((held, granted), accelerations) in
            self.held.values.iter_mut().zip(&granted.values).zip(&self.accelerations)
        {
            self.follows &= approach(held, |i| granted[i], accelerations, dt);
        }
        self.held.copy_reports(granted);
    }

    /// Ramps to zero for `dt` [ns].
    fn ramp(&mut self, dt: i64) {
        self.follows = false;
        for (held, accelerations) in self.held.values.iter_mut().zip(&self.accelerations) {
            approach(held, |_| 0.0, accelerations, dt as f64 * 1e-9);
        }
        self.held.clear_reports();
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::device::{Command, Description};
    use crate::signal::JointsShape;

    const MS: i64 = 1_000_000;

    /// A lease on two joints of 10 rad/s² that are called every 4 ms and stop after a silence of 100 ms, and commands.
    fn lease() -> (Lease, Commands, Command) {
        let mut description = Description::every(0.004);
        let joints = JointsShape { joints: vec![Default::default(); 2], ..Default::default() };
        let velocity = description.fills("arm").command("velocity", joints);
        let commands = Commands::of(&description);
        (Lease::new(commands.clone(), vec![vec![10.0; 2]], 4 * MS, 100 * MS), commands, velocity)
    }

    fn grant(commands: &mut Commands, velocity: Command, values: [f64; 2], epoch: u64, now: i64) {
        commands.command(velocity, &values);
        commands.grant = Grant { epoch, until: now + 20 * MS, seen: None };
    }

    #[test]
    fn a_command_that_is_not_renewed_ramps_to_zero_and_its_epoch_is_refused() {
        let (mut lease, mut commands, velocity) = lease();
        let mut now = 0;
        // It approaches the first command, 0.04 rad/s in each call.
        for expected in [0.04, 0.08, 0.1, 0.1] {
            now += 4 * MS;
            grant(&mut commands, velocity, [0.1, 0.0], 1, now);
            assert!((lease.hold(&commands, now).joints(velocity)[0] - expected).abs() < 1e-12);
        }
        let renewed = now;
        for (ms, expected) in [(4, 0.1), (20, 0.1), (22, 0.08), (26, 0.04), (30, 0.0), (34, 0.0)] {
            let held = lease.hold(&commands, renewed + ms * MS).joints(velocity)[0];
            assert!((held - expected).abs() < 1e-12, "{held} after {ms} ms");
        }
        // The graph is back, but only a new epoch moves the device.
        now = renewed + 300 * MS;
        for (epoch, expected) in [(1, 0.0), (1, 0.0), (2, 0.04), (2, 0.08)] {
            now += 4 * MS;
            grant(&mut commands, velocity, [0.1, 0.0], epoch, now);
            let held = lease.hold(&commands, now).joints(velocity)[0];
            assert!((held - expected).abs() < 1e-12, "{held} in epoch {epoch}");
        }
    }

    #[test]
    fn a_graph_that_is_back_before_the_ramp_ends_does_not_end_the_ramp() {
        let (mut lease, mut commands, velocity) = lease();
        for now in 1..=100 {
            grant(&mut commands, velocity, [1.0, 0.0], 1, now * 4 * MS);
            lease.hold(&commands, now * 4 * MS);
        }
        // The commands expire 20 ms after the last one, and 40 ms later the graph renews them, with zero.
        let renewed = 400 * MS;
        let mut last = lease.hold(&commands, renewed + 60 * MS).joints(velocity)[0];
        assert!((last - 0.6).abs() < 1e-9, "{last}");
        for ms in (64..=116).step_by(4) {
            grant(&mut commands, velocity, [0.0, 0.0], 1, renewed + ms * MS);
            let held = lease.hold(&commands, renewed + ms * MS).joints(velocity)[0];
            assert!((last - held - 0.04).abs() < 1e-9 || held == 0.0, "{last} to {held}");
            last = held;
        }
        grant(&mut commands, velocity, [0.0, 0.0], 1, renewed + 140 * MS);
        assert!(!lease.shared.rests());
        assert!(lease.hold(&commands, renewed + 140 * MS).are_zero() && lease.shared.rests());
    }

    #[test]
    fn a_cut_is_zero_at_once_for_a_device_that_lags_behind_the_commands_or_refuses_them() {
        let (mut lease, mut commands, velocity) = lease();
        for now in 1..=100 {
            grant(&mut commands, velocity, [1.0, 0.0], 1, now * 4 * MS);
            lease.hold(&commands, now * 4 * MS);
        }
        // A call that is 60 ms late ends the following, and the graph's own ramp is as fast as the device can be.
        grant(&mut commands, velocity, [0.4, 0.0], 1, 460 * MS);
        assert!(lease.hold(&commands, 460 * MS).joints(velocity)[0] > 0.9);
        grant(&mut commands, velocity, [0.0, 0.0], 1, 464 * MS);
        assert!(lease.hold(&commands, 464 * MS).joints(velocity)[0] > 0.8);
        assert!(lease.shared.cut() && !lease.shared.cut());
        assert!(lease.hold(&commands, 468 * MS).are_zero() && lease.shared.rests());
        grant(&mut commands, velocity, [0.1, 0.0], 2, 472 * MS);
        assert!(lease.hold(&commands, 472 * MS).are_zero());
    }

    #[test]
    fn a_process_that_was_stopped_does_not_move_the_device_when_it_continues() {
        let (mut lease, mut commands, velocity) = lease();
        for now in 1..=20 {
            grant(&mut commands, velocity, [0.1, -0.1], 1, now * 4 * MS);
            lease.hold(&commands, now * 4 * MS);
        }
        // Even if the tick is the first to go on and renews the command.
        let now = 80 * MS + 5_000 * MS;
        grant(&mut commands, velocity, [0.1, -0.1], 1, now);
        assert_eq!(lease.hold(&commands, now).joints(velocity), [0.0, 0.0]);
        assert_eq!(lease.hold(&commands, now + 4 * MS).joints(velocity), [0.0, 0.0]);
    }

    #[test]
    fn a_device_at_rest_needs_no_lease() {
        let (mut lease, mut commands, velocity) = lease();
        grant(&mut commands, velocity, [0.0, 0.0], 1, 0);
        assert!(lease.hold(&commands, 5_000 * MS).are_zero());
        grant(&mut commands, velocity, [0.1, 0.0], 1, 5_900 * MS);
        assert_eq!(lease.hold(&commands, 5_900 * MS).joints(velocity), [0.08, 0.0], "it does not jump");
    }

    proptest! {
        #[test]
        fn no_order_of_grants_and_calls_makes_a_device_jump_or_move_without_a_lease(
            events in prop::collection::vec((0..30_i64, prop::option::of(prop::array::uniform2(-0.5..0.5_f64)), any::<bool>()), 1..120),
        ) {
            let (mut lease, mut commands, velocity) = lease();
            let (mut now, mut epoch, mut graph, mut last) = (0, 1, [0.0; 2], [0.0; 2]);
            let (mut called, mut granted) = (0, 0);
            for (ms, target, resumes) in events {
                now += ms * MS;
                epoch += u64::from(resumes);
                if let Some(target) = target {
                    // The graph itself respects the accelerations between two of its commands.
                    let dt = (now - std::mem::replace(&mut granted, now)).min(4 * MS) as f64 * 1e-9;
                    approach(&mut graph, |i| target[i], &[10.0; 2], dt);
                    grant(&mut commands, velocity, graph, epoch, now);
                }
                let was_refused = lease.shared.refuses(commands.grant.epoch);
                let held: [f64; 2] = lease.hold(&commands, now).joints(velocity).try_into().unwrap();
                let dt = ((now - called) as f64 * 1e-9).max(0.004) + 0.004;
                for i in 0..2 {
                    prop_assert!((held[i] - last[i]).abs() <= 10.0 * dt + 1e-9, "{last:?} to {held:?}");
                    let is_slower = held[i].abs() < last[i].abs() || held[i] == 0.0;
                    prop_assert!(!was_refused || now == called || is_slower, "{last:?} to {held:?} in {epoch}");
                }
                prop_assert_eq!(lease.shared.rests(), held == [0.0; 2]);
                (last, called) = (held, now);
            }
        }
    }
}
