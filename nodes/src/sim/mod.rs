//! A simulated bench: a pad of foam on an arm in joint impedance, and objects to touch.
//!
//! [`shape`] and [`object`] are what is touched; [`foam`], [`contact`] and [`imprint`] are how the pad feels it; [`readout`]
//! is what the electronics make of that; [`joints`] is the arm. [`world`] steps them together, [`truth`] and [`survey`] are what
//! only a simulation knows, and [`bench`] is the device.
//!
//! What is left out: the foam's columns do not know of each other (no bulging, no shear waves, no compression of the
//! neighbours beyond the spread of the reading); objects are rigid bodies on springs that do not turn; the arm's joints
//! are inertias that do not couple, without gravity, Coriolis forces and the elasticity of gears; nothing wears,
//! sticks or gets warm.

pub mod bench;
pub mod contact;
pub mod foam;
pub mod imprint;
pub mod joints;
pub mod object;
pub mod readout;
pub mod shape;
pub mod survey;
pub mod truth;
pub mod world;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
