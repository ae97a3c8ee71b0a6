//! What passes signals on, makes them, or shows them: nothing here knows of touch, of twists of a task or of arms.
//!
//! [`gate`], [`switch`] and [`delay`] come for scalars and for twists, each pair from one text.

pub mod compare;
pub mod contact_debounce;
pub mod delay;
pub mod gate;
pub mod logic;
pub mod multisine;
mod passing;
pub mod probe;
pub mod signal_generator;
pub mod switch;
