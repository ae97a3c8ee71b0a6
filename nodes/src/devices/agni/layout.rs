//! Layouts: where the readings of the tactels are in the payload of a frame.
//!
//! A reading has 12 bits and falls with the force: the value of a tactel is 1 - reading / 4095.

use tactflow_runtime::node::{Mistake, Param};

/// Largest reading.
const MAX_READING: f32 = 4095.0;
/// The bits of a reading; the others are the channel of the converter.
const READING: u16 = 0x0FFF;
/// The bit of the high byte where the channel begins.
const CHANNEL_BIT: u8 = 4;
/// Largest number of tactels of a sensor: a payload has at most 65,535 bytes.
const MAX_TACTELS: usize = 32_767;
/// Largest number of tactels whose readings come with an id of one byte.
const MAX_IDS: usize = 256;

/// The word of the first tactel of each row and column in a block of four by four tactels of a Myrmex v2.
const MYRMEX_BLOCK: [[usize; 4]; 4] = [[208, 224, 32, 0], [192, 48, 16, 64], [176, 144, 112, 80], [160, 240, 128, 96]];
const MYRMEX_SIDE: usize = 16;
/// Rows and columns into which the 64 tactels of a glove are sorted by their ids.
const GLOVE_SIDE: usize = 8;

/// The form of a payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(super) enum Form {
    /// A word of 16 bits for each tactel, little-endian: 12 bits of reading, and above them 4 bits that are the same in
    /// each frame, such as the channel of the converter.
    Words,
    /// The id of a tactel, one byte, and its word, for each tactel in any order.
    Pairs,
}

/// A layout of the bench.
#[derive(Debug, Clone, Param)]
pub(super) struct LayoutParams {
    /// Form of the payload.
    #[param(default = Form::Words)]
    form: Form,
    /// Number of rows.
    #[param(range = 1..=32_767)]
    rows: usize,
    /// Number of columns.
    #[param(range = 1..=32_767)]
    cols: usize,
    /// For each tactel, row by row, the number of its word or its id, from 0; in their order if not given.
    order: Option<Vec<usize>>,
}

/// A layout that is checked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Layout {
    form: Form,
    pub(super) rows: usize,
    pub(super) cols: usize,
    /// For each word or id, its tactel.
    tactels: Vec<usize>,
}

/// The names of the built-in layouts.
pub(super) const BUILTIN: [&str; 2] = ["myrmex_v2", "glove"];

impl Layout {
    /// Returns the built-in layout with a name.
    pub(super) fn builtin(name: &str) -> Option<Self> {
        match name {
            "myrmex_v2" => {
                let word = |(r, c): (usize, usize)| MYRMEX_BLOCK[r % 4][c % 4] + 4 * (r / 4) + c / 4;
                let order = (0..MYRMEX_SIDE * MYRMEX_SIDE).map(|i| word((i / MYRMEX_SIDE, i % MYRMEX_SIDE)));
                let tactels = inverse(&order.collect::<Vec<_>>());
                Some(Self { form: Form::Words, rows: MYRMEX_SIDE, cols: MYRMEX_SIDE, tactels })
            }
            "glove" => {
                let tactels = (0..GLOVE_SIDE * GLOVE_SIDE).collect();
                Some(Self { form: Form::Pairs, rows: GLOVE_SIDE, cols: GLOVE_SIDE, tactels })
            }
            _ => None,
        }
    }

    /// Returns a layout of the bench. `path` is that of its parameters.
    ///
    /// # Errors
    /// If it has too many tactels, or its order is not a bijection.
    pub(super) fn of(params: &LayoutParams, path: &str) -> Result<Self, Mistake> {
        let LayoutParams { form, rows, cols, order } = params;
        let count = rows * cols;
        let most = if *form == Form::Pairs { MAX_IDS } else { MAX_TACTELS };
        if count > most {
            let message = format!("{rows} by {cols} tactels are more than the {most} that a frame can have");
            return Err(Mistake::param(format!("{path}.rows"), message));
        }
        let tactels = match order {
            None => (0..count).collect(),
            Some(order) => {
                check_order(order, count).map_err(|message| Mistake::param(format!("{path}.order"), message))?;
                inverse(order)
            }
        };
        Ok(Self { form: *form, rows: *rows, cols: *cols, tactels })
    }

    /// Returns the number of bytes of a payload.
    pub(super) fn bytes(&self) -> usize {
        self.tactels.len() * if self.form == Form::Pairs { 3 } else { 2 }
    }

    /// Reads a payload into `cells`. Returns whether it is one: it has the right length, each word has its channel, and in
    /// pairs each tactel stands once.
    pub(super) fn read(&self, payload: &[u8], channels: &mut Channels, cells: &mut [f32]) -> bool {
        if payload.len() != self.bytes() || cells.len() != self.tactels.len() {
            return false;
        }
        if self.form == Form::Words && !channels.are_those_of(payload) {
            return false;
        }
        let value = |low, high| 1.0 - f32::from(u16::from_le_bytes([low, high]) & READING) / MAX_READING;
        match self.form {
            Form::Words => {
                let (words, _) = payload.as_chunks::<2>();
                words.iter().zip(&self.tactels).for_each(|([low, high], at)| cells[*at] = value(*low, *high));
                true
            }
            Form::Pairs => {
                let (pairs, _) = payload.as_chunks::<3>();
                let mut seen = [false; MAX_IDS];
                pairs.iter().all(|[id, low, high]| {
                    let id = usize::from(*id);
                    let Some(at) = self.tactels.get(id).filter(|_| !seen[id]) else { return false };
                    seen[id] = true;
                    cells[*at] = value(*low, *high);
                    true
                })
            }
        }
    }
}

/// The channels of the words of a sensor, as its frames have shown them.
///
/// A word has the same channel in every frame. Where a byte is missing, the words are mixed up, and a checksum of 8 bits
/// does not see that in one frame of 256. Two frames in a row with the same other channels are believed.
#[derive(Debug, Default)]
pub(super) struct Channels {
    known: Vec<u8>,
    /// Those of the last frame that had others.
    others: Vec<u8>,
}

impl Channels {
    fn are_those_of(&mut self, payload: &[u8]) -> bool {
        let (words, _) = payload.as_chunks::<2>();
        let found = words.iter().map(|[_, high]| high >> CHANNEL_BIT);
        if self.known.is_empty() || self.others.iter().copied().eq(found.clone()) {
            self.known.clear();
            self.known.extend(found.clone());
        }
        self.others.clear();
        let are_known = self.known.iter().copied().eq(found.clone());
        if !are_known {
            self.others.extend(found);
        }
        are_known
    }
}

/// Checks that an order has each number below `count` once.
fn check_order(order: &[usize], count: usize) -> Result<(), String> {
    if order.len() != count {
        return Err(format!("the order has {} entries, but the sensor has {count} tactels", order.len()));
    }
    let mut seen = vec![false; count];
    for number in order {
        match seen.get_mut(*number) {
            Some(seen) if !*seen => *seen = true,
            Some(_) => {
                let missing = (0..count).find(|i| !order.contains(i)).unwrap_or_default();
                return Err(format!("the order has {number} twice, and {missing} is missing"));
            }
            None => return Err(format!("the order has {number}, but the numbers go from 0 to {}", count - 1)),
        }
    }
    Ok(())
}

/// Returns the inverse of a bijection.
fn inverse(order: &[usize]) -> Vec<usize> {
    let mut inverse = vec![0; order.len()];
    for (i, number) in order.iter().enumerate() {
        inverse[*number] = i;
    }
    inverse
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn layout(form: Form, order: Option<Vec<usize>>) -> Result<Layout, Mistake> {
        Layout::of(&LayoutParams { form, rows: 1, cols: 3, order }, "layouts.own")
    }

    #[test]
    fn the_words_of_a_myrmex_are_where_the_table_says() {
        let layout = Layout::builtin("myrmex_v2").unwrap();
        assert_eq!(layout.bytes(), 512);
        // By hand from the closed form: (row, column, word).
        for (row, col, word) in [(0, 0, 208), (0, 3, 0), (1, 1, 48), (5, 2, 20), (15, 15, 111), (3, 12, 163)] {
            let mut payload = vec![0xFF; 512];
            payload[2 * word..2 * word + 2].copy_from_slice(&[0x00, 0xA0]);
            let mut cells = vec![-1.0; 256];
            assert!(layout.read(&payload, &mut Channels::default(), &mut cells));
            let pressed: Vec<usize> = (0..256).filter(|i| cells[*i] == 1.0).collect();
            assert_eq!(pressed, [16 * row + col], "word {word}");
            assert!(cells.iter().all(|cell| [0.0, 1.0].contains(cell)), "the channel is not part of the reading");
        }
    }

    #[test]
    fn readings_fall_with_the_force() {
        let layout = layout(Form::Words, None).unwrap();
        let mut cells = [0.0; 3];
        assert!(layout.read(&[0xFF, 0x0F, 0x00, 0x00, 0x00, 0x04], &mut Channels::default(), &mut cells));
        assert_eq!(cells, [0.0, 1.0, 1.0 - 1024.0 / 4095.0]);
        assert!(!layout.read(&[0; 5], &mut Channels::default(), &mut cells));
    }

    #[test]
    fn a_glove_sends_each_tactel_once_in_any_order() {
        let layout = layout(Form::Pairs, Some(vec![2, 0, 1])).unwrap();
        let mut cells = [0.0; 3];
        assert!(layout.read(&[1, 0xFF, 0x0F, 2, 0x00, 0x00, 0, 0x00, 0x04], &mut Channels::default(), &mut cells));
        assert_eq!(cells, [1.0, 1.0 - 1024.0 / 4095.0, 0.0]);
        assert!(!layout.read(&[1, 0, 0, 1, 0, 0, 0, 0, 0], &mut Channels::default(), &mut cells), "one twice");
        assert!(
            !layout.read(&[1, 0, 0, 3, 0, 0, 0, 0, 0], &mut Channels::default(), &mut cells),
            "one that is not there"
        );
        assert_eq!(Layout::builtin("glove").unwrap().bytes(), 192);
    }

    #[test]
    fn an_order_that_is_no_bijection_is_refused_with_the_number_that_is_wrong() {
        for (order, expected) in [
            (vec![0, 1], "the order has 2 entries, but the sensor has 3 tactels"),
            (vec![0, 0, 1], "the order has 0 twice, and 2 is missing"),
            (vec![0, 1, 3], "the order has 3, but the numbers go from 0 to 2"),
        ] {
            assert_eq!(layout(Form::Words, Some(order)).unwrap_err().message, expected);
        }
    }

    #[test]
    fn a_frame_with_mixed_words_shows_by_its_channels() {
        let (layout, mut channels, mut cells) = (layout(Form::Words, None).unwrap(), Channels::default(), [0.0; 3]);
        for (payload, is_whole) in [
            (&[0x01, 0x02, 0x03, 0x14, 0x05, 0x26][..], true),
            (&[0xFF, 0x0F, 0x00, 0x10, 0xAB, 0x2C], true),
            (&[0xFF, 0x00, 0x10, 0xAB, 0x2C, 0xF0], false),
            (&[0x01, 0x02, 0x03, 0x14], false),
            (&[0xFF, 0x0F, 0x00, 0x10, 0xAB, 0x2C], true),
            // Mixed up for good: another sensor, or the first frame was the wrong one.
            (&[0xFF, 0x30, 0x10, 0x4B, 0x2C, 0x50], false),
            (&[0xFF, 0x31, 0x10, 0x42, 0x2C, 0x53], true),
            (&[0xFF, 0x0F, 0x00, 0x10, 0xAB, 0x2C], false),
        ] {
            assert_eq!(layout.read(payload, &mut channels, &mut cells), is_whole, "{payload:X?}");
        }
    }

    proptest! {
        #[test]
        fn any_payload_is_read_without_a_panic(payload: Vec<u8>, is_pairs: bool) {
            let layout = layout(if is_pairs { Form::Pairs } else { Form::Words }, None).unwrap();
            let mut cells = [0.0; 3];
            layout.read(&payload, &mut Channels::default(), &mut cells);
            prop_assert!(cells.iter().all(|cell| (0.0..=1.0).contains(cell)));
        }
    }
}
