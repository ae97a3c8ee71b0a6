//! From a tactile image to features (paper section III).
//!
//! A pad's image passes [`tactile_source`] (the sensor's frame) → [`calibrate`] → [`binarize`] → [`label`] (finds the
//! contact) → [`moments`] (its position, force and orientation) → [`moving_average`].
//!
//! Besides them, [`select_region`] selects one of several regions, [`region_count`] counts them, and [`image_window`]
//! restricts one to a box;
//! [`hough`], [`eccentricity`], [`principal_axes`], [`contact_area`] and [`curvature`] measure the shape of a region;
//! [`low_pass`] and [`median`] are other filters.
//!
//! The vector image of a pad with three axes passes [`calibrate_vectors`] → [`shear`] (how the object drags the contact) →
//! [`friction_margin`] (how near it is to slip); [`normal_image`] is its image of the normal force.

pub mod binarize;
pub mod calibrate;
pub mod calibrate_vectors;
mod common;
pub mod contact_area;
pub mod curvature;
pub mod eccentricity;
mod filter;
pub mod friction_margin;
pub mod hough;
pub mod image_window;
pub mod label;
pub mod low_pass;
pub mod median;
pub mod moments;
pub mod moving_average;
pub mod normal_image;
pub mod principal_axes;
pub mod region_count;
pub mod select_region;
pub mod shear;
pub mod tactile_source;
