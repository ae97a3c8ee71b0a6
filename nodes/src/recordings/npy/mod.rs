//! `npy` and `npz`: arrays of numpy.
//!
//! An `.npy` is an array `[frames, rows, columns]` of integers or floats. One of `[frames, tactels]` needs the bench's
//! `size`. One of `[frames, rows, columns, 3]` is of a pad with three axes: x, y and z of each tactel, where x and y drag
//! it and z presses it. Rows run along the pad's x, with row i at the i-th y. A tactel that is NaN in the first frame does not
//! exist, and must be NaN in every frame. The bench gives unit, pitch and rate.
//!
//! An `.npz` may give them itself. The images are the array `images`, or the only array with such a shape. It may also
//! hold `time` [s] and `force` [N] (one number a frame), `rate_hz` [1/s], `pitch_mm` [mm] or `pitch` [m] (one number,
//! or one along x and one along y) and `unit` (a text, as `np.array("N")`). Other arrays are ignored.

mod array;

#[cfg(test)]
mod tests;

use self::array::{Array, named};
use crate::recordings::common::reel::{Properties, Reel, bounded};
use crate::recordings::common::text::shortened;
use crate::recordings::common::zip::{self, Archive, MAX_UNPACKED_BYTES, ZipFile};
use crate::recordings::common::{FileFormat, Frame, HEAD_BYTES, Hints, Parser, Recording, Refusal, Window, units};

pub(super) const NPY: FileFormat = FileFormat {
    name: "npy",
    title: "a numpy array [frames, rows, columns], or [frames, rows, columns, 3] (`.npy`)",
    recognises: |head| head.bytes.starts_with(array::MAGIC),
    parser: Parser::Bytes(|bytes, hints| recording(NPY.name, bytes, Beside::default(), hints)),
};

pub(super) const NPZ: FileFormat = FileFormat {
    name: "npz",
    title: "numpy arrays `images`, `time`, `force`, … (`.npz`)",
    recognises: |head| is_npz(head.bytes),
    parser: Parser::Bytes(read_npz),
};

/// Whether the first file of a zip archive is an array.
pub(super) fn is_npz(head: &[u8]) -> bool {
    zip::first_name(head).is_some_and(|name| name.ends_with(b".npy"))
}

/// The arrays of an `.npz` other than the images.
#[derive(Default)]
struct Beside {
    time: Option<Vec<f64>>,
    found: Properties,
}

/// Names of the arrays that an `.npz` may hold beside the images.
const KEYS: [&str; 6] = ["time", "force", "rate_hz", "pitch_mm", "pitch", "unit"];

fn read_npz(bytes: &[u8], hints: &Hints) -> Result<Recording, Refusal> {
    let archive = Archive::new(bytes)?;
    let mut beside = Beside::default();
    let mut images = None;
    let mut cubes = Vec::new();
    for file in archive.files() {
        let file = file?;
        let name = zip::name(&file);
        match name.strip_suffix(".npy") {
            Some("images") => images = Some(file),
            Some(key) if KEYS.contains(&key) => {
                let bytes = unpack(&archive, &file)?;
                let taken = Array::read(&bytes).and_then(|array| beside.take(key, &array));
                taken.map_err(|message| Refusal::broken(format!("`{key}`: {message}")))?;
            }
            Some(_) if cubes.len() < 2 && has_images(&archive, &file)? => cubes.push(file),
            _ => {}
        }
    }
    let count = if cubes.is_empty() { "none" } else { "more than one" };
    let images = images.or_else(|| cubes.pop().filter(|_| cubes.is_empty())).ok_or_else(|| Refusal::Broken {
        message: format!("no array is called `images`, and {count} of the others has the axes of images"),
        help: Some("save the frames as `images`, with the axes [frames, rows, columns]".into()),
    })?;
    recording(NPZ.name, &unpack(&archive, &images)?, beside, hints)
}

fn unpack(archive: &Archive<'_>, file: &ZipFile<'_>) -> Result<Vec<u8>, Refusal> {
    let (mut out, mut source, name) = (Vec::new(), archive.open(file)?, zip::name(file));
    if !zip::read(&mut *source, &name, HEAD_BYTES as u64, &mut out)? {
        Array::begin(&out).map_err(|message| Refusal::broken(format!("`{name}`: {message}")))?;
        if !zip::read(&mut *source, &name, MAX_UNPACKED_BYTES, &mut out)? {
            return Err(Refusal::broken(format!("`{name}` is more than {} MiB", MAX_UNPACKED_BYTES >> 20)));
        }
    }
    Ok(out)
}

/// Whether a file has the axes of images, or of vector images.
fn has_images(archive: &Archive<'_>, file: &ZipFile<'_>) -> Result<bool, Refusal> {
    let mut head = Vec::new();
    zip::read(&mut *archive.open(file)?, &zip::name(file), 4096, &mut head)?;
    Ok(Array::begin(&head).is_ok_and(|array| matches!(array.shape[..], [_, _, _] | [_, _, _, 3])))
}

impl Beside {
    fn take(&mut self, key: &str, array: &Array<'_>) -> Result<(), String> {
        if key == "unit" {
            let name = array.text().ok_or("expected a single text")?;
            let unit = units::unit(&name).ok_or_else(|| format!("`{}` is unknown", shortened(&name)))?;
            self.found.unit = Some(unit);
            return Ok(());
        }
        let numbers = array.numbers().ok_or("expected numbers along at most one axis")?;
        if let Some(wrong) = numbers.clone().find(|number| !number.is_finite()) {
            return Err(format!("`{wrong}` is not finite"));
        }
        let few: Vec<f64> = numbers.clone().take(3).collect();
        match (key, &*few) {
            ("time", _) => self.time = Some(numbers.collect()),
            ("force", _) => self.found.force = Some(numbers.collect()),
            ("rate_hz", [rate]) if *rate > 0.0 => self.found.period = Some(1.0 / rate),
            ("rate_hz", _) => return Err("expected a single number greater than 0".into()),
            (_, [x] | [x, _]) if few.iter().all(|pitch| *pitch > 0.0) => {
                let metres = if key == "pitch" { 1.0 } else { 1e-3 };
                self.found.pitch = Some([x * metres, few[few.len() - 1] * metres]);
            }
            _ => return Err("expected one or two numbers greater than 0".into()),
        }
        Ok(())
    }
}

fn recording(format: &'static str, file: &[u8], beside: Beside, hints: &Hints) -> Result<Recording, Refusal> {
    let array = Array::read(file).map_err(Refusal::broken)?;
    let axes @ [count, rows, cols] = axes(&array, hints)?;
    let Beside { time, mut found } = beside;
    for (name, numbers) in [("time", &time), ("force", &found.force)] {
        if let Some(found) = numbers.as_ref().map(Vec::len).filter(|found| *found != count) {
            return Err(Refusal::broken(format!("`{name}` has {found} numbers, but there are {count} frames")));
        }
    }
    let mut reel = Reel::default();
    reel.frames.reserve_exact(count);
    reel.cells.reserve_exact(count * rows * cols);
    fill(&mut reel, &array, axes, found.factor(), time.as_deref()).map_err(Refusal::broken)?;
    found.size = Some([rows, cols]);
    found.period = reel.mean_step().or(found.period);
    reel.finish(format, found, hints)
}

/// Returns the number of frames, rows and columns.
fn axes(array: &Array<'_>, hints: &Hints) -> Result<[usize; 3], Refusal> {
    if !array.is_number() {
        return Err(Refusal::broken("the elements of the array are not numbers"));
    }
    let [count, rows, cols] = match *array.shape {
        [count, rows, cols] | [count, rows, cols, 3] => [count, rows, cols],
        [count, tactels] => {
            let [rows, cols] = hints.size(None)?;
            if rows.checked_mul(cols) != Some(tactels) {
                let message =
                    format!("a frame of the array has {tactels} numbers, which is not {rows} by {cols} tactels");
                return Err(Refusal::Contradicted { hint: "size", message });
            }
            [count, rows, cols]
        }
        _ => {
            let message = format!(
                "expected an array [frames, rows, columns], or [frames, rows, columns, 3], found {}",
                named(&array.shape)
            );
            return Err(Refusal::broken(message));
        }
    };
    hints.size(Some([rows, cols]))?;
    bounded(rows, cols).map_err(Refusal::broken)?;
    if count == 0 {
        return Err(Refusal::broken("the array has no frame"));
    }
    // A frame in memory must not be many times larger than in the file.
    let bytes = array.len() / count * array.width;
    if size_of::<Frame>() + 4 * array.len() / count > 9 * bytes {
        let help = Some("save the array with larger numbers, as `float64`".into());
        return Err(Refusal::Broken { message: format!("frames of {bytes} bytes are too small"), help });
    }
    Ok([count, rows, cols])
}

fn fill(
    reel: &mut Reel,
    array: &Array<'_>,
    [count, rows, cols]: [usize; 3],
    factor: f64,
    times: Option<&[f64]>,
) -> Result<(), String> {
    let axes = array.shape.len();
    for frame in 0..count {
        for tactel in 0..rows * cols {
            let (row, col) = (tactel / cols, tactel % cols);
            let value = |index: &[usize]| array.number(array.place(index)) * factor;
            let z = match axes {
                2 => value(&[frame, tactel]),
                3 => value(&[frame, row, col]),
                _ => value(&[frame, row, col, 2]),
            };
            let wrong =
                |message: &str, value: f64| format!("frame {frame}, row {row}, column {col}: {message}: `{value:?}`");
            reel.cell(z).map_err(|message| wrong(message, z))?;
            if axes == 4 {
                // A tactel that does not exist has no drag.
                let drag = [0, 1].map(|axis| if z.is_nan() { 0.0 } else { value(&[frame, row, col, axis]) });
                if let Some(value) = drag.into_iter().find(|value| !(*value as f32).is_finite()) {
                    return Err(wrong("its x or y is not finite", value));
                }
                reel.drag.push(drag.map(|value| value as f32));
            }
        }
        let time = times.map(|times| since_start(times, frame)).transpose()?;
        if reel.frames.last().is_some_and(|last| time.is_some_and(|time| time < last.time)) {
            return Err(format!("`time`: the time goes back at frame {frame}"));
        }
        reel.frame(frame as u64, time, Window::whole(rows, cols));
    }
    Ok(())
}

/// Returns the time of a frame since the first [ns].
fn since_start(times: &[f64], frame: usize) -> Result<i64, String> {
    let since = times[frame] - times[0];
    if !(0.0..1e9).contains(&since) {
        let time = times[frame];
        return Err(format!("`time`: frame {frame} at {time} s is not from 0 to 1e9 s after the first"));
    }
    Ok((since * 1e9).round() as i64)
}
