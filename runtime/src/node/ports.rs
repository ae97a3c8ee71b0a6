//! Ports: how a step sees its inputs and hands over its outputs.

use std::borrow::Cow;
use std::ops::Deref;

use super::Tick;
use crate::signal::{Arenas, Features, Freshness, Kind, Mark, Scalar, Settable, Shape, Signal, Stamp};

/// What an input needs, and when it wakes its node; see the table in [`node`](super).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Need {
    /// Whether the graph must wire it.
    pub must_be_wired: bool,
    /// Whether the node steps only while its value is present, if it is wired; otherwise the outputs are absent.
    pub must_be_present: bool,
    /// Whether a new value wakes the node. The loss of a value always does.
    pub is_trigger: bool,
    /// Whether it is any number of wires, each named in the graph.
    pub is_many: bool,
    /// Whether it is read as the last tick left it. It wakes the node, one tick late, only if no other input does. Its
    /// shape is not known when the node is made, except that of a flag: `Some` if it is wired.
    pub is_delayed: bool,
}

impl Need {
    /// An input that must be wired and present, and wakes the node.
    pub const REQUIRED: Self =
        Self { must_be_wired: true, must_be_present: true, is_trigger: true, is_many: false, is_delayed: false };
    /// An input that need neither be wired nor present, and wakes the node.
    pub const OPTIONAL: Self = Self { must_be_wired: false, must_be_present: false, ..Self::REQUIRED };
}

/// What is known of a port without a graph.
#[derive(Debug, Clone, PartialEq)]
pub struct PortSpec {
    /// Name in the graph file.
    pub name: Cow<'static, str>,
    /// What it carries, with its unit.
    pub doc: Cow<'static, str>,
    /// Kind of signal.
    pub kind: Kind,
    /// Unit, then frames: `"N"`, `"E/s"`, `"base"`; a capital letter is a variable, `"$name"` the parameter `name`.
    pub args: Cow<'static, [Cow<'static, str>]>,
    /// When it wakes; of no meaning for an output.
    pub need: Need,
}

impl PortSpec {
    /// The description of a port of signal `T`, with its arguments by name. Arguments that its kind does not take are
    /// left out, and so are frames from the first `"_"` on.
    #[must_use]
    pub fn of<T: Signal>(
        name: &'static str,
        doc: &'static str,
        arguments: &[(&str, &'static str)],
        need: Need,
    ) -> Self {
        let value = |argument: &&str| arguments.iter().find(|(name, _)| name == argument).map(|(_, value)| *value);
        let is_said = |argument: &&str| *argument == "unit" || value(argument) != Some("_");
        let arguments = T::KIND.arguments().iter().take_while(|argument| is_said(argument));
        let args = arguments.filter_map(|argument| value(&argument)).map(Cow::Borrowed).collect();
        Self { name: name.into(), doc: doc.into(), kind: T::KIND, args, need }
    }
}

/// The letters that the inputs of a node bind; for the derives.
#[doc(hidden)]
#[derive(Debug, Clone, Copy)]
pub struct Letters {
    units: &'static str,
    frames: &'static str,
}

impl Letters {
    /// The letters of the units and of the frames.
    #[must_use]
    pub const fn of(units: &'static str, frames: &'static str) -> Self {
        Self { units, frames }
    }

    /// Whether an input binds a letter.
    #[must_use]
    pub const fn binds(&self, is_unit: bool, letter: char) -> bool {
        let letters = if is_unit { self.units } else { self.frames }.as_bytes();
        let mut i = 0;
        while i < letters.len() && letters[i] != letter as u8 {
            i += 1;
        }
        i < letters.len()
    }
}

/// Where a port's value and mark are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PortId {
    /// Index into the arena of its kind.
    pub slot: u32,
    /// Index of its mark.
    pub mark: u32,
}

impl PortId {
    /// No port: an input that is not wired.
    pub const NONE: Self = Self { slot: u32::MAX, mark: u32::MAX };
}

/// Every value of a running graph, with its mark.
#[derive(Debug, Default)]
pub struct Bus {
    /// Marks of all ports.
    pub marks: Vec<Mark>,
    /// Values of all ports.
    pub arenas: Arenas,
}

impl Bus {
    /// Makes room for one more port.
    pub fn add(&mut self, shape: &Shape) -> PortId {
        self.marks.push(Mark::default());
        PortId { slot: self.arenas.add(shape), mark: self.marks.len() as u32 - 1 }
    }
}

/// The wires of one node: a port for each input, in the order of the declaration.
#[derive(Debug, Clone, Default)]
pub struct Wires {
    single: Box<[PortId]>,
    many: Box<[PortId]>,
}

impl Wires {
    /// Wires from the ports of each input: at most one for a plain input, any number for `Many`.
    #[must_use]
    pub fn new(inputs: &[(Need, Vec<PortId>)]) -> Self {
        let mut many = Vec::new();
        let single = inputs.iter().map(|(need, ports)| match need {
            need if need.is_many => {
                let start = many.len() as u32;
                many.extend_from_slice(ports);
                PortId { slot: start, mark: ports.len() as u32 }
            }
            _ => ports.first().copied().unwrap_or(PortId::NONE),
        });
        let single = single.collect();
        Self { single, many: many.into() }
    }

    /// The port of input `i`, if it is wired.
    #[must_use]
    pub fn port(&self, i: usize) -> Option<PortId> {
        Some(self.single[i]).filter(|port| *port != PortId::NONE)
    }

    /// The ports of the variadic input `i`.
    #[must_use]
    pub fn ports(&self, i: usize) -> &[PortId] {
        let PortId { slot, mark } = self.single[i];
        &self.many[slot as usize..(slot + mark) as usize]
    }
}

/// A value that is there.
#[derive(Debug, Clone, Copy)]
pub struct In<'a, T> {
    value: &'a T,
    mark: &'a Mark,
    tick: u64,
}

impl<'a, T> In<'a, T> {
    /// A value with its mark, as seen in `tick`.
    pub const fn new(value: &'a T, mark: &'a Mark, tick: u64) -> Self {
        Self { value, mark, tick }
    }

    /// The value, for as long as the tick lasts.
    #[must_use]
    pub const fn value(&self) -> &'a T {
        self.value
    }

    /// Whether it was made in this tick; otherwise it is held.
    #[must_use]
    pub const fn is_new(&self) -> bool {
        self.mark.changed_in(self.tick)
    }

    /// Stamp of the sample it came from.
    #[must_use]
    pub const fn stamp(&self) -> Stamp {
        self.mark.stamp()
    }
}

impl<T> Deref for In<'_, T> {
    type Target = T;
    fn deref(&self) -> &T {
        self.value
    }
}

/// The components of a feature vector, each with a freshness of its own.
impl<'a> In<'a, Features> {
    /// Number of components.
    #[must_use]
    pub fn len(&self) -> usize {
        self.value.components().len()
    }

    /// Whether there is no component.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns component `i`, if it is present.
    #[must_use]
    pub fn get(&self, i: usize) -> Option<In<'a, Scalar>> {
        let (value, mark) = self.value.components()[i].parts();
        mark.is_present().then(|| In::new(value, mark, self.tick))
    }

    /// Returns the freshness of component `i`.
    #[must_use]
    pub fn freshness(&self, i: usize) -> Freshness {
        self.value.components()[i].freshness(self.tick)
    }

    /// Returns the components in order.
    pub fn iter(&self) -> impl Iterator<Item = Option<In<'a, Scalar>>> {
        (0..self.len()).map(|i| self.get(i))
    }
}

/// The wires of a variadic input, in the order of the graph file.
#[derive(Debug, Clone, Copy)]
pub struct Many<'a, T> {
    values: &'a [T],
    marks: &'a [Mark],
    ports: &'a [PortId],
    tick: u64,
}

impl<'a, T> Many<'a, T> {
    /// Number of wires.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.ports.len()
    }

    /// Whether nothing is wired.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.ports.is_empty()
    }

    /// What comes in on wire `i`, if it is there.
    #[must_use]
    pub fn get(&self, i: usize) -> Option<In<'a, T>> {
        let port = self.ports[i];
        let mark = &self.marks[port.mark as usize];
        mark.is_present().then(|| In::new(&self.values[port.slot as usize], mark, self.tick))
    }

    /// Freshness of wire `i`.
    #[must_use]
    pub fn freshness(&self, i: usize) -> Freshness {
        self.marks[self.ports[i].mark as usize].freshness(self.tick)
    }

    /// What comes in on each wire.
    pub fn iter(&self) -> impl Iterator<Item = Option<In<'a, T>>> {
        (0..self.len()).map(|i| self.get(i))
    }
}

/// How one input is seen in a step.
pub trait View<'a>: Sized {
    /// Its signal.
    type Signal: Signal;
    /// What the node learns of its shape at load.
    type Shape;

    /// What input `i` shows in `tick`.
    fn fetch(bus: &'a Bus, wires: &'a Wires, i: usize, tick: u64) -> Self;
    /// The shape, from the named wires of the input.
    fn shape(wires: Vec<(String, Shape)>) -> Self::Shape;
}

fn shape_of<T: Signal>(shape: &Shape) -> T::Shape {
    T::shape_of(shape).expect("the check has compared the kinds").clone()
}

impl<'a, T: Signal> View<'a> for In<'a, T> {
    type Signal = T;
    type Shape = T::Shape;

    fn fetch(bus: &'a Bus, wires: &'a Wires, i: usize, tick: u64) -> Self {
        let port = wires.single[i];
        In::new(&T::arena(&bus.arenas)[port.slot as usize], &bus.marks[port.mark as usize], tick)
    }

    fn shape(wires: Vec<(String, Shape)>) -> T::Shape {
        shape_of::<T>(&wires.first().expect("the check has seen that it is wired").1)
    }
}

impl<'a, T: Signal> View<'a> for Option<In<'a, T>> {
    type Signal = T;
    type Shape = Option<T::Shape>;

    fn fetch(bus: &'a Bus, wires: &'a Wires, i: usize, tick: u64) -> Self {
        let port = wires.port(i)?;
        let mark = &bus.marks[port.mark as usize];
        mark.is_present().then(|| In::new(&T::arena(&bus.arenas)[port.slot as usize], mark, tick))
    }

    fn shape(wires: Vec<(String, Shape)>) -> Option<T::Shape> {
        wires.first().map(|(_, shape)| shape_of::<T>(shape))
    }
}

impl<'a, T: Signal> View<'a> for Many<'a, T> {
    type Signal = T;
    type Shape = Vec<(String, T::Shape)>;

    fn fetch(bus: &'a Bus, wires: &'a Wires, i: usize, tick: u64) -> Self {
        Many { values: T::arena(&bus.arenas), marks: &bus.marks, ports: wires.ports(i), tick }
    }

    fn shape(wires: Vec<(String, Shape)>) -> Self::Shape {
        wires.into_iter().map(|(name, shape)| (name, shape_of::<T>(&shape))).collect()
    }
}

/// All inputs of a node; made by [`inputs!`](crate::inputs).
pub trait InputSet<'a>: Sized {
    /// What the node learns of its inputs at load.
    type Shapes;

    /// The declaration.
    fn specs() -> Vec<PortSpec>;
    /// The shapes, from the named wires of each input.
    fn shapes(wires: Vec<Vec<(String, Shape)>>) -> Self::Shapes;
    /// What the inputs show in `tick`.
    fn fetch(bus: &'a Bus, wires: &'a Wires, tick: u64) -> Self;
}

/// A value for a step to write. What it does not write is absent, but for the components of a feature vector.
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
    /// Writes the value.
    pub fn set(&mut self, value: T) {
        *self.write() = value;
    }
}

impl Out<Features> {
    /// Sets component `i`, with the stamp of the step: the oldest among the inputs that wake the node.
    pub fn set(&mut self, i: usize, value: f64) {
        let (tick, stamp) = self.value.now();
        self.write().set(i, value, tick, stamp);
    }

    /// Sets component `i`, with the stamp of the input that it is computed from.
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

    /// The value, to be written whole and in place.
    pub const fn write(&mut self) -> &mut T {
        self.done = Done::Written;
        &mut self.value
    }

    /// Leaves the output as it was: a value that was there is held, and does not count as new once more. For a node
    /// that is woken by one input and passes another on.
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

    /// Puts the buffer back and marks what the step did.
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

/// All outputs of a node; made by [`outputs!`](crate::outputs).
pub trait OutputSet: Sized {
    /// The shapes, for the node to set.
    type Shapes: Default;

    /// The declaration.
    fn specs() -> Vec<PortSpec>;
    /// The shapes as the node set them, in the order of the declaration.
    fn into_shapes(shapes: Self::Shapes) -> Vec<Shape>;
    /// Takes all buffers from the bus for one step.
    fn take(bus: &mut Bus, ports: &[PortId], tick: &Tick) -> Self;
    /// Puts all buffers back and marks what the step did.
    fn put(self, bus: &mut Bus, ports: &[PortId], tick: &Tick);
    /// Makes all outputs absent.
    fn lose(bus: &mut Bus, ports: &[PortId], tick: u64);
}

/// A node without inputs.
impl InputSet<'_> for () {
    type Shapes = ();

    fn specs() -> Vec<PortSpec> {
        Vec::new()
    }

    fn shapes(_: Vec<Vec<(String, Shape)>>) {}

    fn fetch(_: &Bus, _: &Wires, _: u64) {}
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
    use crate::signal::{Joints, JointsShape, Scalar, ScalarShape, Settable};

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
