//! Exports a recording as CSV, or with its images as an archive of numpy arrays.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use rawzip::ZipArchiveWriter;
use serde_json::{Map, Value, json};

use super::channels::LOST;
use super::compare::{grid_fields, grid_values};
use super::reader::Recording;
use super::table::{Table, lost_port};
use crate::record::{RecordFormat, file_seconds, mode_line};

/// What was exported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exported {
    /// Number of ticks.
    pub ticks: u64,
    /// Number of columns, without the time.
    pub columns: usize,
    /// Number of ports with images.
    pub images: usize,
}

/// Writes a recording as .csv or .npz, by the name of the file.
///
/// # Errors
/// If the recording cannot be read, the file cannot be written, or its name has another ending.
pub fn export(from: &Path, to: &Path) -> Result<Exported, String> {
    let cannot = |error: io::Error| format!("cannot write `{}`: {error}", to.display());
    let recording = Recording::open(from)?;
    let create = || File::create(to).map(BufWriter::new).map_err(cannot);
    match to.extension().and_then(|extension| extension.to_str()) {
        Some("csv") => csv(recording, &mut create()?, &cannot),
        Some("npz") => npz(from, recording, create()?, &cannot),
        _ => Err(format!("`{}` does not end in .csv or .npz: write for example `run.npz`", to.display())),
    }
}

/// Writes one row per tick, with the lines of `run --out` and comments on the run after those with the units.
fn csv(
    mut recording: Recording,
    out: &mut impl Write,
    cannot: &dyn Fn(io::Error) -> String,
) -> Result<Exported, String> {
    let format = RecordFormat::Csv.rows(false);
    let mut table = Table::new(&recording);
    let mut text = Vec::new();
    format.header(&table.columns, &comments(&recording), &mut text).map_err(cannot)?;
    let (mut ticks, mut row) = (0, vec![0.0; table.columns.len() + 1]);
    while let Some(tick) = recording.next_tick()? {
        let time = table.add(&recording, &tick);
        row[0] = f64::from_bits(time as u64);
        row[1..].copy_from_slice(&table.row);
        format.row(&table.columns, &row, &mut text).map_err(cannot)?;
        out.write_all(&text).map_err(cannot)?;
        text.clear();
        ticks += 1;
    }
    out.write_all(&text).and_then(|()| out.flush()).map_err(cannot)?;
    Ok(Exported { ticks, columns: table.columns.len(), images: 0 })
}

/// Returns lines about the run.
fn comments(recording: &Recording) -> Vec<String> {
    let about = recording.about();
    let mut lines = vec![format!("tactflow {}, graph {}, hash {}", about.tactflow, about.graph.display(), about.hash)];
    lines.extend(about.seed.map(|seed| format!("seed {seed}")));
    let modes = recording.modes();
    lines.extend(modes.iter().filter_map(|(task, modes)| mode_line(task, modes.iter().map(String::as_str))));
    lines
}

/// Writes an array for each column, one for the images of each port, and one text with everything else.
fn npz(
    from: &Path,
    mut recording: Recording,
    out: BufWriter<File>,
    cannot: &dyn Fn(io::Error) -> String,
) -> Result<Exported, String> {
    let mut archive = ZipArchiveWriter::new(out);
    let mut table = Table::new(&recording);
    let (mut times, mut columns) = (Vec::new(), vec![Vec::new(); table.columns.len()]);
    while let Some(tick) = recording.next_tick()? {
        times.push(file_seconds(table.add(&recording, &tick)));
        columns.iter_mut().zip(&table.row).for_each(|(column, value)| column.push(*value));
    }
    let ticks = times.len();
    let mut array = |name: &str, values: &[f64]| {
        let header = npy_header("<f8", &[ticks]);
        add(&mut archive, name, |file| {
            file.write_all(&header)?;
            values.iter().try_for_each(|value| file.write_all(&value.to_le_bytes()))
        })
    };
    array("time", &times).map_err(cannot)?;
    for (column, values) in table.columns.iter().zip(&columns) {
        array(&column.name, values).map_err(cannot)?;
    }
    let text = about(&recording, &table).to_string();
    let characters: Vec<u32> = text.chars().map(u32::from).collect();
    let header = npy_header(&format!("<U{}", characters.len()), &[]);
    let about = |file: &mut dyn Write| {
        file.write_all(&header)?;
        characters.iter().try_for_each(|character| file.write_all(&character.to_le_bytes()))
    };
    add(&mut archive, "about", about).map_err(cannot)?;
    let images: Vec<u16> =
        recording.channels().iter().filter(|(_, channel)| channel.is_image()).map(|(id, _)| *id).collect();
    for image in &images {
        add_images(&mut archive, from, *image, ticks, cannot)?;
    }
    archive.finish().map_err(|error| cannot(io::Error::other(error)))?.flush().map_err(cannot)?;
    Ok(Exported { ticks: ticks as u64, columns: table.columns.len(), images: images.len() })
}

/// Describes the run, the units and the modes as JSON.
fn about(recording: &Recording, table: &Table) -> Value {
    let about = recording.about();
    let images = recording.channels().values().filter(|channel| channel.is_image());
    let images = images
        .filter_map(|image| Some((image.port.clone()?, image.units.first().map_or("1", |(_, unit)| unit).into())));
    let columns = table.columns.iter().map(|column| (column.name.clone(), Value::from(column.unit.to_string())));
    let units: Map<String, Value> = columns.chain(images).chain([("time".to_owned(), "s".into())]).collect();
    let modes: Map<String, Value> = recording.modes().into_iter().map(|(task, modes)| (task, modes.into())).collect();
    json!({
        "version": about.tactflow, "graph": about.graph, "hash": about.hash, "seed": about.seed,
        "set": about.set, "units": units, "modes": modes,
    })
}

/// Adds the images of a port: ticks by rows by columns, and by 3 for a vector image. They are read from the file once more, so that they need not fit
/// into memory.
fn add_images(
    archive: &mut ZipArchiveWriter<BufWriter<File>>,
    from: &Path,
    channel: u16,
    ticks: usize,
    cannot: &dyn Fn(io::Error) -> String,
) -> Result<(), String> {
    let mut recording = Recording::open(from)?;
    let name = recording.channels().get(&channel).map_or_else(String::new, |channel| channel.name().to_owned());
    let (mut size, mut last, mut failure) = (None, Vec::new(), None);
    let mut open = Recording::open(from)?;
    // The size is that of the first image.
    while let Some(tick) = open.next_tick()?.filter(|_| size.is_none()) {
        size = tick.messages.iter().find(|(id, ..)| *id == channel).and_then(|(.., data)| grid_size(data));
    }
    let size = size.unwrap_or(vec![0, 0]);
    last.resize(size.iter().product(), f32::NAN);
    let header = npy_header("<f4", &[&[ticks], &size[..]].concat());
    let write = |file: &mut dyn Write| {
        file.write_all(&header)?;
        for _ in 0..ticks {
            match recording.next_tick() {
                Ok(Some(tick)) => update(&recording, &tick, (channel, &name), &mut last),
                Ok(None) => {}
                Err(message) => failure = Some(message),
            }
            last.iter().try_for_each(|value| file.write_all(&value.to_le_bytes()))?;
        }
        Ok(())
    };
    add(archive, &name, write).map_err(cannot)?;
    failure.map_or(Ok(()), Err)
}

/// Takes over the image of a tick.
fn update(recording: &Recording, tick: &super::reader::RecordedTick, (channel, name): (u16, &str), last: &mut [f32]) {
    for (id, _, data) in &tick.messages {
        let is_lost = || recording.channels().get(id).is_some_and(|known| known.topic == LOST);
        if *id == channel {
            let message = serde_json::from_slice::<Map<String, Value>>(data).unwrap_or_default();
            let values = grid_values(&message).filter(|values| values.len() == last.len());
            values.into_iter().for_each(|values| last.copy_from_slice(&values));
        } else if is_lost() && lost_port(data).as_deref() == Some(name) {
            last.fill(f32::NAN);
        }
    }
}

/// Returns the rows and columns of a grid, and the fields of a cell if it has several.
fn grid_size(data: &[u8]) -> Option<Vec<usize>> {
    let message: Map<String, Value> = serde_json::from_slice(data).ok()?;
    let columns = message.get("column_count")?.as_u64()? as usize;
    let fields = grid_fields(&message);
    let rows = grid_values(&message)?.len().checked_div(columns * fields)?;
    Some([&[rows, columns], &[fields][..usize::from(fields > 1)]].concat())
}

/// Adds a file to an archive.
fn add(
    archive: &mut ZipArchiveWriter<BufWriter<File>>,
    name: &str,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let name = format!("{name}.npy");
    let (mut entry, config) = archive.new_file(name.as_str()).start().map_err(io::Error::other)?;
    let mut file = config.wrap(&mut entry);
    write(&mut file)?;
    let (_, descriptor) = file.finish().map_err(io::Error::other)?;
    entry.finish(descriptor).map_err(io::Error::other)?;
    Ok(())
}

/// Returns the header of a numpy array, format 1.0.
fn npy_header(descr: &str, shape: &[usize]) -> Vec<u8> {
    let sizes: String = shape.iter().map(|size| format!("{size}, ")).collect();
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}), }}", sizes.trim_end());
    // The header ends with a line feed at a multiple of 64 bytes, of which 10 stand before the text.
    while (text.len() + 11) % 64 != 0 {
        text.push(' ');
    }
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend_from_slice(&(text.len() as u16).to_le_bytes());
    header.extend_from_slice(text.as_bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_of_an_array_is_that_of_numpy() {
        let header = npy_header("<f8", &[3, 2]);
        assert_eq!(header.len() % 64, 0);
        assert_eq!(&header[10..61], b"{'descr': '<f8', 'fortran_order': False, 'shape': (");
        assert!(header[61..].starts_with(b"3, 2,), }") && header.ends_with(b"\n"));
        assert!(String::from_utf8_lossy(&npy_header("<U5", &[])[10..]).contains("'shape': (), }"));
    }
}
