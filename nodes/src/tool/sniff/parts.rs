//! Finds the number of a packet, if several packets make one image.

/// Maximum number of packets of an image. A counter of frames goes on for longer.
const MAX_PACKETS: usize = 64;
/// Number of bytes behind the mark in which the number is looked for.
const MAX_OFFSET: usize = 8;
/// How often the numbers begin anew, at least.
const MIN_CYCLES: usize = 2;

/// A byte that counts packets and begins anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Numbering {
    /// Its place in the packet.
    pub(super) offset: usize,
    /// Number of the first packet of an image.
    pub(super) first: u8,
    /// Number of packets of an image.
    pub(super) count: usize,
}

impl Numbering {
    /// Returns the key `parts` of a description whose packets have that many values.
    pub(super) fn key(&self, values: usize) -> String {
        let Self { offset, first, .. } = self;
        format!("{{ index = {{ offset = {offset}, cell = \"u8\" }}, first = {first}, values = {values} }}")
    }
}

/// Finds the number of packets that came one after the other, behind their `header` and before their `end`.
pub(super) fn numbering(packets: &[&[u8]], header: usize, end: usize) -> Option<Numbering> {
    (header..end.min(header + MAX_OFFSET)).find_map(|offset| {
        let numbers = || packets.iter().map(|packet| packet[offset]);
        let (first, last) = (numbers().min()?, numbers().max()?);
        let count = usize::from(last - first) + 1;
        let follows = |before: u8, after: u8| after == if before == last { first } else { before + 1 };
        let counts = numbers().zip(numbers().skip(1)).all(|(before, after)| follows(before, after));
        let cycles = numbers().filter(|number| *number == last).count();
        let is_one = counts && (2..=MAX_PACKETS).contains(&count) && cycles >= MIN_CYCLES;
        is_one.then_some(Numbering { offset, first, count })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(numbers: impl IntoIterator<Item = u8>) -> Option<Numbering> {
        let packets: Vec<Vec<u8>> = numbers.into_iter().map(|number| vec![0xAA, 7, number, 50, 60]).collect();
        numbering(&packets.iter().map(Vec::as_slice).collect::<Vec<_>>(), 1, 5)
    }

    #[test]
    fn a_byte_that_begins_anew_numbers_the_parts() {
        let expected = Numbering { offset: 2, first: 1, count: 8 };
        assert_eq!(found((0..30).map(|i| 1 + i % 8)), Some(expected.clone()));
        assert_eq!(expected.key(128), "{ index = { offset = 2, cell = \"u8\" }, first = 1, values = 128 }");
    }

    #[test]
    fn a_counter_of_frames_and_other_bytes_are_no_parts() {
        assert_eq!(found(0..=255), None, "it never begins anew");
        assert_eq!(found((0..=255).cycle().take(1000)), None, "it counts frames");
        assert_eq!(found([7; 30]), None, "it is constant");
        assert_eq!(found((0..30).map(|i| if i == 20 { 3 } else { i % 8 })), None, "it jumps");
        assert_eq!(found((0..10).map(|i| i % 8)), None, "it has begun anew once");
    }
}
