//! The image of a still picture.

use super::layout::{CHARACTER, LINE, MARGIN, TOP};
use crate::cli::text::number::{number, seconds};
use crate::cli::text::picture::{ColourScale, Raster, Snapshot};
use crate::cli::text::svg::Svg;
use crate::cli::view::images::ImageHistory;
use crate::signal::ImageShape;

/// Maximum number of cells along each side of the image.
const MAX_CELLS: usize = 64;
/// Length of the longer side of the image [px].
const IMAGE_SIZE: f64 = 300.0;

/// Returns the lengths of a pad along x and y [m].
fn lengths(shape: &ImageShape) -> [f64; 2] {
    [shape.cols as f64 * shape.pitch[0], shape.rows as f64 * shape.pitch[1]]
}

/// Returns the width and the height of an image [px].
pub(crate) fn image_size(shape: &ImageShape) -> [f64; 2] {
    let [x, y] = lengths(shape);
    [x, y].map(|length| IMAGE_SIZE * length / x.max(y))
}

/// Draws the strongest image with its mark and its colours, or says that there was none.
pub(crate) fn draw_image(svg: &mut Svg, image: &ImageHistory) {
    let Some(snapshot) = &image.strongest else {
        svg.text([MARGIN, TOP - 10.0], "start", &format!("{}: absent", image.name));
        return;
    };
    let raster = Raster::with_cells(&image.shape, MAX_CELLS);
    let scale = raster.scale(&[snapshot]);
    let caption = format!("{} at {:.3} s: strongest", image.name, seconds(snapshot.time));
    svg.text([MARGIN, TOP - 10.0], "start", &caption);
    let [width, height] = image_size(&image.shape);
    let ImageShape { rows, cols, .. } = image.shape;
    // The lower left corner of a tactel; y points up.
    let x = |col: usize| MARGIN + col.min(cols) as f64 / cols as f64 * width;
    let y = |row: usize| TOP + height - row.min(rows) as f64 / rows as f64 * height;
    svg.group("class=\"image\" shape-rendering=\"crispEdges\"", |svg| {
        for row in 0..raster.rows() {
            let [bottom, top] = [row, row + 1].map(|row| y(row * raster.block));
            let colour = |col: usize| raster.cell(snapshot, row, col).map(|value| scale.hex(value));
            let cells: Vec<(usize, Option<String>)> = (0..raster.cols()).map(|col| (col, colour(col))).collect();
            for run in cells.chunk_by(|a, b| a.1 == b.1) {
                let (first, Some(fill)) = &run[0] else { continue };
                let [left, right] = [*first, first + run.len()].map(|col| x(col * raster.block));
                let (width, height) = (right - left, bottom - top);
                svg.put(format_args!(
                    "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{fill}\"/>"
                ));
            }
        }
    });
    draw_drag(svg, raster, snapshot, scale, [x(1) - x(0), y(0) - y(1)]);
    let centre = [MARGIN + 0.5 * width, TOP + 0.5 * height];
    draw_mark(svg, snapshot, centre, width / lengths(&image.shape)[0]);
    let mark = if snapshot.mark.is_some() { "; + centre of the contact" } else { "" };
    draw_legend(svg, &format!("{}{mark}", image.shape.unit), scale, TOP + height + 10.0);
    svg.text([MARGIN, TOP + height + 10.0 + 2.6 * LINE], "start", &raster.describe());
}

/// Draws the drag of the object on each cell of a vector image, as a line from the middle of the cell; a tactel is `size`
/// \[px\] wide and high.
fn draw_drag(svg: &mut Svg, raster: Raster<'_>, snapshot: &Snapshot, scale: ColourScale, size: [f64; 2]) {
    let cells = (0..raster.rows()).flat_map(|row| (0..raster.cols()).map(move |col| [row, col]));
    let drags: Vec<([usize; 2], [f64; 2])> =
        cells.filter_map(|[row, col]| Some(([row, col], raster.drag(snapshot, row, col, scale)?))).collect();
    let largest = drags.iter().fold(0.0_f64, |largest, (_, [x, y])| largest.max(libm::hypot(*x, *y)));
    if drags.is_empty() {
        return;
    }
    let [width, height] = size.map(|size| size * raster.block as f64);
    let bottom = TOP + size[1] * raster.shape.rows as f64;
    svg.group("class=\"drag\" stroke=\"#3d85c6\" stroke-width=\"2\"", |svg| {
        svg.put("<title>drag of the object</title>");
        for ([row, col], drag) in drags {
            let [x, y] = [MARGIN + (col as f64 + 0.5) * width, bottom - (row as f64 + 0.5) * height];
            let [along, up] = drag.map(|part| part / largest);
            svg.put(format_args!(
                "<path d=\"M{x:.1} {y:.1}l{:.1} {:.1}\"/><circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.5\"/>",
                along * width,
                -up * height
            ));
        }
    });
}

/// Draws a cross at the centre of the contact.
fn draw_mark(svg: &mut Svg, snapshot: &Snapshot, centre: [f64; 2], pixels_per_metre: f64) {
    let Some([x, y]) = snapshot.mark else { return };
    let [x, y] = [centre[0] + x * pixels_per_metre, centre[1] - y * pixels_per_metre];
    svg.group("class=\"mark\" fill=\"none\"", |svg| {
        svg.put("<title>centre of the contact</title>");
        for (stroke, width) in [("#000000", 5), ("#ffffff", 2)] {
            svg.put(format_args!(
                "<path stroke=\"{stroke}\" stroke-width=\"{width}\" d=\"M{:.1} {y:.1}h16M{x:.1} {:.1}v16\"/>",
                x - 8.0,
                y - 8.0
            ));
        }
    });
}

/// Draws the colours of the image between the values they stand for, and the unit behind them.
fn draw_legend(svg: &mut Svg, unit: &str, scale: ColourScale, top: f64) {
    let low = number(scale.low);
    let left = MARGIN + (low.len() + 1) as f64 * CHARACTER;
    svg.text([MARGIN, top + 11.0], "start", &low);
    let mut x = left;
    for fill in ColourScale::all_hex() {
        svg.put(format_args!("<rect x=\"{x:.1}\" y=\"{top:.1}\" width=\"10\" height=\"12\" fill=\"{fill}\"/>"));
        x += 10.0;
    }
    svg.text([x + CHARACTER, top + 11.0], "start", &format!("{} {unit}", number(scale.high)));
}
