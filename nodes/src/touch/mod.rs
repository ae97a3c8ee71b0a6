//! From a tactile image to features (paper section III).
//!
//! A pad's image passes [`tactile_source`] (the sensor's frame) → [`calibrate`] → [`binarize`] → [`label`] (finds the
//! contact) → [`moments`] (its position, force and orientation) → [`moving_average`].
//!
//! Besides them, [`select_region`] selects one of several regions, [`region_count`] counts them, and [`image_window`]
//! restricts one to a box;
//! [`hough`], [`eccentricity`], [`principal_axes`], [`contact_area`] and [`curvature`] measure the shape of a region;
//! [`low_pass`] and [`median`] are other filters.

pub mod binarize;
pub mod calibrate;
mod common;
pub mod contact_area;
pub mod curvature;
pub mod eccentricity;
mod filter;
pub mod hough;
pub mod image_window;
pub mod label;
pub mod low_pass;
pub mod median;
pub mod moments;
pub mod moving_average;
pub mod principal_axes;
pub mod region_count;
pub mod select_region;
pub mod tactile_source;
