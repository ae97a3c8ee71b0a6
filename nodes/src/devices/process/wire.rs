//! The bytes between the tool and a program: frames with a header, in little-endian order.
//!
//! A header is `TFLO`, the number of bytes of the body (u32), the number of the question (u64) and a stamp (i64, ns).

use std::io::{self, Read};

use tactflow_runtime::device::ReportAge;
use tactflow_runtime::signal::ImageShape;

use super::signature::{OutputShape, Signature};

/// The first bytes of a frame.
const MARK: [u8; 4] = *b"TFLO";
/// Number of bytes of a header.
const HEADER_BYTES: usize = 24;
/// Number of bytes of text in a message about garbage.
const SHOWN_BYTES: usize = 40;

/// A question: the values of the inputs.
#[derive(Debug)]
pub(super) struct Question {
    pub(super) number: u64,
    pub(super) stamp: i64,
    bytes: Vec<u8>,
}

impl Question {
    pub(super) fn new(number: u64, stamp: i64) -> Self {
        let mut bytes = Vec::new();
        bytes.extend_from_slice(&MARK);
        bytes.extend_from_slice(&0u32.to_le_bytes());
        bytes.extend_from_slice(&number.to_le_bytes());
        bytes.extend_from_slice(&stamp.to_le_bytes());
        Self { number, stamp, bytes }
    }

    /// Appends an input: u8 0 absent, 1 held or 2 new; i64 its own stamp; and the value, if it is there.
    pub(super) fn input(&mut self, age: ReportAge, is_new: bool, value: impl FnOnce(&mut Vec<u8>)) {
        self.bytes.push(if age.is_present { 1 + u8::from(is_new) } else { 0 });
        self.bytes.extend_from_slice(&age.stamp.to_le_bytes());
        if age.is_present {
            value(&mut self.bytes);
        }
    }

    /// Returns the whole frame.
    pub(super) fn frame(mut self) -> Vec<u8> {
        let length = (self.bytes.len() - HEADER_BYTES) as u32;
        self.bytes[4..8].copy_from_slice(&length.to_le_bytes());
        self.bytes
    }
}

/// A frame of a program.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Frame {
    pub(super) number: u64,
    pub(super) stamp: i64,
    body: Vec<u8>,
}

/// The value of an output.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Absent,
    Scalar(f64),
    Flag(bool),
    Features(Vec<Option<f64>>),
    Image(Vec<f32>),
    VectorImage(Vec<[f32; 3]>),
}

/// Reads a frame of at most `max` bytes. Returns `None` at the end.
///
/// # Errors
/// What the program sends instead.
pub(super) fn read(from: &mut impl Read, max: usize) -> Result<Option<Frame>, String> {
    let mut header = [0; HEADER_BYTES];
    let got = fill(from, &mut header).map_err(|error| error.to_string())?;
    if got == 0 {
        return Ok(None);
    }
    if !header.starts_with(&MARK[..got.min(4)]) {
        return Err(garbage(&header[..got]));
    }
    if got < HEADER_BYTES {
        return Err("it ended in the middle of a frame".to_owned());
    }
    let eight = |at: usize| -> [u8; 8] { header[at..at + 8].try_into().expect("eight bytes") };
    let length = u32::from_le_bytes(header[4..8].try_into().expect("four bytes")) as usize;
    if length > max {
        return Err(format!("it sends a frame of {length} bytes, and a frame of its outputs has at most {max}"));
    }
    let mut body = vec![0; length];
    if fill(from, &mut body).map_err(|error| error.to_string())? < length {
        return Err("it ended in the middle of a frame".to_owned());
    }
    Ok(Some(Frame { number: u64::from_le_bytes(eight(8)), stamp: i64::from_le_bytes(eight(16)), body }))
}

/// Describes bytes that are no frame.
fn garbage(bytes: &[u8]) -> String {
    let is_text = bytes.iter().all(|byte| (0x20..0x7f).contains(byte) || byte.is_ascii_whitespace());
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(SHOWN_BYTES)]);
    if is_text {
        let text = text.lines().next().unwrap_or_default();
        return format!("it writes text instead of a frame: `{text}`; print to the standard error instead");
    }
    let hex: Vec<String> = bytes.iter().take(8).map(|byte| format!("{byte:02X}")).collect();
    format!("it sends bytes that are no frame: {}", hex.join(" "))
}

/// Fills a buffer, and returns how many bytes came before the end.
fn fill(from: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut got = 0;
    while got < buffer.len() {
        match from.read(&mut buffer[got..]) {
            Ok(0) => break,
            Ok(count) => got += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(got)
}

/// Returns the size of the largest frame of a program.
pub(super) fn max_bytes(signature: &Signature) -> usize {
    let size = |shape: &OutputShape| match shape {
        OutputShape::Scalar(_) => 8,
        OutputShape::Flag => 1,
        OutputShape::Features(shape) => 4 + 9 * shape.features.len(),
        OutputShape::Image(shape) => 8 + 4 * shape.tactels(),
        OutputShape::VectorImage(shape) => 8 + 12 * shape.0.tactels(),
    };
    signature.outputs.iter().flat_map(|port| port.output()).map(|shape| 1 + size(&shape)).sum()
}

/// Reads the values of a frame.
///
/// # Errors
/// What is wrong, with the name of the output.
pub(super) fn values(frame: &Frame, signature: &Signature) -> Result<Vec<Value>, String> {
    let mut rest = frame.body.as_slice();
    let mut values = Vec::with_capacity(signature.outputs.len());
    for port in &signature.outputs {
        let shape = port.output()?;
        values.push(value(&mut rest, &shape).map_err(|why| format!("output `{}`: {why}", port.name))?);
    }
    if !rest.is_empty() {
        return Err(format!("a frame has {} bytes more than its outputs", rest.len()));
    }
    Ok(values)
}

fn value(rest: &mut &[u8], shape: &OutputShape) -> Result<Value, String> {
    match take::<1>(rest)?[0] {
        0 => return Ok(Value::Absent),
        1 => {}
        other => return Err(format!("its presence is {other}, and not 0 or 1")),
    }
    Ok(match shape {
        OutputShape::Scalar(_) => Value::Scalar(f64::from_le_bytes(take(rest)?)),
        OutputShape::Flag => match take::<1>(rest)?[0] {
            0 => Value::Flag(false),
            1 => Value::Flag(true),
            other => return Err(format!("a flag is {other}, and not 0 or 1")),
        },
        OutputShape::Features(shape) => {
            let (count, stated) = (u32::from_le_bytes(take(rest)?) as usize, shape.features.len());
            if count != stated {
                return Err(format!("it has {count} features, and the signature states {stated}"));
            }
            let mut component = |_| {
                let is_present = take::<1>(rest)?[0] != 0;
                let value = f64::from_le_bytes(take(rest)?);
                Ok(is_present.then_some(value))
            };
            let values: Result<Vec<_>, String> = (0..count).map(&mut component).collect();
            Value::Features(values?)
        }
        OutputShape::Image(shape) => Value::Image(cells(rest, shape, number)?),
        OutputShape::VectorImage(shape) => {
            Value::VectorImage(cells(rest, &shape.0, |rest| Ok([number(rest)?, number(rest)?, number(rest)?]))?)
        }
    })
}

/// Reads the size of an image, and its cells row by row.
fn cells<T>(
    rest: &mut &[u8],
    shape: &ImageShape,
    mut cell: impl FnMut(&mut &[u8]) -> Result<T, String>,
) -> Result<Vec<T>, String> {
    let (rows, cols) = (u32::from_le_bytes(take(rest)?) as usize, u32::from_le_bytes(take(rest)?) as usize);
    if (rows, cols) != (shape.rows, shape.cols) {
        let stated = format!("{} by {}", shape.rows, shape.cols);
        return Err(format!("it has {rows} by {cols} tactels, and the signature states {stated}"));
    }
    (0..shape.tactels()).map(|_| cell(rest)).collect()
}

fn number(rest: &mut &[u8]) -> Result<f32, String> {
    take(rest).map(f32::from_le_bytes)
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], String> {
    let (taken, after) = rest.split_first_chunk::<N>().ok_or("the frame is too short for it")?;
    *rest = after;
    Ok(*taken)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGNATURE: &str = r#"{"tactflow":1,"name":"a","inputs":[{"name":"image","kind":"image"}],"outputs":[
        {"name":"x","kind":"scalar","unit":"m"},{"name":"is_there","kind":"flag"},
        {"name":"parts","kind":"features","features":[{"name":"a","unit":"m"},{"name":"b","unit":"N"}]},
        {"name":"heat","kind":"image","rows":1,"cols":2,"pitch":[0.001,0.001],"unit":"N"},
        {"name":"drag","kind":"vector_image","rows":2,"cols":1,"pitch":[0.001,0.001],"unit":"N"}]}"#;

    /// A frame with these bytes as its body.
    fn frame(body: &[u8]) -> Vec<u8> {
        let mut question = Question::new(7, -3);
        question.bytes.extend_from_slice(body);
        question.frame()
    }

    fn body() -> Vec<u8> {
        let mut body = vec![1];
        body.extend(1.5f64.to_le_bytes());
        body.extend([1, 1, 1, 2, 0, 0, 0, 1]);
        body.extend(2.5f64.to_le_bytes());
        body.push(0);
        body.extend(0f64.to_le_bytes());
        body.push(1);
        body.extend([1, 0, 0, 0, 2, 0, 0, 0]);
        body.extend([0.5f32, -0.5].iter().flat_map(|cell| cell.to_le_bytes()));
        body.push(1);
        body.extend([2, 0, 0, 0, 1, 0, 0, 0]);
        body.extend([1f32, 2.0, 3.0, 4.0, 5.0, 6.0].iter().flat_map(|cell| cell.to_le_bytes()));
        body
    }

    #[test]
    fn a_frame_comes_back_with_the_presence_of_each_component() {
        let signature = Signature::from_line(SIGNATURE).unwrap();
        let bytes = frame(&body());
        assert_eq!(max_bytes(&signature), body().len());
        let frame = read(&mut bytes.as_slice(), 1000).unwrap().unwrap();
        assert_eq!((frame.number, frame.stamp), (7, -3));
        let expected = [
            Value::Scalar(1.5),
            Value::Flag(true),
            Value::Features(vec![Some(2.5), None]),
            Value::Image(vec![0.5, -0.5]),
            Value::VectorImage(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        ];
        assert_eq!(values(&frame, &signature).unwrap(), expected);
    }

    #[test]
    fn whatever_is_no_frame_is_named_and_takes_no_memory() {
        let signature = Signature::from_line(SIGNATURE).unwrap();
        for (bytes, why) in [
            (b"Loading the model ...\nready\n".to_vec(), "text instead of a frame: `Loading the model ...`"),
            (vec![0xff; 30], "no frame: FF FF FF"),
            (frame(&body())[..20].to_vec(), "in the middle of a frame"),
            (frame(&body())[..40].to_vec(), "in the middle of a frame"),
            ([&MARK[..], &u32::MAX.to_le_bytes(), &[0; 16]].concat(), "a frame of 4294967295 bytes"),
        ] {
            let said = read(&mut bytes.as_slice(), 1000).unwrap_err();
            assert!(said.contains(why), "{said}");
        }
        assert_eq!(read(&mut &b""[..], 10), Ok(None));
        let spoilt = |at: usize, byte: u8| {
            let mut body = body();
            body[at] = byte;
            body
        };
        for (body, why) in [
            (body()[..20].to_vec(), "output `parts`: the frame is too short"),
            ([body(), vec![0]].concat(), "1 bytes more"),
            (spoilt(0, 9), "output `x`: its presence is 9"),
            (spoilt(10, 3), "output `is_there`: a flag is 3"),
            (spoilt(12, 3), "output `parts`: it has 3 features, and the signature states 2"),
            (spoilt(35, 2), "output `heat`: it has 2 by 2 tactels, and the signature states 1 by 2"),
        ] {
            let frame = read(&mut frame(&body).as_slice(), 1000).unwrap().unwrap();
            let said = values(&frame, &signature).unwrap_err();
            assert!(said.contains(why), "{said}");
        }
    }
}
