//! Outputs: how a step writes them.

use super::{Bus, In, PortId, PortSpec, Tick};
use crate::signal::{Features, Settable, Shape, Signal};

/// An output that a step writes. An output that the step does not write becomes absent; components of a feature vector
/// keep their values until the step sets or loses them.
#[derive(Debug, Default)]
pub struct Out<T> {
    value: T,
    done: Done,
}

/// What a step did with an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Done {
    #[default]
    Nothing,
    Kept,
    Written,
}

impl<T: Settable> Out<T> {
    /// Sets the value.
    pub fn set(&mut self, value: T) {
        *self.write() = value;
    }
}

impl Out<Features> {
    /// Sets component `i`. Its stamp is that of the step: the oldest among the inputs that wake the node.
    pub fn set(&mut self, i: usize, value: f64) {
        let (tick, stamp) = self.value.now();
        self.write().set(i, value, tick, stamp);
    }

    /// Sets component `i`. Its stamp is that of `input`, from which the value is computed.
    pub fn set_from<T>(&mut self, i: usize, value: f64, input: &In<'_, T>) {
        let (tick, _) = self.value.now();
        self.write().set(i, value, tick, input.stamp());
    }

    /// Makes component `i` absent. A component that is neither set nor lost stays as it is.
    pub fn lose(&mut self, i: usize) {
        let (tick, _) = self.value.now();
        self.write().lose(i, tick);
    }
}

impl<T: Signal> Out<T> {
    /// Writes a copy of `value`, in place.
    pub fn copy_from(&mut self, value: &T) {
        value.copy_to(self.write());
    }

    /// Returns the value, which the step must write completely.
    pub const fn write(&mut self) -> &mut T {
        self.done = Done::Written;
        &mut self.value
    }

    /// Leaves the output unchanged: a present value stays, and is held instead of new. Use it in a node that one input
    /// wakes and that passes on another.
    pub const fn keep(&mut self) {
        self.done = Done::Kept;
    }

    /// Takes the buffer from the bus for one step.
    #[doc(hidden)]
    #[inline(always)]
    pub fn take(bus: &mut Bus, port: PortId, tick: &Tick) -> Self {
        let slot = &mut T::arena_mut(&mut bus.arenas)[port.slot as usize];
        Self { value: T::take(slot, tick.index, tick.stamp), done: Done::Nothing }
    }

    /// Returns the buffer to the bus and marks the port as written, held or absent.
    #[doc(hidden)]
    #[inline(always)]
    pub fn put(self, bus: &mut Bus, port: PortId, tick: &Tick) {
        let mark = &mut bus.marks[port.mark as usize];
        match self.done {
            Done::Written => {
                mark.renew(tick.index, tick.stamp);
                *mark = self.value.mark(*mark, tick.index);
            }
            Done::Kept if T::STAYS => return,
            Done::Nothing if !T::KEEPS => mark.lose(tick.index),
            Done::Kept | Done::Nothing => {}
        }
        T::arena_mut(&mut bus.arenas)[port.slot as usize] = self.value;
    }

    /// Makes the port absent.
    #[doc(hidden)]
    pub fn lose_port(bus: &mut Bus, port: PortId, tick: u64) {
        bus.marks[port.mark as usize].lose(tick);
        T::arena_mut(&mut bus.arenas)[port.slot as usize].lose(tick);
    }
}

/// All outputs of a node. `#[derive(Outputs)]` implements it.
pub trait OutputSet: Sized {
    /// The shapes, which the node sets in `new`.
    type Shapes: Default;

    /// Returns the declarations of the ports, in their order.
    fn specs() -> Vec<PortSpec>;
    /// Returns the shapes that the node has set, in the order of the declarations.
    fn into_shapes(shapes: Self::Shapes) -> Vec<Shape>;
    /// Takes all buffers from the bus for one step.
    fn take(bus: &mut Bus, ports: &[PortId], tick: &Tick) -> Self;
    /// Returns all buffers to the bus and marks each port as written, held or absent.
    fn put(self, bus: &mut Bus, ports: &[PortId], tick: &Tick);
    /// Makes all outputs absent.
    fn lose(bus: &mut Bus, ports: &[PortId], tick: u64);
}

/// A node without outputs.
impl OutputSet for () {
    type Shapes = ();

    fn specs() -> Vec<PortSpec> {
        Vec::new()
    }

    fn into_shapes((): ()) -> Vec<Shape> {
        Vec::new()
    }

    fn take(_: &mut Bus, _: &[PortId], _: &Tick) {}

    fn put(self, _: &mut Bus, _: &[PortId], _: &Tick) {}

    fn lose(_: &mut Bus, _: &[PortId], _: u64) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{Freshness, Joints, JointsShape, Scalar, ScalarShape};

    /// A port of a bus of its own that a first step has written.
    fn written<T: Settable>(shape: T::Shape, value: T) -> (Bus, PortId) {
        let mut bus = Bus::default();
        let port = bus.add(&shape.into());
        let mut out = Out::<T>::take(&mut bus, port, &Tick::first());
        out.set(value);
        out.put(&mut bus, port, &Tick::first());
        (bus, port)
    }

    fn second(step: impl FnOnce(&mut Out<Scalar>)) -> (Freshness, Scalar) {
        let (mut bus, port) = written(ScalarShape::default(), 1.5);
        let mut out = Out::take(&mut bus, port, &Tick { index: 2, ..Tick::first() });
        step(&mut out);
        out.put(&mut bus, port, &Tick { index: 2, ..Tick::first() });
        (bus.marks[port.mark as usize].freshness(2), Scalar::arena(&bus.arenas)[port.slot as usize])
    }

    #[test]
    fn what_is_kept_is_held_and_what_is_not_written_is_lost() {
        assert_eq!(second(|out| out.set(2.5)), (Freshness::New, 2.5));
        assert_eq!(second(|out| out.keep()), (Freshness::Held, 1.5));
        assert_eq!(second(|_| ()).0, Freshness::Lost);
    }

    #[test]
    fn a_buffer_that_is_kept_comes_back_into_its_slot() {
        let (mut bus, port) = written(JointsShape::default(), Joints([1.0, 2.0].into()));
        let mut out = Out::<Joints>::take(&mut bus, port, &Tick::first());
        out.keep();
        out.put(&mut bus, port, &Tick { index: 2, ..Tick::first() });
        assert_eq!(Joints::arena(&bus.arenas)[port.slot as usize], Joints([1.0, 2.0].into()));
        assert_eq!(bus.marks[port.mark as usize].freshness(2), Freshness::Held);
    }

    #[test]
    fn what_is_absent_stays_so_when_it_is_kept() {
        let mut bus = Bus::default();
        let port = bus.add(&ScalarShape::default().into());
        let mut out = Out::<Scalar>::take(&mut bus, port, &Tick::first());
        out.keep();
        out.put(&mut bus, port, &Tick::first());
        assert_eq!(bus.marks[port.mark as usize].freshness(1), Freshness::Absent);
    }
}
