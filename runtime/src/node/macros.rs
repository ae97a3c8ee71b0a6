//! The four blocks of a node file. Each declares plain data once; the check, the messages and the reference read it.

/// Declares the parameters of a node: a field each, with its doc, its type and, after `=`, its default. A `live` one may
/// change while the graph runs, in a mode; what the others say is settled at load: a window, a name, a size.
///
/// Without a name the struct is called `Params`; a parameter that is a table of its own gets one: `params! { Gains: … }`.
///
/// ```
/// tactflow_runtime::params! {
///     /// Proportional gain [1/s].
///     live kp: f64,
///     /// Number of samples in the mean.
///     window: usize = 10,
/// }
/// ```
#[macro_export]
macro_rules! params {
    (@list $Name:ident [$($done:tt)*]) => { $crate::params! { @emit $Name $($done)* } };
    (@list $Name:ident [$($done:tt)*] $(#[doc = $doc:literal])* live $field:ident: $ty:ty $(= $default:expr)? $(, $($rest:tt)*)?) => {
        $crate::params! { @list $Name [$($done)* { [$($doc)*] true $field ($ty) [$($default)?] }] $($($rest)*)? }
    };
    (@list $Name:ident [$($done:tt)*] $(#[doc = $doc:literal])* $field:ident: $ty:ty $(= $default:expr)? $(, $($rest:tt)*)?) => {
        $crate::params! { @list $Name [$($done)* { [$($doc)*] false $field ($ty) [$($default)?] }] $($($rest)*)? }
    };
    (@emit $Name:ident $({ [$($doc:literal)*] $is_live:literal $field:ident ($ty:ty) [$($default:expr)?] })*) => {
        #[doc = concat!("Parameters: `", stringify!($Name), "`.")]
        #[allow(unreachable_pub, reason = "a node's module may be private")]
        #[derive(Debug, Clone)]
        pub struct $Name { $($(#[doc = $doc])* pub $field: $ty),* }

        impl $crate::node::Param for $Name {
            const EXPECTS: &'static str = "a table";

            fn fields() -> Vec<$crate::node::ParamSpec> {
                vec![$($crate::node::ParamSpec::from_macro::<$ty>(
                    &$crate::node::Declared {
                        name: stringify!($field), doc: concat!($($doc, "\n"),*), unit: None, bounds: None, is_live: $is_live,
                    },
                    None$(.or(Some((|| $default) as fn() -> $ty)))?, stringify!($($default)?))),*]
            }

            fn written(&self) -> Option<$crate::node::Written> {
                $crate::node::written_table([$((stringify!($field), $crate::node::Param::written(&self.$field))),*])
            }

            #[allow(unused_mut, unused_variables, reason = "a node may have no parameters")]
            fn read(value: &$crate::source::Value, reader: &mut $crate::node::Reader<'_>) -> Option<Self> {
                let mut table = reader.table(value)?;
                $(let $field = reader.field::<$ty>(
                    &mut table,
                    &$crate::node::Declared::new(stringify!($field)),
                    None$(.or(Some((|| $default) as fn() -> $ty)))?);)*
                reader.close(table, &[$(stringify!($field)),*]);
                Some(Self { $($field: $field?),* })
            }
        }
    };
    ($Name:ident: $(#[$($first:tt)*] $($body:tt)*)?) => {
        $crate::params! { @list $Name [] $(#[$($first)*] $($body)*)? }
    };
    ($($body:tt)*) => { $crate::params! { @list Params [] $($body)* } };
}

/// Declares what a node remembers from one step to the next; a reset copies a fresh state over it without allocating.
///
/// ```
/// tactflow_runtime::state! {
///     /// Sum of the errors.
///     integral: Vec<f64>,
/// }
/// ```
#[macro_export]
macro_rules! state {
    ($($(#[doc = $doc:literal])* $field:ident: $ty:ty),* $(,)?) => {
        /// What the node remembers.
        #[derive(Debug)]
        pub struct State { $($(#[doc = $doc])* pub $field: $ty),* }

        impl Clone for State {
            fn clone(&self) -> Self {
                Self { $($field: self.$field.clone()),* }
            }
            fn clone_from(&mut self, from: &Self) {
                $(self.$field.clone_from(&from.$field);)*
            }
        }
    };
}

/// Declares the inputs of a node; see the table in [`node`](crate::node) for what the forms mean.
///
/// ```
/// tactflow_runtime::inputs! {
///     /// The image.
///     image: Image["N", "A"],
///     /// Open while this is set.
///     gate: Trigger<Flag>,
///     /// What is added.
///     twist: Many<Twist["A"]>,
/// }
/// ```
#[macro_export]
macro_rules! inputs {
    (@need Required) => { $crate::node::Need::REQUIRED };
    (@need Sampled) => { $crate::node::Need { is_trigger: false, ..$crate::node::Need::REQUIRED } };
    (@need Trigger) => { $crate::node::Need::OPTIONAL };
    (@need Optional) => { $crate::node::Need { is_trigger: false, ..$crate::node::Need::OPTIONAL } };
    (@need Many) => { $crate::node::Need { is_many: true, ..$crate::node::Need::OPTIONAL } };
    (@need Delayed) => { $crate::node::Need { is_delayed: true, ..$crate::node::Need::OPTIONAL } };
    (@list [$($done:tt)*]) => { $crate::inputs! { @emit $($done)* } };
    (@list [$($done:tt)*] $(#[doc = $doc:literal])* $name:ident: Sampled<$kind:ident $([$($arg:literal),*])?> $(, $($rest:tt)*)?) => {
        $crate::inputs! { @list [$($done)* { [$($doc)*] $name $kind [$($($arg)*)?] Sampled ($crate::node::In<'a, $crate::signal::$kind>) }] $($($rest)*)? }
    };
    (@list [$($done:tt)*] $(#[doc = $doc:literal])* $name:ident: Trigger<$kind:ident $([$($arg:literal),*])?> $(, $($rest:tt)*)?) => {
        $crate::inputs! { @list [$($done)* { [$($doc)*] $name $kind [$($($arg)*)?] Trigger (Option<$crate::node::In<'a, $crate::signal::$kind>>) }] $($($rest)*)? }
    };
    (@list [$($done:tt)*] $(#[doc = $doc:literal])* $name:ident: Option<$kind:ident $([$($arg:literal),*])?> $(, $($rest:tt)*)?) => {
        $crate::inputs! { @list [$($done)* { [$($doc)*] $name $kind [$($($arg)*)?] Optional (Option<$crate::node::In<'a, $crate::signal::$kind>>) }] $($($rest)*)? }
    };
    (@list [$($done:tt)*] $(#[doc = $doc:literal])* $name:ident: Delayed<$kind:ident $([$($arg:literal),*])?> $(, $($rest:tt)*)?) => {
        $crate::inputs! { @list [$($done)* { [$($doc)*] $name $kind [$($($arg)*)?] Delayed (Option<$crate::node::In<'a, $crate::signal::$kind>>) }] $($($rest)*)? }
    };
    (@list [$($done:tt)*] $(#[doc = $doc:literal])* $name:ident: Many<$kind:ident $([$($arg:literal),*])?> $(, $($rest:tt)*)?) => {
        $crate::inputs! { @list [$($done)* { [$($doc)*] $name $kind [$($($arg)*)?] Many ($crate::node::Many<'a, $crate::signal::$kind>) }] $($($rest)*)? }
    };
    (@list [$($done:tt)*] $(#[doc = $doc:literal])* $name:ident: $kind:ident $([$($arg:literal),*])? $(, $($rest:tt)*)?) => {
        $crate::inputs! { @list [$($done)* { [$($doc)*] $name $kind [$($($arg)*)?] Required ($crate::node::In<'a, $crate::signal::$kind>) }] $($($rest)*)? }
    };
    (@emit $({ [$($doc:literal)*] $name:ident $kind:ident [$($arg:literal)*] $need:ident ($view:ty) })*) => {
        /// What the node reads.
        pub struct Inputs<'a> {
            $($(#[doc = $doc])* pub $name: $view,)*
            #[doc(hidden)]
            pub lifetime: std::marker::PhantomData<&'a ()>,
        }

        /// What the node learns of its inputs at load.
        pub struct InputShapes<'a> {
            $($(#[doc = $doc])* pub $name: <$view as $crate::node::View<'a>>::Shape,)*
            #[doc(hidden)]
            pub lifetime: std::marker::PhantomData<&'a ()>,
        }

        impl<'a> $crate::node::InputSet<'a> for Inputs<'a> {
            type Shapes = InputShapes<'a>;

            fn specs() -> Vec<$crate::node::PortSpec> {
                vec![$($crate::node::PortSpec {
                    name: stringify!($name).into(),
                    doc: concat!($($doc, "\n"),*).into(),
                    kind: $crate::signal::Kind::$kind,
                    args: vec![$(std::borrow::Cow::Borrowed($arg)),*].into(),
                    need: $crate::inputs! { @need $need },
                }),*]
            }

            #[allow(unused_variables, unused_mut, reason = "a node may have no inputs")]
            fn shapes(wires: Vec<Vec<(String, $crate::signal::Shape)>>) -> InputShapes<'a> {
                let mut wires = wires.into_iter();
                InputShapes {
                    $($name: <$view as $crate::node::View<'a>>::shape(wires.next().unwrap_or_default()),)*
                    lifetime: std::marker::PhantomData,
                }
            }

            #[allow(unused_variables, unused_mut, unused_assignments, reason = "a node may have no inputs")]
            #[inline]
            fn fetch(bus: &'a $crate::node::Bus, wires: &'a $crate::node::Wires, tick: u64) -> Self {
                let mut i = 0;
                $(
                    let lag = u64::from($crate::inputs! { @need $need }.is_delayed);
                    let $name = <$view as $crate::node::View<'a>>::fetch(bus, wires, i, tick.wrapping_sub(lag));
                    i += 1;
                )*
                Self { $($name,)* lifetime: std::marker::PhantomData }
            }
        }
    };
    ($($body:tt)*) => { $crate::inputs! { @list [] $($body)* } };
}

/// Declares the outputs of a node.
///
/// ```
/// tactflow_runtime::outputs! {
///     /// Sum of the region's values, f.
///     force: Scalar["U", "A"],
/// }
/// ```
#[macro_export]
macro_rules! outputs {
    ($($(#[doc = $doc:literal])* $name:ident: $kind:ident $([$($arg:literal),*])?),* $(,)?) => {
        /// What the node writes.
        #[derive(Debug, Default)]
        pub struct Outputs { $($(#[doc = $doc])* pub $name: $crate::node::Out<$crate::signal::$kind>),* }

        /// Shapes of what the node writes.
        #[derive(Debug, Default)]
        pub struct OutputShapes { $($(#[doc = $doc])* pub $name: <$crate::signal::$kind as $crate::signal::Signal>::Shape),* }

        impl $crate::node::OutputSet for Outputs {
            type Shapes = OutputShapes;

            fn specs() -> Vec<$crate::node::PortSpec> {
                vec![$($crate::node::PortSpec {
                    name: stringify!($name).into(),
                    doc: concat!($($doc, "\n"),*).into(),
                    kind: $crate::signal::Kind::$kind,
                    args: vec![$($(std::borrow::Cow::Borrowed($arg)),*)?].into(),
                    need: $crate::node::Need::REQUIRED,
                }),*]
            }

            fn into_shapes(shapes: OutputShapes) -> Vec<$crate::signal::Shape> {
                vec![$(shapes.$name.into()),*]
            }

            #[allow(unused_variables, unused_mut, reason = "a node may have no outputs")]
            #[inline]
            fn take(bus: &mut $crate::node::Bus, ports: &[$crate::node::PortId], tick: &$crate::node::Tick) -> Self {
                let mut ports = ports.iter();
                Self { $($name: $crate::node::Out::take(bus, *ports.next().expect("a port for each output"), tick)),* }
            }

            #[allow(unused_variables, unused_mut, reason = "a node may have no outputs")]
            #[inline]
            fn put(self, bus: &mut $crate::node::Bus, ports: &[$crate::node::PortId], tick: &$crate::node::Tick) {
                let mut ports = ports.iter();
                $(self.$name.put(bus, *ports.next().expect("a port for each output"), tick);)*
            }

            #[allow(unused_variables, unused_mut, reason = "a node may have no outputs")]
            fn lose(bus: &mut $crate::node::Bus, ports: &[$crate::node::PortId], tick: u64) {
                let mut ports = ports.iter();
                $($crate::node::Out::<$crate::signal::$kind>::lose_port(bus, *ports.next().expect("a port for each output"), tick);)*
            }
        }
    };
}
