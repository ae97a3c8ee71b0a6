//! Messages to the program on the robot: 8 integers of 32 bits, big-endian.
//!
//! The first is the time after which the program stops without another message [ms]. Six are velocities of the joints
//! [µrad/s]. The last is the mode.

use super::recipe::JOINTS;

/// Bytes of a message.
pub(super) const SIZE: usize = 32;
/// The joints follow the velocities.
const FOLLOW: i32 = 2;
/// The program ends.
const END: i32 = -2;
/// Units of the wire in one rad/s.
const SCALE: f64 = 1e6;

/// Returns the message that moves the joints with velocities [rad/s], in the order of the controller. Without another
/// message, the robot stops after `timeout_ms`.
pub(super) fn velocity(timeout_ms: i32, velocity: &[f64; JOINTS]) -> [u8; SIZE] {
    // A conversion of a number that is too large saturates.
    message(timeout_ms, velocity.map(|v| (v * SCALE).round() as i32), FOLLOW)
}

/// Returns the message that ends the program on the robot.
pub(super) fn end(timeout_ms: i32) -> [u8; SIZE] {
    message(timeout_ms, [0; JOINTS], END)
}

fn message(timeout_ms: i32, [a, b, c, d, e, f]: [i32; JOINTS], mode: i32) -> [u8; SIZE] {
    let mut bytes = [0; SIZE];
    for (field, value) in bytes.as_chunks_mut::<4>().0.iter_mut().zip([timeout_ms, a, b, c, d, e, f, mode]) {
        *field = value.to_be_bytes();
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The literal vector of the protocol.
    #[test]
    fn a_message_has_the_bytes_of_the_protocol() {
        let bytes: String =
            velocity(20, &[0.1, 0.0, 0.0, 0.0, 0.0, -0.1]).iter().map(|byte| format!("{byte:02X}")).collect();
        assert_eq!(bytes, format!("00000014000186A0{}FFFE796000000002", "00000000".repeat(4)));
        assert_eq!(end(20)[28..], [0xFF, 0xFF, 0xFF, 0xFE]);
        assert_eq!(end(20)[..28], [&[0, 0, 0, 20][..], &[0; 24]].concat());
        assert_eq!(velocity(20, &[1e9; 6])[4..8], [0x7F, 0xFF, 0xFF, 0xFF], "it saturates");
    }
}
