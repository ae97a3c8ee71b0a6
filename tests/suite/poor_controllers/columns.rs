//! Controllers with a wrong column, each with the code of its warning.

use super::variant::{Variant, variant, with_feature};

/// Columns that move the sensor the wrong way, or along the wrong axis.
pub(super) fn wrong_columns() -> Vec<(&'static str, Variant)> {
    let cases = [
        variant("hybrid", &["columns.x = [1, 0, 0, 0, 20, 0]"]),
        variant("hybrid", &["columns.y = [0, 1, 0, -20, 0, 0]"]),
        variant("hybrid", &["columns.pressure = [0, 0, -1, 0, 0, 0]"]),
        variant(
            "hybrid",
            &[
                "columns.y = [0, -1, 0, 0, 0, 0]",
                "columns.pressure = [0, 0, 0, 1, 0, 0]",
                "select = [1, 1, 0, 1, 0, 0]",
            ],
        ),
        variant("hybrid", &["columns.x = [0, -1, 0, 20, 0, 0]", "columns.y = [-1, 0, 0, 0, -20, 0]"]),
        variant("hybrid", &["columns.x = [0, -1, 0, 20, 0, 0]"]),
        variant("edge", &["columns.orientation = [0, 0, 0, 0, 0, 1]"]),
        variant("edge", &["columns.pressure = [0, 0, 0, 0, 0, -1]", "columns.orientation = [0, 0, 1, 0, 0, 0]"]),
        variant("rolling", &["columns.x = [-1, 0, 0, 0, 20, 0]"]),
        // As the paper prints it.
        variant("rolling", &["columns.y = [0, -1, 0, -20, 0, 0]"]),
        variant("force", &["columns.pressure = [0, 0, -1, 0, 0, 0]"]),
        variant("cable", &["columns.orientation = [0, 0, 0, 0, 0, 1]"]),
        variant("cable", &["columns.x = [0, 0, 0, 0, 0, -1]", "columns.orientation = [-1, 0, 0, 0, -20, 0]"]),
        variant("explore", &["columns.x = [1, 0, 0, 0, -20, 0]"]),
        variant("seek_ridge", &["columns.y = [0, 1, 0, 20, 0, 0]"]),
        variant("position", &["columns.y = [0, 1, 0, 20, 0, 0]"]),
        variant("square", &["columns.pressure = [0, 0, -1, 0, 0, 0]"]),
        variant("finger_press", &["columns.pressure = [0, 0, -0.0005, 0, 0, 0]"]),
        variant("two_arms", &["set parts.left.set.jacobian.columns.x=[1, 0, 0, 0, 20, 0]"]),
        variant("carry", &["set parts.left.set.jacobian.columns.force=[0, 0, -0.004, 0, 0, 0]"]),
        // Turned by 80 degrees, turned by 100 degrees, rolled along the other axis, and slid instead of pressed.
        variant("hybrid", &["columns.x = [-0.17, -0.98, 0, 0, 0, 0]"]),
        variant("hybrid", &["columns.x = [0, -0.98, 0, 0, 0, 0]", "columns.y = [0.98, 0, 0, 0, 0, 0]"]),
        variant("rolling", &["columns.x = [-1, 0, 0, -20, 0, 0]"]),
        variant("hybrid", &["columns.pressure = [3, 0, 1, 0, 0, 0]"]),
    ];
    cases.into_iter().map(|variant| ("wrong-column", variant)).collect()
}

/// Columns that are wrong for lines, areas and drags.
pub(super) fn more_wrong_columns() -> Vec<(&'static str, Variant)> {
    let cases = [
        // The offset of a line grows toward its direction turned by 90 degrees: here along -x.
        with_feature(
            "cable",
            "offset",
            "line2.offset",
            "[-1, 0, 0, 0, 0, 0]",
            &[
                "set nodes.line2.type=\"hough\"",
                "set nodes.line2.in.image=\"touch.repaired\"",
                "set nodes.line2.in.region=\"middle.region\"",
                "set nodes.error.setpoint.orientation=1.2",
                "select = [1, 0, 1, 0, 0, 1]",
            ],
        ),
        with_feature(
            "hold_without_slip",
            "torque",
            "shear.torque",
            "[0, 0, 0, 0, 0, 1]",
            &["select = [0, 0, 1, 0, 0, 1]"],
        ),
        // Where the direction wraps, no column is right.
        with_feature(
            "edge",
            "offset",
            "line2.offset",
            "[1, 0, 0, 0, 0, 0]",
            &[
                "set nodes.line2.type=\"hough\"",
                "set nodes.line2.in.image=\"touch.repaired\"",
                "set nodes.line2.in.region=\"touch.region\"",
                "select = [1, 0, 1, 0, 0, 1]",
            ],
        ),
        with_feature("hold_without_slip", "fx", "shear.fx", "[0.01, 0, 0, 0, 0, 0]", &["select = [1, 0, 1, 0, 0, 0]"]),
        with_feature(
            "edge",
            "area",
            "size.area",
            "[0, 0, -0.001, 0, 0, 0]",
            &[
                "set nodes.error.setpoint.area=40.0",
                "set nodes.size.type=\"contact_area\"",
                "set nodes.size.in.image=\"touch.repaired\"",
                "set nodes.size.in.region=\"touch.region\"",
            ],
        ),
    ];
    cases.into_iter().map(|variant| ("wrong-column", variant)).collect()
}
