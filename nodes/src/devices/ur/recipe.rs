//! The outputs that the driver asks for, and the state of the robot that they are.

/// Number of joints.
pub(super) const JOINTS: usize = 6;

/// The state of the robot in one cycle of the controller. Joints are in the order of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct State {
    /// Time since the controller was started [s].
    pub(super) time: f64,
    /// Measured positions of the joints [rad].
    pub(super) q: [f64; JOINTS],
    /// Positions that the controller commands to the joints [rad].
    pub(super) target_q: [f64; JOINTS],
    /// Pose of the tool centre point in the base of the controller: x, y, z [m] and a rotation vector [rad].
    pub(super) tcp_pose: [f64; 6],
    /// Force [N] and torque [N m] on the tool centre point, along the axes of the base of the controller.
    pub(super) tcp_force: Option<[f64; 6]>,
    /// Pose of the tool centre point in the flange: x, y, z [m] and a rotation vector [rad].
    pub(super) tcp_offset: Option<[f64; 6]>,
    /// Mass of the payload that the controller assumes [kg].
    pub(super) payload: Option<f64>,
    pub(super) robot_mode: i64,
    pub(super) safety_mode: i64,
    pub(super) runtime_state: i64,
    /// Position of the speed slider, 0 to 1.
    pub(super) speed_fraction: f64,
}

/// An output of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Output {
    Time,
    Q,
    TargetQ,
    TcpPose,
    TcpForce,
    TcpOffset,
    Payload,
    RobotMode,
    SafetyMode,
    RuntimeState,
    SpeedScaling,
    SpeedFraction,
}

impl Output {
    /// All outputs that the driver asks for, each with its name in the protocol, in the order of the variants.
    const NAMES: [(Self, &'static str); 12] = [
        (Self::Time, "timestamp"),
        (Self::Q, "actual_q"),
        (Self::TargetQ, "target_q"),
        (Self::TcpPose, "actual_TCP_pose"),
        (Self::TcpForce, "actual_TCP_force"),
        (Self::TcpOffset, "tcp_offset"),
        (Self::Payload, "payload"),
        (Self::RobotMode, "robot_mode"),
        (Self::SafetyMode, "safety_mode"),
        (Self::RuntimeState, "runtime_state"),
        (Self::SpeedScaling, "speed_scaling"),
        (Self::SpeedFraction, "target_speed_fraction"),
    ];

    /// Returns all outputs that the driver asks for.
    pub(super) fn all() -> [Self; 12] {
        Self::NAMES.map(|(output, _)| output)
    }

    /// Returns the name in the protocol.
    pub(super) const fn name(self) -> &'static str {
        Self::NAMES[self as usize].1
    }

    /// Whether the driver can do without it. Old controllers do not have `tcp_offset` and `payload`.
    pub(super) const fn is_optional(self) -> bool {
        matches!(self, Self::TcpForce | Self::TcpOffset | Self::Payload | Self::SpeedFraction)
    }

    /// Returns the types that its value can have.
    const fn types(self) -> &'static [Type] {
        match self {
            Self::Time | Self::Payload | Self::SpeedScaling | Self::SpeedFraction => &[Type::Double],
            Self::Q | Self::TargetQ | Self::TcpPose | Self::TcpForce | Self::TcpOffset => &[Type::Vector6],
            Self::RobotMode | Self::SafetyMode | Self::RuntimeState => &[Type::Int32, Type::Uint32],
        }
    }
}

/// The type of a value in the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Type {
    Double,
    Vector6,
    Int32,
    Uint32,
}

impl Type {
    const fn name(self) -> &'static str {
        match self {
            Self::Double => "DOUBLE",
            Self::Vector6 => "VECTOR6D",
            Self::Int32 => "INT32",
            Self::Uint32 => "UINT32",
        }
    }

    const fn size(self) -> usize {
        match self {
            Self::Double => 8,
            Self::Vector6 => 48,
            Self::Int32 | Self::Uint32 => 4,
        }
    }
}

/// Why a controller does not send what was asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It does not know these outputs, and the driver can do without them.
    Without(Vec<Output>),
    /// The driver cannot go on.
    Final(String),
}

/// The outputs of each sample, in their order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Recipe {
    id: u8,
    values: Vec<(Output, Type)>,
    /// Bytes of the values.
    size: usize,
}

impl Recipe {
    /// Reads the answer to a request of outputs: `recipe u8 | types`.
    ///
    /// # Errors
    /// If the controller does not know an output, or sends another type than the protocol states.
    pub(super) fn read(asked: &[Output], payload: &[u8]) -> Result<Self, Refusal> {
        let (id, types) = payload.split_first().unwrap_or((&0, &[]));
        let types = String::from_utf8_lossy(types);
        let types: Vec<&str> = types.split(',').map(str::trim).collect();
        if types.len() != asked.len() {
            let why = format!("it answers {} outputs with {} types", asked.len(), types.len());
            return Err(Refusal::Final(why));
        }
        let (mut values, mut without) = (Vec::new(), Vec::new());
        for (output, name) in asked.iter().zip(types) {
            match (name, output.types().iter().find(|known| known.name() == name)) {
                (_, Some(known)) => values.push((*output, *known)),
                ("NOT_FOUND", None) if output.is_optional() => without.push(*output),
                (name, None) => return Err(Refusal::Final(refusal(*output, name))),
            }
        }
        if !without.is_empty() {
            return Err(Refusal::Without(without));
        }
        let size = values.iter().map(|(_, kind)| kind.size()).sum();
        Ok(Self { id: *id, values, size })
    }

    /// Reads a sample: `recipe u8 | values`. Returns `None` if it is not one of this recipe, or if a value is not finite.
    pub(super) fn state(&self, payload: &[u8]) -> Option<State> {
        let (id, mut rest) = payload.split_first()?;
        if *id != self.id || rest.len() != self.size {
            return None;
        }
        let mut state = State::default();
        let mut slider = None;
        for (output, kind) in &self.values {
            let (value, later) = rest.split_at_checked(kind.size())?;
            rest = later;
            match output {
                Output::Time => state.time = double(value)?,
                Output::Q => state.q = vector(value)?,
                Output::TargetQ => state.target_q = vector(value)?,
                Output::TcpPose => state.tcp_pose = vector(value)?,
                Output::TcpForce => state.tcp_force = Some(vector(value)?),
                Output::TcpOffset => state.tcp_offset = Some(vector(value)?),
                Output::Payload => state.payload = Some(double(value)?),
                Output::RobotMode => state.robot_mode = integer(*kind, value)?,
                Output::SafetyMode => state.safety_mode = integer(*kind, value)?,
                Output::RuntimeState => state.runtime_state = integer(*kind, value)?,
                Output::SpeedScaling => state.speed_fraction = double(value)?,
                Output::SpeedFraction => slider = Some(double(value)?),
            }
        }
        // Without the slider, the factor that the controller applies takes its place.
        state.speed_fraction = slider.unwrap_or(state.speed_fraction);
        Some(state)
    }
}

/// Returns why an output cannot be used, and what to do.
fn refusal(output: Output, found: &str) -> String {
    let name = output.name();
    match found {
        "NOT_FOUND" => {
            format!("it does not know the output `{name}`: update its software to PolyScope 3.4 or 5.0, or newer")
        }
        "IN_USE" => {
            format!("the output `{name}` is in use by another client: end that program, or remove it from the fieldbus")
        }
        _ => {
            let expected: Vec<&str> = output.types().iter().map(|kind| kind.name()).collect();
            let found: String = found.chars().take(40).collect();
            format!("it sends the output `{name}` as `{found}`, not as `{}`", expected.join("` or `"))
        }
    }
}

fn double(bytes: &[u8]) -> Option<f64> {
    Some(f64::from_be_bytes(bytes.try_into().ok()?)).filter(|value| value.is_finite())
}

fn vector(bytes: &[u8]) -> Option<[f64; 6]> {
    let (values, _) = bytes.as_chunks::<8>();
    let values: [[u8; 8]; 6] = values.try_into().ok()?;
    let values = values.map(f64::from_be_bytes);
    values.iter().all(|value| value.is_finite()).then_some(values)
}

fn integer(kind: Type, bytes: &[u8]) -> Option<i64> {
    let bytes: [u8; 4] = bytes.try_into().ok()?;
    Some(if kind == Type::Uint32 { u32::from_be_bytes(bytes).into() } else { i32::from_be_bytes(bytes).into() })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const ALL_TYPES: &str =
        "DOUBLE,VECTOR6D,VECTOR6D,VECTOR6D,VECTOR6D,VECTOR6D,DOUBLE,INT32,INT32,UINT32,DOUBLE,DOUBLE";

    fn answer(types: &str) -> Vec<u8> {
        [&[1], types.as_bytes()].concat()
    }

    #[test]
    fn the_names_are_in_the_order_of_the_variants() {
        assert!(Output::all().iter().enumerate().all(|(i, output)| *output as usize == i));
    }

    /// The sizes of samples that the protocol states: header, recipe and values.
    #[test]
    fn a_sample_has_the_size_of_its_types() {
        use Output::{Q, SafetyMode, TargetQ, Time};
        let recipe = Recipe::read(&[Time, Q, TargetQ, SafetyMode], &answer("DOUBLE,VECTOR6D,VECTOR6D,INT32")).unwrap();
        assert_eq!(3 + 1 + recipe.size, 112);
        assert_eq!(3 + answer("DOUBLE,VECTOR6D,VECTOR6D,INT32").len(), 34);
        let recipe = Recipe::read(&[Q, SafetyMode], &answer("VECTOR6D,INT32")).unwrap();
        assert_eq!(3 + 1 + recipe.size, 0x38);
        assert_eq!(recipe.state(&[1; 53]).unwrap().safety_mode, 0x0101_0101);
    }

    #[test]
    fn every_value_comes_from_its_place() {
        let recipe = Recipe::read(&Output::all(), &answer(ALL_TYPES)).unwrap();
        let mut sample = vec![1];
        sample.extend((1..=32).flat_map(|i| f64::from(i).to_be_bytes()));
        sample.extend([7, 1, 2].iter().flat_map(|mode: &i32| mode.to_be_bytes()));
        sample.extend([0.5, 0.9f64].iter().flat_map(|value| value.to_be_bytes()));
        let state = recipe.state(&sample).unwrap();
        assert_eq!((state.time, state.q, state.target_q[5]), (1.0, [2.0, 3.0, 4.0, 5.0, 6.0, 7.0], 13.0));
        assert_eq!((state.tcp_pose[0], state.tcp_force.unwrap()[0], state.tcp_offset.unwrap()[0]), (14.0, 20.0, 26.0));
        assert_eq!((state.payload, state.speed_fraction), (Some(32.0), 0.9));
        assert_eq!((state.robot_mode, state.safety_mode, state.runtime_state), (7, 1, 2));
        for wrong in [&sample[..sample.len() - 1], &[&sample[..], &[0]].concat(), &[]] {
            assert_eq!(recipe.state(wrong), None);
        }
        sample[0] = 2;
        assert_eq!(recipe.state(&sample), None, "another recipe");
        sample[0] = 1;
        sample[9..17].copy_from_slice(&f64::NAN.to_be_bytes());
        assert_eq!(recipe.state(&sample), None, "not a number");
    }

    #[test]
    fn without_the_slider_the_scaling_takes_its_place() {
        let recipe = Recipe::read(&[Output::SpeedScaling], &answer("DOUBLE")).unwrap();
        assert_eq!(recipe.state(&[&[1][..], &0.25f64.to_be_bytes()].concat()).unwrap().speed_fraction, 0.25);
    }

    #[test]
    fn a_refusal_names_the_output_and_what_to_do() {
        let cases = [
            (
                ALL_TYPES.replacen("DOUBLE", "NOT_FOUND", 1),
                "it does not know the output `timestamp`: update its software to PolyScope 3.4 or 5.0, or newer",
            ),
            (
                ALL_TYPES.replacen("VECTOR6D", "IN_USE", 1),
                "the output `actual_q` is in use by another client: end that program, or remove it from the fieldbus",
            ),
            (
                ALL_TYPES.replacen("UINT32", "BOOL", 1),
                "it sends the output `runtime_state` as `BOOL`, not as `INT32` or `UINT32`",
            ),
            ("DOUBLE".into(), "it answers 12 outputs with 1 types"),
            (String::new(), "it answers 12 outputs with 1 types"),
        ];
        for (types, why) in cases {
            assert_eq!(Recipe::read(&Output::all(), &answer(&types)), Err(Refusal::Final(why.into())));
        }
        let old = ALL_TYPES.replacen("VECTOR6D,DOUBLE", "NOT_FOUND,NOT_FOUND", 1);
        let without = Refusal::Without(vec![Output::TcpOffset, Output::Payload]);
        assert_eq!(Recipe::read(&Output::all(), &answer(&old)), Err(without));
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(types in prop::collection::vec(any::<u8>(), 0..200), sample in prop::collection::vec(any::<u8>(), 0..400)) {
            let _ = Recipe::read(&Output::all(), &types);
            let recipe = Recipe::read(&Output::all(), &answer(ALL_TYPES)).unwrap();
            let _ = recipe.state(&sample);
            let whole: Vec<u8> = std::iter::once(1).chain(sample.iter().copied().cycle().take(if sample.is_empty() { 0 } else { recipe.size })).collect();
            let _ = recipe.state(&whole);
        }
    }
}
