//! Tests of the messages: literal bytes of the protocol, and any bytes at all.

use proptest::prelude::*;

use super::*;

fn hex(text: &str) -> Vec<u8> {
    let text: String = text.split_whitespace().collect();
    (0..text.len() / 2).map(|i| u8::from_str_radix(&text[2 * i..2 * i + 2], 16).unwrap()).collect()
}

/// Closes a message with its checksum, computed here once more.
fn sealed(body: &[u8]) -> Vec<u8> {
    let mut message = body.to_vec();
    message.push(message.iter().copied().reduce(|a, b| a ^ b).unwrap());
    message
}

/// A device with a sensor of two bytes and one of four.
fn messages() -> Messages {
    let mut messages = Messages::default();
    let sensors = vec![SensorType { uid: 1, bytes: 2 }, SensorType { uid: 2, bytes: 4 }];
    messages.configure(&Config { version: 1, sensors });
    messages
}

fn frame(sensor: u8, stamp: u32, payload: &[u8]) -> Vec<u8> {
    sealed(&[&[0xF0, 0xC4, sensor], &stamp.to_le_bytes()[..], payload].concat())
}

/// Returns what each message is, as text.
fn read(messages: &mut Messages, bytes: &[u8]) -> Vec<String> {
    messages.push(bytes);
    let mut found = Vec::new();
    while let Some(message) = messages.next() {
        found.push(match message {
            Message::Frame(frame) => format!("{} {} {:?}", frame.sensor, frame.stamp, frame.payload),
            other => format!("{other:?}"),
        });
    }
    found
}

#[test]
fn what_the_host_sends_is_what_the_protocol_states() {
    for (bytes, literal) in [
        (&STOP[..], "F0C4000034"),
        (&ASK_CONFIG[..], "F0C400C0F4"),
        (&ASK_TOPOLOGY[..], "F0C400C1F5"),
        (&ASK_SERIAL[..], "F0C400C2F6"),
        (&START[..], "F0C400F1C5"),
        (&set_period(1, 10)[..], "F0C401D002000A00ED"),
    ] {
        assert_eq!(bytes, hex(literal));
    }
}

#[test]
fn the_literal_configuration_is_one_sensor_of_512_bytes() {
    let mut messages = Messages::default();
    messages.push(&hex("F0C4000102013412000212"));
    let sensors = vec![SensorType { uid: 0x1234, bytes: 512 }];
    assert_eq!(messages.next(), Some(Message::Config(Config { version: 1, sensors })));
    assert_eq!(messages.next(), None);
}

#[test]
fn each_kind_of_message_is_read() {
    let text = sealed(&[&hex("F0C4FE03")[..], b"hot"].concat());
    let serial = sealed(&[&hex("F0C4F204")[..], b"B007"].concat());
    for (bytes, expected) in [
        (serial, "Serial(\"B007\")"),
        (text, "Fault(Text(\"hot\"))"),
        (sealed(&hex("F0C4FE00")), "Fault(Unknown)"),
        (sealed(&hex("F0C4FEF0")), "Fault(Checksum)"),
        (sealed(&hex("F0C4FEF1")), "Fault(Command)"),
        (hex("F0C4FEF1"), "Fault(Command)"),
        (sealed(&hex("F0C4FEF2")), "Fault(Sensor)"),
        (sealed(&hex("F0C4F0")), "Other"),
        // Two cells, of two ids and of none.
        (sealed(&hex("F0C4F1 12 02 07 08 00")), "Other"),
    ] {
        let mut messages = messages();
        assert_eq!(read(&mut messages, &bytes), [expected]);
        assert_eq!(messages.counts, Counts::default());
    }
}

#[test]
fn an_error_without_its_checksum_does_not_eat_the_next_message() {
    let mut messages = messages();
    let bytes = [hex("F0C4FEF1"), frame(1, 7, &[1, 2])].concat();
    assert_eq!(read(&mut messages, &bytes), ["Fault(Command)", "1 7 [1, 2]"]);
}

#[test]
fn garbage_before_the_first_frame_costs_this_frame() {
    let mut messages = messages();
    let bytes = [b"press h for help\r\n".to_vec(), frame(1, 1, &[1, 1]), frame(2, 2, &[2; 4])].concat();
    assert_eq!(read(&mut messages, &bytes), ["2 2 [2, 2, 2, 2]"]);
    assert_eq!(messages.counts, Counts { rejected: 0, resyncs: 0, skipped: 18 });
}

#[test]
fn a_wrong_checksum_a_lost_byte_and_an_unknown_sensor_yield_no_frame() {
    let good = frame(1, 5, &[1, 2]);
    let damaged: Vec<Vec<u8>> = (2..good.len())
        .flat_map(|i| {
            let (mut flipped, mut cut) = (good.clone(), good.clone());
            flipped[i] ^= 0x40;
            cut.remove(i);
            [flipped, cut]
        })
        .chain([frame(3, 5, &[1, 2])])
        .collect();
    for bad in damaged {
        let mut messages = messages();
        let bytes = [good.clone(), good.clone(), bad.clone(), good.clone(), frame(1, 6, &[3, 4])].concat();
        let found = read(&mut messages, &bytes);
        assert!(found.iter().all(|found| ["1 5 [1, 2]", "1 6 [3, 4]"].contains(&&**found)), "{bad:?}: {found:?}");
        assert!(messages.counts.skipped > 0 && messages.counts.resyncs > 0, "{bad:?}");
        assert_eq!(found.last().unwrap(), "1 6 [3, 4]", "{bad:?}");
    }
}

#[test]
fn a_beginning_inside_the_data_is_data() {
    let mut messages = messages();
    let payload = [0xF0, 0xC4, 0x01, 0x00];
    let bytes = [frame(1, 0, &[0, 0]), frame(2, 1, &payload), frame(2, 2, &payload)].concat();
    assert_eq!(read(&mut messages, &bytes), ["2 1 [240, 196, 1, 0]", "2 2 [240, 196, 1, 0]"]);
}

proptest! {
    #[test]
    fn any_bytes_in_any_pieces_are_read_without_a_panic(bytes: Vec<u8>, piece in 1usize..40) {
        let mut messages = messages();
        for piece in bytes.chunks(piece) {
            read(&mut messages, piece);
        }
        prop_assert!(messages.bytes.len() <= bytes.len());
    }

    /// Bytes that look like the protocol reach further.
    #[test]
    fn any_bytes_after_a_header_are_read_without_a_panic(bodies: Vec<(u8, Vec<u8>)>) {
        let mut messages = messages();
        for (id, body) in bodies {
            read(&mut messages, &sealed(&[&[0xF0, 0xC4, id], &body[..]].concat()));
        }
    }

    #[test]
    fn frames_split_anywhere_behind_any_garbage_come_out_whole(
        garbage in proptest::collection::vec(0u8..0xF0, 0..60),
        cells in proptest::collection::vec(any::<[u8; 4]>(), 2..8),
        piece in 1usize..20,
    ) {
        let frames: Vec<Vec<u8>> = cells.iter().enumerate().map(|(i, cells)| frame(2, i as u32, cells)).collect();
        let bytes = [garbage.clone(), frames.concat()].concat();
        let mut messages = messages();
        let found: Vec<String> = bytes.chunks(piece).flat_map(|piece| read(&mut messages, piece)).collect();
        let expected = cells.iter().enumerate().map(|(i, cells)| format!("2 {i} {cells:?}"));
        prop_assert_eq!(found, expected.skip(1).collect::<Vec<_>>());
        prop_assert_eq!(messages.counts.skipped, garbage.len() as u64);
    }
}
