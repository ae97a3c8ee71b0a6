//! The runtime's own hand on a device's command: what the graph commands, or a ramp to zero, never the last velocity.

use crate::device::Commands;
use crate::graph::PlannedCommand;
use crate::node::{Bus, PortId};
use crate::signal::{Joints, Signal};

/// Time in which a command that nothing drives any more goes to zero [s].
const RAMP: f64 = 0.1;

/// One command port of a device.
pub(super) struct CommandSlot {
    pub(super) device: usize,
    source: PortId,
    command: usize,
    /// What is left of the ramp, from 1 to 0.
    left: f64,
}

impl CommandSlot {
    pub(super) const fn new(source: PortId, planned: &PlannedCommand) -> Self {
        Self { device: planned.device, source, command: planned.command, left: 1.0 }
    }

    /// Takes over what the graph commands; ramps on if it commands nothing.
    pub(super) fn commit(&mut self, bus: &Bus, commands: &mut Commands, dt: f64) {
        if bus.marks[self.source.mark as usize].is_present() {
            self.left = 1.0;
            let Joints(values) = &Joints::arena(&bus.arenas)[self.source.slot as usize];
            commands.values[self.command].copy_from_slice(values);
        } else {
            self.ramp(commands, dt);
        }
    }

    /// One step of the ramp of `dt` [s]; whether the command is zero.
    pub(super) fn ramp(&mut self, commands: &mut Commands, dt: f64) -> bool {
        let left = (self.left - dt / RAMP).max(0.0);
        let factor = if self.left > 0.0 { left / self.left } else { 0.0 };
        commands.values[self.command].iter_mut().for_each(|value| *value *= factor);
        self.left = left;
        left <= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_linear_and_ends_at_zero() {
        let source = PortId::NONE;
        let mut slot = CommandSlot { device: 0, source, command: 0, left: 1.0 };
        let mut commands = Commands { values: vec![vec![2.0, -1.0].into()] };
        let mut last = 2.0;
        for step in 1..=10 {
            let is_still = slot.ramp(&mut commands, 0.01);
            let now = commands.joints(0)[0];
            assert!((last - now - 0.2).abs() < 1e-12, "step {step}: {last} to {now}");
            assert!((commands.joints(0)[1] + now / 2.0).abs() < 1e-12, "the direction stays");
            assert!(!is_still || step >= 10);
            last = now;
        }
        assert!(slot.ramp(&mut commands, 0.01));
        assert_eq!(commands.joints(0), [0.0, 0.0]);
    }
}
