//! The images of one pad in a recording, so that another graph or a calibration can use them.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use super::compare::grid_values;
use super::reader::Recording;
use super::table::Table;
use crate::signal::{ImageShape, Shape, Unit};

/// The images of a role in a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedPad {
    /// Size, pitch and unit of the images.
    pub shape: ImageShape,
    /// The time of the sample \[ns\] and the cells of each image, row by row.
    pub images: Vec<(i64, Vec<f32>)>,
    /// The value of another port in the tick of each image; NaN where it is absent.
    pub beside: Option<Vec<f64>>,
    /// The facts that every device with such images states.
    pub facts: toml::Table,
}

/// Why the images cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PadError {
    /// The file cannot be read.
    Broken(String),
    /// No role, or several, and none was named: the roles with images.
    Unnamed(Vec<String>),
    /// No role of that name has images: the roles that have.
    Unknown(Vec<String>),
    /// There is no such column beside the images.
    NoColumn(String),
}

impl RecordedPad {
    /// Reads the images of the role `role`, or of the only one with images, from the bytes of a recording. `beside` is the
    /// name of a column, whose values are read too.
    ///
    /// # Errors
    /// If there are no such images, no such column, or the recording is damaged.
    pub fn read(bytes: &[u8], role: Option<&str>, beside: Option<&str>) -> Result<Self, PadError> {
        let mut recording = Recording::of_bytes(bytes.to_vec()).map_err(PadError::Broken)?;
        let roles = recording.contents().roles();
        let images = recording.channels().iter().filter(|(_, channel)| channel.kind == "image");
        let with_role = images.filter_map(|(id, channel)| {
            let (role, "image") = channel.port.as_deref()?.split_once('.')? else { return None };
            roles.contains(role).then(|| (role.to_owned(), *id))
        });
        let found: Vec<(String, u16)> = with_role.collect();
        let names = || found.iter().map(|(role, _)| role.clone()).collect();
        let (_, channel) = match (role, &found[..]) {
            (Some(role), _) => found.iter().find(|(own, _)| own == role).ok_or_else(|| PadError::Unknown(names()))?,
            (None, [only]) => only,
            (None, _) => return Err(PadError::Unnamed(names())),
        };
        let channel = *channel;
        let mut table = Table::new(&recording);
        let column = beside.map(|name| {
            let place = table.columns.iter().position(|column| column.name == name);
            place.ok_or_else(|| PadError::NoColumn(name.to_owned()))
        });
        let column = column.transpose()?;
        let unit = recording.channels()[&channel].units.first().and_then(|(_, unit)| unit.parse().ok());
        let mut pad = Self {
            shape: ImageShape { unit: unit.unwrap_or(Unit::RAW), ..ImageShape::default() },
            images: Vec::new(),
            beside: column.map(|_| Vec::new()),
            facts: toml::Table::new(),
        };
        while let Some(tick) = recording.next_tick().map_err(PadError::Broken)? {
            table.add(&recording, &tick);
            for (_, stamp, data) in tick.messages.iter().filter(|(id, ..)| *id == channel) {
                pad.add(*stamp as i64, data).map_err(PadError::Broken)?;
                if let (Some(values), Some(column)) = (&mut pad.beside, column) {
                    values.push(table.row[column]);
                }
            }
        }
        pad.facts = recording.contents().facts_of_images(&pad.shape);
        Ok(pad)
    }

    /// Adds an image.
    fn add(&mut self, stamp: i64, data: &[u8]) -> Result<(), String> {
        let damaged = || "an image in it is damaged".to_owned();
        let message: Map<String, Value> = serde_json::from_slice(data).map_err(|_| damaged())?;
        let cells = grid_values(&message).ok_or_else(damaged)?;
        let cols = message.get("column_count").and_then(Value::as_u64).unwrap_or(0) as usize;
        let rows = cells.len().checked_div(cols).unwrap_or(0);
        let pitch = ["x", "y"].map(|axis| message.get("cell_size").and_then(|size| size[axis].as_f64()).unwrap_or(0.0));
        let shape = ImageShape { rows, cols, pitch, unit: self.shape.unit };
        if rows * cols != cells.len() || cells.is_empty() || (!self.images.is_empty() && shape != self.shape) {
            return Err(damaged());
        }
        self.shape = shape;
        self.images.push((stamp, cells));
        Ok(())
    }
}

impl super::about::Contents {
    /// Returns the names of the roles of the graph that ran.
    fn roles(&self) -> BTreeSet<String> {
        let text = self.files.get(&self.about.graph).map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        let graph: Option<toml::Table> = text.and_then(|text| toml::from_str(&text).ok());
        let roles = graph.and_then(|graph| graph.get("roles")?.as_table().cloned());
        roles.into_iter().flatten().map(|(name, _)| name).collect()
    }

    /// Returns the facts of the devices with such images, as far as all of them state the same.
    fn facts_of_images(&self, shape: &ImageShape) -> toml::Table {
        let of_image = Shape::from(shape.clone());
        let mut facts: Option<toml::Table> = None;
        for own in self.devices.iter().flat_map(|device| device.facts_of(&of_image)) {
            match &mut facts {
                None => facts = Some(own),
                Some(facts) => facts.retain(|name, value| own.get(name) == Some(value)),
            }
        }
        facts.unwrap_or_default()
    }
}
