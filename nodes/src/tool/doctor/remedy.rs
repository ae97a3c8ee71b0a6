//! What corrects a pad whose corners are not where they should be, as lines to paste.

use tactflow_runtime::graph::BenchDevice;
use tactflow_runtime::signal::{Image, ImageShape};

use super::Finding;
use super::symmetry::Symmetry;
use super::touch::{Spot, Touch, spot};
use crate::arm::mount::Mount;
use crate::devices::stream::{Grid, Turn};
use crate::motion::pose::rpy_of;

/// A device of the bench, as its files describe it.
#[derive(Debug, Clone)]
pub(super) struct Described {
    pub(super) name: String,
    kind: String,
    params: toml::Table,
}

impl Described {
    pub(super) fn of(device: &BenchDevice) -> Self {
        Self { name: device.name.clone(), kind: device.kind.clone(), params: device.params.clone() }
    }

    /// Returns the turns of a device that has them.
    fn order(&self) -> Option<Vec<Turn>> {
        let words = match self.params.get("order") {
            None => &Vec::new(),
            Some(order) => order.as_array()?,
        };
        let turn = |word: &toml::Value| Turn::ALL.into_iter().find(|turn| Some(turn.word()) == word.as_str());
        words.iter().map(turn).collect::<Option<_>>().filter(|_| self.kind == "stream")
    }

    /// Returns rows and columns in the order of the bytes, and the number of axes, if they are known.
    fn shape(&self) -> Option<Vec<usize>> {
        let numbers = self.params.get("shape")?.as_array()?.iter();
        numbers.map(|number| usize::try_from(number.as_integer()?).ok()).collect()
    }
}

/// A pad whose corners were named in the base of its arm.
#[derive(Debug, Clone)]
pub(super) struct OnArm {
    /// Its pose on the tip, as the bench states it.
    pub(super) mount: Mount,
    /// Where its z points by this mount: `+x of the base of `arm``.
    pub(super) facing: String,
}

/// Judges the four touches of a pad, in the order of the corners. `on_arm` is `None` if the corners were named in the pad's
/// own frame.
///
/// In the base, a mirrored image looks like a mount whose z points into the tool, and both together look right. Only the
/// person sees where the pad faces.
pub(super) fn judge(device: &Described, on_arm: Option<&OnArm>, shape: &ImageShape, touches: &[Touch; 4]) -> Finding {
    let felt = touches.each_ref().map(|touch| in_halves(&touch.spot, shape));
    if let Some((swapped, turns)) = reshaped(device, shape, touches) {
        return Finding::problem(format!(
            "one touch shows in several places of the image: `shape` is wrong. {}",
            paste(device, &format!("shape = {swapped}\norder = {}", list(&turns)))
        ));
    }
    let Some(symmetry) = Symmetry::of(&felt) else { return nothing_fits(&felt) };
    let fault = symmetry.fault();
    if symmetry == Symmetry::IDENTITY {
        let confirm = on_arm.map_or_else(String::new, |OnArm { facing, .. }| {
            format!(
                ", if the pad faces {facing}, where z of its `mount` points. If it faces the other way, the image is mirrored \
                 and z of `mount` points into the tool: correct `mount`, and press the corners again"
            )
        });
        return Finding::fine(format!("all four corners are where they should be{confirm}"));
    }
    let order = device.order().map(|old| Symmetry::of_turns(&old).then(symmetry.inverse()).turns());
    let order = order.map(|turns| paste(device, &format!("order = {}", list(&turns))));
    if symmetry.is_mirrored() {
        let way_out = order
            .unwrap_or_else(|| format!("The device `{}` has no turns: correct the layout of its tactels", device.kind));
        return Finding::problem(mirrored(device, on_arm, symmetry, &way_out));
    }
    let Some(OnArm { mount, facing }) = on_arm else {
        let order = order.map_or_else(String::new, |order| format!(". If it is an error: {order}"));
        return Finding::warning(format!(
            "{fault}, against how you held the pad. This is an error only if you know which side is x; the image is not \
             mirrored{order}"
        ));
    };
    let turned = turned(mount, symmetry);
    let mount = format!("If the pad is turned on the arm: {}", paste(device, &turned));
    let order = order.map_or_else(String::new, |order| format!("If the order of its tactels is wrong: {order}\n  "));
    Finding::problem(format!(
        "{fault}.\n  {order}{mount}.\n  Both hold only if the pad faces {facing}, where z of its `mount` points"
    ))
}

/// Describes a mirrored image, and the mount that looks like one.
fn mirrored(device: &Described, on_arm: Option<&OnArm>, symmetry: Symmetry, way_out: &str) -> String {
    const MIRRORED: &str = "the image is mirrored, so the control of a contact becomes positive feedback, and no `mount` \
                            corrects it";
    let fault = symmetry.fault();
    let Some(OnArm { mount, facing }) = on_arm else { return format!("{fault}: {MIRRORED}. {way_out}") };
    let turned = paste(device, &turned(mount, symmetry));
    format!(
        "{fault}. By the `mount` of the bench, z of the pad points to {facing}.\n  If the pad faces there: {MIRRORED}. \
         {way_out}.\n  If it faces the other way: z of `mount` points into the tool. {turned}"
    )
}

/// Returns where a touch is, in halves of the pad from its middle.
fn in_halves(spot: &Spot, shape: &ImageShape) -> [f64; 2] {
    let half = [shape.x(shape.cols as f64 - 1.0), shape.y(shape.rows as f64 - 1.0)];
    [0, 1].map(|axis| spot.centre[axis] / half[axis])
}

fn nothing_fits(felt: &[[f64; 2]; 4]) -> Finding {
    let places: Vec<String> = felt.iter().map(|[x, y]| format!("({:.0} %, {:.0} %)", 100.0 * x, 100.0 * y)).collect();
    Finding::problem(format!(
        "no flip and no turn explains the touches, at {} of the way from the middle to the edges: another corner was \
         pressed, a part of the pad is dead, or its `shape` is wrong. Press again, one corner after the other",
        places.join(", ")
    ))
}

/// Returns `shape` and `order` for a pad whose rows and columns are exchanged in its description, if the touches say so:
/// each is then in fewer tactels that are closer to each other.
fn reshaped(device: &Described, shape: &ImageShape, touches: &[Touch; 4]) -> Option<(String, Vec<Turn>)> {
    /// Part of the spread of the touches in the present image that is clearly less.
    const CLEARLY_LESS: f64 = 0.7;
    let (order, mut sizes) = (device.order()?, device.shape()?);
    let (rows, cols) = (*sizes.first()?, *sizes.get(1)?);
    let grid = order.iter().fold(Grid::new(rows, cols), |grid, turn| grid.turned(*turn));
    if rows == cols || (grid.rows, grid.cols) != (shape.rows, shape.cols) {
        return None;
    }
    let exchanged = ImageShape { rows: cols, cols: rows, ..shape.clone() };
    let spots: Vec<Spot> = touches
        .iter()
        .map(|touch| {
            let mut frame = vec![0.0; rows * cols];
            grid.places.iter().zip(touch.above.cells()).for_each(|(place, cell)| frame[*place] = *cell);
            spot(&Image::from_cells(rows, &frame), &exchanged)
        })
        .collect::<Option<_>>()?;
    let spread: f64 = spots.iter().map(|spot| spot.spread).sum();
    let before: f64 = touches.iter().map(|touch| touch.spot.spread).sum();
    let felt: [[f64; 2]; 4] = std::array::from_fn(|i| in_halves(&spots[i], &exchanged));
    let symmetry = Symmetry::of(&felt).filter(|_| spread < CLEARLY_LESS * before)?;
    sizes.swap(0, 1);
    Some((format!("{sizes:?}"), symmetry.inverse().turns()))
}

/// Returns the mount with which an image that a symmetry maps is right, as a line. z turns around if the symmetry mirrors.
fn turned(mount: &Mount, symmetry: Symmetry) -> String {
    let rotation = mount.pose().rotation * symmetry.inverse().rotation();
    format!("mount = {{ xyz = {}, rpy = {} }}", rounded(&mount.xyz), rounded(&rpy_of(&rotation)))
}

/// Writes numbers with at most five decimals.
fn rounded(numbers: &[f64]) -> String {
    // Adding zero turns -0 into 0.
    format!("{:?}", numbers.iter().map(|number| (number * 1e5).round() / 1e5 + 0.0).collect::<Vec<_>>())
}

fn list(turns: &[Turn]) -> String {
    let words: Vec<String> = turns.iter().map(|turn| format!("\"{}\"", turn.word())).collect();
    format!("[{}]", words.join(", "))
}

/// Says where a line belongs. It replaces that of the bench and that of a file of a sensor.
fn paste(device: &Described, lines: &str) -> String {
    let lines = lines.replace('\n', "`, `");
    format!("Write `{lines}` into `[devices.{}]` of the bench, in place of what is there", device.name)
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::Unit;

    use super::super::Severity;
    use super::super::symmetry::CORNERS;
    use super::*;

    fn described(kind: &str, params: &str) -> Described {
        Described { name: "skin".into(), kind: kind.into(), params: params.parse().expect("TOML") }
    }

    fn level() -> OnArm {
        OnArm { mount: Mount { xyz: [0.0, 0.0, 0.03], rpy: [0.0; 3] }, facing: "-z of the base of `arm`".into() }
    }

    /// Touches of two by two tactels in the corners, in an image of which the grid says where the cells of the frame are.
    /// Cell k of the frame is really in row k / cols and column k % cols.
    fn touches(truth: &Grid, grid: &Grid) -> (ImageShape, [Touch; 4]) {
        let shape = ImageShape { rows: grid.rows, cols: grid.cols, pitch: [0.002; 2], unit: Unit::RAW };
        let touch = |[x, y]: [f64; 2]| {
            let mut frame = vec![0.0; truth.places.len()];
            for (k, cell) in truth.places.iter().enumerate() {
                let (row, col) = (k / truth.cols, k % truth.cols);
                let is_near = |at: usize, count: usize, side: f64| if side < 0.0 { at < 2 } else { at + 2 >= count };
                if is_near(row, truth.rows, y) && is_near(col, truth.cols, x) {
                    frame[*cell] = 40.0;
                }
            }
            let cells: Vec<f32> = grid.places.iter().map(|place| frame[*place]).collect();
            let above = Image::from_cells(grid.cols, &cells);
            Touch { spot: spot(&above, &shape).expect("it is pressed"), above }
        };
        let touches = CORNERS.map(touch);
        (shape, touches)
    }

    fn judged(device: &Described, on_arm: Option<OnArm>, truth: &Grid, grid: &Grid) -> Finding {
        let (shape, touches) = touches(truth, grid);
        judge(device, on_arm.as_ref(), &shape, &touches)
    }

    #[test]
    fn a_mirrored_image_needs_an_order_that_replaces_the_old_one() {
        let truth = Grid::new(6, 8);
        let device = described("stream", "shape = [6, 8]\norder = [\"flip_x\"]");
        let finding = judged(&device, Some(level()), &truth, &Grid::new(6, 8).turned(Turn::FlipX));
        assert_eq!(finding.severity, Severity::Problem);
        assert!(finding.text.starts_with("x is flipped") && finding.text.contains("`order = []`"), "{}", finding.text);
        let device = described("stream", "shape = [6, 8]");
        let finding = judged(&device, None, &Grid::new(6, 8).turned(Turn::FlipY), &truth);
        assert!(
            finding.text.starts_with("y is flipped") && finding.text.contains("`order = [\"flip_y\"]`"),
            "{finding:?}"
        );
        let finding = judged(&described("agni", ""), None, &Grid::new(6, 8).turned(Turn::FlipY), &truth);
        assert!(finding.text.contains("The device `agni` has no turns"), "{finding:?}");
        assert_eq!(judged(&device, None, &truth, &truth).severity, Severity::Fine);
    }

    /// A mount whose z points into the tool, with a right image: the pad is really turned by half a turn about x.
    #[test]
    fn a_mount_that_points_inward_looks_mirrored_and_has_its_own_line() {
        let truth = Grid::new(6, 8);
        let device = described("stream", "shape = [6, 8]");
        let finding = judged(&device, Some(level()), &truth, &truth.clone().turned(Turn::FlipY));
        assert_eq!(finding.severity, Severity::Problem);
        for text in [
            "y is flipped. By the `mount` of the bench, z of the pad points to -z of the base of `arm`",
            "If the pad faces there: the image is mirrored",
            "`order = [\"flip_y\"]`",
            "If it faces the other way: z of `mount` points into the tool",
            "`mount = { xyz = [0.0, 0.0, 0.03], rpy = [3.14159, 0.0, 0.0] }`",
        ] {
            assert!(finding.text.contains(text), "{text}: {finding:?}");
        }
    }

    /// A mirrored image and a mount that points inward cancel out, so a right result names what the person must see.
    #[test]
    fn what_looks_right_in_the_base_is_right_only_if_the_pad_faces_that_way() {
        let truth = Grid::new(6, 8);
        let device = described("stream", "shape = [6, 8]");
        let finding = judged(&device, Some(level()), &truth, &truth);
        assert_eq!(finding.severity, Severity::Fine);
        assert!(finding.text.contains("if the pad faces -z of the base of `arm`"), "{finding:?}");
        let own = judged(&device, None, &truth, &truth);
        assert_eq!(own.text, "all four corners are where they should be");
    }

    #[test]
    fn a_turned_image_can_be_an_error_of_the_mount() {
        let square = Grid::new(6, 6);
        let device = described("stream", "shape = [6, 6]");
        let turned = square.clone().turned(Turn::Rot90);
        let finding = judged(&device, Some(level()), &square, &turned);
        assert!(finding.text.starts_with("the image is turned by 90° counterclockwise"), "{finding:?}");
        assert!(
            finding.text.contains("`mount = { xyz = [0.0, 0.0, 0.03], rpy = [0.0, 0.0, -1.5708] }`"),
            "{finding:?}"
        );
        assert!(finding.text.contains("`order = [\"flip_x\", \"transpose\"]`"), "{finding:?}");
        let finding = judged(&device, None, &square, &turned);
        assert_eq!(finding.severity, Severity::Warning, "nobody knows where x is");
    }

    #[test]
    fn rows_and_columns_that_are_exchanged_are_found_with_their_order() {
        // The frame has 8 rows of 6, and the description says 6 rows of 8.
        for order in [vec![], vec![Turn::FlipX], vec![Turn::Transpose]] {
            let truth = order.iter().fold(Grid::new(16, 6), |grid, turn| grid.turned(*turn));
            let finding = judged(&described("stream", "shape = [6, 16, 3]"), None, &truth, &Grid::new(6, 16));
            let expected = format!("`shape = [16, 6, 3]`, `order = {}`", list(&order));
            assert!(finding.text.contains(&expected), "{expected}: {finding:?}");
        }
    }

    #[test]
    fn the_same_place_four_times_is_named() {
        let grid = Grid::new(6, 8);
        let (shape, touches) = touches(&grid, &grid);
        let same = [0; 4].map(|i: usize| touches[i].clone());
        let finding = judge(&described("stream", "shape = [6, 8]"), None, &shape, &same);
        assert_eq!(finding.severity, Severity::Problem);
        assert!(finding.text.contains("no flip and no turn explains the touches, at (-86 %, -80 %)"), "{finding:?}");
    }
}
