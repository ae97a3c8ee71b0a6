//! Inputs: how a step reads them.

use std::ops::Deref;

use super::{Bus, PortId, PortSpec, Wires};
use crate::signal::{Features, Freshness, Mark, Scalar, Shape, Signal, Stamp};

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

/// A node without inputs.
impl InputSet<'_> for () {
    type Shapes = ();

    fn specs() -> Vec<PortSpec> {
        Vec::new()
    }

    fn shapes(_: Vec<Vec<(String, Shape)>>) {}

    fn fetch(_: &Bus, _: &Wires, _: u64) {}
}
