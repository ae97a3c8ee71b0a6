//! The catalogue of tactflow: one node per file, the devices, and the roles they fill.
//!
//! [`touch`] turns a tactile image into features, [`servo`] turns features into a twist of the sensor, [`arm`] turns
//! the twist into joint velocities; [`devices`] are the edge.

pub mod arm;
pub mod devices;
pub mod roles;
pub mod servo;
pub mod touch;

use tactflow_runtime::catalogue::Catalogue;

/// Everything there is: one line each.
#[must_use]
pub fn catalogue() -> Catalogue {
    Catalogue::new()
        .role(roles::tactile_pad())
        .role(roles::velocity_arm())
        .node::<touch::tactile_source::TactileSource>()
        .node::<touch::calibrate::Calibrate>()
        .node::<touch::binarize::Binarize>()
        .node::<touch::label::Label>()
        .node::<touch::moments::Moments>()
        .node::<touch::smooth::Smooth>()
        .node::<servo::projector::Projector>()
}
