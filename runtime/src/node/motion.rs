//! The motion that a node generates without a sample.

/// The motion that a node generates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Motion {
    /// None: the parameters of the generator cause no motion.
    Still,
    /// Away from what the sensor touches: along -z of the sensor.
    Retreat,
    /// Any other, or an unknown one.
    #[default]
    Any,
}
