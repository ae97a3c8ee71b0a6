//! Tests of descriptions: what each key does, the mistakes, and the descriptions that ship, on literal frames.

use tactflow_runtime::device::Opened;
use tactflow_runtime::node::{At, Mistakes};
use tactflow_runtime::signal::Shape;

use super::plan::Plan;
use super::reader::{Read, Reader};
use super::{Params, Stream};
use crate::builtin;
use crate::devices::testing::{open, read};

/// A description that is complete.
const PAD: &str = "link = 'serial:/dev/null'\nbaud = 115200\nframe = 'sync'\nmark = 'hex:AA55'\ncell = 'u8'\n\
                   shape = [2, 3]\nrate_hz = 100\npitch = 0.005\n";

/// The description with keys that replace its own, or remove them: `mark =`.
fn with(keys: &str) -> String {
    let name = |line: &str| line.split('=').next().unwrap_or_default().trim().to_owned();
    let names: Vec<String> = keys.lines().map(name).collect();
    let own = PAD.lines().filter(|line| !names.contains(&name(line)));
    let new = keys.lines().filter(|line| !line.trim_end().ends_with('='));
    own.chain(new).map(|line| format!("{line}\n")).collect()
}

fn refused(keys: &str) -> Mistakes {
    match open::<Stream>(&with(keys)) {
        Ok(_) => panic!("accepted: {keys}"),
        Err(mistakes) => mistakes,
    }
}

/// Keys that are wrong, the key at which the mistake is, and a part of its message.
const MISTAKES: &[(&str, &str, &str)] = &[
    ("link = '/dev/ttyUSB0'", "link", "does not begin with a kind of link"),
    ("baud =", "link", "a serial port needs `baud`"),
    ("mark =", "frame", "`mark` is missing: the bytes with which each frame begins"),
    ("mark = 'AA55'", "mark", "`AA55` is a text of 4 bytes"),
    ("mark = 'hex:AA5'", "mark", "3 hexadecimal digits are not whole bytes"),
    ("mark = ''", "mark", "`mark` is empty"),
    ("length = 7", "length", "the last value ends after 8 bytes, but the length is 7"),
    ("length = 8\ncheck = 'sum16le'", "length", "the last value ends after 8 bytes, and 2 more follow it, but"),
    ("length = 100_000", "length", "a frame has at most 65536 bytes"),
    ("frame = 'trailer'\nlength = 7", "length", "the last value ends after 6 bytes, and 2 more follow it, but"),
    ("frame = 'reply'\npoll = '01 04 F1'", "poll", "`01 04 F1` is sent as text, and looks like hexadecimal digits"),
    ("check = 'crc-16/modbuss'", "check", "no checksum is called `crc-16/modbuss`"),
    ("check_from = 2", "check_from", "`check_from` has no meaning without a `check`"),
    ("check = 'xor8'\ncheck_from = 8", "check_from", "the checksum covers nothing: it stands at byte 8"),
    ("check_order = 'le'", "check_order", "`check_order` has no meaning without a `check`"),
    ("cell = 'dec'", "cell", "numbers in text need `frame = \"lines\"`"),
    ("frame = 'lines'\nmark =", "cell", "lines hold numbers in text"),
    ("frame = 'lines'\nmark =\ncell = 'dec'\ncheck = 'xor8'", "check", "no meaning for numbers in text"),
    ("frame = 'datagram'", "frame", "sends bytes without borders"),
    ("frame = 'reply'\nmark =", "frame", "a reply needs `poll`"),
    ("frame = 'cobs'\nmark =\nmark_at = 1", "mark_at", "`mark_at` has no meaning with this `frame`"),
    ("mark_at = 40\noffset = 2", "mark_at", "the mark ends behind the frame, which has 8 bytes"),
    ("mask = 256", "mask", "the mask 256 is not from 1 to 255"),
    ("mask = 0", "mask", "the mask 0 is not from 1 to 255"),
    ("cell = 'f32le'\nmask = 255", "mask", "`mask` has no meaning for a float"),
    ("cell = 'f32le'\nshift = 4", "shift", "`shift` has no meaning for a float"),
    ("cell = 'u16le'\nstride = 1", "stride", "values 1 apart overlap: a value has 2 bytes"),
    ("offset = 70_000", "offset", "a frame is longer than 65536 bytes"),
    ("shape = [2]", "shape", "`shape` has 1 numbers"),
    ("shape = [0, 3]", "shape", "`shape` has a number that is 0"),
    ("shape = [1000, 1000]", "shape", "1000 by 1000 by 1 values are more than 262144"),
    ("axes = ['x']", "axes", "`axes` has no meaning for a `shape` of two numbers"),
    ("axis = 'x'", "axis", "`axis` has no meaning for a `shape` of two numbers"),
    ("shape = [2, 3, 2]", "shape", "a tactel has 2 values, and `axes` names 0"),
    ("shape = [2, 3, 2]\naxes = ['x']", "axes", "a tactel has 2 values, and `axes` names 1"),
    ("shape = [2, 3, 2]\naxes = ['x', 'x']", "axes", "two axes are called `x`"),
    ("shape = [2, 3, 2]\naxes = ['x', 'z']", "axes", "`axis` is missing"),
    ("shape = [2, 3, 2]\naxes = ['x', 'z']\naxis = 'y'", "axis", "no axis is called `y`"),
    ("tangential = ['x', 'y']", "tangential", "a vector image needs three axes"),
    (
        "shape = [2, 3, 3]\naxes = ['x', 'y', 'z']\naxis = 'z'\ntangential = ['x']",
        "tangential",
        "`tangential` has 1 names",
    ),
    (
        "shape = [2, 3, 3]\naxes = ['x', 'y', 'z']\naxis = 'z'\ntangential = ['x', '-w']",
        "tangential",
        "no axis is called `w`",
    ),
    (
        "shape = [2, 3, 3]\naxes = ['x', 'y', 'z']\naxis = 'z'\ntangential = ['x', '-z']",
        "tangential",
        "must be three axes",
    ),
    ("plausible = { value = [3, 1] }", "plausible.value", "the least value 3 is above the greatest value 1"),
    ("plausible = { valeu = [1, 3] }", "plausible.valeu", "no axis is called `valeu`"),
    ("lut = [0, 1, 2, 3, 4, 4]", "lut", "`lut` has the index 4 twice, and the index 5 is missing"),
    ("lut = [0, 1]", "lut", "`lut` has 2 indices, and 2 by 3 cells need 6"),
    ("lut = [0, 1, 2, 3, 4, 6]", "lut", "`lut` has the index 6, and the last cell is 5"),
    ("scale = { gain = 0 }", "scale.gain", "with a `gain` of 0 the image is always the same"),
    ("clock = { counter = { offset = 8, cell = 'u8' } }", "clock.counter.offset", "it ends behind the frame"),
    (
        "length = 10\nclock = { stamp = { offset = 8, cell = 'dec', unit = 'ms' } }",
        "clock.stamp.cell",
        "the values of the frame are bytes",
    ),
    ("parts = { values = 4 }", "parts.values", "a frame of 6 values has no whole number of parts with 4 values"),
    ("parts = { values = 3 }", "parts", "a part needs `index`, its number, or `start`"),
    (
        "parts = { values = 3, index = { offset = 2, cell = 'u8' }, start = { offset = 2, cell = 'u8' } }",
        "parts.start",
        "`index` and `start` exclude each other",
    ),
    (
        "parts = { values = 3, index = { offset = 2, cell = 'u8' }, first = 1, completes = 3 }",
        "parts.completes",
        "`completes` is no part: they are 1 to 2",
    ),
    (
        "parts = { values = 3, index = { offset = 2, cell = 'u8' }, lengths = [8] }",
        "parts.lengths",
        "`lengths` has 1 numbers, and a frame has 2 parts",
    ),
    (
        "parts = { values = 3, index = { offset = 2, cell = 'u8' }, lengths = [4, 9] }\noffset = 3",
        "parts.lengths",
        "a part of 4 bytes is too short or too long: its last value ends at byte 6",
    ),
    ("start = 'hex:0'", "start", "1 hexadecimal digits are not whole bytes"),
    ("stop = ''", "stop", "`stop` is empty"),
    ("from = '10.0.0.1'", "from", "`from` has no meaning with the link `/dev/null`"),
    ("link = 'udp:5005'\nfrom = 'pad'", "from", "`pad` is not the address of a host"),
    ("link = 'udp:5005'\nstart = 'go'", "start", "`start` has no receiver: `udp:5005` only listens"),
];

#[test]
fn each_mistake_is_at_its_key_with_a_way_out() {
    for (keys, path, message) in MISTAKES {
        let mistakes = refused(keys);
        let is_there = mistakes.iter().any(|mistake| {
            matches!(&mistake.at, At::Param(at) | At::Key(at) if at == path) && mistake.message.contains(message)
        });
        assert!(is_there, "{keys}\n{mistakes:#?}");
    }
    let with_help =
        MISTAKES.iter().flat_map(|(keys, ..)| refused(keys)).filter(|mistake| mistake.help.is_some()).count();
    assert!(with_help > 40, "{with_help} mistakes have a way out");
}

#[test]
fn all_mistakes_are_reported_at_once() {
    let mistakes = refused("mark = 'AA55'\nlink = 'usb'\nlut = [1]\nstart = 'hex:0'\ncheck = 'sum7'");
    assert_eq!(mistakes.len(), 5, "{mistakes:#?}");
}

#[test]
fn the_device_states_its_shape_and_its_facts() {
    let keys = "order = ['transpose']\nthreshold = 3\npressure = 2\nlatency_ms = 4\n\
                mount = { xyz = [0, 0, 0.03], rpy = [0, 0, 0] }";
    let Ok(Opened { description, .. }) = open::<Stream>(&with(keys)) else { panic!("it opens") };
    let Some(Shape::Image(shape)) = description.shape("image") else { panic!("an image") };
    assert_eq!((shape.rows, shape.cols, shape.unit.to_string()), (3, 2, "raw".to_owned()));
    assert_eq!((description.period, description.latency), (0.01, 0.004));
    assert_eq!(description.fact("threshold"), Some(&"3 raw".into()));
    assert_eq!(description.fact("pressure"), Some(&"2 raw/tactel".into()));
    assert!(description.fact("mount").is_some() && description.fact("dead").is_some());
}

/// The reader of a description, and a buffer for its images.
struct Pad {
    reader: Reader,
    cells: Vec<f32>,
}

impl Pad {
    fn new(text: &str) -> Self {
        let params: Params = read(text);
        let plan = Plan::new(&params).unwrap_or_else(|mistakes| panic!("{mistakes:#?}"));
        let reader = Reader::new(plan);
        Self { cells: reader.cells(), reader }
    }

    /// Returns the images in some bytes.
    fn read(&mut self, bytes: &[u8]) -> Vec<(Read, Vec<f32>)> {
        self.reader.push(bytes, false);
        let mut images = Vec::new();
        while let Some(read) = self.reader.next(&mut self.cells) {
            images.push((read, self.cells.clone()));
        }
        images
    }

    /// Returns the last image.
    fn last(&mut self, bytes: &[u8]) -> Vec<f32> {
        self.read(bytes).pop().expect("an image").1
    }
}

#[test]
fn three_axes_become_a_vector_image() {
    // Temperature, x, y and z of two tactels; the image is flipped, and the data sheet counts y downward.
    let keys = "cell = 'i16le'\nshape = [1, 2, 4]\naxes = ['t', 'x', 'y', 'z']\naxis = 'z'\n\
                tangential = ['x', '-y']\norder = ['flip_x']\nscale = { invert_full = 100, gain = 0.5 }\nunit = 'N'";
    let Ok(Opened { description, .. }) = open::<Stream>(&with(keys)) else { panic!("it opens") };
    assert_eq!(description.roles().collect::<Vec<_>>(), ["three_axis_pad"]);
    let Some(Shape::VectorImage(shape)) = description.shape("vectors") else { panic!("a vector image") };
    assert_eq!((shape.0.rows, shape.0.cols, shape.0.unit.to_string()), (1, 2, "N".to_owned()));
    let mut pad = Pad::new(&with(keys));
    let frame = |values: [i16; 8]| {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        [0xAA, 0x55].into_iter().chain(bytes).collect::<Vec<u8>>()
    };
    let frames = [
        frame([20, 1, 2, 98, 20, -3, 4, 60]),
        frame([21, 1, 2, 98, 20, -3, 4, 60]),
        frame([20, 7, 8, 90, 20, 5, 6, 80]),
    ];
    let image = pad.last(&frames.concat());
    // z falls with the force; x and y are about their zero.
    assert_eq!(image, [10.0, 5.0]);
    assert_eq!(pad.reader.vectors, [[2.5, -3.0, 10.0], [3.5, -4.0, 5.0]]);
    let without = Pad::new(&with(&keys.replace("tangential = ['x', '-y']\n", "")));
    assert!(without.reader.vectors.is_empty());
}

#[test]
fn cells_are_decoded_ordered_and_scaled() {
    // The low 12 bits of 16, high byte first, with a gap of a byte between them, behind a byte of a header.
    let keys = "cell = 'u16be'\nmask = 0x0FFF\nshift = 4\noffset = 3\nstride = 3\norder = ['flip_x']\n\
                scale = { invert_full = 255, gain = 0.5, offset = 1 }\nunit = 'N'\nlength = 21";
    let mut pad = Pad::new(&with(keys));
    let values = [0x000_u16, 0x010, 0x020, 0xFF0, 0x800, 0x7F0];
    let frame = |number: u8| {
        let mut frame = vec![0xAA, 0x55, number];
        values.iter().for_each(|value| frame.extend([0x90 | (value >> 8) as u8, *value as u8, number]));
        frame
    };
    let bytes: Vec<u8> = (0..3).flat_map(frame).collect();
    // 1 + 0.5 (255 - v), with rows from right to left.
    assert_eq!(pad.last(&bytes), [127.5, 128.0, 128.5, 65.0, 64.5, 1.0]);
}

#[test]
fn a_repeated_frame_is_one_sample_and_a_counter_decides() {
    let frame = |number: u8, value: u8| [0xAA, 0x55, number, value, 1, 2, 3, 4, 5];
    let numbers = |pad: &mut Pad, frames: &[[u8; 9]]| -> Vec<u64> {
        pad.read(&frames.concat()).iter().map(|(read, _)| read.number).collect()
    };
    let mut plain = Pad::new(&with("offset = 3"));
    let frames = [frame(0, 1), frame(0, 1), frame(0, 1), frame(0, 1), frame(0, 2), frame(0, 1)];
    assert_eq!(numbers(&mut plain, &frames), [1, 1, 2, 3]);
    assert_eq!((plain.reader.tally.repeated, plain.reader.tally.frames), (1, 4));
    let mut constant = Pad::new(&with("offset = 3\nrepeats_are_new = true"));
    assert_eq!(numbers(&mut constant, &frames), [1, 2, 3, 4]);
    assert_eq!(constant.reader.tally.repeated, 1);
    let mut counted = Pad::new(&with("offset = 3\nclock = { counter = { offset = 2, cell = 'u8' } }"));
    let frames = [253, 254, 254, 255, 255, 2, 1, 3].map(|number| frame(number, 1));
    assert_eq!(numbers(&mut counted, &frames), [254, 255, 255, 258, 259]);
    let tally = counted.reader.tally;
    assert_eq!((tally.repeated, tally.lost, tally.late), (1, 2, 1));
}

#[test]
fn a_stamp_is_the_time_of_the_pad() {
    let mut pad = Pad::new(&with("offset = 4\nclock = { stamp = { offset = 2, cell = 'u16le', unit = 'ms' } }"));
    let frame = |stamp: u16| [&[0xAA, 0x55][..], &stamp.to_le_bytes(), &[1, 2, 3, 4, 5, 6]].concat();
    let bytes: Vec<u8> = [65_000, 65_100, 65_500, 64].into_iter().flat_map(frame).collect();
    let times: Vec<Option<i64>> = pad.read(&bytes).iter().map(|(read, _)| read.time).collect();
    assert_eq!(times, [Some(65_500_000_000), Some(65_600_000_000)]);
}

#[test]
fn frames_come_in_parts_by_the_index_of_their_first_value() {
    let keys = "frame = 'sync'\nmark = 'wr'\noffset = 3\nlength = 10\ncell = 'u8'\n\
                parts = { values = 3, start = { offset = 2, cell = 'u8' } }\n\
                clock = { counter = { offset = 6, cell = 'u32le' } }";
    let mut pad = Pad::new(&with(keys));
    let part =
        |number: u32, start: u8, value: u8| [b"wr", &[start, value, value, value][..], &number.to_le_bytes()].concat();
    let parts = [(0, 0, 9), (1, 3, 9), (2, 0, 1), (3, 3, 2), (4, 0, 3), (6, 0, 5), (7, 3, 6), (8, 3, 7)];
    let bytes: Vec<u8> = parts.into_iter().flat_map(|(number, start, value)| part(number, start, value)).collect();
    let images: Vec<Vec<f32>> = pad.read(&bytes).into_iter().map(|(_, cells)| cells).collect();
    assert_eq!(images, [[1.0, 1.0, 1.0, 2.0, 2.0, 2.0], [5.0, 5.0, 5.0, 6.0, 6.0, 6.0]]);
    assert_eq!(pad.reader.tally.lost, 1, "the frame whose second part is missing");
}

/// The description of a pad that ships, with a link.
fn shipped(name: &str) -> String {
    let (_, bytes) = builtin::FILES.iter().find(|(file, _)| *file == format!("pads/{name}.toml")).unwrap();
    let text = std::str::from_utf8(bytes).unwrap();
    text.replace("[sensor]\n", "link = 'serial:/dev/null'\n").replace("[sensor.", "[")
}

#[test]
fn every_shipped_description_opens() {
    let mut count = 0;
    for (name, _) in builtin::FILES {
        let Some(name) = name.strip_prefix("pads/").and_then(|name| name.strip_suffix(".toml")) else { continue };
        count += 1;
        open::<Stream>(&shipped(name)).unwrap_or_else(|mistakes| panic!("{name}: {mistakes:#?}"));
    }
    assert!(count >= 9);
}

#[test]
fn a_frame_of_myrmex_has_its_length_its_table_and_its_checksum() {
    let mut pad = Pad::new(&shipped("myrmex_v2"));
    // Word k holds k, with a channel in the high nibble.
    let mut frame = vec![0xF0, 0xC4, 0x01, 0x10, 0x27, 0x00, 0x00];
    for k in 0_u16..256 {
        frame.extend((k | (k % 16) << 12).to_le_bytes());
    }
    frame.push(frame.iter().fold(0, |xor, byte| xor ^ byte));
    assert_eq!(frame.len(), 520);
    let cells = pad.last(&frame.repeat(3));
    let blocks = [[208, 224, 32, 0], [192, 48, 16, 64], [176, 144, 112, 80], [160, 240, 128, 96]];
    for r in 0..16 {
        for c in 0..16 {
            let word = blocks[r % 4][c % 4] + 4 * (r / 4) + c / 4;
            assert_eq!(cells[16 * r + c], (4095 - word) as f32, "row {r}, column {c}");
        }
    }
    let good = frame.clone();
    frame[100] ^= 1;
    assert_eq!(pad.read(&frame), []);
    assert_eq!(pad.read(&good).len(), 1);
    assert_eq!(pad.reader.tally.rejected, 1);
}

#[test]
fn the_glove_has_two_packets_of_different_length() {
    let mut pad = Pad::new(&shipped("aa550399_glove"));
    let packet = |order: u8, value: u8| {
        let mut packet = vec![0xAA, 0x55, 0x03, 0x99, order, 0x01];
        packet.extend([value; 128]);
        packet.extend(vec![7; if order == 2 { 16 } else { 0 }]);
        packet
    };
    let bytes: Vec<u8> = [(2, 9), (1, 1), (2, 2), (1, 3), (2, 4)].into_iter().flat_map(|(o, v)| packet(o, v)).collect();
    let images: Vec<Vec<f32>> = pad.read(&bytes).into_iter().map(|(_, cells)| cells).collect();
    assert_eq!(images.len(), 1, "the row is believed with its third packet, and that is a second one");
    let expected = [[3.0; 128], [4.0; 128]].concat();
    assert_eq!(images[0], expected);
}

#[test]
fn anyskin_shows_its_z_axis() {
    let mut pad = Pad::new(&shipped("anyskin"));
    let frame = |k: f32| {
        let values = (0..5).flat_map(|chip| [24.5, 1.0, 2.0, k - chip as f32]);
        let mut frame: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
        frame.extend([0x0D, 0x0A]);
        frame
    };
    let bytes: Vec<u8> = (0..4).flat_map(|k| frame(k as f32)).collect();
    assert_eq!(bytes.len(), 4 * 82);
    assert_eq!(pad.last(&bytes), [3.0, 2.0, 1.0, 0.0, -1.0]);
}
