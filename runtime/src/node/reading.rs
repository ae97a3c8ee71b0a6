//! What the value of a node says about the one that it reads.

/// What the first output of a node says about its first input.
///
/// The checker follows the conditions of modes back through nodes that state it, and so finds modes that one value leads
/// through.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Reading {
    /// Something else, or unknown.
    #[default]
    Other,
    /// It is the same value or the same flag, smoothed or later.
    Same,
    /// It is the flag that is set while the one that it reads is not.
    Opposite,
    /// It is a flag, set while the number is between two bounds.
    Between {
        /// Lower bound, in the unit of the input; infinite if there is none.
        min: f64,
        /// Upper bound, in the unit of the input; infinite if there is none.
        max: f64,
        /// How far outside of a bound the number must be to clear the flag, in the unit of the input.
        hysteresis: f64,
    },
}
