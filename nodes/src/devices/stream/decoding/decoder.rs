//! Reads the numbers of a frame, and converts them to the cells of an image.

use std::ops::Range;

use tactflow_runtime::node::Param;

use super::cell::{Cell, Field};
use super::words::find_words;

/// Where a number of a frame stands beside its cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) struct Place {
    /// Offset from the first byte of the frame; in text, the number of values before it.
    pub(crate) offset: usize,
    /// Type of the number.
    pub(crate) cell: Field,
}

/// A number beside the cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Reading {
    Whole(u64),
    Decimal(f64),
}

/// Where the cells of a frame stand, and which values they can have.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) cell: Cell,
    /// Mask and shift of whole numbers.
    pub(crate) bits: Option<(u32, u32)>,
    /// Offset of the first value, and the step to the next one: in bytes, or in values of a text.
    pub(crate) offset: usize,
    pub(crate) stride: usize,
    /// Number of values in a frame, or in a part of one.
    pub(crate) count: usize,
    /// Number of values of a text, with those that are no cells.
    pub(crate) words: usize,
    /// Number of values of a tactel.
    pub(crate) axes: usize,
    /// The values that an axis can have.
    pub(crate) plausible: Vec<(usize, [f64; 2])>,
}

/// Reads frames of one layout.
#[derive(Debug, Clone)]
pub(crate) struct Decoder {
    pub(crate) layout: Layout,
    /// The words of the last text.
    found: Vec<Range<usize>>,
}

impl Decoder {
    pub(crate) fn new(layout: Layout) -> Self {
        let found = Vec::with_capacity(if layout.cell.is_text() { layout.words } else { 0 });
        Self { layout, found }
    }

    /// Reads the values of a frame in their order. Returns whether the frame has all of them, and each is finite and
    /// plausible.
    pub(crate) fn read(&mut self, frame: &[u8], values: &mut [f64]) -> bool {
        if !self.opens(frame) {
            return false;
        }
        for (i, value) in values.iter_mut().enumerate() {
            let Some(read) = self.value(frame, i).filter(|read| read.is_finite()) else { return false };
            *value = read;
        }
        self.layout.plausible.iter().all(|(axis, [min, max])| {
            values.iter().skip(*axis).step_by(self.layout.axes).all(|value| (*min..=*max).contains(value))
        })
    }

    /// Finds the words of a text. Returns whether the frame can be read.
    pub(crate) fn opens(&mut self, frame: &[u8]) -> bool {
        let words = self.layout.words;
        !self.layout.cell.is_text() || (find_words(frame, words, &mut self.found) && self.found.len() == words)
    }

    fn value(&self, frame: &[u8], i: usize) -> Option<f64> {
        let Layout { cell, bits, offset, stride, .. } = self.layout;
        let at = offset + i * stride;
        match cell.is_text() {
            true => cell.read_text(self.word(frame, at)?),
            false => cell.read(frame.get(at..)?, bits),
        }
    }

    fn word<'f>(&self, frame: &'f [u8], at: usize) -> Option<&'f str> {
        std::str::from_utf8(frame.get(self.found.get(at)?.clone())?).ok()
    }

    /// Reads a number beside the cells, of the frame that was read last.
    pub(crate) fn beside(&self, frame: &[u8], place: Place) -> Option<Reading> {
        match place.cell.is_text() {
            true => place.cell.read_text(self.word(frame, place.offset)?).map(Reading::Decimal),
            false => place.cell.read(frame.get(place.offset..)?).map(Reading::Whole),
        }
    }
}

impl Reading {
    /// Returns the number without its fraction.
    pub(crate) fn whole(self) -> u64 {
        match self {
            Self::Whole(number) => number,
            Self::Decimal(number) => number as u64,
        }
    }
}

/// From values to the cells of an image.
#[derive(Debug, Clone)]
pub(crate) struct Image {
    /// For each cell of the image, the index of its value.
    pub(crate) places: Vec<usize>,
    pub(crate) gain: f64,
    pub(crate) offset: f64,
}

impl Image {
    /// Writes the cells. Returns whether all are finite.
    pub(crate) fn write<'c>(&self, values: &[f64], cells: impl IntoIterator<Item = &'c mut f32>) -> bool {
        let mut is_finite = true;
        for (cell, place) in cells.into_iter().zip(&self.places) {
            *cell = (values[*place] * self.gain + self.offset) as f32;
            is_finite &= cell.is_finite();
        }
        is_finite
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(cell: Cell, offset: usize, stride: usize, count: usize) -> Layout {
        Layout { cell, bits: None, offset, stride, count, words: offset + count * stride, axes: 1, plausible: vec![] }
    }

    #[test]
    fn values_stand_at_an_offset_with_a_stride() {
        let mut decoder = Decoder::new(layout(Cell::U16be, 2, 3, 2));
        let mut values = [0.0; 2];
        assert!(decoder.read(&[0xAA, 0x55, 1, 2, 99, 3, 4, 99], &mut values));
        assert_eq!(values, [258.0, 772.0]);
        assert!(!decoder.read(&[0xAA, 0x55, 1, 2, 99, 3], &mut values), "the last value is cut off");
        let place = Place { offset: 1, cell: Field::U16be };
        assert_eq!(decoder.beside(&[0xAA, 0x55, 1], place), Some(Reading::Whole(0x5501)));
        assert_eq!(decoder.beside(&[0xAA, 0x55], place), None);
    }

    #[test]
    fn an_axis_outside_its_range_or_a_value_that_is_not_finite_spoils_the_frame() {
        // AnySkin: temperature, x, y, z of each chip.
        let frame = |temperature: f32, z: f32| {
            let chip = [25.0, 1.0, 2.0, 3.0];
            let chips = [chip, [temperature, 1.0, 2.0, z]].concat();
            chips.iter().flat_map(|value: &f32| value.to_le_bytes()).collect::<Vec<u8>>()
        };
        let plausible = vec![(0, [-20.0, 80.0])];
        let mut decoder = Decoder::new(Layout { axes: 4, plausible, ..layout(Cell::F32le, 0, 4, 8) });
        let mut values = [0.0; 8];
        assert!(decoder.read(&frame(80.0, -7.5), &mut values));
        assert_eq!(values, [25.0, 1.0, 2.0, 3.0, 80.0, 1.0, 2.0, -7.5]);
        assert!(!decoder.read(&frame(80.5, 3.0), &mut values));
        assert!(!decoder.read(&frame(25.0, f32::NAN), &mut values));
        assert!(!decoder.read(&frame(25.0, f32::INFINITY), &mut values));
    }

    #[test]
    fn a_text_has_exactly_its_number_of_values() {
        let mut decoder = Decoder::new(layout(Cell::Dec, 1, 1, 3));
        let mut values = [0.0; 3];
        assert!(decoder.read(b"1234, 1,2,3", &mut values));
        assert_eq!(values, [1.0, 2.0, 3.0]);
        let stamp = Place { offset: 0, cell: Field::Dec };
        assert_eq!(decoder.beside(b"1234, 1,2,3", stamp), Some(Reading::Decimal(1234.0)));
        for text in ["1234,1,2", "1234,1,2,3,4", "1234,1,x,3", "1234,1,,3", "1234,1,inf,3", "1234,1,nan,3", "\u{fffd}"]
        {
            assert!(!decoder.read(text.as_bytes(), &mut values), "{text}");
        }
        assert!(!decoder.read(&[0xFF, b' ', 0xFE, b' ', 0xFD, b' ', 0xFC], &mut values), "no UTF-8");
    }

    #[test]
    fn cells_are_scaled_in_the_order_of_their_places() {
        let image = Image { places: vec![2, 0], gain: -1.0, offset: 4095.0 };
        let mut cells = [0.0; 2];
        assert!(image.write(&[0.0, 1.0, 4095.0], &mut cells));
        assert_eq!(cells, [0.0, 4095.0]);
        assert!(!Image { gain: 1e39, ..image }.write(&[1.0, 1.0, 1.0], &mut cells), "too large for the image");
    }
}
