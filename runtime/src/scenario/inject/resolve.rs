//! Checks the faults of a scenario with its task on its bench: their roles, their cells and their units.

use super::table::{Cells, InjectBlock, InjectTable};
use crate::graph::{Compiled, into_diagnostic};
use crate::signal::{ImageShape, Shape};
use crate::source::{Code, Diagnostic, quoted};

/// A checked fault, and the image that it spoils.
#[derive(Debug, Clone)]
pub(crate) struct Injection {
    /// Index of the device.
    pub(super) device: usize,
    /// Index of the output among those of the device.
    pub(super) port: usize,
    /// Shape of the image.
    pub(super) shape: ImageShape,
    /// The fault. Its numbers are in the unit of the image.
    pub(super) table: InjectTable,
}

/// Resolves the faults of a scenario. Mistakes are added to `found`.
pub(crate) fn resolve(blocks: &[InjectBlock], compiled: &Compiled, found: &mut Vec<Diagnostic>) -> Vec<Injection> {
    let tables = blocks.iter().filter_map(|block| block.table.clone());
    tables.filter_map(|table| one(table, compiled).map_err(|diagnostic| found.push(*diagnostic)).ok()).collect()
}

fn one(mut table: InjectTable, compiled: &Compiled) -> Result<Injection, Box<Diagnostic>> {
    let images = compiled.plan.roles.iter().flat_map(|role| {
        let ports = role.ports.iter().zip(&role.numbers);
        ports.filter_map(move |(port, number)| match &port.shape {
            Shape::Image(shape) => Some((role, *number, shape)),
            _ => None,
        })
    });
    let name = &table.role.value;
    let Some((role, port, shape)) = images.clone().find(|(role, ..)| role.name == *name) else {
        let names: Vec<&str> = images.map(|(role, ..)| role.name.as_str()).collect();
        return Err(wrong_role(&table, compiled, &names).into());
    };
    let (device, port, shape) = (role.device, port, shape.clone());
    if let Some(cells) = &table.cells
        && let Some(message) = outside(&cells.value, &shape)
    {
        let help = "rows and columns count from 0, in the image of the device";
        return Err(Diagnostic::new(Code::BadValue, cells.span.clone(), message).help(help).into());
    }
    if let Some(reading) = &mut table.reading {
        reading.settle(Some(shape.unit), &mut Vec::new()).map_err(into_diagnostic)?;
    }
    Ok(Injection { device, port, shape, table })
}

/// Reports a role that does not exist, or that has no image.
fn wrong_role(table: &InjectTable, compiled: &Compiled, images: &[&str]) -> Diagnostic {
    let (name, span) = (&table.role.value, &table.role.span);
    let exists = compiled.plan.roles.iter().any(|role| role.name == *name);
    if exists || images.is_empty() {
        let message = if exists {
            format!("the role `{name}` has no image, and faults spoil images")
        } else {
            format!("there is no role `{name}`, and no role of this task has an image to spoil")
        };
        let help = if images.is_empty() {
            "remove this fault".to_owned()
        } else {
            format!("roles with an image: {}", quoted(images.iter().copied()))
        };
        return Diagnostic::new(Code::WrongRole, span.clone(), message).help(help);
    }
    Diagnostic::new(Code::WrongRole, span.clone(), format!("there is no role `{name}` in this task")).suggest(
        name,
        images.iter().copied(),
        "roles with an image",
    )
}

/// Returns what is wrong with cells that an image does not have.
fn outside(cells: &Cells, shape: &ImageShape) -> Option<String> {
    let ImageShape { rows, cols, .. } = shape;
    match cells {
        Cells::Count(count) if *count > rows * cols => {
            Some(format!("{count} cells are more than the {} of the image", rows * cols))
        }
        Cells::Count(_) => None,
        Cells::List(list) => list
            .iter()
            .find(|[i, j]| i >= rows || j >= cols)
            .map(|[i, j]| format!("cell [{i}, {j}] is outside the image of {rows} rows by {cols} columns")),
    }
}
