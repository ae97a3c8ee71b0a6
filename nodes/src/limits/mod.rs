//! Limiters: what every motion crosses on its way to an arm. Each holds a limit and says what share of the motion it
//! lets pass; the check proves that none is missing.

pub mod acceleration_limit;
pub mod bumpless;
pub mod contact_limit;
pub mod joint_limit;
pub mod twist_limit;
pub mod workspace_limit;

#[cfg(test)]
mod tests;
