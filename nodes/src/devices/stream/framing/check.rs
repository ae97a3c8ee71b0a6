//! Checksums of frames: by XOR, by sum, or by a CRC of the catalogue.

use crc::{Algorithm, Crc, Table};
use tactflow_runtime::node::Param;

/// Order of the bytes of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) enum ByteOrder {
    /// The low byte first.
    Le,
    /// The high byte first.
    Be,
}

/// How a checksum is computed.
#[derive(Clone)]
pub(crate) enum Sum {
    Xor8,
    Sum8,
    Sum16,
    Crc8(Box<Crc<u8, Table<1>>>),
    Crc16(Box<Crc<u16, Table<1>>>),
    Crc32(Box<Crc<u32, Table<1>>>),
}

/// A checksum at the end of a frame.
#[derive(Clone)]
pub(crate) struct Check {
    pub(crate) sum: Sum,
    pub(crate) order: ByteOrder,
    /// The first byte that it covers. It covers all bytes up to itself.
    pub(crate) from: usize,
    /// Number of bytes of the frame behind it.
    pub(crate) after: usize,
}

macro_rules! catalogue {
    ($($width:ident: $($name:ident)*;)*) => {
        /// The CRCs of the catalogue whose width is whole bytes, by the name of their constant.
        const CRCS: &[(&str, Parameters)] = &[$($((stringify!($name), Parameters::$width(&crc::$name))),*),*];
    };
}

/// The parameters of a CRC.
enum Parameters {
    Crc8(&'static Algorithm<u8>),
    Crc16(&'static Algorithm<u16>),
    Crc32(&'static Algorithm<u32>),
}

catalogue! {
    Crc8: CRC_8_AUTOSAR CRC_8_BLUETOOTH CRC_8_CDMA2000 CRC_8_DARC CRC_8_DVB_S2 CRC_8_GSM_A CRC_8_GSM_B CRC_8_HITAG
        CRC_8_I_432_1 CRC_8_I_CODE CRC_8_LTE CRC_8_MAXIM_DOW CRC_8_MIFARE_MAD CRC_8_NRSC_5 CRC_8_OPENSAFETY CRC_8_ROHC
        CRC_8_SAE_J1850 CRC_8_SMBUS CRC_8_TECH_3250 CRC_8_WCDMA;
    Crc16: CRC_16_ARC CRC_16_CDMA2000 CRC_16_CMS CRC_16_DDS_110 CRC_16_DECT_R CRC_16_DECT_X CRC_16_DNP CRC_16_EN_13757
        CRC_16_GENIBUS CRC_16_GSM CRC_16_IBM_3740 CRC_16_IBM_SDLC CRC_16_ISO_IEC_14443_3_A CRC_16_KERMIT CRC_16_LJ1200
        CRC_16_M17 CRC_16_MAXIM_DOW CRC_16_MCRF4XX CRC_16_MODBUS CRC_16_NRSC_5 CRC_16_OPENSAFETY_A CRC_16_OPENSAFETY_B
        CRC_16_PROFIBUS CRC_16_RIELLO CRC_16_SPI_FUJITSU CRC_16_T10_DIF CRC_16_TELEDISK CRC_16_TMS37157 CRC_16_UMTS
        CRC_16_USB CRC_16_XMODEM;
    Crc32: CRC_32_AIXM CRC_32_AUTOSAR CRC_32_BASE91_D CRC_32_BZIP2 CRC_32_CD_ROM_EDC CRC_32_CKSUM CRC_32_ISCSI
        CRC_32_ISO_HDLC CRC_32_JAMCRC CRC_32_MPEG_2 CRC_32_XFER;
}

/// The checksums that are no CRC.
const SIMPLE: [&str; 5] = ["none", "xor8", "sum8", "sum16le", "sum16be"];

/// Other names of CRCs that data sheets use, each with that of the catalogue.
const ALIASES: [(&str, &str); 7] = [
    ("crc-8", "crc-8/smbus"),
    ("crc-16", "crc-16/arc"),
    ("crc-16/x-25", "crc-16/ibm-sdlc"),
    ("crc-16/ccitt-false", "crc-16/ibm-3740"),
    ("crc-32", "crc-32/iso-hdlc"),
    ("crc-32c", "crc-32/iscsi"),
    ("modbus", "crc-16/modbus"),
];

/// Returns the name of a CRC as the catalogue writes it: `crc-16/modbus` for `CRC_16_MODBUS`.
fn written(constant: &str) -> String {
    let lower = constant.to_lowercase();
    let mut words = lower.splitn(3, '_');
    let [crc, width, name] = [(); 3].map(|()| words.next().unwrap_or_default());
    format!("{crc}-{width}/{}", name.replace('_', "-"))
}

/// Returns the names of all checksums.
pub(crate) fn names() -> Vec<String> {
    let crcs = CRCS.iter().map(|(name, _)| written(name));
    SIMPLE.iter().map(|name| (*name).to_owned()).chain(crcs).collect()
}

/// Returns the number of bytes of a checksum; 0 if there is none of that name.
#[cfg(feature = "cli")]
pub(crate) fn size_of(name: &str) -> usize {
    Sum::of(name).flatten().map_or(0, |(sum, _)| sum.size())
}

/// Whether a frame has the checksum of that name over all its bytes, with `after` bytes behind it.
#[cfg(feature = "cli")]
pub(crate) fn has_checksum(name: &str, frame: &[u8], after: usize) -> bool {
    Sum::of(name).flatten().is_some_and(|(sum, order)| Check { sum, order, from: 0, after }.holds(frame))
}

impl Sum {
    /// Returns the checksum of that name and its order of bytes, `Some(None)` for `none`, or `None` if there is none.
    pub(crate) fn of(name: &str) -> Option<Option<(Self, ByteOrder)>> {
        let simple = match name {
            "none" => return Some(None),
            "xor8" => Some((Self::Xor8, ByteOrder::Le)),
            "sum8" => Some((Self::Sum8, ByteOrder::Le)),
            "sum16le" => Some((Self::Sum16, ByteOrder::Le)),
            "sum16be" => Some((Self::Sum16, ByteOrder::Be)),
            _ => None,
        };
        simple.or_else(|| Self::crc(name)).map(Some)
    }

    /// Returns a CRC. One that takes the low bit first is sent with the low byte first.
    fn crc(name: &str) -> Option<(Self, ByteOrder)> {
        let lower = name.to_lowercase();
        let name = ALIASES.iter().find(|(alias, _)| *alias == lower).map_or(name, |(_, name)| name);
        let constant = name.to_uppercase().replace(['-', '/', ' '], "_");
        let (_, parameters) = CRCS.iter().find(|(known, _)| *known == constant)?;
        let order = |is_reflected: bool| if is_reflected { ByteOrder::Le } else { ByteOrder::Be };
        Some(match parameters {
            Parameters::Crc8(crc) => (Self::Crc8(Box::new(Crc::<u8, Table<1>>::new(crc))), ByteOrder::Le),
            Parameters::Crc16(crc) => (Self::Crc16(Box::new(Crc::<u16, Table<1>>::new(crc))), order(crc.refout)),
            Parameters::Crc32(crc) => (Self::Crc32(Box::new(Crc::<u32, Table<1>>::new(crc))), order(crc.refout)),
        })
    }

    /// Returns the number of bytes of the checksum.
    pub(crate) const fn size(&self) -> usize {
        match self {
            Self::Xor8 | Self::Sum8 | Self::Crc8(_) => 1,
            Self::Sum16 | Self::Crc16(_) => 2,
            Self::Crc32(_) => 4,
        }
    }

    /// Returns the checksum of some bytes.
    pub(crate) fn of_bytes(&self, bytes: &[u8]) -> u32 {
        match self {
            Self::Xor8 => u32::from(bytes.iter().fold(0, |xor, byte| xor ^ byte)),
            Self::Sum8 => u32::from(bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte))),
            Self::Sum16 => u32::from(bytes.iter().fold(0_u16, |sum, byte| sum.wrapping_add(u16::from(*byte)))),
            Self::Crc8(crc) => u32::from(crc.checksum(bytes)),
            Self::Crc16(crc) => u32::from(crc.checksum(bytes)),
            Self::Crc32(crc) => crc.checksum(bytes),
        }
    }
}

impl Check {
    /// Whether a single frame with this checksum is believed: bytes that are no frame have it by chance once in 65,536
    /// times, or more rarely.
    pub(crate) const fn is_proof(&self) -> bool {
        matches!(self.sum, Sum::Crc16(_) | Sum::Crc32(_))
    }

    /// Whether a frame has the right checksum.
    pub(crate) fn holds(&self, frame: &[u8]) -> bool {
        let Some(end) = frame.len().checked_sub(self.after + self.sum.size()) else { return false };
        let Some(covered) = frame.get(self.from..end) else { return false };
        let read = |bytes: &mut dyn Iterator<Item = &u8>| bytes.fold(0_u32, |sum, byte| sum << 8 | u32::from(*byte));
        let stored = &frame[end..end + self.sum.size()];
        let stored = match self.order {
            ByteOrder::Le => read(&mut stored.iter().rev()),
            ByteOrder::Be => read(&mut stored.iter()),
        };
        stored == self.sum.of_bytes(covered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of the catalogue is the CRC of these bytes.
    const DIGITS: &[u8] = b"123456789";

    fn check(name: &str, from: usize, after: usize) -> Check {
        let (sum, order) = Sum::of(name).flatten().unwrap_or_else(|| panic!("{name}"));
        Check { sum, order, from, after }
    }

    #[test]
    fn every_name_is_found_and_every_crc_has_its_check_value() {
        for name in names() {
            assert!(Sum::of(&name).is_some(), "{name}");
        }
        let published = [
            ("crc-8/smbus", 0xF4),
            ("crc-16/modbus", 0x4B37),
            ("CRC-16/XMODEM", 0x31C3),
            ("crc-32/iso-hdlc", 0xCBF4_3926),
            ("CRC-32", 0xCBF4_3926),
            ("crc-16/x-25", 0x906E),
            ("crc-16/ccitt-false", 0x29B1),
            ("crc-32c", 0xE306_9283),
        ];
        for (name, expected) in published {
            assert_eq!(check(name, 0, 0).sum.of_bytes(DIGITS), expected, "{name}");
        }
        assert!(Sum::of("crc-17").is_none() && Sum::of("none").is_some_and(|none| none.is_none()));
    }

    #[test]
    fn the_host_frames_of_agni_have_their_xor() {
        // Literal bytes of the protocol: stop, config, start, and the period of sensor 1.
        let frames: [&[u8]; 4] = [
            &[0xF0, 0xC4, 0x00, 0x00, 0x34],
            &[0xF0, 0xC4, 0x00, 0xC0, 0xF4],
            &[0xF0, 0xC4, 0x00, 0xF1, 0xC5],
            &[0xF0, 0xC4, 0x01, 0xD0, 0x02, 0x00, 0x0A, 0x00, 0xED],
        ];
        for frame in frames {
            assert!(check("xor8", 0, 0).holds(frame), "{frame:02X?}");
            assert!(!check("xor8", 1, 0).holds(frame), "{frame:02X?}");
        }
    }

    #[test]
    fn a_checksum_covers_from_a_byte_and_stands_before_the_trailer() {
        // 01+02+03 = 6.
        assert!(check("sum16le", 1, 2).holds(&[0xFF, 1, 2, 3, 6, 0, 0x0D, 0x0A]));
        assert!(check("sum16be", 1, 2).holds(&[0xFF, 1, 2, 3, 0, 6, 0x0D, 0x0A]));
        assert!(!check("sum16le", 0, 2).holds(&[0xFF, 1, 2, 3, 6, 0, 0x0D, 0x0A]));
        assert!(check("sum8", 0, 0).holds(&[200, 100, 44]));
        assert!(!check("sum16le", 0, 0).holds(&[1]), "too short");
        assert!(check("crc-16/modbus", 0, 0).holds(b"123456789\x37\x4B"), "the low byte first");
        assert!(check("crc-16/xmodem", 0, 0).holds(b"123456789\x31\xC3"), "the high byte first");
    }
}
