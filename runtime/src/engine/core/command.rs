//! The runtime's own hand on a device's command: what the graph commands, or the way to zero, never the last velocity.
//!
//! It follows the graph's command exactly. When nothing drives it any more, or while commands are halted, it goes to zero
//! in a straight line, as fast as the joints' accelerations allow; and when it may follow again, it catches up by the
//! same accelerations before it follows.

use crate::device::Commands;
use crate::graph::{PlannedCommand, PlannedReport};
use crate::node::{Bus, PortId, Tick};
use crate::signal::line::{scale_to, step_toward};
use crate::signal::{Joints, Signal};

/// One command port of a device.
pub(crate) struct CommandSlot {
    pub(crate) device: usize,
    source: PortId,
    command: usize,
    /// How old the command may be [ns].
    max_age: i64,
    /// Greatest acceleration of each joint [rad/s²]; infinite where nothing bounds it.
    accelerations: Box<[f64]>,
    /// Whether it has caught up with what the graph commands.
    follows: bool,
}

impl CommandSlot {
    pub(crate) fn new(source: PortId, planned: PlannedCommand) -> Self {
        let PlannedCommand { device, command, age, accelerations, .. } = planned;
        Self { device, source, command, max_age: age.max_age, accelerations: accelerations.into(), follows: false }
    }

    /// Takes over what the graph commands; goes on toward zero if it commands nothing, or nothing that is fresh, or if all
    /// is halted.
    pub(crate) fn commit(&mut self, bus: &Bus, commands: &mut Commands, tick: &Tick, is_halted: bool) {
        let (mark, dt) = (&bus.marks[self.source.mark as usize], tick.dt);
        if is_halted || !mark.is_present() || mark.stamp().age(tick.now) > self.max_age {
            self.ramp(commands, dt);
            return;
        }
        let Joints(wanted) = &Joints::arena(&bus.arenas)[self.source.slot as usize];
        let values = &mut commands.values[self.command];
        if self.follows {
            values.copy_from_slice(wanted);
        } else {
            self.follows = approach(values, |i| wanted[i], &self.accelerations, dt);
        }
    }

    /// One step of `dt` [s] toward zero; whether the command is zero.
    pub(crate) fn ramp(&mut self, commands: &mut Commands, dt: f64) -> bool {
        self.follows = false;
        approach(&mut commands.values[self.command], |_| 0.0, &self.accelerations, dt)
    }
}

/// One report to a device: what the graph tells it, as it is and while it is fresh. It moves nothing, so it goes on while
/// commands are held.
pub(crate) struct ReportSlot {
    pub(crate) device: usize,
    source: PortId,
    report: usize,
    /// How old the report may be [ns].
    max_age: i64,
}

impl ReportSlot {
    pub(crate) const fn new(source: PortId, planned: &PlannedReport) -> Self {
        Self { device: planned.device, source, report: planned.report, max_age: planned.age.max_age }
    }

    /// Takes over what the graph reports, or that it reports nothing.
    pub(crate) fn commit(&self, bus: &Bus, commands: &mut Commands, tick: &Tick) {
        let mark = &bus.marks[self.source.mark as usize];
        let is_there = mark.is_present() && mark.stamp().age(tick.now) <= self.max_age;
        commands.take_report(self.report, &bus.arenas, is_there.then_some(self.source.slot));
    }
}

/// Moves `values` toward `wanted` on a straight line, no joint by more than its acceleration allows in `dt` [s]. Returns
/// whether they have arrived.
fn approach(values: &mut [f64], wanted: impl Fn(usize) -> f64, accelerations: &[f64], dt: f64) -> bool {
    let mut scale = 1.0_f64;
    for (i, (value, acceleration)) in values.iter().zip(accelerations).enumerate() {
        // An unbounded acceleration in no time is not a number, and `min` skips it.
        scale = scale.min(scale_to((wanted(i) - value).abs(), acceleration * dt));
    }
    for (i, value) in values.iter_mut().enumerate() {
        *value = step_toward(*value, wanted(i), scale);
    }
    scale >= 1.0
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::device::Description;
    use crate::signal::{JointsShape, Stamp};

    /// A slot for two joints, and the bus its command comes over.
    fn slot(accelerations: [f64; 2]) -> (CommandSlot, Bus, Commands) {
        let mut bus = Bus::default();
        let source = bus.add(&JointsShape { joints: vec![Default::default(); 2], ..Default::default() }.into());
        let slot = CommandSlot {
            device: 0,
            source,
            command: 0,
            max_age: 100,
            accelerations: accelerations.into(),
            follows: false,
        };
        let mut description = Description::every(1.0);
        let joints = JointsShape { joints: vec![Default::default(); 2], ..Default::default() };
        description.fills("arm").command("velocity", joints);
        (slot, bus, Commands::of(&description))
    }

    fn drive(bus: &mut Bus, slot: &CommandSlot, wanted: Option<[f64; 2]>) {
        let mark = &mut bus.marks[slot.source.mark as usize];
        match wanted {
            Some(wanted) => {
                mark.renew(1, Stamp::TIMELESS);
                Joints::arena_mut(&mut bus.arenas)[slot.source.slot as usize].0.copy_from_slice(&wanted);
            }
            None => mark.lose(1),
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
    fn without_a_bound_on_the_acceleration_it_is_there_at_once() {
        let (mut slot, mut bus, mut commands) = slot([f64::INFINITY; 2]);
        drive(&mut bus, &slot, Some([3.0, 4.0]));
        slot.commit(&bus, &mut commands, &Tick::first(), false);
        assert_eq!(&*commands.values[0], [3.0, 4.0]);
        slot.commit(&bus, &mut commands, &Tick::first(), true);
        assert_eq!(&*commands.values[0], [0.0, 0.0]);
    }

    #[test]
    fn what_is_too_old_is_not_followed() {
        let (mut slot, mut bus, mut commands) = slot([f64::INFINITY; 2]);
        drive(&mut bus, &slot, Some([3.0, 4.0]));
        bus.marks[slot.source.mark as usize].renew(1, Stamp { nanos: 0, device: 0 });
        for (now, expected) in [(100, [3.0, 4.0]), (101, [0.0, 0.0])] {
            slot.commit(&bus, &mut commands, &Tick { now, ..Tick::first() }, false);
            assert_eq!(&*commands.values[0], expected, "{now} ns");
        }
    }

    #[test]
    fn a_report_is_what_is_there_and_fresh_and_needs_no_new_room() {
        let (mut bus, shape) =
            (Bus::default(), JointsShape { joints: vec![Default::default(); 2], ..Default::default() });
        let source = bus.add(&shape.clone().into());
        let report = ReportSlot { device: 0, source, report: 1, max_age: 100 };
        let mut description = Description::every(1.0);
        let mut arm = description.fills("arm");
        let (other, joints) = (arm.report::<bool>("is_there"), arm.report::<Joints>("joints"));
        let shape = shape.into();
        let mut commands = Commands::with_reports(&description, |report| (report == 1).then_some(&shape));
        let room = Joints::arena(&bus.arenas)[0].0.as_ptr();
        let mut tell = |wanted: Option<i64>, now: i64| {
            let mark = &mut bus.marks[source.mark as usize];
            match wanted {
                Some(nanos) => mark.renew(1, Stamp { nanos, device: 0 }),
                None => mark.lose(1),
            }
            Joints::arena_mut(&mut bus.arenas)[source.slot as usize].0.fill(now as f64);
            report.commit(&bus, &mut commands, &Tick { now, ..Tick::first() });
            let told = commands.report(joints).map(|joints| (joints.0[1], joints.0.as_ptr()));
            assert!(commands.report(other).is_none());
            assert!(told.is_none_or(|(_, place)| place != room));
            told
        };
        let first = tell(Some(0), 0).unwrap();
        assert_eq!(tell(Some(0), 100), Some((100.0, first.1)), "in the same place");
        assert_eq!(tell(Some(0), 101), None, "too old");
        assert_eq!(tell(Some(50), 101), Some((101.0, first.1)));
        assert_eq!(tell(None, 102), None, "absent");
        commands.fall_silent();
        assert!(commands.report(joints).is_none());
    }

    proptest! {
        #[test]
        fn it_never_steps_and_never_holds_what_nothing_drives(
            what in prop::collection::vec((prop::option::of(prop::array::uniform2(-1.0..1.0f64)), any::<bool>()), 1..60),
            dt in 0.0..0.02f64,
        ) {
            let accelerations = [5.0, 2.0];
            let (mut slot, mut bus, mut commands) = slot(accelerations);
            // A command that changes as it may, as a limiter gives it.
            let (mut given, mut last) = ([0.0; 2], [0.0; 2]);
            for (wanted, is_halted) in what {
                if let Some(wanted) = wanted {
                    approach(&mut given, |i| wanted[i], &accelerations, dt);
                }
                drive(&mut bus, &slot, wanted.map(|_| given));
                slot.commit(&bus, &mut commands, &Tick { dt, ..Tick::first() }, is_halted);
                let now: [f64; 2] = (*commands.values[0]).try_into().unwrap();
                for i in 0..2 {
                    prop_assert!((now[i] - last[i]).abs() <= accelerations[i] * dt + 1e-12);
                    let is_driven = wanted.is_some() && !is_halted;
                    prop_assert!(is_driven || now[i].abs() < last[i].abs() || now[i] == 0.0 || dt == 0.0);
                }
                last = now;
            }
        }
    }
}
