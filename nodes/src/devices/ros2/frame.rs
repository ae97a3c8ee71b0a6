//! From messages to the cells of a pad.

use super::message::{Float32MultiArray, Picture, TactileState};

/// Reads an image into `cells`, of which each row has `cols`.
///
/// # Errors
/// What does not fit.
pub(super) fn of_picture(picture: &Picture, cells: &mut [f32], cols: usize) -> Result<(), String> {
    let (rows, width) = (cells.len() / cols, picture.width as usize);
    if (picture.height as usize, width) != (rows, cols) {
        return Err(format!("an image of {}x{} pixels, and not {rows}x{cols}", picture.height, picture.width));
    }
    let is_big = picture.is_bigendian != 0;
    let read: fn(&[u8], bool) -> f32 = match picture.encoding.as_str() {
        "mono8" | "8UC1" => |bytes, _| f32::from(bytes[0]),
        "mono16" | "16UC1" => |bytes, is_big| {
            let bytes = [bytes[0], bytes[1]];
            f32::from(if is_big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
        },
        "32FC1" => |bytes, is_big| {
            let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
            if is_big { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) }
        },
        other => return Err(format!("an image of the encoding `{other}`, and not mono8, mono16 or 32FC1")),
    };
    let size = match picture.encoding.as_str() {
        "mono8" | "8UC1" => 1,
        "mono16" | "16UC1" => 2,
        _ => 4,
    };
    let (step, needed) = (picture.step as usize, size * cols);
    if step < needed || picture.data.len() < step * (rows - 1) + needed {
        return Err(format!(
            "an image of {} bytes with rows of {step}, where each row has {needed} bytes of pixels",
            picture.data.len()
        ));
    }
    for (row, cells) in picture.data.chunks(step).zip(cells.chunks_exact_mut(cols)) {
        for (pixel, cell) in row.chunks_exact(size).zip(cells) {
            *cell = read(pixel, is_big);
        }
    }
    Ok(())
}

/// Reads an array of one or two dimensions.
///
/// # Errors
/// What does not fit.
pub(super) fn of_array(array: &Float32MultiArray, cells: &mut [f32], cols: usize) -> Result<(), String> {
    let rows = cells.len() / cols;
    let sizes: Vec<usize> = array.layout.dim.iter().map(|dim| dim.size as usize).collect();
    if !sizes.is_empty() && sizes != [rows, cols] && sizes != [rows * cols] {
        return Err(format!("an array of the dimensions {sizes:?}, and not [{rows}, {cols}]"));
    }
    let data = array.data.get(array.layout.data_offset as usize..).unwrap_or_default();
    copy(data, cells, "an array")
}

/// Reads a channel of a tactile state: the one with a name, or else the only one.
///
/// # Errors
/// What does not fit.
pub(super) fn of_state(state: &TactileState, channel: Option<&str>, cells: &mut [f32]) -> Result<(), String> {
    let names = || state.sensors.iter().map(|sensor| sensor.name.as_str()).collect::<Vec<_>>().join("`, `");
    let sensor = match (channel, state.sensors.as_slice()) {
        (None, [only]) => only,
        (None, _) => return Err(format!("{} sensors, `{}`: name one with `channel`", state.sensors.len(), names())),
        (Some(name), sensors) => sensors
            .iter()
            .find(|sensor| sensor.name == name)
            .ok_or_else(|| format!("the sensors `{}`, and none is `{name}`", names()))?,
    };
    copy(&sensor.values, cells, "a sensor")
}

fn copy(data: &[f32], cells: &mut [f32], what: &str) -> Result<(), String> {
    if data.len() != cells.len() {
        return Err(format!("{what} of {} values, and not {}", data.len(), cells.len()));
    }
    cells.copy_from_slice(data);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::message::{Channel, Dimension, Layout};
    use super::*;

    fn picture(encoding: &str, step: u32, is_bigendian: u8, data: Vec<u8>) -> Picture {
        Picture { height: 2, width: 3, encoding: encoding.into(), is_bigendian, step, data, ..Picture::default() }
    }

    /// The pixels 1 to 6 in each encoding, with rows that are longer than their pixels.
    #[test]
    fn every_encoding_is_read_with_its_stride_and_its_endianness() {
        let values: Vec<f32> = (1..=6).map(|value| value as f32).collect();
        let mono8 = vec![1, 2, 3, 99, 4, 5, 6];
        let big: Vec<u8> = [1_u16, 2, 3, 99, 4, 5, 6].iter().flat_map(|value| value.to_be_bytes()).collect();
        let little: Vec<u8> = [1_u16, 2, 3, 4, 5, 6].iter().flat_map(|value| value.to_le_bytes()).collect();
        let float: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        for picture in [
            picture("mono8", 4, 0, mono8),
            picture("mono16", 8, 1, big),
            picture("16UC1", 6, 0, little),
            picture("32FC1", 12, 0, float),
        ] {
            let mut cells = [0.0; 6];
            of_picture(&picture, &mut cells, 3).unwrap();
            assert_eq!(cells, *values, "{}", picture.encoding);
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let mut cells = [0.0; 6];
        for (picture, why) in [
            (picture("rgb8", 9, 0, vec![0; 18]), "the encoding `rgb8`"),
            (picture("mono16", 3, 0, vec![0; 18]), "rows of 3"),
            (picture("mono8", 3, 0, vec![0; 5]), "of 5 bytes"),
            (picture("mono8", u32::MAX, 0, vec![0; 18]), "of 18 bytes"),
            (Picture { width: 0, ..picture("mono8", 3, 0, vec![]) }, "2x0 pixels"),
        ] {
            let said = of_picture(&picture, &mut cells, 3).unwrap_err();
            assert!(said.contains(why), "{said}");
        }
        let dim = |size| Dimension { size, ..Dimension::default() };
        let array = |sizes: &[u32], data_offset, count| Float32MultiArray {
            layout: Layout { dim: sizes.iter().copied().map(dim).collect(), data_offset },
            data: vec![0.5; count],
        };
        for (array, why) in [
            (array(&[3, 2], 0, 6), "[3, 2]"),
            (array(&[2, 3], 1, 6), "of 5 values"),
            (array(&[], 100, 6), "of 0 values"),
            (array(&[], 0, 7), "of 7 values"),
        ] {
            let said = of_array(&array, &mut cells, 3).unwrap_err();
            assert!(said.contains(why), "{said}");
        }
        of_array(&array(&[2, 3], 1, 7), &mut cells, 3).unwrap();
        assert_eq!(cells, [0.5; 6]);
    }

    #[test]
    fn a_channel_is_found_by_its_name() {
        let channel = |name: &str, value| Channel { name: name.into(), values: vec![value; 6] };
        let state = TactileState { sensors: vec![channel("palm", 1.0), channel("thumb", 2.0)], ..Default::default() };
        let mut cells = [0.0; 6];
        of_state(&state, Some("thumb"), &mut cells).unwrap();
        assert_eq!(cells, [2.0; 6]);
        let said = of_state(&state, None, &mut cells).unwrap_err();
        assert!(said.contains("2 sensors, `palm`, `thumb`"), "{said}");
        let said = of_state(&state, Some("finger"), &mut cells).unwrap_err();
        assert!(said.contains("none is `finger`"), "{said}");
    }
}
