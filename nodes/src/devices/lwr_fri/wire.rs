//! The datagrams of FRI 1.0: what the controller measures (MSR), and what the driver answers (CMD). Both are
//! little-endian, with `f32` numbers, and start with four `u16`: the number of the datagram, the number of the newest
//! datagram of the other side, the size in bytes, and the sort of the datagram.
//!
//! Numbers stay `f64` inside of the driver. A position that is only mirrored comes back with the same bits.

use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, Translation3};

use crate::devices::wrench::Wrench;

/// Number of joints, from the base to the tip: A1, A2, E1, A3, A4, A5, A6.
pub(super) const JOINTS: usize = 7;
/// Size of what the controller sends.
pub(super) const MSR_BYTES: usize = 916;
/// Size of an answer.
pub(super) const CMD_BYTES: usize = 376;
/// Size of the values of the KRL program: 16 reals, 16 integers, 16 flags and a fill.
const KRL_BYTES: usize = 132;
/// Place of the first integer among them.
const KRL_INTS: usize = 64;
/// Number of integers among them.
pub(super) const KRL_INT_COUNT: usize = 16;

const MSR_ID: u16 = 0x2006;
const CMD_ID: u16 = 0x1005;
const HEADER_BYTES: usize = 8;

/// Positions, stiffnesses or dampings of the joints.
pub(super) type Joints = [f64; JOINTS];

/// The values that the KRL program and the driver exchange.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Krl([u8; KRL_BYTES]);

impl Krl {
    /// Sets an integer, the first of which is number 0.
    pub(super) fn set_int(&mut self, number: usize, value: i32) {
        let at = KRL_INTS + 4 * number;
        self.0[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
}

/// What the controller has sent: the fields that the driver reads.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Report {
    pub(super) sequence: u16,
    pub(super) krl: Krl,
    /// Time of the controller [s].
    pub(super) time: f64,
    pub(super) state: u16,
    pub(super) quality: u16,
    /// Time between two measurements [s].
    pub(super) sample_time: f64,
    pub(super) power: u16,
    pub(super) control: u16,
    pub(super) error: u16,
    /// Measured positions [rad].
    pub(super) measured: Joints,
    /// The posture that the controller commands, with the offset of FRI [rad].
    pub(super) commanded: Joints,
    /// Measured pose of the tool in the base [m].
    pub(super) pose: IsometryMatrix3<f64>,
    /// External wrench at the tool, in its axes.
    pub(super) wrench: Wrench,
}

impl Report {
    /// Reads a datagram. Returns `None` if it is no measurement of FRI 1.0, or if a number that the driver uses is not
    /// finite.
    pub(super) fn decode(datagram: &[u8]) -> Option<Self> {
        let bytes: &[u8; MSR_BYTES] = datagram.try_into().ok()?;
        if (u16_at(bytes, 4), u16_at(bytes, 6)) != (MSR_BYTES as u16, MSR_ID) {
            return None;
        }
        let mut krl = [0; KRL_BYTES];
        krl.copy_from_slice(&bytes[HEADER_BYTES..HEADER_BYTES + KRL_BYTES]);
        let joints = |at: usize| -> Joints { std::array::from_fn(|i| f64::from(f32_at(bytes, at + 4 * i))) };
        // In the precision of the wire, so that the sum is the one that the controller computes.
        let commanded = std::array::from_fn(|i| f64::from(f32_at(bytes, 292 + 4 * i) + f32_at(bytes, 320 + 4 * i)));
        let pose: [f64; 12] = std::array::from_fn(|i| f64::from(f32_at(bytes, 244 + 4 * i)));
        // The torques come in the order z, y, x.
        let wrench = [0, 1, 2, 5, 4, 3].map(|i| f64::from(f32_at(bytes, 500 + 4 * i)));
        let report = Self {
            sequence: u16_at(bytes, 0),
            krl: Krl(krl),
            time: f64::from(f32_at(bytes, 140)),
            state: u16_at(bytes, 144),
            quality: u16_at(bytes, 146),
            sample_time: f64::from(f32_at(bytes, 148)),
            power: u16_at(bytes, 180),
            control: u16_at(bytes, 182),
            error: u16_at(bytes, 184),
            measured: joints(216),
            commanded,
            pose: pose_of(&pose),
            wrench,
        };
        let times = [report.time, report.sample_time];
        let numbers = times.iter().chain(&report.measured).chain(&report.commanded).chain(&pose).chain(&report.wrench);
        numbers.copied().all(f64::is_finite).then_some(report)
    }
}

/// Returns the pose of the rows of its matrix, [R p].
fn pose_of(rows: &[f64; 12]) -> IsometryMatrix3<f64> {
    let [xx, xy, xz, x, yx, yy, yz, y, zx, zy, zz, z] = *rows;
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::new(xx, xy, xz, yx, yy, yz, zx, zy, zz));
    IsometryMatrix3::from_parts(Translation3::new(x, y, z), rotation)
}

/// An answer to the controller.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Answer<'a> {
    /// Number of the answer.
    pub(super) sequence: u16,
    /// Number of the datagram that it answers.
    pub(super) reflected: u16,
    pub(super) krl: &'a Krl,
    /// The joint positions that the controller shall command [rad].
    pub(super) position: &'a Joints,
    /// Stiffness and damping of the joints, where the driver sets them.
    pub(super) impedance: Impedance,
}

/// Stiffness and damping of the joints; `None` if the KRL program sets them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Impedance {
    /// Stiffness [N m/rad].
    pub(super) stiffness: Option<Joints>,
    /// Damping as a fraction of the critical one [1].
    pub(super) damping: Option<Joints>,
}

impl Impedance {
    /// Whether the driver sets neither of them.
    pub(super) const fn is_none(&self) -> bool {
        self.stiffness.is_none() && self.damping.is_none()
    }
}

const JOINT_POSITION: u32 = 0x1;
const JOINT_STIFFNESS: u32 = 0x10;
const JOINT_DAMPING: u32 = 0x20;

impl Answer<'_> {
    /// Returns the bytes of the answer. Without `is_driving`, no flag is set: the driver leaves.
    pub(super) fn encode(&self, is_driving: bool) -> [u8; CMD_BYTES] {
        let mut bytes = [0; CMD_BYTES];
        let header = [self.sequence, self.reflected, CMD_BYTES as u16, CMD_ID];
        put(&mut bytes, 0, header.into_iter().flat_map(u16::to_le_bytes));
        put(&mut bytes, HEADER_BYTES, self.krl.0);
        let Impedance { stiffness, damping } = self.impedance;
        let mut flags = JOINT_POSITION;
        for (values, flag, at) in [(stiffness, JOINT_STIFFNESS, 272), (damping, JOINT_DAMPING, 300)] {
            if let Some(values) = values {
                flags |= flag;
                put_f32s(&mut bytes, at, &values);
            }
        }
        put(&mut bytes, 140, (if is_driving { flags } else { 0 }).to_le_bytes());
        put_f32s(&mut bytes, 144, self.position);
        bytes
    }
}

fn put(bytes: &mut [u8], at: usize, value: impl IntoIterator<Item = u8>) {
    bytes[at..].iter_mut().zip(value).for_each(|(byte, value)| *byte = value);
}

fn put_f32s(bytes: &mut [u8], at: usize, values: &[f64]) {
    put(bytes, at, values.iter().flat_map(|value| (*value as f32).to_le_bytes()));
}

fn u16_at(bytes: &[u8; MSR_BYTES], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn f32_at(bytes: &[u8; MSR_BYTES], at: usize) -> f32 {
    f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Writes a table of `offset values…`, as the description of the protocol has it, into a datagram.
    pub(in super::super) fn datagram(fields: &[(usize, &[f32])], words: &[(usize, u16)]) -> Vec<u8> {
        let mut bytes = vec![0; 916];
        // The first datagram of a controller, from the description of the protocol.
        bytes[..8].copy_from_slice(&[0x01, 0x00, 0x00, 0x00, 0x94, 0x03, 0x06, 0x20]);
        for (at, values) in fields {
            for (i, value) in values.iter().enumerate() {
                bytes[at + 4 * i..at + 4 * i + 4].copy_from_slice(&value.to_le_bytes());
            }
        }
        for (at, word) in words {
            bytes[*at..at + 2].copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }

    #[test]
    fn every_field_is_read_from_its_place() {
        let pose = [0.0, -1.0, 0.0, 0.5, 1.0, 0.0, 0.0, -0.25, 0.0, 0.0, 1.0, 0.75];
        let bytes = datagram(
            &[
                (140, &[12.5]),
                (148, &[0.004]),
                (152, &[0.008]),
                (216, &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]),
                (244, &pose),
                (292, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]),
                (320, &[0.5, 0.25, 0.125, 0.0, -0.5, -0.25, -0.125]),
                // Fx, Fy, Fz, Tz, Ty, Tx.
                (500, &[1.0, 2.0, 3.0, 30.0, 20.0, 10.0]),
            ],
            &[(0, 0x1234), (144, 2), (146, 3), (180, 0x7f), (182, 1), (184, 5)],
        );
        let report = Report::decode(&bytes).unwrap();
        let is = (report.sequence, report.state, report.quality, report.power, report.control, report.error);
        assert_eq!(is, (0x1234, 2, 3, 0x7f, 1, 5));
        assert_eq!((report.time, report.sample_time), (12.5, f64::from(0.004_f32)));
        assert_eq!(report.measured, [0.1_f32, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7].map(f64::from));
        assert_eq!(report.commanded, [1.5, 2.25, 3.125, 4.0, 4.5, 5.75, 6.875]);
        assert_eq!(report.pose.translation.vector, nalgebra::Vector3::new(0.5, -0.25, 0.75));
        // A quarter turn about z.
        assert_eq!(report.pose * nalgebra::Point3::new(1.0, 0.0, 0.0), nalgebra::Point3::new(0.5, 0.75, 0.75));
        assert_eq!(report.wrench, [1.0, 2.0, 3.0, 10.0, 20.0, 30.0]);
    }

    #[test]
    fn a_datagram_of_another_sort_is_none() {
        let good = datagram(&[], &[]);
        assert!(Report::decode(&good).is_some());
        for length in [0, 7, 8, 376, 915] {
            assert_eq!(Report::decode(&good[..length]), None, "{length} bytes");
        }
        assert_eq!(Report::decode(&[&good[..], &[0]].concat()), None);
        for (at, word) in [(4, 915), (6, 0x1005), (6, 0x2005)] {
            assert_eq!(Report::decode(&datagram(&[], &[(at, word)])), None, "{word} at {at}");
        }
        for at in [140, 148, 216 + 24, 244 + 44, 292, 320 + 24, 500 + 20] {
            assert_eq!(Report::decode(&datagram(&[(at, &[f32::NAN])], &[])), None, "no number at {at}");
            assert_eq!(Report::decode(&datagram(&[(at, &[f32::INFINITY])], &[])), None, "infinite at {at}");
        }
    }

    /// Reads values of a CMD from the table of the protocol.
    fn f32s<const N: usize>(bytes: &[u8], at: usize) -> [f32; N] {
        std::array::from_fn(|i| f32::from_le_bytes(bytes[at + 4 * i..at + 4 * i + 4].try_into().unwrap()))
    }

    #[test]
    fn every_field_of_an_answer_is_in_its_place() {
        let mut bytes = datagram(&[(8, &[1.5]), (8 + 60, &[2.5])], &[(136, 0x8001)]);
        bytes[72..76].copy_from_slice(&(-7_i32).to_le_bytes());
        let report = Report::decode(&bytes).unwrap();
        let position = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7];
        let mut krl = report.krl;
        krl.set_int(1, 20);
        let impedance = Impedance { stiffness: Some([200.0; 7]), damping: Some([0.25; 7]) };
        let answer = Answer { sequence: 1, reflected: 1, krl: &krl, position: &position, impedance };
        let bytes = answer.encode(true);
        // The first answer to a controller, from the description of the protocol.
        assert_eq!(bytes[..8], [0x01, 0x00, 0x01, 0x00, 0x78, 0x01, 0x05, 0x10]);
        assert_eq!((bytes.len(), f32s(&bytes, 8), f32s(&bytes, 8 + 60)), (376, [1.5], [2.5]));
        assert_eq!(bytes[72..80], [-7_i32, 20].map(i32::to_le_bytes).concat());
        assert_eq!(bytes[136..138], [0x01, 0x80]);
        assert_eq!(bytes[140..144], [0x31, 0, 0, 0]);
        assert_eq!(f32s::<7>(&bytes, 144), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]);
        assert_eq!((f32s::<7>(&bytes, 272), f32s::<7>(&bytes, 300)), ([200.0; 7], [0.25; 7]));
        let is_filled = |at: &usize| (172..272).contains(at) || (328..376).contains(at);
        assert!(bytes.iter().enumerate().filter(|(at, _)| is_filled(at)).all(|(_, byte)| *byte == 0));
        for (stiffness, damping, flags) in
            [(None, None, 0x1), (Some([1.0; 7]), None, 0x11), (None, Some([1.0; 7]), 0x21)]
        {
            let impedance = Impedance { stiffness, damping };
            let answer = Answer { impedance, ..answer.clone() };
            assert_eq!(answer.encode(true)[140..144], [flags, 0, 0, 0]);
            assert_eq!(answer.encode(false)[140..144], [0; 4]);
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..1000)) {
            Report::decode(&bytes);
        }

        #[test]
        fn what_is_read_is_finite(rest in prop::collection::vec(any::<u8>(), 908)) {
            let bytes = [&datagram(&[], &[])[..8], &rest].concat();
            if let Some(report) = Report::decode(&bytes) {
                prop_assert!(report.commanded.iter().chain(&report.measured).all(|q| q.is_finite()));
            }
        }

        #[test]
        fn a_posture_that_is_mirrored_comes_back_with_the_same_bits(
            commanded in prop::array::uniform7(-3.0..3.0_f32),
            offset in prop::array::uniform7(-1.0..1.0_f32),
        ) {
            let report = Report::decode(&datagram(&[(292, &commanded), (320, &offset)], &[])).unwrap();
            let (krl, impedance) = (&report.krl, Impedance::default());
            let answer = Answer { sequence: 1, reflected: 1, krl, position: &report.commanded, impedance };
            let sum: [f32; 7] = std::array::from_fn(|i| commanded[i] + offset[i]);
            prop_assert_eq!(f32s::<7>(&answer.encode(true), 144).map(f32::to_bits), sum.map(f32::to_bits));
        }
    }
}
