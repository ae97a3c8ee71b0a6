//! A simulated bench: a foam pad on an arm in joint impedance control, and objects to touch.
//!
//! | module | what it simulates |
//! |---|---|
//! | [`shape`], [`object`] | the objects |
//! | [`foam`], [`contact`], [`imprint`] | the pad: forces on each tactel |
//! | [`readout`] | the electronics: counts from forces |
//! | [`joints`] | the arm |
//! | [`world`] | all of them, stepped together |
//! | [`truth`], [`survey`] | quantities that only a simulation knows |
//! | [`bench`] | the device |
//!
//! Not simulated: interaction between columns of foam (bulging, shear waves); rotation of objects under load; gravity,
//! Coriolis forces, coupling of the joints and elasticity of the gears; wear, adhesion and temperature.

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
