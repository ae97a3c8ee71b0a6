//! Inputs: how a step reads them.

use std::ops::Deref;

use super::{Bus, PortId, PortSpec, Wires};
use crate::signal::{Features, Freshness, Mark, Scalar, Shape, Signal, Stamp};

/// A value that is present, with its freshness and its stamp.
#[derive(Debug, Clone, Copy)]
pub struct In<'a, T> {
    value: &'a T,
    mark: &'a Mark,
    tick: u64,
}

impl<'a, T> In<'a, T> {
    /// Creates an input from a value and its mark, as seen in `tick`.
    pub const fn new(value: &'a T, mark: &'a Mark, tick: u64) -> Self {
        Self { value, mark, tick }
    }

    /// Returns the value with the lifetime of the tick.
    #[must_use]
    pub const fn value(&self) -> &'a T {
        self.value
    }

    /// Whether the value was written in this tick. Otherwise it is held from an earlier one.
    #[must_use]
    pub const fn is_new(&self) -> bool {
        self.mark.changed_in(self.tick)
    }

    /// Returns the stamp of the sample that the value was computed from.
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

/// Each component of a feature vector has its own freshness.
impl<'a> In<'a, Features> {
    /// Returns the number of components.
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
    /// Returns the number of wires.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.ports.len()
    }

    /// Whether nothing is wired.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.ports.is_empty()
    }

    /// Returns the value of wire `i`, or `None` while it is absent.
    #[must_use]
    pub fn get(&self, i: usize) -> Option<In<'a, T>> {
        let port = self.ports[i];
        let mark = &self.marks[port.mark as usize];
        mark.is_present().then(|| In::new(&self.values[port.slot as usize], mark, self.tick))
    }

    /// Returns the freshness of wire `i`.
    pub fn freshness(&self, i: usize) -> Freshness {
        self.marks[self.ports[i].mark as usize].freshness(self.tick)
    }

    /// Returns the value of each wire; `None` where it is absent.
    pub fn iter(&self) -> impl Iterator<Item = Option<In<'a, T>>> {
        (0..self.len()).map(|i| self.get(i))
    }
}

/// One form of an input: `In`, `Option<In>` or `Many`.
pub trait View<'a>: Sized {
    /// The signal.
    type Signal: Signal;
    /// The shape that the node gets at load.
    type Shape;

    /// Reads input `i` in `tick`.
    fn fetch(bus: &'a Bus, wires: &'a Wires, i: usize, tick: u64) -> Self;
    /// Returns the shape of the input from its named wires.
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

/// All inputs of a node. `#[derive(Inputs)]` implements it.
pub trait InputSet<'a>: Sized {
    /// The shapes that the node gets at load.
    type Shapes;

    /// Returns the declarations of the ports, in their order.
    fn specs() -> Vec<PortSpec>;
    /// Returns the shapes from the named wires of each input.
    fn shapes(wires: Vec<Vec<(String, Shape)>>) -> Self::Shapes;
    /// Reads the inputs in `tick`.
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
