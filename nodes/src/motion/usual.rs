//! What is usual for an arm and for a pad. A number far beyond it is probably in another unit, so nodes warn of it.

/// Linear speed of a sensor [m/s].
pub const USUAL_M_PER_S: f64 = 3.0;
/// Angular speed of a sensor [rad/s].
pub const USUAL_RAD_PER_S: f64 = 10.0;
/// Linear acceleration of a sensor [m/s²].
pub const USUAL_M_PER_S2: f64 = 100.0;
/// Angular acceleration of a sensor or of a joint [rad/s²].
pub const USUAL_RAD_PER_S2: f64 = 100.0;
/// Coordinate in the workspace of an arm [m].
pub const USUAL_REACH_M: f64 = 10.0;
/// Length of a path on an object, or of a holder [m].
pub const USUAL_LENGTH_M: f64 = 2.0;
/// Angle in either direction: one turn, rounded up [rad].
pub const USUAL_RAD: f64 = 6.3;
/// Lead of the equilibrium of a joint: a quarter of a turn, rounded up [rad].
pub const USUAL_LEAD_RAD: f64 = 1.6;
/// Force on a whole pad [N].
pub const USUAL_FORCE_N: f64 = 1000.0;
/// Force on one tactel [N].
pub const USUAL_PEAK_N: f64 = 100.0;
/// Mean force of the tactels of a contact [N].
pub const USUAL_PRESSURE_N: f64 = 20.0;
/// Force from which a tactel counts as touched [N].
pub const USUAL_THRESHOLD_N: f64 = 5.0;
