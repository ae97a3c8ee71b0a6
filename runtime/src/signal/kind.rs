//! The list of kinds, and what all kinds have in common.

use std::fmt;

use super::unit::is_same;
use super::{
    Features, FeaturesShape, Grid, Image, ImageShape, Jacobian, Joints, JointsShape, Mark, Mask, Pose, PoseShape,
    Regions, RegionsShape, Stamp, Twist, TwistShape, Unit, all_finite,
};

/// A single number.
pub type Scalar = f64;
/// A yes or no.
pub type Flag = bool;

/// What is known of a scalar at load.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalarShape {
    /// Its unit.
    pub unit: Unit,
    /// Least and greatest value it can have [its unit]; infinite where nothing is known.
    pub range: [f64; 2],
}

impl Default for ScalarShape {
    fn default() -> Self {
        Self::of(Unit::default())
    }
}

impl ScalarShape {
    /// Of a scalar with that unit, of whatever size.
    #[must_use]
    pub const fn of(unit: Unit) -> Self {
        Self { unit, range: [f64::NEG_INFINITY, f64::INFINITY] }
    }

    /// The same for a scalar from `least` to `greatest` [its unit].
    #[must_use]
    pub const fn within(self, least: f64, greatest: f64) -> Self {
        Self { range: [least, greatest], ..self }
    }
}

/// Nothing is known of a flag at load.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FlagShape;

/// A value that travels on a wire: one type a kind.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a signal",
    note = "signals are `Scalar`, `Flag`, `Features`, `Image`, `Mask`, `Regions`, `Twist`, `Pose`, `Joints` and `Jacobian`"
)]
pub trait Signal: Default + Clone + Send + 'static {
    /// Which kind.
    const KIND: Kind;
    /// What is known of it at load.
    type Shape: Clone + Default + PartialEq + fmt::Debug + Into<Shape> + 'static;

    /// A value of that shape; the only place where a value allocates.
    fn allocate(shape: &Self::Shape) -> Self;

    /// Whether every number in it is finite; what is absent counts as finite.
    fn is_finite(&self) -> bool;

    /// Rows and columns, or the number of elements; zeros for a kind without a size.
    fn size(&self) -> [usize; 2] {
        [0, 0]
    }

    /// The [`size`](Self::size) of the values of a shape.
    fn size_of(_shape: &Self::Shape) -> [usize; 2] {
        [0, 0]
    }

    /// Becomes the successor of `previous` as a sample that arrives in `tick`.
    fn arrive(&mut self, _previous: &Self, _tick: u64, _stamp: Stamp) {}

    /// The mark of the value after a step that wrote it, given the mark that follows from the step.
    fn mark(&self, from_step: Mark, _tick: u64) -> Mark {
        from_step
    }

    /// Takes the buffer out of its slot for a step in `tick` with that stamp. What [stays](Self::STAYS) starts afresh.
    fn take(slot: &mut Self, _tick: u64, _stamp: Stamp) -> Self {
        std::mem::take(slot)
    }

    /// Whether a slot keeps its value while a step writes another: what is plain and small.
    const STAYS: bool = false;

    /// Copies the value into a slot of the same shape, in place.
    fn copy_to(&self, slot: &mut Self) {
        slot.clone_from(self);
    }

    /// What becomes of the value when its port is made absent.
    fn lose(&mut self, _tick: u64) {}

    /// Whether a step that writes nothing leaves the value as it is, instead of making it absent.
    const KEEPS: bool = false;

    /// The shape of this kind, if `shape` is one.
    fn shape_of(shape: &Shape) -> Option<&Self::Shape>;
    /// The values of this kind.
    fn arena(arenas: &Arenas) -> &Vec<Self>;
    /// The values of this kind, to be written.
    fn arena_mut(arenas: &mut Arenas) -> &mut Vec<Self>;
}

/// A signal whose value a step sets at once: every kind but [`Features`], whose components are set one by one.
pub trait Settable: Signal {}

macro_rules! settable {
    ($($kind:ident)*) => { $(impl Settable for $kind {})* };
}

settable! { Scalar Flag Image Mask Regions Twist Pose Joints Jacobian }

macro_rules! kinds {
    ($($kind:ident $shape:ident $arena:ident $name:literal $word:literal: $summary:literal, $doc:literal
        { $($item:tt)* })*) => {
        /// The kinds of signals: a closed set.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Kind { $(#[doc = concat!("A ", $word, ": ", $summary, ".")] $kind),* }

        impl Kind {
            /// Every kind.
            pub const ALL: &'static [Self] = &[$(Self::$kind),*];

            /// Its name, in one word.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name),* }
            }

            /// The shape of which nothing is known.
            pub(crate) fn default_shape(self) -> Shape {
                match self { $(Self::$kind => $shape::default().into()),* }
            }

            /// What it is, in one line.
            #[must_use]
            pub const fn summary(self) -> &'static str {
                match self { $(Self::$kind => $summary),* }
            }

            /// What else there is to know, for the reference: its unit, its frames and its shape. Markdown.
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

        /// What is known of any signal at load.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Shape { $(#[doc = concat!("Of a ", $word, ".")] $kind($shape)),* }

        impl Shape {
            /// Which kind the shape is of.
            #[must_use]
            pub const fn kind(&self) -> Kind {
                match self { $(Self::$kind(_) => Kind::$kind),* }
            }

            /// Rows and columns, or the number of elements; zeros for a kind without a size.
            pub(crate) fn size(&self) -> [usize; 2] {
                match self { $(Self::$kind(shape) => <$kind as Signal>::size_of(shape)),* }
            }
        }

        /// The values of a graph, kind by kind.
        #[derive(Debug, Default, Clone)]
        pub struct Arenas { $($arena: Vec<$kind>),* }

        impl Arenas {
            /// Makes room for one more value of that shape and tells its slot.
            pub fn add(&mut self, shape: &Shape) -> u32 {
                match shape { $(Shape::$kind(shape) => {
                    self.$arena.push(<$kind as Signal>::allocate(shape));
                    self.$arena.len() as u32 - 1
                })* }
            }

            /// A value as it was at first, in the place of one that is lost or spoilt.
            pub fn renew(&mut self, slot: u32, shape: &Shape) {
                match shape { $(Shape::$kind(shape) => {
                    self.$arena[slot as usize] = <$kind as Signal>::allocate(shape);
                })* }
            }

            /// Exchanges a value of `kind` with one of another arena.
            pub fn swap(&mut self, kind: Kind, slot: u32, other: &mut Self, other_slot: u32) {
                match kind { $(Kind::$kind =>
                    std::mem::swap(&mut self.$arena[slot as usize], &mut other.$arena[other_slot as usize])),* }
            }

            /// Takes over a sample of `kind` that arrives in `tick`, by exchanging the buffers. Returns its mark.
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

            /// Size of a value of `kind`.
            pub(crate) fn size(&self, kind: Kind, slot: u32) -> [usize; 2] {
                match kind { $(Kind::$kind => self.$arena[slot as usize].size()),* }
            }

            /// Copies a value of `kind` to a slot of another arena that has its shape.
            pub fn copy(&self, kind: Kind, slot: u32, other: &mut Self, other_slot: u32) {
                match kind { $(Kind::$kind =>
                    self.$arena[slot as usize].copy_to(&mut other.$arena[other_slot as usize])),* }
            }

            /// Whether every value is finite, images aside: those are checked once, where they enter.
            #[must_use]
            pub fn are_finite(&self) -> bool {
                $((Kind::$kind == Kind::Image || self.$arena.iter().fold(true, |all, value| all & value.is_finite())) &)* true
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

/// The shape of a mask is that of the array it lies on.
pub type MaskShape = Grid;
/// What is known of a Jacobian at load: the joints of its columns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JacobianShape(pub JointsShape);

kinds! {
    Scalar ScalarShape scalars "scalar" "scalar": "a number with a unit",
        "It belongs to a frame. Its unit is known at load." {
        fn allocate(_: &ScalarShape) -> Self { 0.0 }
        fn take(_: &mut Self, _: u64, _: Stamp) -> Self { 0.0 }
        const STAYS: bool = true;
        fn is_finite(&self) -> bool { all_finite(&[*self]) }
    }
    Flag FlagShape flags "flag" "flag": "a yes or no",
        "It has no unit. Gates and conditions are flags." {
        fn allocate(_: &FlagShape) -> Self { false }
        fn take(_: &mut Self, _: u64, _: Stamp) -> Self { false }
        const STAYS: bool = true;
        fn is_finite(&self) -> bool { true }
    }
    Features FeaturesShape features "features" "feature vector": "named numbers, each with a unit and a freshness of its own",
        "The names are known at load: they come from the graph file, where wires or tables name them. Each component can be \
        absent while the others are there; the vector is there if any component is. The vector belongs to one frame." {
        fn allocate(shape: &FeaturesShape) -> Self { Self::absent(shape.features.len()) }
        fn size(&self) -> [usize; 2] { [self.components().len(), 0] }
        fn size_of(shape: &FeaturesShape) -> [usize; 2] { [shape.features.len(), 0] }
        fn arrive(&mut self, previous: &Self, tick: u64, stamp: Stamp) { self.follow(previous, tick, stamp); }
        fn copy_to(&self, slot: &mut Self) { slot.copy_from(self); }
        fn is_finite(&self) -> bool { Self::is_finite(self) }
        fn mark(&self, _: Mark, tick: u64) -> Mark { Self::mark(self, tick) }
        fn lose(&mut self, tick: u64) { self.lose_all(tick); }
        fn take(slot: &mut Self, tick: u64, stamp: Stamp) -> Self { std::mem::take(slot).at(tick, stamp) }
        const KEEPS: bool = true;
    }
    Image ImageShape images "image" "image": "a number for each tactel of a pad, row after row",
        "All tactels have one unit. Its shape is rows, columns and the pitch along x and y [m]: column j runs along the \
        sensor's x, row i along its y, and z points out of the pad toward the object. It belongs to the frame of its pad." {
        fn allocate(shape: &ImageShape) -> Self { Self::zeros(shape.rows, shape.cols) }
        fn size(&self) -> [usize; 2] { [self.rows(), self.cols()] }
        fn size_of(shape: &ImageShape) -> [usize; 2] { [shape.rows, shape.cols] }
        fn copy_to(&self, slot: &mut Self) { slot.copy_from(self); }
        fn is_finite(&self) -> bool { Self::is_finite(self) }
    }
    Mask MaskShape masks "mask" "mask": "a yes or no for each tactel of a pad",
        "Its shape is the rows and columns of the array it lies on, and it belongs to the frame of its pad." {
        fn allocate(grid: &MaskShape) -> Self { Self::empty(grid.rows, grid.cols) }
        fn size(&self) -> [usize; 2] { [self.rows(), self.cols()] }
        fn size_of(grid: &MaskShape) -> [usize; 2] { [grid.rows, grid.cols] }
        fn copy_to(&self, slot: &mut Self) { slot.copy_from(self); }
        fn is_finite(&self) -> bool { true }
    }
    Regions RegionsShape regions "regions" "list of regions": "the connected regions of a mask, each with its area and its force",
        "The force is in the unit of the image it was summed from. Its shape is that of the array. They stand in the order \
        of their first tactels, row after row." {
        fn allocate(shape: &RegionsShape) -> Self { Self::with_room(shape.grid.rows, shape.grid.cols) }
        fn copy_to(&self, slot: &mut Self) { slot.copy_from(self); }
        fn is_finite(&self) -> bool { self.list().iter().all(|region| all_finite(&[region.force])) }
    }
    Twist TwistShape twists "twist" "twist": "a velocity: linear and angular",
        "The order is `[v, omega]`, in m/s and rad/s. A twist in a sensor's frame is that of the sensor's origin along the \
        sensor's axes; one in `base` is spatial, at the base's origin (paper eq. 4)." {
        fn allocate(_: &TwistShape) -> Self { Self::default() }
        fn take(_: &mut Self, _: u64, _: Stamp) -> Self { Self::default() }
        const STAYS: bool = true;
        fn is_finite(&self) -> bool { all_finite(self.0.as_slice()) }
    }
    Pose PoseShape poses "pose" "pose": "where one frame is in another",
        "A rotation and a translation [m] that take points of the first frame to the second." {
        fn allocate(_: &PoseShape) -> Self { Self::default() }
        fn take(_: &mut Self, _: u64, _: Stamp) -> Self { Self::default() }
        const STAYS: bool = true;
        fn is_finite(&self) -> bool {
            all_finite(self.0.translation.vector.as_slice()) && all_finite(self.0.rotation.matrix().as_slice())
        }
    }
    Joints JointsShape joints "joints" "joint vector": "a number for each joint of an arm, from the base to the tip",
        "All have one unit: rad for positions, rad/s for velocities. Its shape is the list of joints with their limits." {
        fn allocate(shape: &JointsShape) -> Self { Self::zeros(shape.joints.len()) }
        fn size(&self) -> [usize; 2] { [self.0.len(), 0] }
        fn size_of(shape: &JointsShape) -> [usize; 2] { [shape.joints.len(), 0] }
        fn copy_to(&self, slot: &mut Self) { slot.0.clone_from(&self.0); }
        fn is_finite(&self) -> bool { all_finite(&self.0) }
    }
    Jacobian JacobianShape jacobians "jacobian" "Jacobian": "the twist that unit speed of each joint gives",
        "A column for each joint, at the origin of the frame it is given in." {
        fn allocate(shape: &JacobianShape) -> Self { Self::zeros(shape.0.joints.len()) }
        fn size(&self) -> [usize; 2] { [self.0.len(), 0] }
        fn size_of(shape: &JacobianShape) -> [usize; 2] { [shape.0.joints.len(), 0] }
        fn copy_to(&self, slot: &mut Self) { slot.0.clone_from(&self.0); }
        fn is_finite(&self) -> bool { self.0.iter().all(|column| all_finite(column.0.as_slice())) }
    }
}

impl Kind {
    /// The arguments of a port of this kind, in order: `unit`, then its frames.
    #[must_use]
    pub const fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Scalar | Self::Features | Self::Image | Self::Regions => &["unit", "frame"],
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

    /// Whether a port of this kind names a unit before its frame.
    #[must_use]
    pub const fn has_unit(self) -> bool {
        self.takes("unit")
    }

    /// A size in words: `16 by 16 tactels`, `7 joints`.
    pub(crate) fn size_in_words(self, [first, second]: [usize; 2]) -> String {
        match self {
            Self::Features => format!("{first} features"),
            Self::Joints | Self::Jacobian => format!("{first} joints"),
            _ => format!("{first} by {second} tactels"),
        }
    }

    /// The kind with its article, for messages.
    #[must_use]
    pub fn with_article(self) -> String {
        let article = if self == Self::Image { "an" } else { "a" };
        format!("{article} {self}")
    }
}

impl Shape {
    /// The unit, of a kind that has one for the whole.
    #[must_use]
    pub const fn unit(&self) -> Option<Unit> {
        match self {
            Self::Scalar(shape) => Some(shape.unit),
            Self::Image(shape) => Some(shape.unit),
            Self::Regions(shape) => Some(shape.unit),
            Self::Joints(shape) => Some(shape.unit),
            _ => None,
        }
    }

    /// Sets the unit, of a kind that has one for the whole.
    pub const fn set_unit(&mut self, unit: Unit) {
        match self {
            Self::Scalar(shape) => shape.unit = unit,
            Self::Image(shape) => shape.unit = unit,
            Self::Regions(shape) => shape.unit = unit,
            Self::Joints(shape) => shape.unit = unit,
            _ => {}
        }
    }
}
