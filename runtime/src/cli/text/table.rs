//! Tables with aligned columns.

/// Aligns the cells of the rows: columns from `first_right` up to `first_left` are flush right, the others flush left.
pub(crate) fn table<const N: usize>(rows: &[[String; N]], first_right: usize, first_left: usize) -> String {
    let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (i, (cell, width)) in row.iter().zip(widths).enumerate() {
            let pad = " ".repeat(width - cell.chars().count());
            let is_right = (first_right..first_left).contains(&i);
            let cell = if is_right { format!("{pad}{cell}") } else { format!("{cell}{pad}") };
            line.push_str(&cell);
            line.push_str("  ");
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}
