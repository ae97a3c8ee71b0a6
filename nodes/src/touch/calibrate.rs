//! `calibrate`: a straight line per tactel, `(value - offset) * gain`, from the sensor's counts to a force.
//!
//! The paper inverts each tactel's curve coarsely (section III, fig. 1); here it is its slope and its zero. A dead
//! tactel is 0, whatever it reads: a cell that does not exist is no measurement.

use std::str::FromStr;

use tactflow_runtime::graph::{Item, Value};
use tactflow_runtime::node::{Mistake, Mistakes, Node, Param, Reader, Setup, Tick, Written};
use tactflow_runtime::signal::{ImageShape, Unit};
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// What an unloaded tactel reads: a number for all, or a list of rows [unit of the input].
    offset: PerTactel = PerTactel::All(0.0),
    /// Slope: a number for all, or a list of rows [output unit per input unit].
    gain: PerTactel = PerTactel::All(1.0),
    /// Unit of the calibrated image; that of the input if it is not given.
    unit: Option<String>,
    /// Tactels that measure nothing, as `[row, column]` from 0.
    dead: Vec<[usize; 2]> = Vec::new(),
}

inputs! {
    /// The image as it was measured.
    image: Image["U", "A"],
}

outputs! {
    /// The calibrated image [`unit`].
    image: Image["V", "A"],
}

/// One number for all tactels, or a number for each, row after row.
#[derive(Debug, Clone, PartialEq)]
pub enum PerTactel {
    /// The same for all.
    All(f64),
    /// A list of rows.
    Rows(Vec<Vec<f64>>),
}

impl Param for PerTactel {
    const EXPECTS: &'static str = "a number, or a list of rows of numbers";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        match &value.item {
            Item::Array(_) => Vec::read(value, reader).map(Self::Rows),
            Item::Integer(_) | Item::Float(_) => f64::read(value, reader).map(Self::All),
            _ => {
                reader.wrong_type(value, Self::EXPECTS);
                None
            }
        }
    }

    fn written(&self) -> Option<Written> {
        match self {
            Self::All(value) => value.written(),
            Self::Rows(rows) => rows.written(),
        }
    }
}

/// Offset and gain of each tactel; both are zero for a dead one.
pub struct Calibrate {
    offset: Box<[f32]>,
    gain: Box<[f32]>,
}

impl Node for Calibrate {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const NAME: &'static str = "calibrate";
    const SUMMARY: &'static str = "offset and gain of each tactel";

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let image = &setup.inputs.image;
        let mut mistakes = Mistakes::new();
        let mut offset = spread("offset", &params.offset, image, &mut mistakes);
        let mut gain = spread("gain", &params.gain, image, &mut mistakes);
        let unit = params.unit.as_deref().map_or(Ok(image.unit), Unit::from_str);
        let unit = unit.unwrap_or_else(|message| {
            mistakes.push(Mistake::param("unit", message));
            image.unit
        });
        for [i, j] in params.dead {
            if i >= image.rows || j >= image.cols {
                let message = format!("tactel [{i}, {j}] is not on an array of {} by {}", image.rows, image.cols);
                mistakes.push(Mistake::param("dead", message).help("rows and columns count from 0"));
            } else if mistakes.is_empty() {
                (offset[i * image.cols + j], gain[i * image.cols + j]) = (0.0, 0.0);
            }
        }
        setup.outputs.image = ImageShape { unit, ..image.clone() };
        if mistakes.is_empty() { Ok(Self { offset, gain }) } else { Err(mistakes) }
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let lines = self.offset.iter().zip(&self.gain);
        for ((to, from), (offset, gain)) in
            out.image.write().cells_mut().iter_mut().zip(inputs.image.cells()).zip(lines)
        {
            *to = (from - offset) * gain;
        }
    }
}

/// The parameter `name` for each tactel as f32; nothing of use if there is a mistake.
fn spread(name: &str, value: &PerTactel, image: &ImageShape, mistakes: &mut Mistakes) -> Box<[f32]> {
    let &ImageShape { rows, cols, .. } = image;
    let numbers = match value {
        PerTactel::All(number) => vec![*number; rows * cols],
        PerTactel::Rows(list) => list.concat(),
    };
    if let PerTactel::Rows(list) = value {
        if list.len() != rows {
            let message = format!("`{name}` has {} rows, but the image has {rows}", list.len());
            mistakes.push(Mistake::param(name, message));
        } else if let Some(i) = list.iter().position(|row| row.len() != cols) {
            let message =
                format!("row {i} of `{name}` has {} numbers, but the image has {cols} columns", list[i].len());
            mistakes.push(Mistake::param(name, message));
        }
    }
    if let Some(number) = numbers.iter().find(|number| !(**number as f32).is_finite()) {
        mistakes
            .push(Mistake::param(name, format!("{number:e} is too large for a tactel: images are of 32-bit floats")));
    }
    numbers.into_iter().map(|number| number as f32).collect()
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::node::At;
    use tactflow_runtime::signal::{Image, Shape};

    use super::*;

    fn rig(params: &str) -> Result<NodeRig, Mistakes> {
        let shape = ImageShape { rows: 2, cols: 3, pitch: [0.005, 0.004], unit: Unit::RAW };
        NodeRig::new::<Calibrate>(params, &[("image", shape.into())])
    }

    #[test]
    fn a_line_per_tactel() {
        let cases = [
            ("", [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]),
            ("offset = 10", [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]),
            ("gain = 0.5", [5.0, 10.0, 15.0, 20.0, 25.0, 30.0]),
            ("offset = 20\ngain = -2.0", [20.0, 0.0, -20.0, -40.0, -60.0, -80.0]),
            ("offset = [[1, 2, 3], [4, 5, 6]]", [9.0, 18.0, 27.0, 36.0, 45.0, 54.0]),
            ("offset = 10\ngain = [[1, 2, 3], [4, 5, 6]]", [0.0, 20.0, 60.0, 120.0, 200.0, 300.0]),
            ("dead = [[0, 1], [1, 2]]", [10.0, 0.0, 30.0, 40.0, 50.0, 0.0]),
            ("offset = 100\ndead = [[1, 0]]", [-90.0, -80.0, -70.0, 0.0, -50.0, -40.0]),
        ];
        for (params, calibrated) in cases {
            let mut rig = rig(params).unwrap();
            rig.set("image", Image::from_cells(3, &[10.0, 20.0, 30.0, 40.0, 50.0, 60.0]));
            rig.step();
            assert_eq!(rig.get::<Image>("image"), Some(&Image::from_cells(3, &calibrated)), "{params}");
        }
    }

    #[test]
    fn the_unit_is_the_inputs_unless_it_is_named() {
        for (params, unit) in [("", Unit::RAW), ("unit = \"N\"", Unit::NEWTON), ("unit = \"1\"", Unit::ONE)] {
            let expected = ImageShape { rows: 2, cols: 3, pitch: [0.005, 0.004], unit };
            assert_eq!(rig(params).unwrap().shape("image"), &Shape::from(expected), "{params}");
        }
    }

    #[test]
    fn every_mistake_stands_at_its_parameter() {
        let cases = [
            ("offset = [[1, 2, 3]]", "offset", "`offset` has 1 rows, but the image has 2"),
            ("gain = [[1, 2, 3], [4, 5]]", "gain", "row 1 of `gain` has 2 numbers, but the image has 3 columns"),
            ("gain = 1e39", "gain", "1e39 is too large for a tactel: images are of 32-bit floats"),
            ("offset = [[0, 0, 0], [0, -1e300, 0]]", "offset", "-1e300 is too large"),
            ("unit = \"Nm\"", "unit", "`Nm` is not a unit"),
            ("dead = [[2, 0]]", "dead", "tactel [2, 0] is not on an array of 2 by 3"),
            ("dead = [[0, 3]]", "dead", "tactel [0, 3] is not on an array of 2 by 3"),
        ];
        for (params, at, message) in cases {
            let mistakes = rig(params).err().unwrap();
            assert_eq!(mistakes.len(), 1, "{params}: {mistakes:?}");
            assert_eq!(mistakes[0].at, At::Param(at.into()), "{params}");
            assert!(mistakes[0].message.starts_with(message), "{params}: {}", mistakes[0].message);
        }
        let all = rig("offset = [[1]]\ngain = 1e39\nunit = \"x\"\ndead = [[9, 9]]").err().unwrap();
        assert_eq!(all.len(), 4, "{all:?}");
        for wrong in
            ["gain = \"1\"", "gain = [1, 2]", "gain = { from = 1 }", "gain = inf", "dead = [[1]]", "dead = [[-1, 0]]"]
        {
            assert!(rig(wrong).is_err(), "{wrong}");
        }
    }
}
