//! `npy` and `npz`: arrays of numpy.
//!
//! An `.npy` is an array `[frames, rows, columns]` of integers or floats. One of `[frames, tactels]` needs the bench's
//! `size`. Rows run along the pad's x, with row i at the i-th y. A tactel that is NaN in the first frame does not exist,
//! and must be NaN in every frame. The bench gives unit, pitch and rate.
//!
//! An `.npz` may give them itself. The images are the array `images`, or the only array with three axes. It may also hold
//! `time` [s] and `force` [N] (one number a frame), `rate_hz` [1/s], `pitch_mm` [mm] or `pitch` [m] (one number, or
//! one along x and one along y) and `unit` (a text, as `np.array("N")`). Other arrays are ignored.

mod array;

#[cfg(test)]
mod tests;

use tactflow_runtime::signal::ImageShape;

use self::array::{Array, named};
use crate::recordings::common::reel::{Reel, bounded};
use crate::recordings::common::text::shortened;
use crate::recordings::common::zip::{self, Archive, File, MAX_UNPACKED_BYTES};
use crate::recordings::common::{Format, Frame, HEAD_BYTES, Hints, Recording, Refusal, units};

pub(super) const NPY: Format = Format {
    name: "npy",
    title: "a numpy array [frames, rows, columns] (`.npy`)",
    recognises: |head| head.bytes.starts_with(array::MAGIC),
    read: |bytes, hints| recording(NPY.name, bytes, &Beside::default(), hints),
};

pub(super) const NPZ: Format = Format {
    name: "npz",
    title: "numpy arrays `images`, `time`, `force`, … (`.npz`)",
    recognises: |head| is_npz(head.bytes),
    read: read_npz,
};

/// Whether the first file of a zip archive is an array.
pub(super) fn is_npz(head: &[u8]) -> bool {
    zip::first_name(head).is_some_and(|name| name.ends_with(b".npy"))
}

/// The arrays of an `.npz` other than the images.
#[derive(Default)]
struct Beside {
    time: Option<Vec<f64>>,
    force: Option<Vec<f64>>,
    rate_hz: Option<f64>,
    pitch: Option<[f64; 2]>,
    /// Name of the unit in the file.
    unit: Option<String>,
}

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
            Some(key @ ("time" | "force" | "rate_hz" | "pitch_mm" | "pitch" | "unit")) => {
                let bytes = unpack(&archive, &file)?;
                let taken = Array::read(&bytes).and_then(|array| beside.take(key, &array));
                taken.map_err(|message| Refusal::broken(format!("`{key}`: {message}")))?;
            }
            Some(_) if cubes.len() < 2 && has_three_axes(&archive, &file)? => cubes.push(file),
            _ => {}
        }
    }
    let images = match (&images, &*cubes) {
        (Some(images), _) | (None, [images]) => images,
        (None, others) => {
            let count = if others.is_empty() { "none" } else { "more than one" };
            return Err(Refusal::Broken {
                message: format!("no array is called `images`, and {count} of the others has three axes"),
                help: Some("save the frames as `images`, with the axes [frames, rows, columns]".into()),
            });
        }
    };
    recording(NPZ.name, &unpack(&archive, images)?, &beside, hints)
}

fn unpack(archive: &Archive<'_>, file: &File<'_>) -> Result<Vec<u8>, Refusal> {
    let (mut out, mut source, name) = (Vec::new(), archive.open(file)?, zip::name(file));
    if !zip::read(&mut *source, &name, HEAD_BYTES as u64, &mut out)? {
        Array::begin(&out).map_err(|message| Refusal::broken(format!("`{name}`: {message}")))?;
        if !zip::read(&mut *source, &name, MAX_UNPACKED_BYTES, &mut out)? {
            return Err(Refusal::broken(format!("`{name}` is more than {} MiB", MAX_UNPACKED_BYTES >> 20)));
        }
    }
    Ok(out)
}

fn has_three_axes(archive: &Archive<'_>, file: &File<'_>) -> Result<bool, Refusal> {
    let mut head = Vec::new();
    zip::read(&mut *archive.open(file)?, &zip::name(file), 4096, &mut head)?;
    Ok(Array::begin(&head).is_ok_and(|array| array.shape.len() == 3))
}

impl Beside {
    fn take(&mut self, key: &str, array: &Array<'_>) -> Result<(), String> {
        if key == "unit" {
            self.unit = Some(array.text().ok_or("expected a single text")?);
            return Ok(());
        }
        let numbers = array.numbers().ok_or("expected numbers along at most one axis")?;
        if let Some(wrong) = numbers.clone().find(|number| !number.is_finite()) {
            return Err(format!("`{wrong}` is not finite"));
        }
        let one = || match (numbers.clone().next(), numbers.len()) {
            (Some(number), 1) if number > 0.0 => Ok(number),
            _ => Err("expected a single number greater than 0".to_owned()),
        };
        match key {
            "time" => self.time = Some(numbers.collect()),
            "force" => self.force = Some(numbers.collect()),
            "rate_hz" => self.rate_hz = Some(one()?),
            _ => {
                let metres = if key == "pitch" { 1.0 } else { 1e-3 };
                let pitch: Vec<f64> = numbers.take(3).map(|pitch| pitch * metres).collect();
                self.pitch = Some(match *pitch {
                    [both] if both > 0.0 => [both; 2],
                    [x, y] if x > 0.0 && y > 0.0 => [x, y],
                    _ => return Err("expected one or two numbers greater than 0".into()),
                });
            }
        }
        Ok(())
    }
}

fn recording(format: &'static str, file: &[u8], beside: &Beside, hints: &Hints) -> Result<Recording, Refusal> {
    let array = Array::read(file).map_err(Refusal::broken)?;
    let [count, rows, cols] = axes(&array, hints)?;
    for (name, numbers) in [("time", &beside.time), ("force", &beside.force)] {
        if let Some(found) = numbers.as_ref().map(Vec::len).filter(|found| *found != count) {
            return Err(Refusal::broken(format!("`{name}` has {found} numbers, but there are {count} frames")));
        }
    }
    let known = |name: &String| units::unit(name).ok_or_else(|| format!("`unit`: `{}` is unknown", shortened(name)));
    let (unit, factor) = beside.unit.as_ref().map(known).transpose().map_err(Refusal::broken)?.unzip();
    let mut reel = Reel::default();
    reel.frames.reserve_exact(count);
    reel.cells.reserve_exact(array.len());
    fill(&mut reel, &array, [count, rows, cols], factor.unwrap_or(1.0)).map_err(Refusal::broken)?;
    if let Some(time) = &beside.time {
        stamp(&mut reel.frames, time).map_err(Refusal::broken)?;
    }
    let found = reel.mean_step().or(beside.rate_hz.map(|rate| 1.0 / rate));
    let (unit, pitch, period) = hints.complete(unit, beside.pitch, found)?;
    if beside.time.is_none() {
        reel.tick(period);
    }
    let shape = ImageShape { rows, cols, pitch, unit };
    let (Reel { frames, cells, dead }, force) = (reel, beside.force.clone());
    Ok(Recording { format, shape, frames, cells, dead, threshold: None, period, force })
}

/// Returns the number of frames, rows and columns.
fn axes(array: &Array<'_>, hints: &Hints) -> Result<[usize; 3], Refusal> {
    if !array.is_number() {
        return Err(Refusal::broken("the elements of the array are not numbers"));
    }
    let [count, rows, cols] = match *array.shape {
        [count, rows, cols] => {
            hints.size(Some([rows, cols]))?;
            [count, rows, cols]
        }
        [count, tactels] => {
            let [rows, cols] = hints.size(None)?;
            if rows.checked_mul(cols) != Some(tactels) {
                let message =
                    format!("a row of the array has {tactels} numbers, not those of {rows} by {cols} tactels");
                return Err(Refusal::Contradicted { hint: "size", message });
            }
            [count, rows, cols]
        }
        _ => {
            let message = format!("expected an array [frames, rows, columns], found {}", named(&array.shape));
            return Err(Refusal::broken(message));
        }
    };
    bounded(rows, cols).map_err(Refusal::broken)?;
    if count == 0 {
        return Err(Refusal::broken("the array has no frame"));
    }
    // A frame in memory must not be many times larger than in the file.
    let bytes = rows * cols * array.width;
    if size_of::<Frame>() + 4 * rows * cols > 9 * bytes {
        let help = Some("save the array with larger numbers, as `float64`".into());
        return Err(Refusal::Broken { message: format!("frames of {bytes} bytes are too small"), help });
    }
    Ok([count, rows, cols])
}

fn fill(reel: &mut Reel, array: &Array<'_>, [count, rows, cols]: [usize; 3], factor: f64) -> Result<(), String> {
    let is_flat = array.shape.len() == 2;
    for frame in 0..count {
        for tactel in 0..rows * cols {
            let (row, col) = (tactel / cols, tactel % cols);
            let place = if is_flat { array.place(&[frame, tactel]) } else { array.place(&[frame, row, col]) };
            let value = array.number(place) * factor;
            reel.cell(tactel, value)
                .map_err(|message| format!("frame {frame}, row {row}, column {col}: {message}: `{value:?}`"))?;
        }
        reel.frame(frame as u64, 0, rows, cols);
    }
    Ok(())
}

/// Sets the times of the frames, counted from the first.
fn stamp(frames: &mut [Frame], time: &[f64]) -> Result<(), String> {
    let start = time.first().copied().unwrap_or(0.0);
    let mut last = 0;
    for (i, (frame, time)) in frames.iter_mut().zip(time).enumerate() {
        let since = time - start;
        if !(0.0..1e9).contains(&since) {
            return Err(format!("`time`: frame {i} at {time} s is not from 0 to 1e9 s after the first"));
        }
        frame.time = (since * 1e9).round() as i64;
        if frame.time < last {
            return Err(format!("`time`: the time goes back at frame {i}"));
        }
        last = frame.time;
    }
    Ok(())
}
