//! Simulations as devices: a bench with a foam pad on an arm in joint impedance control and objects to touch, and a cell
//! of two such arms that hold an object between them.
//!
//! | module | what it simulates |
//! |---|---|
//! | [`shape`], [`object`] | the objects |
//! | [`foam`], [`bristle`], [`contact`], [`imprint`], [`wrench`] | the pad: forces on each tactel |
//! | [`housing`] | what else of the tool touches objects |
//! | [`readout`], [`vector_readout`], [`frames`] | the electronics: counts from forces, and when an image is available |
//! | [`joints`] | the arm |
//! | [`pad_model`], [`arm_model`], [`steps`] | parameters of pad and arm, and what can be simulated of them |
//! | [`world`] | all of them on a bench, stepped together |
//! | [`truth`], [`survey`] | quantities that only a simulation knows |
//! | [`bench`] | the device `sim_bench` |
//! | [`pair`] | the device `sim_pair`, with its own world and a free object |
//!
//! Not simulated: interaction between columns of foam (bulging, shear waves); coupling of the joints by the masses of
//! the links, Coriolis forces and elasticity of the gears; wear, adhesion and temperature.

pub mod arm_model;
pub mod bench;
pub mod bristle;
pub mod contact;
pub mod foam;
pub mod frames;
pub mod housing;
pub mod imprint;
pub mod joints;
pub mod object;
pub mod pad_model;
pub mod pair;
pub mod readout;
pub mod shape;
pub mod steps;
pub mod survey;
pub mod truth;
pub mod vector_readout;
pub mod world;
pub mod wrench;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
