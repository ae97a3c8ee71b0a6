//! The list of signal kinds and the code that is generated for all of them.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::spatial::NoProperties;
use super::unit::is_same;
use super::{
    Features, FeaturesShape, Grid, Image, ImageShape, Jacobian, Joints, JointsShape, Mark, Mask, Pose, PoseShape,
    Regions, RegionsShape, Stamp, Twist, TwistShape, Unit, VectorImage, VectorImageShape, all_finite,
};

/// A single number.
pub type Scalar = f64;
/// A boolean.
pub type Flag = bool;

/// The shape of a scalar.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScalarShape {
    /// Unit of the value.
    pub unit: Unit,
    /// Minimum and maximum of the value [unit]; infinite if unknown.
    pub range: [f64; 2],
}

impl Default for ScalarShape {
    fn default() -> Self {
        Self::of(Unit::default())
    }
}

impl ScalarShape {
    /// Creates the shape of an unbounded scalar.
    #[must_use]
    pub const fn of(unit: Unit) -> Self {
        Self { unit, range: [f64::NEG_INFINITY, f64::INFINITY] }
    }

    /// Bounds the value to `min..=max` [unit].
    #[must_use]
    pub const fn within(self, min: f64, max: f64) -> Self {
        Self { range: [min, max], ..self }
    }
}

/// The shape of a flag, which has no properties.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(from = "NoProperties", into = "NoProperties")]
pub struct FlagShape;

impl From<FlagShape> for NoProperties {
    fn from(_: FlagShape) -> Self {
        Self {}
    }
}

impl From<NoProperties> for FlagShape {
    fn from(_: NoProperties) -> Self {
        Self
    }
}

/// A value on a wire. Each kind has one type.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a signal",
    note = "signals are `Scalar`, `Flag`, `Features`, `Image`, `VectorImage`, `Mask`, `Regions`, `Twist`, `Pose`, `Joints` and `Jacobian`"
)]
pub trait Signal: Default + Clone + Send + 'static {
    /// The kind.
    const KIND: Kind;
    /// The properties that are known at load, such as sizes and units.
    type Shape: Clone + Default + PartialEq + fmt::Debug + Into<Shape> + 'static;

    /// Allocates a value of that shape. No other method allocates.
    fn allocate(_shape: &Self::Shape) -> Self {
        Self::default()
    }

    /// Whether every number is finite. Absent components count as finite.
    fn is_finite(&self) -> bool;

    /// Returns rows and columns, or the number of elements and 0; zeros for a kind without a size.
    fn size(&self) -> [usize; 2] {
        [0, 0]
    }

    /// Called on a sample that arrives in `tick` and replaces `previous`. Stamps the components, if the kind has any.
    fn arrive(&mut self, _previous: &Self, _tick: u64, _stamp: Stamp) {}

    /// Returns the mark of a value that a step has written, given the default mark `from_step`.
    fn mark(&self, from_step: Mark, _tick: u64) -> Mark {
        from_step
    }

    /// Takes the buffer out of its slot for a step in `tick` with that stamp. A value that [stays](Self::STAYS) in its
    /// slot is not moved: the step starts with a default value.
    fn take(slot: &mut Self, _tick: u64, _stamp: Stamp) -> Self {
        if Self::STAYS { Self::default() } else { std::mem::take(slot) }
    }

    /// Whether the slot keeps its value during a step; true for small kinds without a heap buffer.
    const STAYS: bool = false;

    /// Copies the value into a slot of the same shape, in place.
    fn copy_to(&self, slot: &mut Self) {
        slot.clone_from(self);
    }

    /// Called when the port becomes absent.
    fn lose(&mut self, _tick: u64) {}

    /// Whether the value stays present when a step does not write it. Otherwise it becomes absent.
    const KEEPS: bool = false;

    /// Returns the shape as this kind's shape type, or `None` if it is of another kind.
    fn shape_of(shape: &Shape) -> Option<&Self::Shape>;
    /// Returns the values of this kind.
    fn arena(arenas: &Arenas) -> &Vec<Self>;
    /// Returns the values of this kind for writing.
    fn arena_mut(arenas: &mut Arenas) -> &mut Vec<Self>;
}

/// A signal whose value a step sets at once: every kind but [`Features`], whose components are set one by one.
#[diagnostic::on_unimplemented(
    message = "an output of `{Self}` is not set as a whole",
    note = "`out.port.set(i, value)` sets one feature; `out.port.copy_from(&value)` copies a value of any kind"
)]
pub trait Settable: Signal {}

macro_rules! settable {
    ($($kind:ident)*) => { $(impl Settable for $kind {})* };
}

settable! { Scalar Flag Image VectorImage Mask Regions Twist Pose Joints Jacobian }

macro_rules! kinds {
    ($($kind:ident $shape:ident $arena:ident $name:literal $word:literal: $summary:literal, $doc:literal
        { $($item:tt)* })*) => {
        /// The kinds of signals, a closed set.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Kind { $(#[doc = concat!("A ", $word, ": ", $summary, ".")] $kind),* }

        impl Kind {
            /// Every kind.
            pub const ALL: &'static [Self] = &[$(Self::$kind),*];

            /// Returns the name in one word.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name),* }
            }

            /// Returns a shape with default properties.
            pub(crate) fn default_shape(self) -> Shape {
                match self { $(Self::$kind => $shape::default().into()),* }
            }

            /// Returns a summary in one line.
            #[must_use]
            pub const fn summary(self) -> &'static str {
                match self { $(Self::$kind => $summary),* }
            }

            /// Returns the text of the reference about unit, frames and shape, as Markdown.
            #[must_use]
            pub const fn doc(self) -> &'static str {
                match self { $(Self::$kind => $doc),* }
            }
        }

        impl fmt::Display for Kind {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$kind => $word),* })
            }
        }

        /// The shape of a signal of any kind: its properties that are known at load.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        pub enum Shape { $(#[doc = concat!("Shape of a ", $word, ".")] $kind($shape)),* }

        impl Shape {
            /// Returns the kind.
            #[must_use]
            pub const fn kind(&self) -> Kind {
                match self { $(Self::$kind(_) => Kind::$kind),* }
            }

            /// Returns rows and columns, or the number of elements and 0; zeros for a kind without a size.
            pub(crate) fn size(&self) -> [usize; 2] {
                match self { $(Self::$kind(shape) => <$kind as Signal>::allocate(shape).size()),* }
            }
        }

        /// The values of a graph, one vector per kind.
        #[derive(Debug, Default, Clone)]
        pub struct Arenas { $($arena: Vec<$kind>),* }

        impl Arenas {
            /// Allocates a value of that shape and returns its slot.
            pub fn add(&mut self, shape: &Shape) -> u32 {
                match shape { $(Shape::$kind(shape) => {
                    self.$arena.push(<$kind as Signal>::allocate(shape));
                    self.$arena.len() as u32 - 1
                })* }
            }

            /// Replaces a value by a newly allocated one.
            pub fn renew(&mut self, slot: u32, shape: &Shape) {
                match shape { $(Shape::$kind(shape) => {
                    self.$arena[slot as usize] = <$kind as Signal>::allocate(shape);
                })* }
            }

            /// Swaps a value of `kind` with one of another arena.
            pub fn swap(&mut self, kind: Kind, slot: u32, other: &mut Self, other_slot: u32) {
                match kind { $(Kind::$kind =>
                    std::mem::swap(&mut self.$arena[slot as usize], &mut other.$arena[other_slot as usize])),* }
            }

            /// Takes over a sample of `kind` that arrives in `tick` by swapping the buffers. Returns its mark.
            pub(crate) fn receive(
                &mut self, kind: Kind, slot: u32, samples: &mut Self, sample: u32, tick: u64, stamp: Stamp,
            ) -> Mark {
                match kind { $(Kind::$kind => {
                    let (value, sample) = (&mut self.$arena[slot as usize], &mut samples.$arena[sample as usize]);
                    sample.arrive(value, tick, stamp);
                    std::mem::swap(value, sample);
                    Signal::mark(value, Mark::new(tick, stamp, true), tick)
                })* }
            }

            /// Makes a value of `kind` absent, component by component where it has any.
            pub(crate) fn lose(&mut self, kind: Kind, slot: u32, tick: u64) {
                match kind { $(Kind::$kind => Signal::lose(&mut self.$arena[slot as usize], tick)),* }
            }

            /// Returns the size of a value of `kind`.
            pub(crate) fn size(&self, kind: Kind, slot: u32) -> [usize; 2] {
                match kind { $(Kind::$kind => self.$arena[slot as usize].size()),* }
            }

            /// Copies a value of `kind` to a slot of the same shape in another arena.
            pub fn copy(&self, kind: Kind, slot: u32, other: &mut Self, other_slot: u32) {
                match kind { $(Kind::$kind =>
                    self.$arena[slot as usize].copy_to(&mut other.$arena[other_slot as usize])),* }
            }

            /// Whether every value is finite. Images are not checked here: inlets check them once, when they arrive.
            #[must_use]
            pub fn are_finite(&self) -> bool {
                $((Kind::$kind.is_picture() || self.$arena.iter().fold(true, |all, value| all & value.is_finite())) &)* true
            }

            /// Whether a value of `kind` is finite.
            #[must_use]
            pub fn is_finite(&self, kind: Kind, slot: u32) -> bool {
                match kind { $(Kind::$kind => self.$arena[slot as usize].is_finite()),* }
            }
        }

        $(
            impl From<$shape> for Shape {
                fn from(shape: $shape) -> Self { Self::$kind(shape) }
            }

            impl Signal for $kind {
                const KIND: Kind = Kind::$kind;
                type Shape = $shape;
                fn shape_of(shape: &Shape) -> Option<&$shape> {
                    match shape { Shape::$kind(shape) => Some(shape), _ => None }
                }
                fn arena(arenas: &Arenas) -> &Vec<Self> { &arenas.$arena }
                fn arena_mut(arenas: &mut Arenas) -> &mut Vec<Self> { &mut arenas.$arena }
                $($item)*
            }
        )*
    };
}

/// The shape of a mask: the array of tactels.
pub type MaskShape = Grid;
/// The shape of a Jacobian: the joints of its columns.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JacobianShape(pub JointsShape);

kinds! {
    Scalar ScalarShape scalars "scalar" "scalar": "a number with a unit",
        "It belongs to a frame. Its unit is known at load." {
        const STAYS: bool = true;
        fn is_finite(&self) -> bool { all_finite(&[*self]) }
    }
    Flag FlagShape flags "flag" "flag": "true or false",
        "It has no unit. Gates and conditions are flags." {
        const STAYS: bool = true;
        fn is_finite(&self) -> bool { true }
    }
    Features FeaturesShape features "features" "feature vector": "named numbers, each with a unit and a freshness of its own",
        "The names come from the wires or tables of the graph file and are known at load. Each component can be absent on \
        its own; the vector is present if any component is. The vector belongs to one frame." {
        fn allocate(shape: &FeaturesShape) -> Self { Self::absent(shape.features.len()) }
        fn size(&self) -> [usize; 2] { [self.components().len(), 0] }
        fn arrive(&mut self, previous: &Self, tick: u64, stamp: Stamp) { self.follow(previous, tick, stamp); }
        fn copy_to(&self, slot: &mut Self) { slot.copy_from(self); }
        fn is_finite(&self) -> bool { Self::is_finite(self) }
        fn mark(&self, _: Mark, tick: u64) -> Mark { Self::mark(self, tick) }
        fn lose(&mut self, tick: u64) { self.lose_all(tick); }
        fn take(slot: &mut Self, tick: u64, stamp: Stamp) -> Self { std::mem::take(slot).at(tick, stamp) }
        const KEEPS: bool = true;
    }
    Image ImageShape images "image" "image": "a number for each tactel of a pad, row by row",
        "All tactels have the same unit. The shape is the number of rows and columns and the pitch along x and y [m]. The \
        column index j increases along the sensor's x, the row index i along its y, and z points out of the pad toward \
        the object. An image belongs to the frame of its pad." {
        fn allocate(shape: &ImageShape) -> Self { Self::zeros(shape.rows, shape.cols) }
        fn size(&self) -> [usize; 2] { [self.rows(), self.cols()] }
        fn copy_to(&self, slot: &mut Self) { slot.copy_from(self); }
        fn is_finite(&self) -> bool { Self::is_finite(self) }
    }
    VectorImage VectorImageShape vector_images "vector_image" "vector image":
        "three numbers for each tactel of a pad with three axes, row by row",
        "x and y are the force with which the object drags the tactel along the sensor's x and y. z is the force with which \
        it presses the tactel, positive as in an image. All have the same unit. Shape and frame are those of an image." {
        fn allocate(shape: &VectorImageShape) -> Self { Self::zeros(shape.0.rows, shape.0.cols) }
        fn size(&self) -> [usize; 2] { [self.rows(), self.cols()] }
        fn copy_to(&self, slot: &mut Self) { slot.copy_from(self); }
        fn is_finite(&self) -> bool { Self::is_finite(self) }
    }
    Mask MaskShape masks "mask" "mask": "true or false for each tactel of a pad",
        "The shape is the number of rows and columns. A mask belongs to the frame of its pad." {
        fn allocate(grid: &MaskShape) -> Self { Self::empty(grid.rows, grid.cols) }
        fn size(&self) -> [usize; 2] { [self.rows(), self.cols()] }
        fn copy_to(&self, slot: &mut Self) { slot.copy_from(self); }
        fn is_finite(&self) -> bool { true }
    }
    Regions RegionsShape regions "regions" "list of regions": "the connected regions of a mask, each with its area and its force",
        "The force has the unit of the image. The shape is that of the array. The regions are in the order of their first \
        tactels, row by row." {
        fn allocate(shape: &RegionsShape) -> Self { Self::with_room(shape.grid.rows, shape.grid.cols) }
        fn copy_to(&self, slot: &mut Self) { slot.copy_from(self); }
        fn is_finite(&self) -> bool { self.list().iter().all(|region| all_finite(&[region.force])) }
    }
    Twist TwistShape twists "twist" "twist": "a velocity: linear and angular",
        "The order is `[v, omega]`, in m/s and rad/s. A twist in a sensor's frame is the velocity of the sensor's origin in \
        the sensor's axes. A twist in `base` is spatial: the velocity at the base's origin (paper eq. 4)." {
        const STAYS: bool = true;
        fn is_finite(&self) -> bool { all_finite(self.0.as_slice()) }
    }
    Pose PoseShape poses "pose" "pose": "the position and orientation of one frame in another",
        "It consists of a rotation and a translation [m] that transform points of the first frame to the second." {
        const STAYS: bool = true;
        fn is_finite(&self) -> bool {
            all_finite(self.0.translation.vector.as_slice()) && all_finite(self.0.rotation.matrix().as_slice())
        }
    }
    Joints JointsShape joints "joints" "joint vector": "a number for each joint of an arm, from the base to the tip",
        "All values have the same unit: rad for positions, rad/s for velocities. The shape is the list of joints with \
        their limits." {
        fn allocate(shape: &JointsShape) -> Self { Self::zeros(shape.joints.len()) }
        fn size(&self) -> [usize; 2] { [self.0.len(), 0] }
        fn copy_to(&self, slot: &mut Self) { slot.0.clone_from(&self.0); }
        fn is_finite(&self) -> bool { all_finite(&self.0) }
    }
    Jacobian JacobianShape jacobians "jacobian" "Jacobian": "the twist at unit speed of each joint",
        "It has one column per joint. The linear part of a column is the velocity at the origin of the Jacobian's frame." {
        fn allocate(shape: &JacobianShape) -> Self { Self::zeros(shape.0.joints.len()) }
        fn size(&self) -> [usize; 2] { [self.0.len(), 0] }
        fn copy_to(&self, slot: &mut Self) { slot.0.clone_from(&self.0); }
        fn is_finite(&self) -> bool { self.0.iter().all(|column| all_finite(column.0.as_slice())) }
    }
}

impl Kind {
    /// The arguments of a port of this kind, in order: `unit`, then its frames.
    #[must_use]
    pub const fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Scalar | Self::Features | Self::Image | Self::VectorImage | Self::Regions => &["unit", "frame"],
            Self::Flag => &[],
            Self::Mask | Self::Twist => &["frame"],
            Self::Pose => &["frame", "reference"],
            Self::Joints => &["unit", "robot"],
            Self::Jacobian => &["frame", "robot"],
        }
    }

    /// Whether a port of this kind takes that argument.
    #[must_use]
    pub const fn takes(self, argument: &str) -> bool {
        let arguments = self.arguments();
        let mut i = 0;
        while i < arguments.len() && !is_same(arguments[i].as_bytes(), argument.as_bytes()) {
            i += 1;
        }
        i < arguments.len()
    }

    /// Whether the port arguments of this kind begin with a unit.
    #[must_use]
    pub const fn has_unit(self) -> bool {
        self.takes("unit")
    }

    /// Whether it has numbers for each tactel, which are shown as a picture.
    #[must_use]
    pub const fn is_picture(self) -> bool {
        matches!(self, Self::Image | Self::VectorImage)
    }

    /// Formats a size for messages: `16 by 16 tactels`, `7 joints`.
    pub(crate) fn size_in_words(self, [first, second]: [usize; 2]) -> String {
        match self {
            Self::Features => format!("{first} features"),
            Self::Joints | Self::Jacobian => format!("{first} joints"),
            _ => format!("{first} by {second} tactels"),
        }
    }

    /// Returns the kind with its article, for messages.
    #[must_use]
    pub fn with_article(self) -> String {
        let article = if self == Self::Image { "an" } else { "a" };
        format!("{article} {self}")
    }
}

impl Shape {
    /// Returns the unit, or `None` for a kind without a single unit.
    #[must_use]
    pub const fn unit(&self) -> Option<Unit> {
        match self {
            Self::Scalar(shape) => Some(shape.unit),
            Self::Image(shape) | Self::VectorImage(VectorImageShape(shape)) => Some(shape.unit),
            Self::Regions(shape) => Some(shape.unit),
            Self::Joints(shape) => Some(shape.unit),
            _ => None,
        }
    }

    /// Sets the unit. Does nothing for a kind without a single unit.
    pub const fn set_unit(&mut self, unit: Unit) {
        match self {
            Self::Scalar(shape) => shape.unit = unit,
            Self::Image(shape) | Self::VectorImage(VectorImageShape(shape)) => shape.unit = unit,
            Self::Regions(shape) => shape.unit = unit,
            Self::Joints(shape) => shape.unit = unit,
            _ => {}
        }
    }
}
