//! From features to a twist of the sensor (paper section IV).

pub mod projector;
