//! Vectors in words.

use nalgebra::Vector3;

/// Writes three numbers with some decimals.
pub(crate) fn three(numbers: &Vector3<f64>, decimals: usize) -> String {
    // Adding zero turns -0 into 0.
    let scale = 10_f64.powi(decimals as i32);
    let [x, y, z] = [0, 1, 2].map(|i| (numbers[i] * scale).round() / scale + 0.0);
    format!("[{x:.decimals$}, {y:.decimals$}, {z:.decimals$}]")
}

/// Names a direction with its sign: an axis if the component along it is above `near`, and else the unit vector.
pub(crate) fn direction(axis: &Vector3<f64>, near: f64) -> String {
    let largest = axis.iamax();
    let sign = if axis[largest] < 0.0 { '-' } else { '+' };
    match axis[largest].abs() > near {
        true => format!("{sign}{}", ["x", "y", "z"][largest]),
        false => three(axis, 2),
    }
}
