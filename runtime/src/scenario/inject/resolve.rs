//! Checks the faults of a scenario with its task on its bench: their roles, their cells, their joints and their units.

use super::table::{Cells, InjectTable, Spoils};
use crate::device::{Disturbance, Driver};
use crate::graph::{Compiled, into_diagnostic};
use crate::signal::{ImageShape, Shape, VectorImageShape};
use crate::source::{Code, Diagnostic, quoted};

/// A checked fault, and what it spoils.
#[derive(Debug, Clone)]
pub(crate) struct Injection {
    /// Index of the device.
    pub(super) device: usize,
    pub(super) target: Target,
    /// The fault. Its numbers are in the unit of the image.
    pub(super) table: InjectTable,
}

/// What a fault spoils.
#[derive(Debug, Clone)]
pub(super) enum Target {
    /// An image: the index of the output among those of the device, that of the vector image of the same tactels if there
    /// is one, and the shape.
    Image(usize, Option<usize>, ImageShape),
    /// A command: its index among those of the device, and the indices of the joints that stop.
    Command(usize, Vec<usize>),
    /// The world that the device simulates.
    World,
}

/// Resolves the faults of a scenario. Mistakes are added to `found`.
pub(crate) fn resolve(
    tables: impl IntoIterator<Item = InjectTable>,
    compiled: &mut Compiled,
    found: &mut Vec<Diagnostic>,
) -> Vec<Injection> {
    let mut injections = Vec::new();
    for table in tables {
        let one = match table.fault.value.spoils() {
            Spoils::Images => of_image(table, compiled),
            Spoils::Commands => of_command(table, compiled),
            Spoils::World => of_world(table, compiled),
        };
        match one {
            Ok(injection) => injections.push(injection),
            Err(diagnostic) => found.push(*diagnostic),
        }
    }
    injections
}

fn of_image(mut table: InjectTable, compiled: &Compiled) -> Result<Injection, Box<Diagnostic>> {
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
    let mut ports = role.ports.iter().zip(&role.numbers);
    let vectors =
        ports.find(|(port, _)| matches!(&port.shape, Shape::VectorImage(VectorImageShape(own)) if own == shape));
    let vectors = vectors.map(|(_, number)| *number);
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
    Ok(Injection { device, target: Target::Image(port, vectors, shape), table })
}

fn of_command(table: InjectTable, compiled: &Compiled) -> Result<Injection, Box<Diagnostic>> {
    let commands = compiled.plan.commands.iter().filter(|command| !command.is_report);
    let name = &table.role.value;
    let Some(command) = commands.clone().find(|command| command.name[0] == *name) else {
        let names: Vec<&str> = commands.map(|command| command.name[0].as_str()).collect();
        let message = format!("the task commands no role `{name}`, and `{}` spoils commands", table.fault.value.word());
        let diagnostic = Diagnostic::new(Code::WrongRole, table.role.span.clone(), message);
        return Err(Box::new(match names[..] {
            [] => diagnostic.help("remove this fault"),
            _ => diagnostic.suggest(name, names.iter().copied(), "commanded roles"),
        }));
    };
    let names: Vec<&str> = match &command.shape {
        Shape::Joints(shape) => shape.joints.iter().map(|joint| joint.name.as_str()).collect(),
        _ => Vec::new(),
    };
    let mut stopped = Vec::new();
    for joint in table.joints.iter().flat_map(|joints| &joints.value) {
        let Some(index) = names.iter().position(|known| known == joint) else {
            let span = table.joints.as_ref().map_or(0..0, |joints| joints.span.clone());
            let message = format!("the arm `{name}` has no joint `{joint}`");
            return Err(Diagnostic::new(Code::BadValue, span, message)
                .suggest(joint, names.into_iter(), "joints")
                .into());
        };
        stopped.push(index);
    }
    Ok(Injection { device: command.device, target: Target::Command(command.port, stopped), table })
}

fn of_world(table: InjectTable, compiled: &mut Compiled) -> Result<Injection, Box<Diagnostic>> {
    let (name, span) = (&table.role.value, table.role.span.clone());
    let Some(device) = compiled.plan.roles.iter().find(|role| role.name == *name).map(|role| role.device) else {
        let names: Vec<&str> = compiled.plan.roles.iter().map(|role| role.name.as_str()).collect();
        let diagnostic = Diagnostic::new(Code::WrongRole, span, format!("there is no role `{name}` in this task"));
        return Err(diagnostic.suggest(name, names.into_iter(), "roles").into());
    };
    let planned = &mut compiled.plan.devices[device];
    let is_simulated = match &mut planned.driver {
        Driver::Stepped(driver) | Driver::Lockstep(driver) | Driver::Beside { stepped: driver, .. } => {
            driver.disturb(&Disturbance::default())
        }
        Driver::Live(_) | Driver::Recorded { .. } => false,
    };
    if !is_simulated {
        let message = format!(
            "the device `{}` of `{name}` simulates no world that can be disturbed, as `{}` does",
            planned.name,
            table.fault.value.word()
        );
        let help =
            "use a bench whose device simulates one, such as `builtin:benches/simulated.toml`, or remove this fault";
        return Err(Diagnostic::new(Code::WrongRole, span, message).help(help).into());
    }
    Ok(Injection { device, target: Target::World, table })
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
