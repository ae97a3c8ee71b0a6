//! The last stage before a device: follows the graph's command or ramps to zero. It never holds the last velocity.
//!
//! A command follows the graph exactly. While the graph's command is absent or too old, or commands are halted, it
//! ramps to zero on a straight line, as fast as the joint accelerations allow. When the graph's command returns, it
//! approaches that command with the same accelerations before it follows again.

use crate::device::Commands;
use crate::graph::PlannedCommand;
use crate::node::{Bus, PortId, Tick};
use crate::signal::Joints;
use crate::signal::line::approach;

/// One command port of a device.
pub(crate) struct CommandSlot {
    /// The tasks that drive it. It rests while one of them does.
    pub(crate) tasks: Box<[usize]>,
    pub(crate) device: usize,
    pub(crate) source: PortId,
    pub(crate) command: usize,
    /// Maximum age of the graph's command [ns].
    max_age: i64,
    /// Maximum acceleration of each joint [rad/s²]; infinite if it has no limit.
    pub(crate) accelerations: Box<[f64]>,
    /// Whether it has reached the graph's command.
    pub(crate) follows: bool,
    /// The runner of the node that makes the graph's command.
    pub(crate) maker: Option<usize>,
}

impl CommandSlot {
    pub(crate) fn new(source: PortId, planned: PlannedCommand) -> Self {
        let PlannedCommand { tasks, device, port, age, accelerations, .. } = planned;
        Self {
            tasks: tasks.into(),
            device,
            source,
            command: port,
            max_age: age.max_age,
            accelerations: accelerations.into(),
            follows: false,
            maker: None,
        }
    }

    /// Takes over the graph's command, or ramps toward zero if that is absent, too old or halted.
    pub(crate) fn commit(&mut self, bus: &Bus, commands: &mut Commands, tick: &Tick, is_halted: bool) {
        let (mark, dt) = (bus.mark(self.source), tick.dt);
        if is_halted || !mark.is_present() || mark.stamp().age(tick.now) > self.max_age {
            self.ramp(commands, dt);
            return;
        }
        let Joints(target) = bus.slot(self.source);
        let values = &mut commands.values[self.command];
        if self.follows {
            values.copy_from_slice(target);
        } else {
            self.follows = approach(values, |i| target[i], &self.accelerations, dt);
        }
    }

    /// Ramps toward zero for `dt` [s]. Returns whether the command is zero.
    pub(crate) fn ramp(&mut self, commands: &mut Commands, dt: f64) -> bool {
        self.follows = false;
        approach(&mut commands.values[self.command], |_| 0.0, &self.accelerations, dt)
    }
}

/// One report port of a device. A report moves nothing, so it is sent while commands are halted too.
pub(crate) struct ReportSlot {
    pub(crate) device: usize,
    source: PortId,
    report: usize,
    /// Maximum age of the report [ns].
    max_age: i64,
}

impl ReportSlot {
    pub(crate) const fn new(source: PortId, planned: &PlannedCommand) -> Self {
        Self { device: planned.device, source, report: planned.port, max_age: planned.age.max_age }
    }

    /// Copies the report, or makes it absent if it is absent or too old.
    pub(crate) fn commit(&self, bus: &Bus, commands: &mut Commands, tick: &Tick) {
        let mark = bus.mark(self.source);
        let is_fresh = mark.is_present() && mark.stamp().age(tick.now) <= self.max_age;
        let is_new = is_fresh && mark.changed_in(tick.index);
        commands.take_report(
            self.report,
            &bus.arenas,
            is_fresh.then_some(self.source.slot),
            (mark.stamp().nanos, is_new),
        );
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::device::Description;
    use crate::signal::{JointsShape, Stamp};

    /// A slot for two joints, and the bus that carries its command.
    fn slot(accelerations: [f64; 2]) -> (CommandSlot, Bus, Commands) {
        let mut bus = Bus::default();
        let source = bus.add(&JointsShape { joints: vec![Default::default(); 2], ..Default::default() }.into());
        let slot = CommandSlot {
            tasks: Box::new([0]),
            device: 0,
            source,
            command: 0,
            max_age: 100,
            accelerations: accelerations.into(),
            follows: false,
            maker: None,
        };
        let mut description = Description::every(1.0);
        let joints = JointsShape { joints: vec![Default::default(); 2], ..Default::default() };
        description.fills("arm").command("velocity", joints);
        (slot, bus, Commands::of(&description))
    }

    fn drive(bus: &mut Bus, slot: &CommandSlot, target: Option<[f64; 2]>) {
        match target {
            Some(target) => {
                bus.mark_mut(slot.source).renew(1, Stamp::TIMELESS);
                bus.slot_mut::<Joints>(slot.source).0.copy_from_slice(&target);
            }
            None => bus.mark_mut(slot.source).lose(1),
        }
    }

    #[test]
    fn a_ramp_is_linear_and_ends_at_zero() {
        let (mut slot, _, mut commands) = slot([20.0, 20.0]);
        commands.values[0].copy_from_slice(&[2.0, -1.0]);
        let mut last = 2.0;
        for step in 1..=10 {
            let is_still = slot.ramp(&mut commands, 0.01);
            let now = commands.values[0][0];
            assert!((last - now - 0.2).abs() < 1e-12, "step {step}: {last} to {now}");
            assert!((commands.values[0][1] + now / 2.0).abs() < 1e-12, "the direction stays");
            assert!(!is_still || step >= 10);
            last = now;
        }
        assert!(slot.ramp(&mut commands, 0.01));
        assert_eq!(&*commands.values[0], [0.0, 0.0]);
    }

    #[test]
    fn without_an_acceleration_limit_the_command_follows_at_once() {
        let (mut slot, mut bus, mut commands) = slot([f64::INFINITY; 2]);
        drive(&mut bus, &slot, Some([3.0, 4.0]));
        slot.commit(&bus, &mut commands, &Tick::first(), false);
        assert_eq!(&*commands.values[0], [3.0, 4.0]);
        slot.commit(&bus, &mut commands, &Tick::first(), true);
        assert_eq!(&*commands.values[0], [0.0, 0.0]);
    }

    #[test]
    fn a_command_that_is_too_old_is_not_followed() {
        let (mut slot, mut bus, mut commands) = slot([f64::INFINITY; 2]);
        drive(&mut bus, &slot, Some([3.0, 4.0]));
        bus.mark_mut(slot.source).renew(1, Stamp { nanos: 0, device: 0 });
        for (now, expected) in [(100, [3.0, 4.0]), (101, [0.0, 0.0])] {
            slot.commit(&bus, &mut commands, &Tick { now, ..Tick::first() }, false);
            assert_eq!(&*commands.values[0], expected, "{now} ns");
        }
    }

    #[test]
    fn a_report_is_copied_in_place_while_it_is_present_and_fresh() {
        let (mut bus, shape) =
            (Bus::default(), JointsShape { joints: vec![Default::default(); 2], ..Default::default() });
        let source = bus.add(&shape.clone().into());
        let report = ReportSlot { device: 0, source, report: 1, max_age: 100 };
        let mut description = Description::every(1.0);
        let mut arm = description.fills("arm");
        let (other, joints) = (arm.report::<bool>("is_there"), arm.report::<Joints>("joints"));
        let shape = shape.into();
        let mut commands = Commands::with_reports(&description, |report| (report == 1).then_some(&shape));
        let buffer = bus.slot::<Joints>(source).0.as_ptr();
        let mut commit = |stamp: Option<i64>, now: i64| {
            match stamp {
                Some(nanos) => bus.mark_mut(source).renew(1, Stamp { nanos, device: 0 }),
                None => bus.mark_mut(source).lose(1),
            }
            bus.slot_mut::<Joints>(source).0.fill(now as f64);
            report.commit(&bus, &mut commands, &Tick { now, ..Tick::first() });
            let reported = commands.report(joints).map(|joints| (joints.0[1], joints.0.as_ptr()));
            assert!(commands.report(other).is_none());
            assert!(reported.is_none_or(|(_, copy)| copy != buffer));
            reported
        };
        let first = commit(Some(0), 0).unwrap();
        assert_eq!(commit(Some(0), 100), Some((100.0, first.1)), "in the same buffer");
        assert_eq!(commit(Some(0), 101), None, "too old");
        assert_eq!(commit(Some(50), 101), Some((101.0, first.1)));
        assert_eq!(commit(None, 102), None, "absent");
        commands.clear_reports();
        assert!(commands.report(joints).is_none());
    }

    proptest! {
        #[test]
        fn a_command_never_jumps_and_an_undriven_one_always_slows_down(
            ticks in prop::collection::vec((prop::option::of(prop::array::uniform2(-1.0..1.0f64)), any::<bool>()), 1..60),
            dt in 0.0..0.02f64,
        ) {
            let accelerations = [5.0, 2.0];
            let (mut slot, mut bus, mut commands) = slot(accelerations);
            // The graph's command respects the accelerations, like the output of a limiter.
            let (mut limited, mut last) = ([0.0; 2], [0.0; 2]);
            for (target, is_halted) in ticks {
                if let Some(target) = target {
                    approach(&mut limited, |i| target[i], &accelerations, dt);
                }
                drive(&mut bus, &slot, target.map(|_| limited));
                slot.commit(&bus, &mut commands, &Tick { dt, ..Tick::first() }, is_halted);
                let now: [f64; 2] = (*commands.values[0]).try_into().unwrap();
                for i in 0..2 {
                    prop_assert!((now[i] - last[i]).abs() <= accelerations[i] * dt + 1e-12);
                    let is_driven = target.is_some() && !is_halted;
                    prop_assert!(is_driven || now[i].abs() < last[i].abs() || now[i] == 0.0 || dt == 0.0);
                }
                last = now;
            }
        }
    }
}
