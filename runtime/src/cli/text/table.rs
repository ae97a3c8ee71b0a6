//! Tables with aligned columns.

/// Aligns the cells of the rows: columns from `first_right` up to `first_left` are flush right, the others flush left.
#[must_use]
pub fn table<const N: usize>(rows: &[[String; N]], first_right: usize, first_left: usize) -> String {
    let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let line = |row: &[String; N]| {
        let cells =
            row.iter().zip(widths).enumerate().map(|(i, (cell, width))| match (first_right..first_left).contains(&i) {
                true => format!("{cell:>width$}"),
                false => format!("{cell:width$}"),
            });
        format!("{}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}
